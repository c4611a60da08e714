"""Where a programme's next legs lead: the slots up to the next refuge, for a way without an agreed order."""

from collections.abc import Callable, Iterable, Sequence

from onboard.contract.codes import LegAction
from onboard.core.site import Segment
from onboard.systems.car_park.program import CarStep
from onboard.ways.lifts import lift_at, platform
from onboard.ways.refuges import refuges
from onboard.ways.site import WaySite


def way_to_refuge(site: WaySite, steps: Iterable[CarStep]) -> list[Segment]:
    """Slots of ``steps`` in their order up to the first refuge, that included.

    A ride is the platform, then the sill beyond and the way onward: whoever boards can leave the platform again.
    """
    places = refuges(site)
    way: list[Segment] = []
    for step in steps:
        for slot in _slots(site, step):
            if slot not in way[-1:]:
                way.append(slot)
            if slot in places:
                return way
    return way


def line_to_refuge(
    site: WaySite, line: Sequence[Segment], beyond: Callable[[], Sequence[Segment]]
) -> tuple[Segment, ...]:
    """Slots of a ``line`` from where a body is up to the next refuge, that included; without, all ``beyond`` too."""
    places = refuges(site)
    for number, slot in enumerate(line[1:], start=1):
        if slot in places:
            return tuple(line[: number + 1])
    return (*line, *beyond())


def _slots(site: WaySite, step: CarStep) -> list[Segment]:
    if step.action is LegAction.RIDE:
        return [platform(step.track)]
    along = 1 if step.to_index >= step.from_index else -1
    line = [Segment(step.track, index) for index in range(step.from_index, step.to_index + along, along)]
    lifts = [lift_at(site, position) for position in line]
    return [position if lift is None else platform(lift) for position, lift in zip(line, lifts, strict=True)]
