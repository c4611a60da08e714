"""Which segments a body occupies when, from itinerary and site alone: every machine computes the same windows."""

from functools import lru_cache
from typing import NamedTuple

from onboard.core.codes import LegAction
from onboard.core.kinematics import run_duration_us, time_at_us
from onboard.core.messages import Itinerary
from onboard.core.reservations import FOREVER, Window
from onboard.core.serial import from_bus_ms
from onboard.core.site import Axis, Segment, Site


class Sweep(NamedTuple):
    """The body is in the segment ``offset`` steps from the start during ``[enter_us, leave_us)`` of a run."""

    offset: int
    enter_us: int
    leave_us: int


def reach_segments(site: Site, track: int) -> int:
    """How many segments beyond its own the body, with its clearance, touches on either side while it stands."""
    pitch_mm = site.tracks[track].pitch_mm
    over_mm = site.carrier_length_mm // 2 + site.carrier_clearance_mm - pitch_mm // 2
    return max(0, -(-over_mm // pitch_mm))


@lru_cache(maxsize=4096)
def run_sweeps(segments: int, pitch_mm: int, half_mm: int, reach: int, axis: Axis) -> tuple[Sweep, ...]:
    """Sweeps of a run over ``segments`` >= 1 steps, for a body of ``half_mm`` (clearance included) each way.

    Offsets go from ``-reach`` to ``segments + reach``; sweeps at the destination end with the run.
    """
    distance_mm = segments * pitch_mm
    duration_us = run_duration_us(distance_mm, axis)
    sweeps = []
    for offset in range(-reach, segments + reach + 1):
        near_mm = offset * pitch_mm - pitch_mm // 2 - half_mm
        far_mm = offset * pitch_mm + pitch_mm - pitch_mm // 2 + half_mm
        if near_mm >= distance_mm or far_mm <= 0:
            continue
        enter_us = time_at_us(near_mm, distance_mm, axis)
        leave_us = duration_us if far_mm >= distance_mm else time_at_us(far_mm, distance_mm, axis)
        sweeps.append(Sweep(offset, enter_us, leave_us))
    return tuple(sweeps)


def leg_sweeps(site: Site, track: int, segments: int) -> tuple[Sweep, ...]:
    """Sweeps of the carrier of ``site`` for a run over ``segments`` steps of a track."""
    pitch_mm = site.tracks[track].pitch_mm
    half_mm = site.carrier_length_mm // 2 + site.carrier_clearance_mm
    return run_sweeps(segments, pitch_mm, half_mm, reach_segments(site, track), site.carrier)


def standing_segments(site: Site, segment: Segment) -> list[Segment]:
    """Segments that a carrier standing at ``segment`` occupies, clearance included."""
    reach = reach_segments(site, segment.track)
    last = site.tracks[segment.track].length
    low, high = max(1, segment.index - reach), min(last, segment.index + reach)
    return [Segment(segment.track, index) for index in range(low, high + 1)]


def travel_windows(site: Site, origin: Segment, to_index: int, begin_us: int, end_us: int) -> list[Window]:
    """Windows of one run. Where ``[begin, end)`` is not exactly the run's duration (a delay, a leg under way), a
    segment counts as occupied from the earliest entering to the latest leaving that fit."""
    step = 1 if to_index > origin.index else -1
    segments = abs(to_index - origin.index)
    slack_us = end_us - begin_us - run_duration_us(segments * site.tracks[origin.track].pitch_mm, site.carrier)
    early_us, late_us = min(begin_us, begin_us + slack_us), max(begin_us, begin_us + slack_us)
    windows = []
    for sweep in leg_sweeps(site, origin.track, segments):
        index = origin.index + step * sweep.offset
        if 1 <= index <= site.tracks[origin.track].length:
            windows.append(Window(Segment(origin.track, index), early_us + sweep.enter_us, late_us + sweep.leave_us))
    return windows


def itinerary_windows(site: Site, itinerary: Itinerary, now_us: int) -> list[Window]:
    """All windows of an itinerary; after the last leg the machine stands where it ends, without end."""
    begin_us = from_bus_ms(itinerary.stamp.award_ms, now_us)
    windows: list[Window] = []
    last: Segment | None = None
    for leg in itinerary.legs:
        if leg.track not in site.tracks:
            continue
        end_us = from_bus_ms(leg.end_ms, now_us)
        origin = Segment(leg.track, leg.from_index)
        if leg.action is LegAction.TRAVEL and leg.from_index != leg.to_index:
            windows += travel_windows(site, origin, leg.to_index, begin_us, end_us)
        elif end_us > begin_us:
            windows += [Window(segment, begin_us, end_us) for segment in standing_segments(site, origin)]
        begin_us = max(begin_us, end_us)
        last = Segment(leg.track, leg.to_index)
    if last is not None:
        windows += [Window(segment, begin_us, FOREVER) for segment in standing_segments(site, last)]
    return windows
