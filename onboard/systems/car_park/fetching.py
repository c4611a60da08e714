"""From which places a car can be fetched again: an itinerary tells ``MAX_STEPS`` legs, and no plan that is longer.

Where carriers go round one way only, the way to a car, on to the exit and back to a refuge may lead round every floor
twice, with two legs at each corner; a car that was left there would stay for ever. On other sites a way is so long only
for who rests far away (``out_of_reach``); docs/reliability.md has the legs of the shipped ones.
"""

from collections.abc import Iterable

from onboard.core.site import Segment, Station
from onboard.systems.car_park.clearance import MAX_EXPANSIONS
from onboard.systems.car_park.program import MAX_STEPS
from onboard.systems.car_park.site import CarPark
from onboard.ways.effort import Search
from onboard.ways.kept import Kept
from onboard.ways.refuges import open_refuges, refuges
from onboard.ways.reservations import Reservations
from onboard.ways.room import resting_room
from onboard.ways.sipp import NoRoute, Route, Visit, planning
from onboard.ways.site import BayUse

#: Legs that a plan may need besides: a wait for somebody, and the run that is under way when it is made.
SPARE_STEPS = 2


def to_fetch_from(site: CarPark, places: Iterable[Station]) -> list[Station]:
    """Those of ``places`` that a robot in some refuge can fetch a car from, to every exit, by one itinerary."""
    if not any(track.one_way for track in site.tracks.values()):
        return list(places)
    told = _told.of(site)
    return [place for place in places if place.segment in told]


def can_fetch(site: CarPark, start: Segment, place: Segment, out: Segment) -> bool:
    """Whether a robot that rests at ``start`` can fetch a car from ``place`` to ``out`` by one itinerary."""
    return _legs(site, start, place, out) + SPARE_STEPS < MAX_STEPS


def _find_told(site: CarPark) -> frozenset[Segment]:
    return frozenset(one for one in {place.segment for place in site.places} if _is_told(site, one))


def _is_told(site: CarPark, place: Segment) -> bool:
    exits = site.fronts(BayUse.EXIT, BayUse.BOTH)
    return all(any(can_fetch(site, start, place, out) for start in _starts(site)) for out in exits)


def _starts(site: CarPark) -> list[Segment]:
    """A slot of each stretch where a robot may rest; of a lone one any refuge."""
    if len(site.robots) <= 1:
        return [min(refuges(site))]
    return [min(slots) for slots in resting_room(site).stretches.values()]


def _legs(site: CarPark, start: Segment, place: Segment, out: Segment) -> int:
    """How many legs the soonest way takes where all others rest; more than can be told where there is none."""
    others = [one for one in _starts(site) if one != start][: len(site.robots) - 1]
    visits, ends = (Visit(place, 1), Visit(out, 1)), open_refuges(site, others)
    search = planning(site, Reservations(), 0, start, 0, visits, ends, MAX_EXPANSIONS, dict.fromkeys(site.lifts, 0))
    route = _whole(search)
    return MAX_STEPS if isinstance(route, NoRoute) else len(route.legs)


def _whole(search: Search[Route | NoRoute]) -> Route | NoRoute:
    while True:
        try:
            next(search)
        except StopIteration as found:
            route: Route | NoRoute = found.value
            return route


_told: Kept[CarPark, frozenset[Segment]] = Kept(_find_told)
