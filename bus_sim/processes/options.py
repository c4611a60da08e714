"""The options of ``bus-sim run`` that put every machine into a process of its own."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from bus_sim.faults import controllers
from bus_sim.faults.arm import ACTIONS
from bus_sim.faults.injection import AnyFault, Injection
from bus_sim.processes.plan import PowerChange, ProcessPlan, parse_moments, spans_of
from onboard.core.site import Site

#: Where the buses are served unless ``--serve`` says so: a free port of this host.
ANY_PORT = "127.0.0.1:0"
_HELP = {
    PowerChange.JOIN: "start this machine so many seconds after the run began; where it left before, with its journal",
    PowerChange.LEAVE: "end this machine's process then (SIGTERM)",
    PowerChange.KILL: "kill it then (SIGKILL), as a power cut does",
}


def add_processes(group: argparse._ArgumentGroup) -> None:
    """Add ``--processes`` and what goes with it."""
    group.add_argument(
        "--processes",
        action="store_true",
        help="simulate buses, plant and customers, and run `onboard --machine FILE` as a process for every machine, at "
        "the pace of the clock",
    )
    for change in (PowerChange.JOIN, PowerChange.LEAVE, PowerChange.KILL):
        group.add_argument(
            f"--{change.value}", action="append", default=[], metavar="MACHINE=SECONDS", help=_HELP[change]
        )
    group.add_argument(
        "--process-dir",
        type=Path,
        metavar="DIR",
        help="keep machine files, journals and logs here (default: a temporary directory)",
    )


def process_plan(args: argparse.Namespace, site: Site, text: str, faults: Sequence[AnyFault]) -> ProcessPlan | None:
    """What the options ask for; None for all controllers in one process. ``text`` is that of the site file.

    Raises ``ValueError`` with one line.
    """
    moments = [moment for change in PowerChange for moment in parse_moments(change, getattr(args, change.value))]
    if not args.processes:
        if moments or args.process_dir is not None:
            given = str(moments[0]) if moments else f"--process-dir {args.process_dir}"
            raise ValueError(f"{given}: only a machine in a process of its own can; add --processes")
        return None
    for option in ("hour", "window"):
        if getattr(args, option) is not None:
            raise ValueError(
                f"--{option} {getattr(args, option)}: what comes before is hurried, and processes live at "
                "the clock's pace; leave it out"
            )
    if args.speed not in (None, "1", "1.0"):
        raise ValueError(f"--speed {args.speed}: processes live at the clock's pace; leave it out")
    for fault in faults:
        if isinstance(fault, Injection) and ACTIONS.get(fault.kind) in vars(controllers).values():
            raise ValueError(f"--fault {fault}: acts inside a controller of this process; use --kill and --join")
    spans_of(moments, [one.name for one in site.machines.values() if one.name not in args.without])
    return ProcessPlan(text, tuple(moments), args.process_dir)
