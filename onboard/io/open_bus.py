"""Opening the bus that a machine file or a command line names.

Each is imported only where it is opened. python-can costs a tenth of a second and 5 MB that a board on SocketCAN or on
the asyncio client does not have to spend.
"""

import argparse
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

from onboard.io.settings import BusOpenError, BusSettings, Interface
from onboard.ports.bus import Bus

__all__ = [
    "OWN_INTERFACES",
    "BusOpenError",
    "BusSettings",
    "OpenBus",
    "add_bus_arguments",
    "add_site_arguments",
    "bus_settings",
    "open_bus",
    "parse_with_bus",
]

#: Interfaces of ours beside python-can's: ``socketcand-asyncio`` speaks the protocol of python-can's ``socketcand``.
OWN_INTERFACES = ("socketcand-asyncio",)
#: Further keys of a SocketCAN interface that need no python-can.
WITHOUT_PYTHON_CAN = frozenset({"receive_own_messages"})


class OpenBus(Bus, Protocol):
    """A bus to the world outside this process, which can vanish."""

    async def wait_lost(self) -> str:
        """Return, with the reason in words, once the bus is gone for good; never while it may come back."""


def add_site_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what every program needs that joins the bus of a site: the site file, and the bus."""
    parser.add_argument("--site", type=Path, required=True, metavar="SITE", help="site file, or a shipped site's name")
    add_bus_arguments(parser)


def parse_with_bus(parser: argparse.ArgumentParser, argv: Sequence[str]) -> argparse.Namespace:
    """Parse a command line in which a bus has to be named; ends the program with status 2 where it is not."""
    args = parser.parse_args(argv)
    if not hasattr(args, "interface"):
        parser.error("name a bus: -i INTERFACE -c CHANNEL")
    return args


def add_bus_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options by which python-can's own tools take a bus (``can.cli.add_bus_arguments``, python-can 4.6).

    An option that is not given leaves no attribute behind, as there. python-can's function itself would have to be
    imported with all of python-can for ``--help``, and refuses the names in ``OWN_INTERFACES``.
    """
    group = parser.add_argument_group("bus arguments")
    group.add_argument(
        "-i",
        "--interface",
        default=argparse.SUPPRESS,
        metavar="INTERFACE",
        help="CAN interface: any of python-can's (socketcan, socketcand, virtual, slcan, kvaser, pcan ...), or "
        + ", ".join(OWN_INTERFACES),
    )
    group.add_argument(
        "-c",
        "--channel",
        default=argparse.SUPPRESS,
        metavar="CHANNEL",
        help="channel of the interface, such as can0 or /dev/ttyACM0",
    )
    group.add_argument(
        "-b", "--bitrate", type=int, default=argparse.SUPPRESS, metavar="BITRATE", help="bit rate of the bus, bit/s"
    )
    group.add_argument(
        "--bus-kwargs",
        action=_BusKwargs,
        nargs=argparse.ONE_OR_MORE,
        default=argparse.SUPPRESS,
        metavar="NAME=VALUE",
        help="further arguments of the interface, such as host=127.0.0.1 port=29536",
    )


def bus_settings(arguments: argparse.Namespace, default: Interface) -> BusSettings:
    """The bus of a machine file as far as the command line does not name another.

    ``--bus-kwargs`` are added to the file's; where the command line names another interface, the file's are not for
    it and are left out.
    """
    interface = getattr(arguments, "interface", default.interface)
    extra = dict(default.extra) if interface == default.interface else {}
    extra.update(getattr(arguments, "bus_kwargs", {}))
    return BusSettings(
        interface,
        getattr(arguments, "channel", default.channel),
        getattr(arguments, "bitrate", default.bitrate),
        tuple(sorted(extra.items())),
    )


async def open_bus(settings: Interface) -> OpenBus:
    """Open a bus on the running loop. Raises ``BusOpenError``."""
    if settings.interface == "socketcand-asyncio":
        from onboard.io.socketcand import open_socketcand  # noqa: PLC0415 - see the top of this file

        return await open_socketcand(BusSettings.of(settings))
    if settings.interface == "socketcan" and WITHOUT_PYTHON_CAN.issuperset(key for key, _ in settings.extra):
        from onboard.io.socketcan import open_socketcan  # noqa: PLC0415 - see the top of this file

        return await open_socketcan(BusSettings.of(settings))
    try:
        from onboard.io.pycan import open_python_can  # noqa: PLC0415 - see the top of this file
    except ImportError as error:
        raise BusOpenError(
            f'interface "{settings.interface}": python-can cannot be imported ({error}); '
            "install python-can 4.6 or use socketcand-asyncio"
        ) from error
    return await open_python_can(BusSettings.of(settings))


def cast(text: str) -> str | int | float | bool:
    """A value of ``--bus-kwargs`` as python-can understands it (``can.util.cast_from_string``)."""
    if re.fullmatch(r"[-+]?\d+", text):
        return int(text)
    if re.fullmatch(r"[-+]?\d*\.\d+(?:e[-+]?\d+)?", text):
        return float(text)
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    return text


class _BusKwargs(argparse.Action):
    """``NAME=VALUE ...`` into a dictionary, as python-can's tools do it."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: str | Sequence[Any] | None,
        option_string: str | None = None,
    ) -> None:
        found: dict[str, str | int | float | bool] = {}
        for one in values or ():
            match = re.fullmatch(r"([_a-zA-Z][_a-zA-Z0-9]*)=(\S*)", one)
            if match is None:
                raise argparse.ArgumentError(self, f"{one!r} is not of the form NAME=VALUE")
            found[match[1]] = cast(match[2])
        setattr(namespace, self.dest, found)
