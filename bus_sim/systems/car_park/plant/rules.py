"""What must never happen in a plant, and how it is told."""

from enum import Enum
from typing import NamedTuple

from bus_sim.systems.car_park.plant.motion import Motion

#: Overlap below this, mm, is rounding.
OVERLAP_TOLERANCE_MM = 1e-3


class PlantRule(Enum):
    """What must never happen in the plant, as the oracle reports it."""

    BODIES_APART = "two bodies overlap on a track"
    ON_TRACK = "a carrier leaves its track"
    SHUTTLE_HOME_TO_MOVE = "a carrier moves while its shuttle is out"
    ONE_DOOR = "both doors of a compartment are not locked"
    NO_PERSON_TO_MACHINES = "a person is inside while the output door is not locked"
    PERSON_BY_OPEN_DOOR = "a person passes a door that is not open"
    BAY_BY_OPEN_DOOR = "a shuttle is in a bay whose output door is not open"
    ORDER_TO_TEAR = "a carrier is ordered away while its shuttle is out"
    NO_WALL = "a shuttle reaches where there is no station"
    ONE_CAR = "two cars are in one place"
    CARS_CONSERVED = "a car is lost or doubled"
    OWN_CAR = "a customer is given another's car"
    LIFT_CRUSH = "a lift crushing what overhangs its sill"
    FALL = "a carrier in a shaft without a platform"
    ONE_ABOARD = "two bodies are on one platform"
    TURN_IN_MOUTH = "a carrier turns elsewhere than in a mouth"
    POWER = "a battery is empty, and nothing has struck"
    RIDE_AT_REST = "a carrier moves on a moving platform"


class PlantViolation(NamedTuple):
    """One broken invariant: when (us of loop time), which, and what exactly."""

    time_us: int
    rule: PlantRule
    text: str

    def __str__(self) -> str:
        return f"{self.time_us / 1e6:.6f} s: {self.rule.value}: {self.text}"


class MotionSpan(NamedTuple):
    """A carrier's motion and from when on it holds; ``turning_to`` is the track towards which it turns."""

    track: int
    motion: Motion
    from_us: int
    turning_to: int | None = None
