"""What a robotized car park has beyond any other site: cars, shuttles, and when lifts are asked for."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import ClassVar

from onboard.core.site import MotionNeeds, Site
from onboard.ways.site import Axis, WaySite
from onboard.work.timing import DeviceTiming


@dataclass(frozen=True, slots=True)
class CarLimits:
    """What cars the park takes (row P33); all in mm and kg."""

    min_wheelbase_mm: int
    max_wheelbase_mm: int
    max_length_mm: int
    max_height_mm: int
    max_load_kg: int


class RideCalls(Enum):
    """When a robot asks lifts for the rides of a task (row P39).

    AFTER winning it, when everybody's itineraries have told enough before; BEFORE its bid, by sub-calls as options.
    """

    AFTER = "after"
    BEFORE = "before"


@dataclass(frozen=True, kw_only=True)
class CarPark(WaySite):
    """A robotized car park (rows P30 to P33)."""

    system: ClassVar[str] = "car-park"
    has_regeneration: ClassVar[bool] = True
    moved_by: ClassVar[Mapping[str, MotionNeeds]] = {
        "DriveOrder": MotionNeeds.RIGHT,
        "ShuttleOrder": MotionNeeds.RIGHT,
        "DoorOrder": MotionNeeds.PLACE,
    }

    timing: DeviceTiming
    shuttle: Axis
    shuttle_reach_mm: int
    cars: CarLimits
    rides: RideCalls = RideCalls.AFTER


def car_park(site: Site) -> CarPark:
    """The same site, for those that only a car park has. A machine of another system never asks."""
    assert isinstance(site, CarPark), f"site {site.name} is no car park"
    return site
