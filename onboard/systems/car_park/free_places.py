"""Places that a robot may choose for a car: free by all words, promised to nobody, and such that it gets out again."""

from collections.abc import Mapping
from dataclasses import dataclass

from onboard.contract.codes import LegAction
from onboard.core.negotiation import CallKey
from onboard.core.serial import from_bus_ms
from onboard.core.site import Station
from onboard.systems.car_park.alternatives import Solution
from onboard.systems.car_park.fetching import to_fetch_from
from onboard.systems.car_park.program import Program
from onboard.systems.car_park.site import CarPark
from onboard.ways.mirror import WayMirror

#: How long past its planned end another robot's work still keeps its place promised: it may be late.
PROMISE_GRACE_US = 60_000_000


@dataclass
class FreePlaces:
    """As one robot sees them; ``tentative`` are its own bids that stand best."""

    site: CarPark
    node_id: int
    mirror: WayMirror
    program: Program
    tentative: Mapping[CallKey, Solution]

    def of(self, now_us: int, car_class: int, bid: CallKey | None = None) -> list[Station]:
        """Places for a class of car at which none stands and that nobody has promised, in the site's order."""
        promised = self._promised(now_us, bid)
        free = [place for place in self.mirror.free_places() if place.number not in promised]
        return self.site.best_for(car_class, to_fetch_from(self.site, free))

    def _promised(self, now_us: int, bid: CallKey | None) -> set[int]:
        """Places at which somebody's plan, or mine, will work: two parkings never aim at one place (row P42)."""
        promised = {
            Station(leg.track, leg.to_index, leg.side).number
            for node, itinerary in self.mirror.itineraries.items()
            if node != self.node_id
            for leg in itinerary.legs
            if leg.action is LegAction.WORK and from_bus_ms(leg.end_ms, now_us) > now_us - PROMISE_GRACE_US
        }
        promised |= {work.station.number for work in self.program.works()}
        promised |= {solution.place.number for key, solution in self.tentative.items() if key != bid}
        return promised
