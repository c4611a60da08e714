"""Places at which a car is to be left: each is one robot's, and who has lost its place chooses another (row P42).

A robot that starts says only where it stands, so the place that it has aboard a car for can be promised again; so can
one that two bids have named at the same time. Who has the station's right keeps the place, else whose plan has the
lower stamp; the other leaves its car elsewhere. A place in which a car stands is nobody's.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from onboard.core.authority import station_token
from onboard.core.serial import ranks_before
from onboard.core.site import Segment, Station
from onboard.systems.car_park import custody
from onboard.systems.car_park.generation import CarParkGeneration
from onboard.systems.car_park.handling import ShuttleWork
from onboard.systems.car_park.kept_out import will_work
from onboard.systems.car_park.program import CarHandling, HandlingPhase, StationWork
from onboard.systems.car_park.site import ANY_CLASS, car_park, class_of_end
from onboard.ways.mirror import WayFleet

#: Other places that are tried for a car at one moment: each is a search.
MOST_PLACES = 4


def nearest(places: Iterable[Station], here: Segment) -> list[Station]:
    """The few that are tried, the nearest to ``here`` first: on the same track, then by segments."""
    return sorted(places, key=lambda one: (one.track != here.track, abs(one.index - here.index)))[:MOST_PLACES]


@dataclass
class PlaceChoice:
    """Which places are one robot's to put a car into, and what it does when another has promised the same."""

    fleet: WayFleet
    generation: CarParkGeneration
    shuttle: ShuttleWork

    def lost(self) -> list[StationWork]:
        """Cars in hand that cannot be left where it was planned, though there is a choice."""
        return [
            work
            for work in self.generation.program.works()
            if work.handling is CarHandling.LEAVE
            and class_of_end(work.call.to_station) is not None
            and not self._is_begun(work)
            and (custody.others_in(self.fleet.mirror, work.station, work.car) or self._is_anothers(work.station))
        ]

    def moved(self) -> list[StationWork]:
        """Cars to be taken that stand at another place by now, which nobody knew when they were called for.

        Only where cars are moved while nobody waits: elsewhere a call names the place that it means.
        """
        if not car_park(self.fleet.site).quiet_moves:
            return []
        takes = [one for one in self.generation.program.works() if one.handling is CarHandling.TAKE]
        stands = ((one, custody.place_of(self.fleet, one.car)) for one in takes if not self._is_begun(one))
        return [one._replace(station=place) for one, place in stands if place is not None and place != one.station]

    def instead(self, work: StationWork, now_us: int) -> list[Station]:
        """Free places that nobody has promised, the nearest to where the car was to be left first."""
        free = self.generation.free.of(now_us, class_of_end(work.call.to_station) or ANY_CLASS)
        return nearest([place for place in free if not self._is_anothers(place)], work.station.segment)

    def _is_begun(self, work: StationWork) -> bool:
        return self.shuttle.work == work and self.shuttle.phase not in (HandlingPhase.ACQUIRE, HandlingPhase.DONE)

    def _is_anothers(self, station: Station) -> bool:
        """Whether another that is to work there has its right, or planned so before me."""
        me, mirror = self.fleet.node_id, self.fleet.mirror
        mine = mirror.itineraries.get(me)
        holder = self.fleet.tokens.holder_of(station_token(station))
        if holder == me or mine is None:
            return False
        rivals = [one for one in mirror.itineraries.values() if one.sender != me and will_work(mirror, one, station)]
        return any(one.sender == holder or ranks_before(one.stamp, mine.stamp) for one in rivals)
