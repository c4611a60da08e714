"""Which segments a body occupies when, from itinerary and site alone: every machine computes the same windows.

Segment i of a track spans its centre +- half a pitch. A body reaches half the carrier's length and the clearance to
either side of its own centre; it enters a segment when its front crosses the near border and leaves it when its rear
crosses the far one. Half millimetres and fractions of a microsecond are rounded so that windows are never too short.

A lift's platform is the position before index 1 or behind the last of an alley, and one resource on all floors. Only
whoever boards, rides, stands on it or leaves it occupies it: clearance does not reach through a shaft's door.
"""

from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

from onboard.contract.codes import LegAction
from onboard.contract.messages import Itinerary, Leg
from onboard.core.serial import from_bus_ms
from onboard.core.site import Segment
from onboard.ways.kinematics import RestToRest, ceil_ms, cleared_at_us, run_duration_us, time_at_us
from onboard.ways.lifts import PLATFORM_INDEX, lift_at, lift_index_of, platform, platform_on
from onboard.ways.reservations import FOREVER, SlotWindow, Use
from onboard.ways.site import Axis, TrackKind, WaySite


class Sweep(NamedTuple):
    """The body is in the segment ``offset`` steps from the start during ``[enter_us, leave_us)`` of a run."""

    offset: int
    enter_us: int
    leave_us: int


def body_mm(site: WaySite) -> int:
    """Length of the body: the carrier with its clearance in front and behind."""
    return site.carrier_length_mm + 2 * site.carrier_clearance_mm


def reach_segments(site: WaySite, track: int) -> int:
    """How many segments beyond its own the body touches on either side while it stands."""
    return _reach(site.tracks[track].pitch_mm, body_mm(site))


