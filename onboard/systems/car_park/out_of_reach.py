"""Cars that nobody bids for: all robots rest where no itinerary tells the way to the car, to the bay, and to a refuge.

An itinerary has ``MAX_STEPS`` legs; where lines of alleys are joined by links and by lifts that one drives through, the
way from the far end of a site to its other end and back has more. Whoever rests nearest to such a car goes to a refuge
from which it can tell the rest, and bids when the car is called for again.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TypeVar

from onboard.contract.codes import CallResult, Operation, Reason
from onboard.contract.messages import Award, CallForProposals, CarAt, Message, Reference
from onboard.core.site import Segment, Station
from onboard.systems.car_park.fetching import can_fetch
from onboard.systems.car_park.site import CarPark
from onboard.ways.roads import roads_of

#: So many calls are remembered, and so many refuges are looked at, the nearest to the car first.
MOST_CALLS, MOST_REFUGES = 16, 8

Key = TypeVar("Key")


@dataclass
class OutOfReach:
    """What one robot has heard of such calls."""

    park: CarPark
    #: Open calls by sender and number, and by task those that ended without any bid, the oldest first.
    _open: dict[tuple[int, int], CallForProposals] = field(default_factory=dict)
    refused: dict[Reference, CallForProposals] = field(default_factory=dict)

    def hear(self, message: Message) -> bool:
        """Whether a call to fetch a car has just ended for good with no bid."""
        if isinstance(message, CallForProposals) and message.operation is Operation.RETRIEVE and not message.depth:
            _keep(self._open, (message.sender, message.call), message)
        elif isinstance(message, CarAt):
            for task, call in [*self.refused.items()]:
                if call.car == message.car and call.from_station != message.station:
                    del self.refused[task]
        elif isinstance(message, Award):
            ended = self._open.pop((message.sender, message.call), None)
            if ended is None:
                return False
            if message.result is CallResult.AWARDED:
                self.refused.pop(ended.task, None)
            elif message.result is CallResult.REFUSED and message.reason is Reason.NO_BID:
                _keep(self.refused, ended.task, ended)
                return True
        return False

    def refuge(self, here: Segment, others: Iterable[Segment], places: Iterable[Segment]) -> Segment | None:
        """Of ``places`` the one to go to for who rests ``here``, nearer to such a car than ``others``; else None."""
        roads, others = roads_of(self.park), list(others)
        for call in self.refused.values():
            car, bay = (Station.from_number(number).segment for number in (call.from_station, call.to_station))
            if not (roads.knows(car) and roads.knows(bay)):
                continue
            mine_us = roads.shortest_us(here, car)
            if any(roads.shortest_us(other, car) <= mine_us for other in others) or can_fetch(
                self.park, here, car, bay
            ):
                continue
            nearest = sorted(places, key=lambda place: (roads.shortest_us(place, car), place))[:MOST_REFUGES]
            found = next((place for place in nearest if can_fetch(self.park, place, car, bay)), None)
            if found is not None and found != here:
                return found
        return None


def _keep(kept: dict[Key, CallForProposals], key: Key, what: CallForProposals) -> None:
    kept.pop(key, None)
    kept[key] = what
    if len(kept) > MOST_CALLS:
        del kept[next(iter(kept))]
