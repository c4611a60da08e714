"""What a place costs beside the time at which a car stands there, by the site's ``place`` (``PlacePolicy``).

A robot takes the place where finish and this are least together, and bids the finish: a bid is a promise. As the rest
is the same for whoever bids, all robots weigh the places of a call alike, and the call goes to who is soonest.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from zlib import crc32

from onboard.contract.messages import CallForProposals, Message, Reference
from onboard.core.site import Station
from onboard.systems.car_park.fetch_costs import fetch_us, moved_from
from onboard.systems.car_park.site import CarPark, PlacePolicy, class_of_end
from onboard.systems.car_park.stays import Stays

#: A second of the fetch counts as so many of the parking: a customer waits for each of the fetch, and of the parking,
#: for which nobody waits once the bay is empty, only the next one whose robot it keeps (the weights that the joint
#: choice of ``bus-sim compare`` counts a customer and a robot by).
FETCH_WEIGHT = 10
#: One step of a rank counts more than any way, us: places are taken in the order of their ranks.
RANK_US = 3_600_000_000
#: A place is so much worse for each place by which it is too near or too far for a stay, us: some runs of a carrier.
OFF_US = 10_000_000
#: A car is moved only to where its fetch costs so much less, us: half of what a robot needs to take and leave it.
GAIN_US = 10_000_000
_ALL = 1_000


@dataclass
class PlaceCosts:
    """One machine's costs of places. ``stays`` is what it has learned of how long cars stay."""

    park: CarPark
    stays: Stays = field(default_factory=Stays)
    #: By the compartment at which a car came in, ranks of all places by their numbers.
    _orders: dict[int, dict[int, int]] = field(default_factory=dict)

    def hear(self, message: Message, now_us: int) -> None:
        """Learn how long cars stay, where places are chosen by that."""
        if self.park.place is PlacePolicy.STAY:
            self.stays.hear(message, now_us)

    def nearer(self, call: CallForProposals, places: list[Station]) -> list[Station]:
        """Of these those to which a call may bring its car: one that is moved only where its fetch costs much less."""
        source = moved_from(self.park, call)
        if source is None:
            return places
        most_us = fetch_us(self.park, source.segment, call.car.origin) - GAIN_US
        return [place for place in places if fetch_us(self.park, place.segment, call.car.origin) <= most_us]

    def of(self, call: CallForProposals, places: Sequence[Station], now_us: int) -> Mapping[int, int]:
        """Costs in us by the place's number, of ``places`` that are free; who is not named costs nothing."""
        car_class = class_of_end(call.to_station)
        if car_class is None:
            return {}
        is_moved = moved_from(self.park, call) is not None
        return self.by(PlacePolicy.COST if is_moved else self.park.place, call.car, car_class, places, now_us)

    def by(
        self, policy: PlacePolicy, car: Reference, car_class: int, places: Sequence[Station], now_us: int
    ) -> Mapping[int, int]:
        """The same by a given policy, for a car by its name and class."""
        match policy:
            case PlacePolicy.NEAREST:
                return {}
            case PlacePolicy.COST:
                return self._by_cost(car, places)
            case PlacePolicy.STAY:
                return self._by_stay(car, places, now_us)
            case PlacePolicy.BALANCED:
                return self._by_balance(car_class, places)
            case PlacePolicy.RANDOM:
                return self._by_chance(car, places)

    def _by_cost(self, car: Reference, places: Sequence[Station]) -> dict[int, int]:
        return {one.number: FETCH_WEIGHT * fetch_us(self.park, one.segment, car.origin) for one in places}

    def _by_chance(self, car: Reference, places: Sequence[Station]) -> dict[int, int]:
        """Drawn by the car's name, so that whoever bids draws the same."""
        name = car.origin << 16 | car.number
        drawn = sorted((crc32(f"{name} {one.number}".encode()), one.number) for one in places)
        return {number: rank * RANK_US for rank, (_, number) in enumerate(drawn)}

    def _by_balance(self, car_class: int, places: Sequence[Station]) -> dict[int, int]:
        """By how full each alley is, of the places that such a car may have, in thousandths."""
        free = Counter(one.track for one in places)
        all_of = Counter(one.track for one in self.park.places if self.park.takes(one, car_class))
        full = {track: _ALL * (all_of[track] - count) // all_of[track] for track, count in free.items()}
        return {one.number: full[one.track] * RANK_US for one in places}

    def _by_stay(self, car: Reference, places: Sequence[Station], now_us: int) -> dict[int, int]:
        """Of the places that are ever needed the nearest for the shortest stays, the farthest for the longest."""
        stay_us = self.stays.expected_us(now_us)
        share = 0 if stay_us is None else self.stays.shorter_permille(stay_us)
        wanted = self.stays.most * share // _ALL
        order = self._in_order(car.origin)
        return {one.number: abs(order[one.number] - wanted) * OFF_US for one in places}

    def _in_order(self, origin: int) -> Mapping[int, int]:
        """All places in the order of what their fetch costs."""
        order = self._orders.get(origin)
        if order is None:
            found = sorted((fetch_us(self.park, one.segment, origin), one.number) for one in self.park.places)
            order = self._orders[origin] = {number: rank for rank, (_, number) in enumerate(found)}
        return order
