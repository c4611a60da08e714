"""What a scenario can do with a device under test; which of it, a target's capabilities say."""

from typing import Protocol

from onboard.ports.bus import BusHealth


class BenchError(Exception):
    """The bench itself failed: a command, an interface; ``str`` is one line for a person."""


class Device(Protocol):
    """One device under test, beside a simulated fleet. Every call ends once the thing is done."""

    async def power_on(self, site_text: str) -> None:
        """Give it power, with this site file where the bench can put one there; it starts by itself."""

    async def power_off(self) -> None:
        """Cut its power without warning."""

    async def unplug(self) -> None:
        """Pull its plug on the fleet bus."""

    async def plug(self) -> None:
        """Put its plug on the fleet bus back in."""

    async def force_bus_off(self) -> None:
        """Destroy its frames until it is off the bus, then leave the bus alone."""

    async def console(self) -> str:
        """All that it has said on its console since the bench was opened."""

    async def counters(self) -> BusHealth:
        """Error counters of its connection to the fleet bus, and what it lost."""

    async def close(self) -> None:
        """End it, and give back what the bench holds."""
