"""Sites of several floors made of plain values, with a lift at either or both ends of the alleys."""

from dataclasses import replace

from onboard.core.site import Segment
from onboard.systems.car_park.site import CarPark
from onboard.ways.site import Axis, Track, TrackKind
from tests.ways.lines import line_site

#: Tracks of the lifts at the left and at the right end.
LEFT, RIGHT = 128, 129


def building(
    floors: int,
    length: int,
    axis: Axis,
    *,
    pitch_mm: int,
    floor_mm: int,
    carrier_length_mm: int,
    clearance_mm: int = 0,
    ends: tuple[int, ...] = (LEFT, RIGHT),
    lift: Axis | None = None,
) -> CarPark:
    """Alleys 1 to ``floors``; every lift of ``ends`` serves them all and has ``axis`` where ``lift`` is not given."""
    site = line_site(length, pitch_mm, axis, carrier_length_mm, clearance_mm)
    tracks = {number: Track(number, TrackKind.ALLEY, length, pitch_mm) for number in range(1, floors + 1)}
    for end in ends:
        sills = tuple(Segment(floor, 1 if end == LEFT else length) for floor in range(1, floors + 1))
        tracks[end] = Track(end, TrackKind.LIFT, floors, floor_mm, sills)
    return replace(site, tracks=tracks, lift=lift or axis, floor_height_mm=floor_mm)
