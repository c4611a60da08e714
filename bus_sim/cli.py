"""``bus-sim``: run a whole site on a simulated CAN bus."""

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from bus_sim.attacks.command import add_attack, run_attack_command
from bus_sim.campaign.command import add_campaign, run_campaign_command, run_scenario
from bus_sim.demand import DemandError
from bus_sim.demand_options import TABLE_OPTIONS, add_table_options
from bus_sim.faults.injection import AnyFault, parse_injection
from bus_sim.options import RunOptions
from bus_sim.outputs import OutputError, check_outputs
from bus_sim.outside import is_address
from bus_sim.processes.fleet import ProcessesError
from bus_sim.processes.options import ANY_PORT, add_processes, process_plan
from bus_sim.publish import PublishError, check_mqtt
from bus_sim.serve.bridge import parse_bus_specs
from bus_sim.serve.socketcand import ServeError
from bus_sim.session import run_site
from bus_sim.site_words import with_words
from bus_sim.sites import SiteNotFoundError, find_site, layout_names, site_names, site_text
from bus_sim.systems.registry import UnknownSystemError, own_commands, simulated_of
from bus_sim.systems.system import SimulatedSystem
from bus_sim.virtual_time import DeadlockError, StandstillError
from onboard import __version__
from onboard.config.arguments import Parser
from onboard.config.problems import ConfigError
from onboard.config.site import parse_site
from onboard.config.site_change import added_machines
from onboard.config.site_report import site_report
from onboard.core.site import Site
from onboard.entry import INTERRUPTED
from onboard.io.broker_address import is_loopback
from onboard.io.open_bus import BusOpenError
from onboard.io.signals import terminated_as_interrupted
from onboard.systems.registry import part
from onboard.web.address import WebError, parse_address
from onboard.web.address import is_installed as is_web_installed

HELP = """\
exit status:
  0  everything that was asked for happened, and no invariant was broken
  1  the run failed: an invariant of the plant broke, a controller halted, or somebody was left waiting
  2  a mistake in the command line or in a file; one line for each says where and what to do

examples:
  bus-sim run                          an hour of a real day on the standard site, a minute a second
  bus-sim run standard                 that whole day, as fast as possible
  bus-sim run standard --hour 16:30    from 16:30 to 17:30, after a short hurried warm-up
  bus-sim run level1                   a day on the one-floor site
  bus-sim run level1 --one-car 300     one car by hand, fetched after five minutes
  bus-sim run small --by-hand          press i for a car in, o for a car out
  bus-sim run level1 --serve           at the pace of the clock, the fleet bus on 127.0.0.1:29536 (socketcand)
  bus-sim run level1 --bus socketcan:vcan0
                                       the fleet bus on an interface, so that `candump vcan0` shows it
  bus-sim run small --processes --one-car 60
                                       every machine in a process of its own, at the pace of the clock
  bus-sim run small --mqtt             publish it to a broker of its own; prints how to watch with mosquitto_sub
  bus-sim dbc level1 > level1.dbc      one message for each machine, for candump | cantools decode, Wireshark ...
"""


#: Where nothing else is named.
DEFAULT_SITE = "standard"


def build_parser() -> argparse.ArgumentParser:
    """The command line of ``bus-sim``."""
    parser: argparse.ArgumentParser = Parser(
        prog="bus-sim",
        description="Run a site on a simulated CAN bus: all controllers, the plant and its customers in one process.",
        epilog=HELP,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"bus-sim {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    _add_run(
        commands.add_parser("run", help="run a site", epilog=HELP, formatter_class=argparse.RawDescriptionHelpFormatter)
    )
    dbc = commands.add_parser("dbc", help="print the DBC of a site: one message for each machine")
    dbc.add_argument("site", nargs="?", default="level1", help="name of a shipped site, or a site file")
    sites = commands.add_parser("sites", help="list the shipped sites, or tell what one holds and can lose")
    sites.add_argument("site", nargs="?", help="name of a shipped site, or a site file")
    sites.add_argument("--draw", metavar="FILE", help="draw the building to scale, as SVG (- for standard output)")
    add_campaign(commands)
    add_attack(commands)
    for module in own_commands():
        module.add(commands)
    return parser


