"""Plans with what the wire does not repeat: when the leg in hand began. All times are bus time in us."""

from typing import NamedTuple

from onboard.contract.messages import Itinerary, Leg
from onboard.core.serial import BUS_MS_MODULUS, away, from_bus_ms
from onboard.ways.occupancy import leg_begins_us

#: Windows told in whole milliseconds may overlap by their rounding; so much is no conflict, us.
TOLERANCE_US = 10_000


class BegunItinerary(NamedTuple):
    """A firm itinerary and when its first leg began (bus us)."""

    itinerary: Itinerary
    first_begin_us: int


def next_plan(known: BegunItinerary | None, in_hand: int, itinerary: Itinerary, now_us: int) -> BegunItinerary:
    """The plan that ``itinerary`` tells after ``known``: a first leg that was planned before keeps its begin.

    An itinerary names the ends of its legs and its award; a leg under way began long after that. Legs of ``known``
    before number ``in_hand`` are over: a first leg like one of these is of the next trip by the same way.
    """
    award_us = from_bus_ms(itinerary.stamp.award_ms, now_us)
    if known is None or not itinerary.legs:
        return BegunItinerary(itinerary, award_us)
    begins_us = leg_begins_us(known.itinerary, now_us, known.first_begin_us)
    for leg, begin_us in [*zip(known.itinerary.legs, begins_us, strict=True)][in_hand:]:
        if _way(leg) == _way(itinerary.legs[0]):
            return BegunItinerary(itinerary, min(begin_us, from_bus_ms(itinerary.legs[0].end_ms, now_us)))
    return BegunItinerary(itinerary, award_us)


def reread_us(time_us: int, near_us: int) -> int:
    """The time nearest to ``near_us`` that is told on the wire as ``time_us`` is: what was read while a clock lied."""
    return near_us + away(time_us, near_us, BUS_MS_MODULUS * 1000)


def _way(leg: Leg) -> tuple[int, ...]:
    return leg.action, leg.track, leg.from_index, leg.to_index, leg.side
