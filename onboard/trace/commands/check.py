"""``onboard trace check``: judge a log by every rule."""

import argparse
import json
import sys
from pathlib import Path

from onboard.bounded_file import read_bounded
from onboard.core.site import Site
from onboard.systems.contract import codecs_for
from onboard.trace.check.checks import Checks, LogVerdict
from onboard.trace.commands.common import (
    Commands,
    TraceError,
    add_command,
    add_log,
    add_site,
    open_log,
    site_of,
    write_text,
)
from onboard.trace.commands.proof import LogProof, proof_of
from onboard.trace.words import Words

HELP = """\
exit status:
  0  no rule was broken
  1  a rule was broken; each finding is one line with its time, its machines and the frame that shows it
  2  a mistake in the command line or in a file; one line says where and what to do

examples:
  onboard trace check trace.log --site bus_sim/sites/standard.toml
  bus-sim run small --trace run.log --devices && onboard trace check run.log --site bus_sim/sites/small.toml
  candump -L can0 | onboard trace check - --site mysite.toml
"""


def register(commands: Commands) -> None:
    """Add ``check`` to the commands of ``onboard trace``, with its options."""
    check = add_command(commands, "check", "judge a log by every rule that a fleet must keep", HELP, run)
    add_log(check)
    add_site(check)
    check.add_argument(
        "--dbc", type=Path, metavar="FILE", help="DBC that the log was made by: must be the contract of this program"
    )
    check.add_argument(
        "--keys",
        type=Path,
        metavar="FILE",
        help="a key file of a site with seals: judge only what counts on its bus, and tell whose seals are right",
    )
    check.add_argument(
        "--faults", action="store_true", help="frames were lost on purpose: leave out rules that need every frame"
    )
    check.add_argument("--json", type=Path, metavar="FILE", help="write the verdict as JSON too")


def run(args: argparse.Namespace) -> int:
    """Judge; 0 where no rule was broken."""
    site = site_of(args)
    contracts = codecs_for(site)
    if args.dbc is not None:
        _check_contract(args.dbc)
    checks = Checks(site, disturbed=args.faults, fleet=contracts.fleet, device=contracts.device)
    proof = proof_of(args, site)
    verdict = _check(args, checks, proof)
    if args.json is not None:
        write_text(args.json, json.dumps(verdict.to_json(), indent=2) + "\n")
    print("\n".join(_report(verdict, site) + (proof.lines(Words(site).machine) if proof is not None else [])))
    sys.stdout.flush()
    return 0 if verdict.is_good else 1


def _report(verdict: LogVerdict, site: Site | None) -> list[str]:
    return verdict.lines(Words(site).machine)


def _check(args: argparse.Namespace, checks: Checks, proof: LogProof | None) -> LogVerdict:
    with open_log(args) as log:
        for portion in log.portions():
            if portion.block is not None and proof is None:
                checks.feed_block(portion.block)
            else:
                for frame in portion.frames:
                    for one in (frame,) if proof is None else proof.counting(frame):
                        checks.feed_raw(one)
        if proof is not None:
            proof.end()
        verdict = checks.finish()
    for fault, count in log.faults.counts.items():
        verdict.unknown[fault.value] += count
    if not verdict.messages:
        raise TraceError(f"{args.log}: no message of this contract in it; is it the log of a fleet bus?")
    return verdict


def _check_contract(path: Path) -> None:
    """Refuse a DBC that is not the contract that this program speaks: it could not judge by it. ``TraceError``."""
    from onboard.wire.dbc_file import fleet_layouts, read_layouts, seal_layouts  # noqa: PLC0415  # takes a third of the start

    try:
        said = {layout.name: layout for layout in read_layouts(read_bounded(path).decode("utf-8-sig"))}
    except OSError as error:
        raise TraceError(f"{path}: cannot be read ({error.strerror}); name an existing DBC") from error
    except Exception as error:  # the DBC reader has a dozen errors of its own for a bad text
        why = " ".join(str(error).split())[:200]
        raise TraceError(f"{path}: not a DBC of this contract ({why}); a site's DBC is for other tools") from error
    for ours in fleet_layouts():
        if ours in seal_layouts():
            # In a file of their own; no rule is about them.
            continue
        theirs = said.get(ours.name)
        if theirs is None or (theirs.frame_id, theirs.length, theirs.signals) != (
            ours.frame_id,
            ours.length,
            ours.signals,
        ):
            what = "is missing" if theirs is None else "is another"
            raise TraceError(
                f"{path}: {ours.name} {what} than in the contract that this program speaks; leave out --dbc"
            )
