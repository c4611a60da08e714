"""The way back: what of a plan is left when its work is done, and yields to whoever carries or fetches.

Such a move is voluntary: who does not begin it stands where its work has ended, and can go later. It yields only to a
stamp that is not much younger than its own, so that nobody waits for ever, and not where it clears the way for somebody
else's work. All times are bus time in us.
"""

from dataclasses import replace
from typing import NamedTuple

from onboard.contract.codes import LegAction
from onboard.contract.messages import Itinerary, Leg, Stamp
from onboard.core.serial import from_bus_ms, ms_after, to_bus_ms
from onboard.core.site import Segment
from onboard.ways.kinematics import run_duration_us
from onboard.ways.lifts import lift_at
from onboard.ways.occupancy import final_position, hop_origins, is_hop, leg_begins_us, turn_in_us, turned_in
from onboard.ways.site import WaySite
from onboard.ways.told_way import BegunItinerary, moves, worked

#: A way back yields to no stamp that is younger than its own by more than this, ms: longer than a task of the shipped
#: sites takes from award to refuge, and half of what a machine that waits may stand before it counts as an obstacle.
AGES_AFTER_MS = 300_000


class HeldBack(NamedTuple):
    """A plan without what of its way back is not begun: its machine stands at ``place`` from ``since_us`` on."""

    plan: BegunItinerary
    place: Segment
    since_us: int


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
    kept = worked(plan.itinerary)
    while kept < len(legs) and (kept <= leg_in_hand or begins_us[kept] < from_us or _is_aboard(site, legs[:kept])):
        kept += 1
    stays = replace(plan.itinerary, legs=legs[:kept])
    place = final_position(site, stays)
    if place is None or not any(moves(leg) for leg in legs[kept:]):
        return None
    return HeldBack(plan._replace(itinerary=stays), place, ends_us[kept - 1])


def put_off(site: WaySite, plan: BegunItinerary, leg_in_hand: int, place: Segment, until_us: int) -> Itinerary | None:
    """What is left of a plan whose machine stands at ``place`` until ``until_us``, and then does the rest as planned.

    None amid a ride or a hop, or where the plan leads through no such place.
    """
    legs, number = plan.itinerary.legs, leg_in_hand
    if any(leg.track not in site.tracks for leg in legs):
        return None
    while number < len(legs) and not moves(legs[number]) and not _is_through(legs[number], place):
        # A wait that was told with the run behind it, so that all know when that began.
        number += 1
    hops = number < len(legs) and _hops_from(site, legs[number], place)
    if number >= len(legs) or not (hops or _is_through(legs[number], place)):
        return None
    begins_us = leg_begins_us(plan.itinerary, until_us, plan.first_begin_us)
    ends_us = [*begins_us[1:], max(begins_us[-1], from_bus_ms(legs[-1].end_ms, until_us))]
    run = legs[number]
    told = [Leg(LegAction.STAND, place.track, place.index, place.index, run.side, to_bus_ms(until_us))]
    if hops:
        until_us += turn_in_us(site, place.track if site.tracks[place.track].ends else run.track)
        told.append(run._replace(end_ms=to_bus_ms(until_us)))
    elif run.action is LegAction.TRAVEL and place.index != run.to_index:
        until_us += run_duration_us(abs(run.to_index - place.index) * site.tracks[run.track].pitch_mm, site.carrier)
        told.append(run._replace(from_index=place.index, end_ms=to_bus_ms(until_us)))
    for leg, begin_us, end_us in zip(legs[number + 1 :], begins_us[number + 1 :], ends_us[number + 1 :], strict=True):
        until_us += end_us - begin_us
        told.append(leg._replace(end_ms=to_bus_ms(until_us)))
    return replace(plan.itinerary, legs=tuple(told))


def _is_through(leg: Leg, place: Segment) -> bool:
    """Whether a run, or standing or work, is or comes by at a place; a hop and a ride are not told by their indices."""
    if leg.track != place.track or leg.action is LegAction.RIDE or is_hop(leg):
        return False
    return min(leg.from_index, leg.to_index) <= place.index <= max(leg.from_index, leg.to_index)


def _hops_from(site: WaySite, leg: Leg, place: Segment) -> bool:
    """Whether a leg is a hop through a mouth that begins at a place, turned there already or not."""
    if not is_hop(leg):
        return False
    return bool({place, turned_in(site, place)} & {*hop_origins(site, Segment(leg.track, leg.from_index))})


def _is_aboard(site: WaySite, legs: tuple[Leg, ...]) -> bool:
    if not legs:
        return True
    return legs[-1].action is LegAction.RIDE or lift_at(site, Segment(legs[-1].track, legs[-1].to_index)) is not None