def _add_run(run: argparse.ArgumentParser) -> None:
    run.add_argument(
        "site",
        nargs="?",
        help="name of a shipped site, or a site file (default: standard, and an hour in which cars come and go)",
    )
    demand = run.add_argument_group("who comes (default: the shipped real day, 2019-07-24)")
    demand.add_argument("--sessions", type=Path, metavar="FILE", help="sessions file (CSV; docs/demand.md)")
    add_table_options(demand)
    demand.add_argument(
        "--day",
        metavar="D[..D]",
        help="only sessions that begin on this local day, or from the first to the last of two, such as "
        "2019-07-24..2019-07-26; cars that stay over midnight stay",
    )
    demand.add_argument(
        "--stalls",
        metavar="NAME,...",
        default="",
        help="only stalls so named, or beginning so (default: all of the file; of the shipped day all 52 where a site "
        "has several compartments, else the fourteen of level 1)",
    )
    demand.add_argument("--one-car", type=float, metavar="SECONDS", help="one car by hand, fetched after so long")
    demand.add_argument(
        "--by-hand",
        action="store_true",
        help="cars come in and are asked for by keys of this terminal while the site runs, ten times as fast as the "
        "clock; or by the same letters in a pipe",
    )
    demand.add_argument(
        "--random",
        nargs=2,
        type=float,
        metavar=("MEAN", "SIGMA"),
        help="cars at normal intervals of this mean and standard deviation, in seconds",
    )
    demand.add_argument(
        "--random-out",
        nargs=2,
        type=float,
        metavar=("MEAN", "SIGMA"),
        help="with --random: intervals at which cars are fetched (default: as they come)",
    )
    demand.add_argument(
        "--announce",
        nargs=2,
        type=float,
        metavar=("SHARE", "MINUTES"),
        help="so large a share of the customers (0 to 1) says at the desk when the car will be fetched, off by this "
        "standard deviation (default: nobody)",
    )
    demand.add_argument("--cars", type=int, default=50, metavar="N", help="number of cars with --random (default: 50)")
    _add_when(run.add_argument_group("which part of the day (default: all of it where a site is named)"))
    how = run.add_argument_group("how it runs")
    how.add_argument("--seed", type=int, default=1, help="seed of everything that is drawn by chance (default: 1)")
    how.add_argument(
        "--speed",
        metavar="FACTOR",
        help="simulated seconds a second, or max (default: 60 in a window, else max; 1 with --serve or --bus)",
    )
    how.add_argument("--for", type=float, dest="limit_s", metavar="SECONDS", help="stop after so much simulated time")
    how.add_argument(
        "--without",
        action="append",
        default=[],
        metavar="MACHINE",
        help="leave this machine's controller out; it may join from another process",
    )
    how.add_argument(
        "--was",
        metavar="SITE",
        help="machines begin with this site file, which that of the run follows with more machines while they work "
        "(onboard operate change-site)",
    )
    how.add_argument(
        "--change-at",
        type=float,
        dest="change_s",
        default=60.0,
        metavar="SECONDS",
        help="with --was: when an operator announces that (default: 60)",
    )
    how.add_argument(
        "--fault",
        action="append",
        default=[],
        metavar="FAULT",
        help="a fault, such as omission:receivers=11,probability=0.01,seed=7 or crash:target=MR1,at_s=80 (repeatable)",
    )
    how.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="TABLE.KEY=VALUE",
        help="in the stead of what the site file says, such as negotiation.place=cost (repeatable; docs/site-file.md)",
    )
    how.add_argument(
        "--scenario",
        type=Path,
        metavar="FILE",
        help="site, customers, seed and faults from this file; of the other options only --trace and --json go with it",
    )
    add_processes(run.add_argument_group("every machine in a process of its own"))
    # Not in the help: a mistake put into this run on purpose, to see the judges find it (PlantedBug).
    how.add_argument("--plant-bug", metavar="NAME", help=argparse.SUPPRESS)
    out = run.add_argument_group("what comes out")
    out.add_argument(
        "--web",
        nargs="?",
        const="127.0.0.1:8080",
        metavar="[HOST:]PORT",
        help="serve a live picture of the site (default: 127.0.0.1:8080)",
    )
    out.add_argument(
        "--web-token",
        type=Path,
        metavar="FILE",
        help="keep the token of the picture's address here, so that it stays (made where missing)",
    )
    out.add_argument("--no-web", action="store_true", help="without a site: do not serve the picture")
    out.add_argument(
        "--trace",
        type=Path,
        default=Path("trace.log"),
        metavar="FILE",
        help="candump log of the fleet bus (default: trace.log)",
    )
    out.add_argument("--devices", action="store_true", help="log every machine's device bus as well")
    out.add_argument("--json", type=Path, metavar="FILE", help="write the summary as JSON too")
    out.add_argument(
        "--serve",
        nargs="?",
        const="127.0.0.1:29536",
        metavar="HOST:PORT",
        help="serve the buses in the socketcand protocol (default 127.0.0.1:29536)",
    )
    out.add_argument(
        "--serve-token",
        type=Path,
        metavar="FILE",
        help="clients open CHANNEL:TOKEN, with the token in this file (made where missing); other hosts need it",
    )
    out.add_argument(
        "--mqtt",
        nargs="?",
        const="",
        metavar="URL",
        help="publish the site to this broker and take orders, at the pace of the clock (default: a mosquitto of the "
        "run's own on a loopback port; docs/mqtt.md)",
    )
    out.add_argument(
        "--bus",
        action="append",
        default=[],
        metavar="[MACHINE=]INTERFACE:CHANNEL",
        help="join the fleet bus, or this machine's device bus, with a python-can interface (repeatable)",
    )


