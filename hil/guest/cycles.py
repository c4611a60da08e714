"""``python -m hil.guest.cycles N``: N times an interface of a machine is gone, late and back, in a guest.

The machines of a small park run as on boards, each in a namespace of its own, on the Linux CAN stack; a car comes in
before and is fetched after. Every cycle tells how long it took, in the guest's time, until all machines took part
again and knew the same plans. The bounds: ``LIVES_ON_S`` where the process lives on, ``STARTS_S`` where it starts,
loading included.
"""

import argparse
import json
import shutil
import statistics
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from bus_sim.sites import site_text
from hil.guest.cycles_scene import KINDS, LATE
from hil.guest.machine import GuestError, run_guest
from hil.guest.quick import QUICK
from onboard.config.site import parse_site
from onboard.trace.candump_reader import CandumpReader
from onboard.trace.check.checks import Checks, check_records

#: From the interface's return until all take part, s of the guest's time.
LIVES_ON_S, STARTS_S = 10.0, 60.0
#: Loading the program takes so long on the guest's processor, s. Processes are forked from one that has loaded it: read
#: from the host's disk, whose pace is not the guest's, it would be measured with it. It is counted.
LOAD_S = 10.0
ROOT = Path(__file__).parents[2]
#: What a cycle may take of the guest's time, s, and what everything else may: a car in before, and out after.
_CYCLE_S, _REST_S = 14, 300


@dataclass(frozen=True, slots=True)
class CycleFindings:
    """What came of a run; ``faults`` are lines for a person, none where it is good."""

    cycles: list[dict[str, object]]
    faults: list[str]

    def table(self) -> list[str]:
        """One line for each kind of cycle."""
        lines = []
        for kind in KINDS:
            took = [float(str(one["took_s"])) for one in self.cycles if one["kind"] == kind]
            if took:
                figures = (
                    f"median {statistics.median(took):5.1f} s  worst {max(took):5.1f} s  (bound {bound_s(kind):g} s)"
                )
                lines.append(f"{kind:34}{len(took):4} cycles  {figures}")
        return lines


def bound_s(kind: str) -> float:
    """How long a cycle of this kind may take, s of the guest's time."""
    return STARTS_S - LOAD_S if kind == LATE else LIVES_ON_S


def play_cycles(share: Path, cycles: int) -> CycleFindings:
    """Play so many in a guest whose files are in ``share``. Raises ``GuestError`` where it came to no end."""
    shutil.rmtree(share, ignore_errors=True)
    share.mkdir(parents=True)
    text = site_text("level1") + QUICK
    site = parse_site(text, "site.toml")
    nodes = {machine.name: node for node, machine in site.machines.items()}
    (share / "site.toml").write_text(text, encoding="utf-8")
    # By hand: the car comes in before the first cycle and is fetched after the last one, and then the run is over.
    plant_s = cycles * _CYCLE_S + _REST_S
    begin = ["--by-hand", "--seed", "3", "--for", str(plant_s), "--json", "figures.json"]
    (share / "order.json").write_text(json.dumps({"machines": list(nodes), "begin": begin}), encoding="utf-8")
    plan = {"nodes": nodes, "cycles": cycles, "plant_s": plant_s}
    (share / "plan.json").write_text(json.dumps(plan), encoding="utf-8")
    settings = f"export PYTHONPATH={ROOT} PYTHONDONTWRITEBYTECODE=1 COLUMNS=200"
    script = f"{settings}\nexec {sys.executable} -m hil.guest.cycles_scene /run/share\n"
    done = run_guest(script, share, limit_s=2 * plant_s)
    if done.status:
        raise GuestError(f"the scene ended with status {done.status}\n{done.output}")
    found = json.loads((share / "found.json").read_text(encoding="utf-8"))
    figures = json.loads((share / "figures.json").read_text(encoding="utf-8"))
    faults = [
        f"cycle {number}: {one['machine']}, {one['kind']}: took {one['took_s']} s"
        for number, one in enumerate(found["cycles"], start=1)
        if one["took_s"] > bound_s(one["kind"])
    ]
    faults += [f"{name} ended with status {status}" for name, status in found["status"].items() if status]
    faults += [str(violation) for violation in figures["violations"]]
    if (figures["cars_in"], figures["cars_out"]) != (1, 1):
        faults.append(f"cars in {figures['cars_in']}, cars out {figures['cars_out']}: not 1 and 1")
    with (share / "fleet.log").open("rb") as lines:
        verdict = check_records(CandumpReader(lines), Checks(site, disturbed=True))
    faults += [] if verdict.is_good else list(verdict.lines())
    return CycleFindings(found["cycles"], faults)


def main(words: Sequence[str] | None = None) -> int:
    """Play, tell, and answer with the exit status: 0 where every cycle kept its bound and rights were intact."""
    parser = argparse.ArgumentParser(prog="python -m hil.guest.cycles", description=(__doc__ or "").split("\n\n")[1])
    parser.add_argument("cycles", type=int, metavar="N", help="how many")
    parser.add_argument("--share", type=Path, default=ROOT / "build" / "cycles", help="folder for logs and results")
    args = parser.parse_args(words)
    try:
        found = play_cycles(args.share, args.cycles)
    except GuestError as error:
        print(f"hil: {error}", file=sys.stderr)
        return 1
    print("\n".join([*found.table(), *found.faults]))
    return 1 if found.faults else 0


if __name__ == "__main__":
    sys.exit(main())
