"""``onboard``: run one machine's controller on a CAN interface."""

import argparse
import asyncio
import errno
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from onboard import __version__
from onboard.config.arguments import Parser
from onboard.config.keys import machine_keys
from onboard.config.machine import MachineConfig, load_machine
from onboard.config.problems import ConfigError
from onboard.controller.shell import Controller, Ports
from onboard.core.records import next_boot
from onboard.core.site import journal_owner
from onboard.gateway.options import add_mqtt_arguments
from onboard.gateway.settings import GatewayError
from onboard.holon.holon import Holon
from onboard.io.broker_address import is_mqtt_installed
from onboard.io.collector import SOME, rare_looks
from onboard.io.console import ConsoleTelemetry, ManyTelemetry
from onboard.io.endings import ExitStatus
from onboard.io.journal import FileJournal
from onboard.io.kept_secrets import kept_secrets, secrets_path
from onboard.io.networkd import write_network_files
from onboard.io.open_bus import BusOpenError, BusSettings, OpenBus, add_bus_arguments, bus_settings
from onboard.io.owned_file import OwnedFileError
from onboard.io.seal_lives import SealLivesError
from onboard.io.sealed_bus import sealed_bus
from onboard.io.signals import terminated_as_interrupted
from onboard.life import ControllerLife
from onboard.ports.broker import BrokerError
from onboard.ports.bus import Bus
from onboard.ports.telemetry import Telemetry
from onboard.seal.keys import Keys
from onboard.systems.contract import codecs_for
from onboard.systems.registry import compaction_for, condition_for, factory_for, system_of, with_secrets
from onboard.systems.system import WithSecrets
from onboard.ways.effort import SLICE_STEPS, Searching
from onboard.web.address import is_installed as is_web_installed
from onboard.wire.codec import Codec

if TYPE_CHECKING:
    from onboard.gateway.gateway import Gateway

#: Of the journal's folder; everything else, such as a full disk, may pass.
_OF_THE_NAME = {errno.ENOENT, errno.ENOTDIR, errno.EISDIR, errno.EEXIST, errno.ENAMETOOLONG}
_MISTAKES = frozenset({errno.EACCES, errno.EPERM, *_OF_THE_NAME})

#: Makes a machine's own gateway on the running loop, from its fleet bus and the contract.
GatewayMaker = Callable[[OpenBus, Codec], "Gateway"]

EXIT_STATUS = """\
exit status:
  0  the controller was stopped by a person or the supervisor
  1  the controller ended, and is to be started again: a broken invariant, the journal or the bus failed
  2  a mistake in the command line, the machine file or the site file; one line for each says where and what to do
  3  the controller stopped itself and waits for a person, who is told why
An interface that is not there yet, or not any more, is waited for.

examples:
  onboard --machine mr1.toml
      the interfaces named in the machine file
  onboard --machine mr1.toml -i socketcan -c can0 -b 500000
      the fleet bus on a real interface; the command line overrides the file
  onboard --machine mr1.toml -i socketcand -c fleet --bus-kwargs host=127.0.0.1 port=29536
      join a site served by: bus-sim run level1 --serve --without MR1
  onboard --machine mr1.toml --mqtt mqtts://broker.example --mqtt-ca ca.pem --mqtt-cert mr1.pem --mqtt-key mr1.key
      publish this machine's state as well (docs/mqtt.md)
  onboard trace check trace.log --site site.toml
      judge a recorded log; see onboard trace --help
  onboard gateway -i socketcan -c can0 --site site.toml --mqtt mqtt://127.0.0.1
      publish the site to a broker; see onboard gateway --help
  onboard web -i socketcan -c can0 --site site.toml
      a live picture on a page of this computer; see onboard web --help
  onboard operate status -i socketcan -c can0 --site site.toml
      who stands and why; stop, go, block, clear, hold, release; see onboard operate --help
  onboard conform -i socketcan -c can0 --site bench.toml --node 11 --kind robot
      play a fleet's part against one node, and judge its duties; see onboard conform --help
  onboard keys make site.toml
      keys for a site with seals (docs/seals.md), and for tickets; see onboard keys --help
"""


