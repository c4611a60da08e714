"""Where a body is, in slots: computed from the site file and a ``Progress`` alone.

A slot is what has a token of its own (docs/network.md): a segment of an alley or spur, a lift's platform (index 0 of
the lift's track), and a lift's gate (index 255), which whoever is over the sill holds. The index beyond a linked end is
its mouth, one pitch away: whoever is there is turned, or turning, and is in both slots.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import pairwise
from typing import Any

from onboard.contract.codes import TokenKind
from onboard.contract.messages import DriveOrder, Progress
from onboard.core.site import Segment, Site
from onboard.trace.check.tokens_seen import Token
from onboard.ways.site import TrackKind, WaySite, way_site

PLATFORM_INDEX = 0
GATE_INDEX = 255
#: A body counts as in a slot from here on, mm: sensors are read to the millimetre, and moments before they are told.
TOLERANCE_MM = 20
#: Extents whose slots are kept: stops, and moments in between, of a dozen robots over a day.
_EXTENTS_KEPT = 1 << 14
#: Tokens of slots that are kept: all of a large site.
_TOKENS_KEPT = 1 << 12


@dataclass(slots=True)
class ReportedPosition:
    """A machine as its last ``Progress`` told it: the centre from that of index 1 of ``track``, in mm."""

    node: int
    track: int
    index: int
    position_mm: int
    speed_mm_s: int
    time_us: int

    @property
    def place(self) -> tuple[int, int]:
        """Number of the track, and position on it in mm."""
        return self.track, self.position_mm


#: ``Segment`` from a tuple of both its fields: half the time of calling the class.
_segment_of: Callable[[Any], Segment] = partial(tuple.__new__, Segment)


def body_of(ways: WaySite, progress: Progress, time_us: int) -> ReportedPosition | None:
    """The body that a message tells of; None where the site has no such track."""
    if progress.track not in ways.tracks:
        return None
    track, index = progress.track, progress.index
    position_mm = ways.position_mm(_segment_of((track, index))) + progress.offset_mm
    return ReportedPosition(progress.sender, track, index, position_mm, progress.speed_mm_s, time_us)


def slots_of(site: Site, track: int, low_mm: float, high_mm: float) -> tuple[Segment, ...]:
    """Slots that a robot's body from ``low_mm`` to ``high_mm`` is in, gates of the sills that it is over included.

    They are asked for again and again, of each body by every rule: what was found is kept with the site.
    """
    ways, extent = way_site(site), (track, low_mm, high_mm)
    found = ways.extents.get(extent)
    if found is None:
        if len(ways.extents) >= _EXTENTS_KEPT:
            ways.extents.clear()
        found = ways.extents[extent] = tuple(_slots_of(site, *extent))
    return found


def _slots_of(site: Site, track: int, low_mm: float, high_mm: float) -> list[Segment]:
    ways = way_site(site)
    line = ways.tracks[track]
    lowest = 0 if _goes_on(site, Segment(track, 0)) else 1
    highest = line.length + _goes_on(site, Segment(track, line.length + 1))
    first, last = (_index_at(mm, line.pitch_mm) for mm in (low_mm + TOLERANCE_MM, high_mm - TOLERANCE_MM))
    indices = range(max(lowest, first), min(highest, last) + 1)
    slots: list[Segment] = []
    for index in indices:
        slots += [slot for slot in slots_at(site, Segment(track, index)) if slot not in slots]
    for one, other in pairwise(indices):
        lift = ways.platforms.get(Segment(track, one), ways.platforms.get(Segment(track, other)))
        if lift is not None:
            slots.append(Segment(lift, GATE_INDEX))
    return slots


def _goes_on(site: Site, position: Segment) -> bool:
    ways = way_site(site)
    return position in ways.platforms or position in ways.mouths


def occupied(ways: WaySite, body: ReportedPosition) -> tuple[Segment, ...]:
    """Slots that a robot's body is in."""
    return swept(ways, body, body.position_mm)


