"""Small sites made of plain values, with axes and lengths that no site file would accept."""

from onboard.core.site import Segment
from onboard.systems.car_park.site import CarLimits, CarPark
from onboard.ways.site import Axis, Track, TrackKind
from onboard.work.timing import DeviceTiming

ALLEY = 1
SPUR = 192


def line_site(
    length: int,
    pitch_mm: int,
    axis: Axis,
    carrier_length_mm: int,
    clearance_mm: int = 0,
    spur_at: int | None = None,
    spur_length: int = 1,
    turn_us: int = 0,
) -> CarPark:
    """One alley of ``length`` segments and, where asked for, a spur that joins it."""
    tracks = {ALLEY: Track(ALLEY, TrackKind.ALLEY, length, pitch_mm)}
    if spur_at is not None:
        tracks[SPUR] = Track(SPUR, TrackKind.SPUR, spur_length, pitch_mm, (Segment(ALLEY, spur_at),))
    return CarPark(
        name="line",
        digest=1,
        bitrate=500_000,
        tracks=tracks,
        places=(),
        machines={},
        stewards={},
        carrier=axis,
        carrier_length_mm=carrier_length_mm,
        carrier_clearance_mm=clearance_mm,
        carrier_turn_us=turn_us,
        shuttle=Axis(750, 500),
        shuttle_reach_mm=5_400,
        lift=Axis(1_083, 500),
        floor_height_mm=2_500,
        cars=CarLimits(1_800, 3_400, 5_300, 2_100, 3_000),
        timing=DeviceTiming(*[1_000] * 10, door_us=1_000, grip_us=1_000),
    )