def _reach(pitch_mm: int, length_mm: int) -> int:
    return max(0, -(-(length_mm - pitch_mm) // (2 * pitch_mm)))


@lru_cache(maxsize=4096)
def run_sweeps(segments: int, pitch_mm: int, length_mm: int, axis: Axis) -> tuple[Sweep, ...]:
    """Sweeps of a run over ``segments`` >= 1 steps, for a body of ``length_mm`` (clearance included).

    Ordered by offset, which goes from ``-reach`` to ``segments + reach``; sweeps at the start begin with the run and
    those at the destination end with it.
    """
    run = RestToRest(segments * pitch_mm, axis)
    reach = _reach(pitch_mm, length_mm)
    sweeps = []
    for offset in range(-reach, segments + reach + 1):
        near_mm = (2 * offset * pitch_mm - pitch_mm - length_mm) // 2
        far_mm = -(-(2 * offset * pitch_mm + pitch_mm + length_mm) // 2)
        sweeps.append(Sweep(offset, time_at_us(run, near_mm), cleared_at_us(run, far_mm)))
    return tuple(sweeps)


def leg_sweeps(site: WaySite, track: int, segments: int) -> tuple[Sweep, ...]:
    """Sweeps of the carrier of ``site`` for a run over ``segments`` steps of a track."""
    return run_sweeps(segments, site.tracks[track].pitch_mm, body_mm(site), site.carrier)


def alley_segments(site: WaySite, segment: Segment) -> list[Segment]:
    """Segments of its track that a carrier standing at ``segment`` occupies, clearance included, in order of index."""
    reach = reach_segments(site, segment.track)
    last = site.tracks[segment.track].length
    low, high = max(1, segment.index - reach), min(last, segment.index + reach)
    return [Segment(segment.track, index) for index in range(low, high + 1)]


def standing_segments(site: WaySite, segment: Segment) -> list[Segment]:
    """Segments that a carrier standing at ``segment`` occupies, a platform first, then those of its track.

    Beyond a linked end is its mouth: whoever turns there is in both.
    """
    mouth = turned_in(site, segment)
    if mouth is not None:
        return junction_segments(site, mouth, site.tracks[segment.track].inside(segment.index))
    on_track = alley_segments(site, segment)
    aboard = _platform_at(site, segment)
    return on_track if aboard is None else [aboard, *on_track]


def _platform_at(site: WaySite, position: Segment) -> Segment | None:
    """The platform that a position beyond an alley's ends means, or None for any other position."""
    if 1 <= position.index <= site.tracks[position.track].length:
        return None
    lift_track = lift_at(site, position)
    return None if lift_track is None else platform(lift_track)


def turn_in_us(site: WaySite, track: int) -> int:
    """From standing in the mouth of a track to standing in it, or back: the turn, then a run over one segment."""
    return ceil_ms(site.carrier_turn_us) + run_duration_us(site.tracks[track].pitch_mm, site.carrier)


def turned_in(site: WaySite, position: Segment) -> Segment | None:
    """The mouth in which a machine at ``position`` is turned, beyond a linked end; None for all others."""
    return site.mouths.get(position)


def hop_origins(site: WaySite, there: Segment) -> list[Segment]:
    """Where a hop through a mouth can begin that ends at a segment: the mouths of its track, and who comes out here."""
    track = site.tracks[there.track]
    into = [mouth for index, mouth in track.ends if track.inside(index) == there]
    return into + [site.tracks[end.track].inside(end.index) for end in site.links.get(there, ())]


def is_hop(leg: Leg) -> bool:
    """Whether a leg leads through a mouth from one track to another."""
    return leg.action is LegAction.TRAVEL and leg.from_index == leg.to_index


def hop_origin(site: WaySite, leg: Leg) -> Segment | None:
    """Where a hop through a mouth begins; None for every other leg, and where a leg before it has to say so."""
    if not is_hop(leg):
        return None
    origins = hop_origins(site, Segment(leg.track, leg.from_index))
    return origins[0] if len(origins) == 1 else None


def junction_segments(site: WaySite, origin: Segment, inside: Segment) -> list[Segment]:
    """Segments occupied for the whole of a hop through a mouth from one track to another."""
    return standing_segments(site, origin) + standing_segments(site, inside)


def travel_windows(site: WaySite, origin: Segment, to_index: int, begin_us: int, end_us: int) -> list[SlotWindow]:
    """Windows of one run from standing at ``origin``; either end may be a platform.

    Where ``[begin, end)`` is not exactly the run's duration (a delay, a leg under way), a segment counts as occupied
    from the earliest entering to the latest leaving that fit.
    """
    track = site.tracks[origin.track]
    step = 1 if to_index > origin.index else -1
    segments = abs(to_index - origin.index)
    slack_us = end_us - begin_us - run_duration_us(segments * track.pitch_mm, site.carrier)
    early_us, late_us = min(begin_us, begin_us + slack_us), max(begin_us, begin_us + slack_us)
    windows = []
    for sweep in leg_sweeps(site, origin.track, segments):
        segment: Segment | None = Segment(origin.track, origin.index + step * sweep.offset)
        if segment is not None and not 1 <= segment.index <= track.length:
            segment = _platform_at(site, segment) if sweep.offset in (0, segments) else None
        if segment is not None:
            windows.append(SlotWindow(segment, early_us + sweep.enter_us, late_us + sweep.leave_us))
    return windows


class _Part(NamedTuple):
    """One leg with its times and the position before it; the last one, without a leg, is the standing at the end."""

    leg: Leg | None
    here: Segment | None
    begin_us: int
    end_us: int


#: What each leg holds, that of the standing behind the last one at the end.
LegWindows = list[tuple[SlotWindow, ...]]


def itinerary_windows(
    site: WaySite, itinerary: Itinerary, now_us: int, first_begin_us: int | None = None
) -> list[SlotWindow]:
    """All windows of an itinerary; after the last leg the machine stands where it ends, without end.

    The first leg begins at ``first_begin_us``, by default when the task was awarded. Legs on tracks that the site does
    not have, and the times that they would take, are passed over: an itinerary from the wire never raises.
    """
    parts = _parts(site, itinerary, now_us, first_begin_us)
    return [window for part in parts for window in _part_windows(site, part)]


def leg_windows(site: WaySite, itinerary: Itinerary, now_us: int, first_begin_us: int | None = None) -> LegWindows:
    """The same windows leg by leg, those of the standing behind the last leg at the end."""
    return [tuple(_part_windows(site, part)) for part in _parts(site, itinerary, now_us, first_begin_us)]


def leg_begins_us(itinerary: Itinerary, now_us: int, first_begin_us: int | None = None) -> list[int]:
    """When each leg begins, bus time in us: the first at ``first_begin_us``, each other when the one before ends."""
    begins_us = []
    begin_us = _award_us(itinerary, now_us) if first_begin_us is None else first_begin_us
    for leg in itinerary.legs:
        begins_us.append(begin_us)
        begin_us = max(begin_us, from_bus_ms(leg.end_ms, now_us))
    return begins_us


def lift_uses(site: WaySite, itinerary: Itinerary, now_us: int, first_begin_us: int | None = None) -> list[Use]:
    """Every use of a lift that an itinerary makes, in order: from the first window on its platform to the last.

    Floors are those at which it boards and leaves; for one that begins or ends aboard, those where it then stands.
    """
    uses: list[Use] = []
    aboard = False
    for part in _parts(site, itinerary, now_us, first_begin_us):
        for window in _part_windows(site, part):
            if window.segment.index != PLATFORM_INDEX:
                continue
            lift_track = window.segment.track
            board_index, leave_index = _floors(site, part, lift_track)
            if aboard and uses[-1].lift_track == lift_track:
                to_us = max(uses[-1].to_us, window.to_us)
                uses[-1] = uses[-1]._replace(leave_index=leave_index, to_us=to_us)
            else:
                uses.append(Use(lift_track, board_index, leave_index, window.from_us, window.to_us, itinerary.sender))
            aboard = True
        there = None if part.leg is None else _after(site, part.leg)
        aboard = aboard and there is not None and _platform_at(site, there) == platform(uses[-1].lift_track)
    return uses


def final_position(site: WaySite, itinerary: Itinerary) -> Segment | None:
    """Where an itinerary ends and its machine stands for ever; None where it has no leg on the site."""
    ends = [_after(site, leg) for leg in itinerary.legs if leg.track in site.tracks]
    return ends[-1] if ends else None


def _award_us(itinerary: Itinerary, now_us: int) -> int:
    return from_bus_ms(itinerary.stamp.award_ms, now_us)


def _parts(site: WaySite, itinerary: Itinerary, now_us: int, first_begin_us: int | None = None) -> Iterator[_Part]:
    begin_us = _award_us(itinerary, now_us) if first_begin_us is None else first_begin_us
    here: Segment | None = None
    for leg in itinerary.legs:
        if leg.track not in site.tracks:
            continue
        end_us = from_bus_ms(leg.end_ms, now_us)
        yield _Part(leg, here, begin_us, end_us)
        begin_us = max(begin_us, end_us)
        here = _after(site, leg)
    if here is not None:
        yield _Part(None, here, begin_us, FOREVER)


def _after(site: WaySite, leg: Leg) -> Segment:
    """Where a machine stands after a leg: a ride ends on the alley of the floor that it goes to."""
    track = site.tracks[leg.track]
    if leg.action is LegAction.RIDE and track.kind is TrackKind.LIFT and 1 <= leg.to_index <= len(track.joins):
        there = platform_on(site, leg.track, track.joins[leg.to_index - 1].track)
        if there is not None:
            return there
    return Segment(leg.track, leg.to_index)


def _floors(site: WaySite, part: _Part, lift_track: int) -> tuple[int, int]:
    """The lift's indices before and after a part that occupies its platform."""
    leg = part.leg
    if leg is not None and leg.track == lift_track:
        last = site.tracks[lift_track].length
        return min(max(leg.from_index, 1), last), min(max(leg.to_index, 1), last)
    floors = [lift_index_of(site, lift_track, on.track) for on in (part.here, leg) if on is not None]
    served = [floor for floor in floors if floor is not None] or [1]
    return served[0], served[-1]


def _part_windows(site: WaySite, part: _Part) -> list[SlotWindow]:
    """Windows of one part; a leg on another track than ``here`` is a ride, or a hop through a junction."""
    leg, here, begin_us, end_us = part
    if leg is None:
        return [] if here is None else _stays(standing_segments(site, here), begin_us, end_us)
    if leg.action is LegAction.RIDE and site.tracks[leg.track].kind is TrackKind.LIFT:
        return _stays([platform(leg.track)], begin_us, end_us)
    origin = Segment(leg.track, leg.from_index)
    if leg.action is not LegAction.TRAVEL:
        return _stays(standing_segments(site, origin), begin_us, end_us)
    windows = []
    if here is None:
        # A plan told anew while its machine turns begins with the hop.
        here = hop_origin(site, leg)
    if here is not None and here.track != leg.track:
        windows = _stays(junction_segments(site, here, origin), begin_us, end_us)
    if leg.from_index != leg.to_index:
        windows += travel_windows(site, origin, leg.to_index, begin_us, end_us)
    return windows or _stays(standing_segments(site, origin), begin_us, end_us)


def _stays(segments: list[Segment], begin_us: int, end_us: int) -> list[SlotWindow]:
    """The same window on each segment; none where it has no length."""
    return [SlotWindow(segment, begin_us, end_us) for segment in segments] if begin_us < end_us else []
