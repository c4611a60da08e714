"""A simulated bus joined with a bus outside: ``--bus socketcan:vcan0``, or any other interface of python-can.

``--bus MR1=socketcan:vcan1`` is a machine's device bus, for a controller that has two real interfaces as on a board.
"""

from collections import Counter
from collections.abc import Collection, Sequence
from typing import NamedTuple

from onboard.config.problems import nearest
from onboard.core.frame import Frame
from onboard.io.open_bus import OpenBus, cast, open_bus
from onboard.io.settings import BusSettings
from onboard.ports.bus import Bus

_FORM = "INTERFACE:CHANNEL[,NAME=VALUE...], such as socketcan:vcan0, or MR1=socketcan:vcan1 for a device bus"


class Joint(NamedTuple):
    """What joins which simulated bus: the device bus of ``machine``, or the fleet bus where that is None."""

    machine: str | None
    settings: BusSettings


def parse_bus_spec(spec: str, bitrate: int) -> BusSettings:
    """The bus of a ``--bus`` option. Raises ``ValueError`` with one line for a person."""
    where, *extra = spec.split(",")
    interface, colon, channel = where.partition(":")
    if not (interface and colon and channel):
        raise ValueError(f'--bus "{spec}": must be {_FORM}')
    pairs = [one.partition("=") for one in extra]
    for name, equals, _ in pairs:
        if not (name.isidentifier() and equals):
            raise ValueError(f'--bus "{spec}": "{name}{equals}" is not NAME=VALUE; must be {_FORM}')
    return BusSettings(interface, channel, bitrate, tuple(sorted((name, cast(value)) for name, _, value in pairs)))


def parse_bus_specs(specs: Sequence[str], bitrate: int, machines: Collection[str] = ()) -> list[Joint]:
    """Several ``--bus`` options for a site of these machines. Raises ``ValueError`` with one line for a person.

    One bus named twice is refused: two bridges between two buses are a loop.
    """
    found: list[Joint] = []
    for spec in specs:
        name, equals, rest = spec.partition("=")
        machine = name if equals and ":" not in name else None
        if machine is not None and machine not in machines:
            raise ValueError(f'--bus "{spec}": no machine {machine}; {nearest(machine, list(machines))}')
        settings = parse_bus_spec(spec if machine is None else rest, bitrate)
        if any(_is_same(settings, one.settings) for one in found):
            raise ValueError(f'--bus "{spec}": given twice, and every frame would go round for ever; give it once')
        found.append(Joint(machine, settings))
    return found


def _is_same(one: BusSettings, other: BusSettings) -> bool:
    return (one.interface, one.channel) == (other.interface, other.channel)


class Bridge:
    """Carries frames both ways between a node of a simulated bus and a node of another bus.

    Neither node hears itself (``ports.Bus``), so a frame that was carried over does not come back. Error frames stay
    on their side. ``counts``: ``outward``, ``inward`` and both with ``_refused`` where the other side's queue was full.
    """

    def __init__(self, inside: Bus, outside: Bus) -> None:
        self.counts: Counter[str] = Counter()
        self._inside = inside
        self._outside = outside
        inside.subscribe(self._outward)
        outside.subscribe(self._inward)

    async def close(self) -> None:
        """Take both nodes off their buses."""
        await self._outside.close()
        await self._inside.close()

    def _outward(self, frame: Frame, _: int) -> None:
        self._carry(frame, self._outside, "outward")

    def _inward(self, frame: Frame, _: int) -> None:
        self._carry(frame, self._inside, "inward")

    def _carry(self, frame: Frame, to: Bus, way: str) -> None:
        if not frame.is_error:
            self.counts[way if to.send(frame) else f"{way}_refused"] += 1


async def open_bridge(inside: Bus, settings: BusSettings) -> tuple[Bridge, OpenBus]:
    """Open the outside bus and join it. Raises ``BusOpenError``. The bus is returned for its ``wait_lost``."""
    outside = await open_bus(settings)
    return Bridge(inside, outside), outside