def _add_when(when: argparse._ArgumentGroup) -> None:
    window = when.add_mutually_exclusive_group()
    window.add_argument(
        "--hour",
        metavar="HH:MM",
        help="this hour of the first day, or busiest, or two-way: that in which cars come and go; who is inside by "
        "then is parked before, as fast as possible. "
        "With 2019-07-25T07:00 an hour of another day",
    )
    window.add_argument("--window", metavar="FROM-TO", help="the same with an end of its own, such as 06:30-09:00")


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    args = build_parser().parse_args(argv)
    try:
        check_outputs(args)
        with terminated_as_interrupted():
            return _command(args.command)(args)
    except (
        ConfigError,
        WebError,
        DemandError,
        SiteNotFoundError,
        BusOpenError,
        ServeError,
        ProcessesError,
        UnknownSystemError,
        PublishError,
        OptionError,
        OutputError,
    ) as error:
        for line in str(error).splitlines():
            print(line if isinstance(error, ConfigError) else f"bus-sim: {line}", file=sys.stderr)
        return 2
    except (StandstillError, DeadlockError) as error:
        print(f"bus-sim: {error}", file=sys.stderr)
        return 1
    except BrokenPipeError:
        return 1
    except KeyboardInterrupt:
        print("bus-sim: interrupted", file=sys.stderr)
        return INTERRUPTED


def _sites(args: argparse.Namespace) -> int:
    if args.draw is None:
        known = [*site_names(), *layout_names()]
        print("\n".join(known if args.site is None else site_report(find_site(args.site))))
        return 0
    if args.site is None:
        raise OptionError("--draw: of which site? name one before it")
    site = find_site(args.site)
    building = part(site.system, "building")
    if building is None:
        raise OptionError(f"--draw: no drawing of a {site.system} by itself; bus-sim run {args.site} --web shows it")
    if args.draw == "-":
        sys.stdout.write(str(building.draw(site)))
        return 0
    Path(args.draw).write_text(str(building.draw(site)), encoding="utf-8")
    print("\n".join([*site_report(site), f"drawn: {args.draw}"]))
    return 0


def _dbc(args: argparse.Namespace) -> int:
    from onboard.wire.site_dbc import site_dbc  # noqa: PLC0415  # reading DBC files is an eighth of every start

    sys.stdout.write(site_dbc(find_site(args.site)))
    return 0


def _run(args: argparse.Namespace) -> int:
    if args.limit_s is not None and not 0 < args.limit_s < float("inf"):
        raise OptionError(f"--for {args.limit_s:g}: must be seconds above 0")
    if args.scenario is not None:
        return _run_scenario(args)
    site, text = _site(args)
    summary = run_site(site, _options(args, site, text))
    if args.json is not None:
        args.json.write_text(json.dumps(summary.to_json(), indent=2) + "\n", encoding="utf-8")
    return 0 if summary.is_good else 1


def _site(args: argparse.Namespace) -> tuple[Site, str]:
    """The site that is run, and the text of its file, with what ``--set`` says."""
    name = args.site or DEFAULT_SITE
    site, text = find_site(name), site_text(name)
    if not args.set:
        return site, text
    try:
        text = with_words(text, args.set)
    except ValueError as error:
        raise OptionError(str(error)) from error
    return parse_site(text, f"{Path(name).stem}.toml"), text


#: What each command does with its options; they return the exit status.
COMMANDS: dict[str, Callable[[argparse.Namespace], int]] = {
    "run": _run,
    "sites": _sites,
    "dbc": _dbc,
    "campaign": run_campaign_command,
    "attack": run_attack_command,
}


def _command(name: str) -> Callable[[argparse.Namespace], int]:
    """What a command does: one of all sites, or of the sites of one system."""
    own = {name: run for module in own_commands() for name, run in module.RUN.items()}
    return COMMANDS.get(name) or own[name]


class OptionError(ValueError):
    """A mistake in one option: its name, the value and the remedy in one line."""


def _planted(system: SimulatedSystem[Any, Any], name: str | None) -> Callable[[Any], None] | None:
    if name is None:
        return None
    try:
        return system.planted(name)
    except KeyError as error:
        raise OptionError(f"--plant-bug {error.args[0]}") from error


def _speed(text: str | None) -> float | None:
    """Simulated seconds a second; None for as fast as possible."""
    if text is None or text == "max":
        return None
    try:
        speed = float(text)
    except ValueError as error:
        raise OptionError(f"--speed {text}: not a number; write a factor above 0, or max") from error
    if not 0 < speed < float("inf"):
        raise OptionError(f"--speed {speed}: must be above 0, or max")
    return speed


