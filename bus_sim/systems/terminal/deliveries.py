"""Which box served which mission: what a terminal's indicators and its end are counted by."""

from collections.abc import Collection
from dataclasses import dataclass

from bus_sim.systems.terminal.world import BoxHandling
from onboard.systems.terminal.site import Mission, Terminal


@dataclass(frozen=True)
class BoxDelivery:
    """One box of a mission: times in us since it was ordered."""

    mission: int
    box: int
    waited_us: int
    finished_us: int
    late_us: int


def ordered(site: Terminal, refused: Collection[int] = ()) -> int:
    """How many boxes all missions ask for but those of these numbers."""
    wanted = [one for number, one in enumerate(site.missions, 1) if number not in refused]
    return sum(max(mission.count, len(mission.boxes)) for mission in wanted)


def deliveries(site: Terminal, handled: list[BoxHandling]) -> list[BoxDelivery]:
    """Which mission each putting down served: the first that names this box, else the first that wants its type."""
    # Named ones come first: a box that one mission names must not be counted for another that takes any of its type.
    missions = sorted(enumerate(site.missions, 1), key=lambda one: not one[1].boxes)
    lacking = {number: max(mission.count, len(mission.boxes)) for number, mission in missions}
    up: dict[int, int] = {}
    found = []
    for one in handled:
        if one.is_up:
            up[one.box] = one.time_us
            continue
        for number, mission in missions:
            if lacking[number] and mission.target == one.station and _wants(site, mission, one.box):
                lacking[number] -= 1
                late_us = max(0, one.time_us - mission.before_us) if mission.before_us else 0
                waited_us = up[one.box] - mission.at_us
                found.append(BoxDelivery(number, one.box, waited_us, one.time_us - mission.at_us, late_us))
                break
    return found


def _wants(site: Terminal, mission: Mission, box: int) -> bool:
    return box in mission.boxes or (not mission.boxes and site.boxes[box - 1].type == mission.type)
