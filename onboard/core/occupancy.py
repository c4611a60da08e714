"""Which segments a body occupies when, from itinerary and site alone: every machine computes the same windows.

Segment i of a track spans its centre +- half a pitch. A body reaches half the carrier's length and the clearance to
either side of its own centre; it enters a segment when its front crosses the near border and leaves it when its rear
crosses the far one. Half millimetres and fractions of a microsecond are rounded so that windows are never too short.
"""

from functools import lru_cache
from typing import NamedTuple

from onboard.core.codes import LegAction
from onboard.core.kinematics import Run, cleared_at_us, run_duration_us, time_at_us
from onboard.core.messages import Itinerary, Leg
from onboard.core.reservations import FOREVER, Window
from onboard.core.serial import from_bus_ms
from onboard.core.site import Axis, Segment, Site


class Sweep(NamedTuple):
    """The body is in the segment ``offset`` steps from the start during ``[enter_us, leave_us)`` of a run."""

    offset: int
    enter_us: int
    leave_us: int


def body_mm(site: Site) -> int:
    """Length of the body: the carrier with its clearance in front and behind."""
    return site.carrier_length_mm + 2 * site.carrier_clearance_mm


def reach_segments(site: Site, track: int) -> int:
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
    run = Run(segments * pitch_mm, axis)
    reach = _reach(pitch_mm, length_mm)
    sweeps = []
    for offset in range(-reach, segments + reach + 1):
        near_mm = (2 * offset * pitch_mm - pitch_mm - length_mm) // 2
        far_mm = -(-(2 * offset * pitch_mm + pitch_mm + length_mm) // 2)
        sweeps.append(Sweep(offset, time_at_us(run, near_mm), cleared_at_us(run, far_mm)))
    return tuple(sweeps)


def leg_sweeps(site: Site, track: int, segments: int) -> tuple[Sweep, ...]:
    """Sweeps of the carrier of ``site`` for a run over ``segments`` steps of a track."""
    return run_sweeps(segments, site.tracks[track].pitch_mm, body_mm(site), site.carrier)


def standing_segments(site: Site, segment: Segment) -> list[Segment]:
    """Segments that a carrier standing at ``segment`` occupies, clearance included, in order of their index."""
    reach = reach_segments(site, segment.track)
    last = site.tracks[segment.track].length
    low, high = max(1, segment.index - reach), min(last, segment.index + reach)
    return [Segment(segment.track, index) for index in range(low, high + 1)]


def junction_segments(site: Site, origin: Segment, inside: Segment) -> list[Segment]:
    """Segments occupied for the whole of a hop between two tracks, such as from an alley into a spur."""
    return standing_segments(site, origin) + standing_segments(site, inside)


def travel_windows(site: Site, origin: Segment, to_index: int, begin_us: int, end_us: int) -> list[Window]:
    """Windows of one run from standing at ``origin``.

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
        index = origin.index + step * sweep.offset
        if 1 <= index <= track.length:
            windows.append(Window(Segment(origin.track, index), early_us + sweep.enter_us, late_us + sweep.leave_us))
    return windows


def itinerary_windows(site: Site, itinerary: Itinerary, now_us: int) -> list[Window]:
    """All windows of an itinerary; after the last leg the machine stands where it ends, without end.

    Legs on tracks that the site does not have, and the times that they would take, are passed over: an itinerary from
    the wire never raises.
    """
    begin_us = from_bus_ms(itinerary.stamp.award_ms, now_us)
    windows: list[Window] = []
    here: Segment | None = None
    for leg in itinerary.legs:
        if leg.track not in site.tracks:
            continue
        end_us = from_bus_ms(leg.end_ms, now_us)
        windows += _leg_windows(site, leg, here, begin_us, end_us)
        begin_us = max(begin_us, end_us)
        here = Segment(leg.track, leg.to_index)
    if here is not None:
        windows += _stays(standing_segments(site, here), begin_us, FOREVER)
    return windows


def _leg_windows(site: Site, leg: Leg, here: Segment | None, begin_us: int, end_us: int) -> list[Window]:
    """Windows of one leg that begins at ``here``; on another track than ``here`` it is a hop through a junction."""
    origin = Segment(leg.track, leg.from_index)
    if leg.action is not LegAction.TRAVEL:
        return _stays(standing_segments(site, origin), begin_us, end_us)
    windows = []
    if here is not None and here.track != leg.track:
        windows = _stays(junction_segments(site, here, origin), begin_us, end_us)
    if leg.from_index != leg.to_index:
        windows += travel_windows(site, origin, leg.to_index, begin_us, end_us)
    return windows or _stays(standing_segments(site, origin), begin_us, end_us)


def _stays(segments: list[Segment], begin_us: int, end_us: int) -> list[Window]:
    """The same window on each segment; none where it has no length."""
    return [Window(segment, begin_us, end_us) for segment in segments] if begin_us < end_us else []