def swept(ways: WaySite, body: ReportedPosition, until_mm: float) -> tuple[Segment, ...]:
    """Slots that a robot's body is in and comes through until its centre is at ``until_mm`` on the same track."""
    if ways.tracks[body.track].kind is TrackKind.LIFT:
        return (Segment(body.track, body.index),)
    half_mm = ways.carrier_length_mm / 2
    low_mm, high_mm = min(body.position_mm, until_mm) - half_mm, max(body.position_mm, until_mm) + half_mm
    return ways.extents.get((body.track, low_mm, high_mm)) or slots_of(ways, body.track, low_mm, high_mm)


def body_at(site: Site, body: ReportedPosition, tape_mm: int) -> ReportedPosition:
    """A body where its drive says that it is; where it was told to be, if that is on no track."""
    ways = way_site(site)
    if not ways.is_charted:
        return replace(body, position_mm=tape_mm)
    told = ways.on_tape(tape_mm)
    if told is None:
        return body
    index = _index_at(told.position_mm, ways.tracks[told.track].pitch_mm)
    return replace(body, track=told.track, index=index, position_mm=told.position_mm)


def sent_through(site: Site, body: ReportedPosition, order: DriveOrder) -> Sequence[Segment]:
    """Slots through which an order sends a body: along its track, or to turn where it is."""
    ways, here = way_site(site), Segment(body.track, body.index)
    if not ways.is_charted:
        if order.across is ways.across(body.track):
            return swept(ways, body, order.target_mm)
        # Into the spur of this mouth, or out of this one.
        spurs = [end.track for end in ways.links.get(here, ())] if order.across else [body.track]
        return slots_at(site, Segment(spurs[0], 0)) if spurs else [here]
    aim = ways.on_tape(order.target_mm)
    if aim is None or aim.track == body.track:
        return [] if aim is None else swept(ways, body, aim.position_mm)
    lift = ways.platforms.get(here)
    sills = () if lift is None else ways.tracks[lift].joins
    there = next((ways.beyond(sill) for sill in sills if sill.track == aim.track), None)
    if there is not None:
        # By another door of the platform on which it stands.
        body = replace(body, track=there.track, index=there.index, position_mm=ways.position_mm(there))
        return swept(ways, body, aim.position_mm)
    ends = [here] if here in ways.mouths else [end for end in ways.links.get(here, ()) if end.track == aim.track]
    return slots_at(site, ends[0]) if ends else [here]


def slots_at(site: Site, position: Segment) -> list[Segment]:
    """Slots of a body at a position: beyond a linked end it is turned, or turning, and in the mouth and inside."""
    ways = way_site(site)
    mouth = ways.mouths.get(position)
    if mouth is None:
        return [slot_at(site, position)]
    return [mouth, ways.tracks[position.track].inside(position.index)]


def slot_at(site: Site, position: Segment) -> Segment:
    """The slot of a position on an alley: itself, or the platform that is meant by the index before or behind it."""
    lift = way_site(site).platforms.get(position)
    return position if lift is None else Segment(lift, PLATFORM_INDEX)


def lifts_under(ways: WaySite, body: ReportedPosition) -> set[int]:
    """Lifts, by track, on whose platform a robot's body is, wholly or in part.

    A body is told of when its centre enters a segment, starts or stops: of one that goes away from a platform the last
    word is older than where it is now, so it counts for nothing here.
    """
    track = ways.tracks[body.track]
    if track.kind is TrackKind.LIFT:
        return set()
    low_end = 2 * body.position_mm < (track.length - 1) * track.pitch_mm
    if body.speed_mm_s and (body.speed_mm_s > 0) is low_end:
        return set()
    return {slot.track for slot in occupied(ways, body) if slot.index == PLATFORM_INDEX}


@lru_cache(_TOKENS_KEPT)
def token_of(slot: Segment) -> Token:
    """The token of a slot."""
    return Token(TokenKind.SEGMENT, slot.number)


def floors_of(site: Site, lift: ReportedPosition) -> list[int]:
    """The tracks to which a lift has doors where its platform is, by the nearest mark."""
    ways = way_site(site)
    joins = ways.tracks[lift.track].joins
    here = min(len(joins), max(1, lift.index))
    return [sill.track for sill in ways.doors(lift.track, here)]


def _index_at(position_mm: float, pitch_mm: int) -> int:
    return int((position_mm + pitch_mm / 2) // pitch_mm) + 1
