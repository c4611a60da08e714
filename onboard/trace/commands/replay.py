"""``onboard trace replay``: would this controller have decided the same?"""

import argparse
import sys
from pathlib import Path

from onboard.config.site import load_site
from onboard.contract.messages import Heartbeat
from onboard.core.behaviour import BehaviourFactory
from onboard.core.site import Machine, Site
from onboard.holon.holon import Holon
from onboard.systems.contract import codecs_for
from onboard.systems.registry import factory_for
from onboard.trace.commands.common import Commands, TraceError, add_command, add_log, open_log, tell_faults
from onboard.trace.replay.driver import JOURNAL_US, RaisedCosts, Recording, ReplayDriver, compare, in_words, record
from onboard.wire.codec import Codecs

#: Most that a replay may raise a machine's bids by: far above any bid, and far below the most that a frame takes.
MOST_RAISED = 1_000_000

HELP = """\
The log must begin with the machine's power-up, with an empty journal, and hold the fleet bus and, under the machine's
name, its device bus (bus-sim run --devices): what its sensors said decides what it does.

exit status:
  0  every frame that the machine said, it would say again
  1  it would act differently; the first frame is named

examples:
  bus-sim run small --one-car 60 --trace run.log --devices
  onboard trace replay run.log --machine MR1 --site bus_sim/sites/small.toml
  onboard trace replay run.log --machine MR1 --site bus_sim/sites/small.toml --raise-costs 1
"""


def register(commands: Commands) -> None:
    """Add ``replay`` to the commands of ``onboard trace``, with its options."""
    parser = add_command(commands, "replay", "run one controller against a log: the first different frame", HELP, run)
    add_log(parser)
    parser.add_argument("--site", type=Path, metavar="SITE", required=True, help="site file, or a shipped site's name")
    parser.add_argument("--machine", metavar="NAME", required=True, help="whose controller")
    parser.add_argument("--bus", default="fleet", metavar="NAME", help="the fleet bus in the log (default: fleet)")
    parser.add_argument(
        "--journal-us",
        type=int,
        default=JOURNAL_US,
        metavar="US",
        help=f"length of a durable write (default: {JOURNAL_US})",
    )
    parser.add_argument(
        "--first-us",
        type=int,
        metavar="US",
        help="from power-up to the end of the log's first frame (default: as long as that frame takes)",
    )
    parser.add_argument("--raise-costs", type=int, default=0, metavar="N", help="try it: its own bids cost N more")


def run(args: argparse.Namespace) -> int:
    """Run one controller against the log; exit status 1 at the first frame that differs."""
    site = load_site(args.site)
    if not 0 <= args.raise_costs <= MOST_RAISED:
        raise TraceError(f"--raise-costs {args.raise_costs}: must be from 0 to {MOST_RAISED}")
    machine = _machine(site, args.machine)
    codecs = codecs_for(site)
    with open_log(args) as log:
        recording = record(log, machine, codecs, args.bus, site.system)
    tell_faults(log)
    _check(args, recording, site, codecs)
    factory: BehaviourFactory = factory_for(site, machine.kind)
    if args.raise_costs:
        factory = RaisedCosts(factory, args.raise_costs)
    first_us = recording.first_bits * 1_000_000 // site.bitrate if args.first_us is None else args.first_us
    origin_us = recording.first_us - first_us
    driver = ReplayDriver(Holon(site, machine, factory), codecs, origin_us, args.journal_us)
    same, difference = compare(recording, driver.run(recording.heard, recording.last_us))
    if difference is None:
        print(f"{machine.name}: {same} frames on fleet and device bus, all the same")
        return 0
    codec = codecs.device
    both = [one for one in (difference.recorded, difference.now) if one is not None]
    if both[0].is_fleet:
        codec = codecs.fleet
    at_s = (both[0].time_us - recording.first_us) / 1e6
    print(f"{machine.name}: {same} frames are the same; at {at_s:.6f} s, frame {difference.number} differs:")
    print(f"  recorded: {in_words(difference.recorded, codec)}")
    print(f"  now:      {in_words(difference.now, codec)}")
    if driver.halted:
        print(f"  halted: {driver.halted}")
    sys.stdout.flush()
    return 1


def _machine(site: Site, name: str) -> Machine:
    try:
        return site.machine(name)
    except KeyError:
        names = ", ".join(machine.name for machine in site.machines.values())
        raise TraceError(f"--machine {name}: not at site {site.name}; its machines are {names}") from None


def _check(args: argparse.Namespace, recording: Recording, site: Site, codecs: Codecs) -> None:
    if not recording.said_fleet:
        raise TraceError(f"{args.log}: {args.machine} says nothing on bus {args.bus!r} there; name it with --bus")
    if not recording.has_devices:
        raise TraceError(
            f"{args.log}: without the device bus of {args.machine}; record it under that name (bus-sim run --devices)"
        )
    for sent in recording.said_fleet:
        message = codecs.fleet.decode_part(sent.frame)
        if isinstance(message, Heartbeat) and message.site_digest != site.digest:
            raise TraceError(
                f"{args.log}: recorded at a site of digest {message.site_digest:04X}, but {args.site} has "
                f"{site.digest:04X}; name the site file that was in force"
            )
        if isinstance(message, Heartbeat) and message.boot != 1:
            raise TraceError(
                f"{args.log}: {args.machine} has boot counter {message.boot} in it, and what its journal held is not "
                "in the log; a replay needs a log from its first power-up, without restarts of it"
            )
