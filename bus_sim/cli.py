"""``bus-sim``: run a whole site on a simulated CAN bus."""

import argparse
import sys
from collections.abc import Sequence
from types import ModuleType

from bus_sim.commands import HELP, Command
from bus_sim.outputs import check_outputs
from bus_sim.systems.registry import UnknownSystemError, own_commands
from onboard import __version__
from onboard.config.arguments import Parser
from onboard.config.problems import ConfigError
from onboard.entry import INTERRUPTED
from onboard.io.signals import terminated_as_interrupted


def _run() -> ModuleType:
    from bus_sim import run_command

    return run_command


def _dbc() -> ModuleType:
    from bus_sim import dbc_command

    return dbc_command


def _sites() -> ModuleType:
    from bus_sim.sites import command

    return command


def _campaign() -> ModuleType:
    from bus_sim.campaign import command

    return command


def _attack() -> ModuleType:
    from bus_sim.attacks import command

    return command


#: Those for all sites; a system may bring commands of its own.
COMMANDS = {
    "run": Command("run a site", _run),
    "dbc": Command("print the DBC of a site: one message for each machine", _dbc),
    "sites": Command("list the shipped sites, or tell what one holds and can lose", _sites),
    "campaign": Command("run a site under many seeds of faults", _campaign),
    "attack": Command("attack a site by a node that sees only the bus", _attack),
}


def mistakes() -> tuple[type[Exception], ...]:
    """What a person can mend, each a line and exit status 2; loaded where something was raised."""
    from bus_sim.commands import OptionError
    from bus_sim.demand import DemandError
    from bus_sim.outputs import OutputError
    from bus_sim.processes.fleet import ProcessesError
    from bus_sim.publish import PublishError
    from bus_sim.serve.socketcand import ServeError
    from bus_sim.sites import SiteNotFoundError
    from onboard.io.settings import BusOpenError
    from onboard.web.address import WebError

    of_sites = (ConfigError, DemandError, OptionError, OutputError, SiteNotFoundError, UnknownSystemError)
    return (*of_sites, BusOpenError, ProcessesError, PublishError, ServeError, WebError)


def ends() -> tuple[type[Exception], ...]:
    """A run that cannot go on: a line and exit status 1."""
    from bus_sim.virtual_time import DeadlockError, StandstillError

    return (StandstillError, DeadlockError)


def build_parser(words: Sequence[str] | None = None) -> argparse.ArgumentParser:
    """The command line of ``bus-sim``; of commands that these words do not name only the names. None for all."""
    parser: argparse.ArgumentParser = Parser(
        prog="bus-sim",
        description="Run a site on a simulated CAN bus: all controllers, the plant and its customers in one process.",
        epilog=HELP,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"bus-sim {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, command in _every_command().items():
        its = commands.add_parser(name, help=command.summary)
        if words is None or name in words:
            command.load().add_options(its)
    return parser


def _every_command() -> dict[str, Command]:
    return COMMANDS | own_commands()


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    args = build_parser(sys.argv[1:] if argv is None else argv).parse_args(argv)
    try:
        check_outputs(args)
        with terminated_as_interrupted():
            status: int = _every_command()[args.command].load().run(args)
            return status
    except KeyboardInterrupt:
        print("bus-sim: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        return 1
    except mistakes() as error:
        for line in str(error).splitlines():
            print(line if isinstance(error, ConfigError) else f"bus-sim: {line}", file=sys.stderr)
        return 2
    except ends() as error:
        print(f"bus-sim: {error}", file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(main())
