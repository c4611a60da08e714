"""What it costs to fetch a car from a place: by the site file alone, so that all machines come to the same.

A fetch is the way of a robot to the car and the way of the car to the compartment. Where robots will be by then nobody
knows. A robot rests in the refuge that is nearest to its last work, and a fetch ends at a compartment: so they count as
resting in the refuges nearest to where cars go out, one in each alley or spur, and each as busy every second time, as
for who waits for calls (``resting.py``).
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from onboard.contract.codes import Operation
from onboard.contract.messages import CallForProposals
from onboard.core.site import Segment, Station
from onboard.systems.car_park.site import CarPark, DeskPolicy, class_of_end
from onboard.ways.kept import Kept
from onboard.ways.refuges import open_refuges
from onboard.ways.reservations import FOREVER
from onboard.ways.roads import roads_of
from onboard.ways.site import BayUse


class FetchWays(NamedTuple):
    """Of one slot, us: until a robot is there, and from there to each compartment that gives cars out, by its node."""

    reach_us: int
    carry_us: Mapping[int, int]


def met_us(times_us: Iterable[int]) -> int:
    """How long a call waits for its robot on average, each of which is busy every second time."""
    return sum(time_us >> place for place, time_us in enumerate(sorted(times_us), start=1))


def fetch_us(park: CarPark, slot: Segment, origin: int) -> int:
    """What it costs to fetch a car from a slot, us; ``origin`` is the compartment at which it came in.

    To that one where the site's cars come out at their own, to the nearest where they come to what suits them; else to
    the mean of all, as its driver may go to any desk. FOREVER where no way leads out.
    """
    ways = _ways.of(park)[slot]
    own = ways.carry_us.get(origin)
    if park.desk is DeskPolicy.OWN and own is not None:
        return min(FOREVER, ways.reach_us + own)
    carries = [one for one in ways.carry_us.values() if one < FOREVER]
    if not carries:
        return FOREVER
    carry_us = sum(carries) // len(carries) if park.desk is DeskPolicy.ANY else min(carries)
    return min(FOREVER, ways.reach_us + carry_us)


def moved_from(park: CarPark, call: CallForProposals) -> Station | None:
    """The place from which a call wants a car moved to another that is nearer to where it is fetched; else None."""
    if call.operation is not Operation.PARK or class_of_end(call.to_station) is None:
        return None
    if class_of_end(call.from_station) is not None:
        return None
    source = Station.from_number(call.from_station)
    return None if source in park.compartments.values() else source


def _find_ways(park: CarPark) -> dict[Segment, FetchWays]:
    roads, uses = roads_of(park), park.bay_uses
    exits = {node: bay for node, bay in sorted(park.compartments.items()) if uses.get(node) is not BayUse.ENTRY}
    starts, found = _rests(park, [bay.segment for bay in exits.values()]), {}
    for slot in sorted({place.segment for place in park.places}):
        reach_us = met_us(roads.shortest_us(start, slot) for start in starts)
        found[slot] = FetchWays(reach_us, {node: roads.shortest_us(slot, bay.segment) for node, bay in exits.items()})
    return found


def _rests(park: CarPark, fronts: Sequence[Segment]) -> list[Segment]:
    """Where as many robots as there are rest behind a fetch: of each track the refuge nearest to the exits."""
    roads, nearest = roads_of(park), dict[int, tuple[int, Segment]]()
    for slot in sorted(open_refuges(park, ())):
        away_us = min((roads.shortest_us(front, slot) for front in fronts), default=FOREVER)
        nearest[slot.track] = min((away_us, slot), nearest.get(slot.track, (FOREVER, slot)))
    return [slot for _, slot in sorted(nearest.values())[: len(park.robots)]]


_ways: Kept[CarPark, dict[Segment, FetchWays]] = Kept(_find_ways)