def build_parser() -> argparse.ArgumentParser:
    """The command line of ``onboard``."""
    parser: argparse.ArgumentParser = Parser(
        prog="onboard",
        description="Run the controller of one machine. Every machine of a site runs this same program; only its "
        "machine file differs.",
        epilog=EXIT_STATUS,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"onboard {__version__}")
    parser.add_argument(
        "--machine", type=Path, required=True, metavar="FILE", help="machine file (docs/machine-file.md)"
    )
    parser.add_argument("--check", action="store_true", help="check the machine and site file, say so, and stop")
    parser.add_argument(
        "--networkd",
        type=Path,
        metavar="DIR",
        help="write systemd-networkd's settings for the machine's CAN interfaces into this folder, and stop",
    )
    parser.add_argument("--journal", type=Path, metavar="DIR", help="journal directory instead of the file's")
    add_mqtt_arguments(parser, required=False)
    add_bus_arguments(parser)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    words = sys.argv[1:] if argv is None else list(argv)
    if words and words[0] in COMMANDS:
        return COMMANDS[words[0]](words[1:])
    parser = build_parser()
    if words and not words[0].startswith("-"):
        parser.error(f'"{words[0]}" is no command; write {", ".join(COMMANDS)}, or --machine FILE')
    args = parser.parse_args(argv)
    try:
        config = load_machine(args.machine)
        fleet_settings = bus_settings(args, config.fleet_bus)
    except ConfigError as error:
        print(error, file=sys.stderr)
        return 2
    if unfit := _unfit(config, fleet_settings):
        print(f"{args.machine}: {config.machine.name}: {unfit}", file=sys.stderr)
        return 2
    if args.check:
        site = config.site
        print(f"{args.machine}: {config.machine.name} of site {site.name} (digest {site.digest:04X}): in order")
        return 0
    if args.networkd is not None:
        return _networkd(config, fleet_settings, args.networkd)
    journal = args.journal or config.journal
    try:
        keys = machine_keys(journal, config.site, config.machine.node_id)
        gateway = _beside(args, config) if args.mqtt is not None else None
        secrets = _secrets(config, journal)
        # Site, tables and modules stay: a look through them all would hold motion up (docs/decisions.md).
        with rare_looks(SOME, settled=True):
            return asyncio.run(run(config, fleet_settings, journal, gateway, keys, secrets))
    except (ConfigError, BusOpenError, BrokerError, GatewayError, SealLivesError, OwnedFileError) as error:
        print(error if isinstance(error, ConfigError) else f"onboard: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        remedy = "name another folder with --journal, or mend this one"
        print(f"onboard: journal {journal}: {error.strerror or error}; {remedy}", file=sys.stderr)
        return ExitStatus.MISTAKE if error.errno in _MISTAKES else ExitStatus.COMES_BACK


def _keeps_secrets(config: MachineConfig) -> bool:
    return isinstance(factory_for(config.site, config.machine.kind), WithSecrets)


def _unfit(config: MachineConfig, fleet_settings: BusSettings) -> str:
    """Why the machine cannot be run as its file says, with the remedy; empty where it can."""
    if config.machine.kind not in system_of(config.site).factories:
        what = f"a {config.machine.kind.name} of a {config.site.called} has no controller yet"
        return f"{what}; name a machine of another site"
    if _keeps_secrets(config) and BusSettings.of(config.device_bus) == fleet_settings:
        return "its tickets would be read on the fleet bus; give its devices a bus of their own, [device_bus]"
    return ""


def _secrets(config: MachineConfig, journal: Path) -> tuple[bytes, ...]:
    """What its kind keeps. A new one is told: other desks do not know it. Raises ``OwnedFileError``."""
    if not _keeps_secrets(config):
        return ()
    path = secrets_path(journal)
    kept = kept_secrets(path)
    if kept.is_new:
        what = "a new secret for tickets: those printed before open nothing, and other desks know none of this one"
        print(f"onboard: {path}: {what}; onboard keys tickets makes one file for all desks", file=sys.stderr)
    return kept.secrets


def _beside(args: argparse.Namespace, config: MachineConfig) -> GatewayMaker:
    """What makes the machine's own gateway. Raises ``GatewayError`` and ``BrokerError``."""
    if not is_mqtt_installed():
        raise GatewayError("--mqtt: its libraries are missing; pip install 'onboard-fleet[mqtt]'")
    from onboard.gateway.cli import beside  # noqa: PLC0415  # a controller without a broker must not carry it

    return beside(args, config.site, config.machine)


def _trace(words: list[str]) -> int:
    from onboard.trace.cli import main as trace  # noqa: PLC0415  # a controller must not carry it

    with terminated_as_interrupted():
        return trace(words)


def _networkd(config: MachineConfig, fleet_settings: BusSettings, to: Path) -> int:
    try:
        written = write_network_files([config.device_bus, fleet_settings], to)
    except OSError as error:
        print(f"onboard: --networkd {to}: {error.strerror}; name a folder that can be written", file=sys.stderr)
        return 2
    print("\n".join(str(path) for path in written))
    return 0


def _web(words: list[str]) -> int:
    if not is_web_installed():
        print("onboard: web: its libraries are missing; pip install 'onboard-fleet[web]'", file=sys.stderr)
        return 2
    from onboard.web.cli import main as web  # noqa: PLC0415  # a controller must not carry it

    return web(words)


def _gateway(words: list[str]) -> int:
    if not is_mqtt_installed():
        print("onboard: gateway: its libraries are missing; pip install 'onboard-fleet[mqtt]'", file=sys.stderr)
        return 2
    from onboard.gateway.cli import main as gateway  # noqa: PLC0415  # a controller must not carry it

    return gateway(words)


def _operate(words: list[str]) -> int:
    from onboard.operate.cli import main as operate  # noqa: PLC0415  # a controller must not carry it

    return operate(words)


def _conform(words: list[str]) -> int:
    from onboard.conform.cli import main as conform  # noqa: PLC0415  # a controller must not carry it

    return conform(words)


def _keys(words: list[str]) -> int:
    from onboard.keys.cli import main as keys  # noqa: PLC0415  # a controller must not carry it

    return keys(words)


#: What is not a controller; each takes the words behind its own and returns the exit status.
COMMANDS: dict[str, Callable[[list[str]], int]] = {
    "trace": _trace,
    "web": _web,
    "gateway": _gateway,
    "operate": _operate,
    "conform": _conform,
    "keys": _keys,
}


async def run(
    config: MachineConfig,
    fleet_settings: BusSettings,
    journal_directory: Path,
    gateway: GatewayMaker | None = None,
    keys: Keys | None = None,
    secrets: tuple[bytes, ...] = (),
) -> int:
    """Run until stopped; the exit status (``ExitStatus``).

    ``keys`` where the site has seals; ``secrets`` where the machine's kind keeps any (``WithSecrets``).
    """
    life = ControllerLife(config.machine.name, journal_directory)
    with life.ended_by_signals():
        journal = FileJournal(journal_directory, journal_owner(config.site, config.machine))
        entries = journal.replay()
        boot = next_boot(entries)
        holon = Holon(
            config.site,
            config.machine,
            with_secrets(factory_for(config.site, config.machine.kind), secrets),
            boot=boot,
            entries=entries,
            journal=condition_for(config.site, journal.condition, entries, journal.name),
        )
        estimator = holon.negotiation.estimator
        if isinstance(estimator, Searching):
            estimator.effort.slice_steps = SLICE_STEPS
        buses = await life.open_buses(fleet_settings, BusSettings.of(config.device_bus))
        if buses is None:
            await journal.close()
            return life.end()
        life.begin()
        codec = codecs_for(config.site)
        telemetry: Telemetry = ConsoleTelemetry()
        beside = gateway(buses[0], codec.fleet) if gateway is not None else None
        published: asyncio.Task[None] | None = None
        if beside is not None:
            telemetry = ManyTelemetry(telemetry, beside)
            published = asyncio.get_running_loop().create_task(beside.run())
            published.add_done_callback(_tell_ended)
        fleet_bus: Bus = buses[0]
        if keys is not None:
            reading = codec.fleet.decode_part
            fleet_bus = await sealed_bus(buses[0], config.site, keys, journal_directory, reading)
        ports = Ports(fleet_bus, buses[1], journal, telemetry, life.watchdog, compaction_for(config.site))
        controller = Controller(holon, ports, codec.fleet, codec.device)
        controller.needs_person = life.needs_person
        controller.start()
        life.follow(controller)
        await life.over()
        await controller.stop()
        if beside is not None and published is not None:
            beside.stop()
            await asyncio.wait([published])
    return life.end()


def _tell_ended(published: "asyncio.Task[None]") -> None:
    """A gateway that has failed is told of; the controller goes on without it."""
    if not published.cancelled() and published.exception() is not None:
        print(f"onboard: the gateway has failed: {published.exception()!r}; the controller goes on", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
