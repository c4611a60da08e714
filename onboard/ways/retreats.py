"""The way back: what of a plan is left when its work is done, and yields to whoever carries or fetches.

Such a move is voluntary: who does not begin it stands where its work has ended, and can go later. It yields only to a
stamp that is not much younger than its own, so that nobody waits for ever, and not where it clears the way for somebody
else's work. All times are bus time in us.
"""

from dataclasses import replace
from typing import NamedTuple

from onboard.contract.codes import LegAction
from onboard.contract.messages import Itinerary, Leg, Stamp
from onboard.core.serial import ms_after
from onboard.core.site import Segment
from onboard.ways.lifts import lift_at
from onboard.ways.occupancy import final_position, leg_begins_us
from onboard.ways.passing import BegunItinerary
from onboard.ways.site import WaySite

#: A way back yields to no stamp that is younger than its own by more than this, ms: longer than a task of the shipped
#: sites takes from award to refuge, and half of what a machine that waits may stand before it counts as an obstacle.
AGES_AFTER_MS = 300_000


class HeldBack(NamedTuple):
    """A plan without what of its way back is not begun: its machine stands at ``place`` from ``since_us`` on."""

    plan: BegunItinerary
    place: Segment
    since_us: int


def moves(leg: Leg) -> bool:
    """Whether a leg is more than standing: waits come and go as a plan is delayed."""
    return leg.action is not LegAction.STAND


def retreat_moves(itinerary: Itinerary) -> int:
    """How many moving legs a plan has behind its last work; all, where it has none."""
    return sum(moves(leg) for leg in itinerary.legs[_worked(itinerary) :])


def has_work(itinerary: Itinerary) -> bool:
    """Whether a plan still carries or fetches."""
    return _worked(itinerary) > 0


def is_aged(stamp: Stamp, other: Stamp) -> bool:
    """Whether a way back under ``stamp`` has waited for too long to yield to a plan under the ``other``."""
    return ms_after(other.award_ms, stamp.award_ms) > AGES_AFTER_MS


def held_back(site: WaySite, plan: BegunItinerary, leg_in_hand: int, from_us: int, now_us: int) -> HeldBack | None:
    """What stays of a plan whose way back yields, but for legs that begin before ``from_us``; None where all stays.

    Nobody stays aboard a lift.
    """
    legs = plan.itinerary.legs
    if any(leg.track not in site.tracks for leg in legs):
        return None
    begins_us = leg_begins_us(plan.itinerary, now_us, plan.first_begin_us)
    ends_us = [*begins_us[1:], from_us]
    kept = _worked(plan.itinerary)
    while kept < len(legs) and (kept <= leg_in_hand or begins_us[kept] < from_us or _is_aboard(site, legs[:kept])):
        kept += 1
    stays = replace(plan.itinerary, legs=legs[:kept])
    place = final_position(site, stays)
    if place is None or not any(moves(leg) for leg in legs[kept:]):
        return None
    return HeldBack(plan._replace(itinerary=stays), place, ends_us[kept - 1])


def _worked(itinerary: Itinerary) -> int:
    """How many legs there are up to the last work."""
    return max((number for number, leg in enumerate(itinerary.legs, 1) if leg.action is LegAction.WORK), default=0)


def _is_aboard(site: WaySite, legs: tuple[Leg, ...]) -> bool:
    if not legs:
        return True
    return legs[-1].action is LegAction.RIDE or lift_at(site, Segment(legs[-1].track, legs[-1].to_index)) is not None
