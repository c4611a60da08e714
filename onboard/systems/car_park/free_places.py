"""Places that a robot may choose for a car: free by all words, promised to nobody, and such that it gets out again."""

from collections.abc import Mapping
from dataclasses import dataclass

from onboard.contract.codes import LegAction
from onboard.contract.messages import Itinerary
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


def promises(itinerary: Itinerary, station: Station, now_us: int) -> bool:
    """Whether a plan will work at a station, or should have done so a moment ago; ``now_us`` is bus time in us."""
    return station.number in _worked_at(itinerary, now_us)


def _worked_at(itinerary: Itinerary, now_us: int) -> set[int]:
    """Stations at which a plan still has work, by number."""
    return {
        Station(leg.track, leg.to_index, leg.side).number
        for leg in itinerary.legs
        if leg.action is LegAction.WORK and from_bus_ms(leg.end_ms, now_us) > now_us - PROMISE_GRACE_US
    }


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
        others = [one for node, one in self.mirror.itineraries.items() if node != self.node_id]
        promised = {number for one in others for number in _worked_at(one, now_us)}
        promised |= {work.station.number for work in self.program.works()}
        promised |= {solution.place.number for key, solution in self.tentative.items() if key != bid}
        return promised
