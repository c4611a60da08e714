"""What nobody can beat: each customer alone in an empty park, a robot already standing where it is needed (us).

Door, shuttle and customer take as long as they do in the plant; messages, tokens and thinking take no time. For a car
that comes in, no robot is waited for at all; one that is asked for is taken from the place where it stood then.

Proof for any run without an oracle's complaint. *In*: a driver sees an empty bay behind an open door no sooner than he
comes, goes ``REACTION_US`` later, and drives and walks as long as he draws. *Out*: the place's stroke ends before the
robot leaves it, the way after that takes at least its runs and rides, the bay's stroke comes behind it, and the input
door moves only once the output door is locked; then the driver sees it, and drives. None of these overlaps another.
"""

import random
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from bus_sim.systems.car_park.demand import Stay
from bus_sim.systems.car_park.plant.bodies import DRIVER_S
from bus_sim.systems.car_park.plant.customer import REACTION_US, WALK_S
from bus_sim.systems.car_park.plant.door import BOLT_US
from bus_sim.systems.car_park.plant.motion import driving
from onboard.core.site import Segment, Site
from onboard.systems.car_park.site import car_park
from onboard.ways.lift_uses import GATE_US
from onboard.ways.network import Network
from onboard.ways.roads import roads_of
from onboard.ways.site import WaySite

#: The planner rounds each run up to the next millisecond; a robot may be there by so much sooner, us.
ROUNDED_US = 1_000


class Acts(NamedTuple):
    """A customer's own acts, us: driving in, walking out with the ticket, driving out again."""

    drive_in_us: int
    walk_us: int
    drive_out_us: int

    @classmethod
    def of(cls, stay: Stay, seed: int) -> "Acts":
        """What the plant's customer will draw in a run of this seed."""
        chance = random.Random(f"customer:{seed}:{stay.car.name}")
        return cls(*(round(chance.uniform(*span) * 1e6) for span in (DRIVER_S, WALK_S, DRIVER_S)))


@dataclass(frozen=True)
class FreeFlow:
    """The least times of a site's parts, us: a door locked, a door open, a car taken from a station or left there."""

    close_us: int
    open_us: int
    handle_us: int

    @classmethod
    def of(cls, site: Site) -> "FreeFlow":
        """The least times of a site."""
        park = car_park(site)
        reach = driving(0.0, 0.0, park.shuttle_reach_mm, park.shuttle.speed_mm_s, park.shuttle.acceleration_mm_s2, 0)
        return cls(
            close_us=park.timing.door_us + BOLT_US,
            open_us=park.timing.door_us,
            handle_us=2 * reach.end_us + park.timing.grip_us,
        )

    @property
    def turn_us(self) -> int:
        """From one door open to the other: the bay turned from the street to the park, or back."""
        return self.close_us + self.open_us

    def in_us(self, acts: Acts) -> int:
        """From coming to walking away with a ticket."""
        return REACTION_US + acts.drive_in_us + acts.walk_us

    def out_us(self, acts: Acts) -> int:
        """From a car before the inner door, open already, to its driving out."""
        return self.handle_us + self.turn_us + REACTION_US + acts.drive_out_us


class LeastWays:
    """Between two positions no carrier needs less: runs and rides alone, neither rounded nor waiting."""

    def __init__(self, site: WaySite) -> None:
        self._roads = roads_of(site)
        self._rests_us: dict[Segment, dict[Segment, int]] = {}

    def us(self, origin: Segment, goal: Segment) -> int:
        """The least time, us; 0 where no way leads there."""
        rests_us, roads = self._to(goal), self._roads
        ends = [one for one in (*roads.junctions(origin.track), goal) if one.track == origin.track and one in rests_us]
        runs_us = (roads.run_us(origin.track, abs(origin.index - one.index)) - ROUNDED_US for one in ends)
        return max(0, min((run_us + rests_us[one] for run_us, one in zip(runs_us, ends, strict=True)), default=0))

    def _to(self, goal: Segment) -> dict[Segment, int]:
        """The same from all junctions to a goal, and 0 from itself."""
        if goal not in self._rests_us:
            roads = self._roads
            starts = {
                one: max(0, roads.run_us(goal.track, abs(goal.index - one.index)) - ROUNDED_US)
                for one in roads.junctions(goal.track)
            }
            self._rests_us[goal] = {**self._network.costs_to({**starts, goal: 0}), goal: 0}
        return self._rests_us[goal]

    @cached_property
    def _network(self) -> Network[Segment]:
        around = self._roads.network.ways.items()
        return Network(
            {here: [(there, self._least_us(here, there, us)) for there, us in ends] for here, ends in around}
        )

    def _least_us(self, here: Segment, there: Segment, counted_us: int) -> int:
        """A move's motion alone: the planner rounds its parts, and counts the tokens of a ride's gate."""
        rides = any(hop.destination == there and hop.lift_track is not None for hop in self._roads.hops(here))
        return max(1, counted_us - 2 * ROUNDED_US - (GATE_US if rides else 0))
