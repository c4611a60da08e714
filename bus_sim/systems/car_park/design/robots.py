"""A robot of the model: what it has in hand, the trips that it offers, and how far it drives if its way back yields."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from bus_sim.systems.car_park.design.times import LEG_US
from bus_sim.systems.car_park.design.ways import ModelLeg, Stand, arrival_us
from onboard.core.site import Segment, Station
from onboard.ways.reservations import FOREVER
from onboard.ways.roads import Roads


class Work(NamedTuple):
    """A task: where the car is taken and left, and when the bay's side of it is ready, us; the place of a parking.

    ``cost_us`` is what this place costs beside the time at which the car stands there (``PlaceCosts``).
    """

    take: Segment
    leave: Segment
    take_ready_us: int
    leave_ready_us: int
    take_door_us: int
    leave_door_us: int
    place: Station | None = None
    cost_us: int = 0


#: All that a task may come to, the most promising first: each takes the same car, at the same time.
Works = Callable[[], Iterator[Work]]


class Trip(NamedTuple):
    """A robot's offer: its way to the car, and with it; times of the work at both ends; when each step of it ends."""

    done_us: int
    take_us: tuple[int, int]
    leave_us: tuple[int, int]
    first: list[ModelLeg]
    second: list[ModelLeg]
    kept: int
    work: Work
    steps_us: list[int]
    #: When it would be over with what plans allow for: that is bid.
    bid_us: int
    #: Whose ways back it counts on to yield.
    yielding: "tuple[HeldBack, ...]" = ()

    @property
    def cost_us(self) -> int:
        """When it is over, and what its place costs beside: the least is the best place."""
        return self.done_us + self.work.cost_us

    def stands(self, node: int, back: list[ModelLeg]) -> list[Stand]:
        """Where the robot stands: at both works, and after its way back for ever."""
        at = back[-1].there if back else self.work.leave
        works = (self.work.take, *self.take_us, node), (self.work.leave, *self.leave_us, node)
        return [*works, (at, arrival_us(back, self.done_us), FOREVER, node)]


@dataclass
class RobotModel:
    """One robot: where and when its work ends, and how it goes to a refuge from there."""

    node: int
    at: Segment
    free_us: int = 0
    retreat: list[ModelLeg] = field(default_factory=list)
    busy_us: int = 0
    distance_mm: int = 0
    #: When its last task was given: of that age is its way back.
    given_us: int = 0
    #: When each step of its work ends that was not over at the last call.
    steps_us: list[int] = field(default_factory=list)

    @property
    def rests_at(self) -> Segment:
        """Where it will stand until somebody calls."""
        return self.retreat[-1].there if self.retreat else self.at

    @property
    def resting(self) -> Stand:
        """Where and from when on it will stand, for ever as far as anybody knows."""
        return self.rests_at, arrival_us(self.retreat, self.free_us), FOREVER, self.node

    def branch(self, time_us: int, roads: Roads) -> tuple[Segment, int, int]:
        """From where and when it can take something up, and how many legs of its retreat it drives before.

        As in the plant (``Program.branch``) a run that was begun is ended, and nobody stays on a platform.
        """
        here, ready_us, kept = self.at, self.free_us, 0
        for leg in self.retreat:
            if leg.begin_us >= time_us and (kept == 0 or roads.lift_at(here) is None):
                break
            here, ready_us, kept = leg.there, leg.end_us, kept + 1
        return here, max(ready_us, time_us), kept

    def held_back(self, from_us: int, roads: Roads) -> "HeldBack | None":
        """Where and since when it stands if it begins nothing more of its way back from then on; None: all is begun.

        As in the plant (``onboard.ways.retreats.held_back``).
        """
        kept = self.branch(from_us, roads)[2]
        begun = self.retreat[:kept]
        here = begun[-1].there if begun else self.at
        return HeldBack(self, kept, here, arrival_us(begun, self.free_us)) if kept < len(self.retreat) else None

    def in_hand_us(self, time_us: int, roads: Roads) -> list[int]:
        """When the steps end that are to be told with whatever it takes up: its work, and a run that is under way."""
        begun = steps_us(self.retreat[: self.branch(time_us, roads)[2]], self.free_us)
        return [end_us for end_us in (*self.steps_us, *begun) if end_us > time_us]


class HeldBack(NamedTuple):
    """A robot that drives no more than so many legs of its way back: where it stands for ever, and since when, us."""

    robot: RobotModel
    kept: int
    place: Segment
    since_us: int

    @property
    def given_up(self) -> list[ModelLeg]:
        """What it drives no more."""
        return self.robot.retreat[self.kept :]

    @property
    def standing(self) -> Stand:
        """Where it stands, as the traffic knows it."""
        return self.place, self.since_us, FOREVER, self.robot.node


def steps_us(legs: Iterable[ModelLeg], since_us: int) -> list[int]:
    """When the steps of an itinerary end by which legs are told: a wait before a leg is one."""
    found: list[int] = []
    for leg in legs:
        if leg.begin_us > since_us:
            found.append(leg.begin_us)
        found.append(leg.end_us)
        since_us = leg.end_us + LEG_US
    return found


def work_steps_us(there_us: int, ready_us: int, done_us: int) -> list[int]:
    """The same of a work: a wait for the bay, and itself."""
    return [ready_us, done_us] if ready_us > there_us else [done_us]