def _run_scenario(args: argparse.Namespace) -> int:
    """A scenario says everything itself: what the command line says besides would be passed over in silence."""
    usual = build_parser().parse_args(["run"])
    free = ("scenario", "trace", "json")
    for name, value in vars(args).items():
        if name not in free and value != getattr(usual, name):
            option = "SITE" if name == "site" else f"--{name.removesuffix('_s').replace('_', '-')}"
            raise OptionError(f"{option}: does not go with --scenario; write it into the file, or leave it out")
    return run_scenario(args.scenario, args.trace, args.json)


def _faults(args: argparse.Namespace) -> list[AnyFault]:
    faults: list[AnyFault] = []
    for text in args.fault:
        try:
            faults.append(parse_injection(text))
        except ValueError as error:
            raise OptionError(f"--fault {text}: {error}") from error
    return faults


#: Options of ``run`` that say who comes, or what is shown of it: the system of the site reads them.
_WHO_COMES = (
    *("sessions", "counts", *TABLE_OPTIONS, "inside"),
    *("day", "stalls", "one_car", "by_hand", "random", "cars", "hour", "window"),
)


def _options(args: argparse.Namespace, site: Site, text: str) -> RunOptions:
    """What was asked for, of a site whose file has this ``text``.

    Raises ``OptionError`` and ``DemandError`` for what does not go together.
    """
    system, faults, speed = simulated_of(site), _faults(args), _speed(args.speed)
    try:
        parse_bus_specs(args.bus, 500_000, [machine.name for machine in site.machines.values()])
        processes = process_plan(args, site, text, faults)
        mqtt = check_mqtt(args.mqtt) if args.mqtt is not None else None
    except ValueError as error:
        raise OptionError(str(error)) from error
    live = args.serve is not None or bool(args.bus) or processes is not None or mqtt is not None
    if args.serve is not None and not is_address(args.serve):
        raise OptionError(f"--serve {args.serve}: must be HOST:PORT, such as 127.0.0.1:29536")
    if args.serve is not None and args.serve_token is None and not is_loopback(args.serve.rpartition(":")[0]):
        raise OptionError(f"--serve {args.serve}: others reach it there, and may say anything; add --serve-token FILE")
    if live and args.without and args.speed is not None and speed != 1.0:
        raise OptionError(
            f"--speed {args.speed}: a controller in another process lives at the clock's pace; leave it out"
        )
    usual = build_parser().parse_args(["run"])
    given = {name: getattr(args, name) for name in _WHO_COMES if getattr(args, name) != getattr(usual, name)}
    demand = system.asked(site, args, given, live=live)
    if args.speed is None:
        looks_on = sys.stdout.isatty()
        speed = 1.0 if live else system.speed(demand, web=args.web is not None, terminal=looks_on)
    return RunOptions(
        seed=args.seed,
        speed=speed,
        limit_s=args.limit_s,
        demand=demand,
        without=frozenset(args.without),
        was=_was(args, site),
        change_s=args.change_s,
        faults=tuple(faults),
        prepare=_planted(system, args.plant_bug),
        trace=args.trace,
        devices=args.devices,
        serve=args.serve or (ANY_PORT if processes is not None or mqtt is not None else None),
        serve_token=args.serve_token,
        buses=tuple(args.bus),
        processes=processes,
        mqtt=mqtt,
        site_text=text if mqtt is not None else "",
        web=_web(args),
        web_token=args.web_token,
    )


def _was(args: argparse.Namespace, site: Site) -> Site | None:
    """The site file that machines begin with. Raises ``ConfigError`` for one that this site cannot follow."""
    if args.was is None:
        return None
    if not 0 <= args.change_s < float("inf"):
        raise OptionError(f"--change-at {args.change_s:g}: must be seconds, 0 or more")
    if args.processes:
        raise OptionError("--was: with --processes each machine reads its site file itself; leave one of them out")
    old = find_site(args.was)
    added_machines(old, site, args.site or DEFAULT_SITE)
    return old


def _web(args: argparse.Namespace) -> str | None:
    """Where the picture is served: as asked for, and on any port where nothing at all was asked for."""
    if args.web is not None:
        if not is_web_installed():
            raise OptionError("--web: its libraries are missing; pip install 'onboard-fleet[web]'")
        try:
            parse_address(args.web)
        except WebError as error:
            raise OptionError(f"--web {error}") from error
        return str(args.web)
    plain = args.site is None and not args.no_web and not args.processes and args.speed is None
    return "127.0.0.1:0" if plain and is_web_installed() else None


if __name__ == "__main__":
    sys.exit(main())
