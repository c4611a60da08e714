"""Lift shafts as they are: the sill at which an alley ends, and the platform that carries a robot past the floors."""

from dataclasses import dataclass
from typing import NamedTuple

from bus_sim.systems.car_park.plant.motion import Motion
from onboard.core.site import Segment
from onboard.ways.site import WaySite


class Sill(NamedTuple):
    """Where an alley ends at a shaft: beyond ``edge_mm`` on its axis, ``towards`` -1 or +1, nothing is but a platform.

    ``centre_mm`` is where the centre of a carrier on the platform is, on the same axis.
    """

    edge_mm: float
    towards: int
    centre_mm: float

    def beyond_mm(self, position_mm: float, length_mm: float) -> float:
        """How far a body with its centre at ``position_mm`` reaches into the shaft; negative while it keeps away."""
        return (position_mm - self.edge_mm) * self.towards + length_mm / 2


@dataclass
class PlatformBody:
    """A lift's platform as it is: its motion along the shaft of ``track``, and the robot that rides on it.

    ``robot`` is set only while the platform is not at a floor; that robot's position then stays on the axis of the
    alley ``axis``, where it boarded.
    """

    track: int
    motion: Motion
    robot: int | None = None
    axis: int = 0


def sills_of(site: WaySite, lift_track: int) -> dict[int, Sill]:
    """The sills of one lift by floor."""
    return {segment.track: _sill(site, segment) for segment in site.tracks[lift_track].joins}


def _sill(site: WaySite, segment: Segment) -> Sill:
    pitch_mm = site.tracks[segment.track].pitch_mm
    towards = -1 if site.beyond(segment).index == 0 else 1
    middle_mm = site.position_mm(segment)
    return Sill(middle_mm + towards * pitch_mm / 2, towards, float(middle_mm + towards * pitch_mm))
