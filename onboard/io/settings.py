"""Where a bus is, in python-can's words."""

from dataclasses import dataclass
from typing import Any, Protocol, Self


class BusOpenError(Exception):
    """A bus that could not be opened. ``str`` is one line for a person: which bus, what is wrong, what to do.

    ``may_come`` tells what time alone may heal, such as an adapter that is not plugged in yet, from a mistake.
    """

    def __init__(self, text: str, *, may_come: bool = False) -> None:
        super().__init__(text)
        self.may_come = may_come


class Interface(Protocol):
    """A bus as a machine file or a command line names it."""

    @property
    def interface(self) -> str:
        """One of python-can's interface names, or one of our own (``onboard.io.open_bus.OWN_INTERFACES``)."""

    @property
    def channel(self) -> str:
        """The channel, in the interface's own words."""

    @property
    def bitrate(self) -> int:
        """Bit/s; interfaces that are configured elsewhere (SocketCAN: ``ip link``) ignore it."""

    @property
    def extra(self) -> tuple[tuple[str, Any], ...]:
        """Further keyword arguments of ``can.Bus``."""


@dataclass(frozen=True, slots=True)
class BusSettings:
    """An ``Interface`` with a value: equal settings name one and the same bus."""

    interface: str
    channel: str
    bitrate: int = 500_000
    extra: tuple[tuple[str, Any], ...] = ()

    @classmethod
    def of(cls, other: Interface) -> Self:
        """A copy; the order of further arguments does not matter."""
        return cls(other.interface, other.channel, other.bitrate, tuple(sorted(other.extra)))

    def __str__(self) -> str:
        return f"{self.interface}:{self.channel}"
