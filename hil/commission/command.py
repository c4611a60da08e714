"""``python -m hil commission``: walks a person through a new machine on a live bus."""

import argparse
import asyncio
import contextlib
import signal
import sys
from datetime import datetime
from pathlib import Path

from hil.commission.listener import CommissionListener
from hil.commission.person import ConsolePerson
from hil.commission.protocol import Protocol, StepVerdict
from hil.commission.setting import CommissionSetting
from hil.commission.walk import walk
from onboard.config.arguments import Parser
from onboard.config.machine import MachineConfig, load_machine
from onboard.config.problems import ConfigError
from onboard.io.open_bus import BusOpenError, BusSettings, add_bus_arguments, bus_settings, open_bus
from onboard.io.signals import ended_by
from onboard.systems.contract import codecs_for

HELP = """\
The controller of the new machine stays off until the walk asks for it: the walk gives orders to its devices in its
place. It is asked at the terminal; answers may come from a pipe, one a line.

exit status:
  0  every step was done and none failed
  1  a step failed or was not done, also because the program was ended; the protocol says which
  2  a mistake in the command line, the machine file or the site file, or a bus that cannot be opened

examples:
  python -m hil commission --machine mr1.toml
      on the board itself, on the interfaces of its machine file, with its service stopped
  python -m hil commission --machine mr1.toml -i socketcan -c can0 --protocol mr1-protocol.txt
      on a laptop that is plugged into the fleet bus
"""


def build_parser() -> argparse.ArgumentParser:
    """The command line of ``hil commission``."""
    parser: argparse.ArgumentParser = Parser(
        prog="hil commission",
        description="Walk through a new machine on a live bus, and print a protocol to sign.",
        epilog=HELP,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--machine", type=Path, required=True, metavar="FILE", help="machine file of the new machine")
    parser.add_argument(
        "--protocol", type=Path, metavar="FILE", help="where the protocol goes (default: MACHINE-protocol.txt)"
    )
    add_bus_arguments(parser)
    return parser


def main(words: list[str]) -> int:
    """Entry point; returns the exit status."""
    args = build_parser().parse_args(words)
    try:
        config = load_machine(args.machine)
        protocol = asyncio.run(_commission(config, bus_settings(args, config.fleet_bus)))
    except ConfigError as error:
        print(error, file=sys.stderr)
        return 2
    except BusOpenError as error:
        print(f"hil commission: {error}", file=sys.stderr)
        return 2
    file = args.protocol or Path(f"{config.machine.name}-protocol.txt")
    try:
        file.write_text(protocol.text(), encoding="utf-8")
    except OSError as error:
        print(f"hil commission: --protocol {file}: {error.strerror}; name a file that can be written", file=sys.stderr)
        return 2
    # Nobody reads of a terminal that is closed.
    with contextlib.suppress(OSError):
        print(f"\n{protocol.text()}\nThe protocol is in {file}.", flush=True)
    return 0 if protocol.is_passed else 1


async def _walked(setting: CommissionSetting) -> None:
    """The walk to its end; who ends the program keeps what was measured until then, and the drives hear no order."""
    walking, loop = asyncio.ensure_future(walk(setting)), asyncio.get_running_loop()
    signals: list[signal.Signals] = []

    def end(number: signal.Signals) -> None:
        signals.append(number)
        walking.cancel()

    with ended_by(loop, end):
        await asyncio.wait({walking})
    if walking.cancelled():
        # Not told to the person as well: the terminal may be closed.
        setting.protocol.note("all further steps", StepVerdict.NOT_DONE, f"ended from outside ({signals[0].name})")
        return
    walking.result()


async def _commission(config: MachineConfig, settings: BusSettings) -> Protocol:
    contract = codecs_for(config.site)
    fleet = devices = await open_bus(settings)
    try:
        if BusSettings.of(config.device_bus) != settings:
            devices = await open_bus(BusSettings.of(config.device_bus))
        machine, site = config.machine, config.site
        protocol = Protocol(
            f"{machine.name} (node-ID {machine.node_id}, {machine.kind.name.lower()})",
            f"{site.name} (digest {site.digest:04X})",
            datetime.now().astimezone().isoformat(sep=" ", timespec="seconds"),
        )
        setting = CommissionSetting(
            site,
            machine,
            CommissionListener(fleet, contract.fleet),
            CommissionListener(devices, contract.device),
            ConsolePerson(),
            protocol,
        )
        await _walked(setting)
        return protocol
    finally:
        await fleet.close()
        if devices is not fleet:
            await devices.close()
