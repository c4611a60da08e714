"""What if: the fleet as it would be after some further tasks, planned one after the other by the robots' own planners.

Nothing here changes a robot: planners are copies over copied mirrors. A dispatcher reads all robots' minds directly.
"""

import copy
from collections.abc import Mapping
from dataclasses import dataclass, replace

from onboard.contract.codes import Grade, LegAction, Operation
from onboard.contract.messages import CallForProposals, Stamp
from onboard.core.serial import to_bus_ms
from onboard.core.site import Segment, Station
from onboard.systems.car_park.alternatives import Solution
from onboard.systems.car_park.generation import CarParkGeneration
from onboard.systems.car_park.program import Program, to_itinerary
from onboard.ways.mirror import WayMirror
from onboard.ways.occupancy import itinerary_windows, lift_uses
from onboard.ways.reservations import FOREVER
from onboard.ways.roads import roads_of


@dataclass(frozen=True)
class Prospect:
    """All robots' planners by node-ID at ``now_us`` (bus us), and the programs that some would have by then."""

    planners: Mapping[int, CarParkGeneration]
    now_us: int
    programs: Mapping[int, Program]

    def start(self, node: int) -> tuple[Segment, int]:
        """From where and when a robot could begin a further task."""
        _, segment, start_us = self._program(node).branch(self.now_us)
        return segment, start_us

    def reach_us(self, node: int, call: CallForProposals) -> int:
        """When a robot could stand before the car of a task with nobody in the way; FOREVER where it never could."""
        segment, start_us = self.start(node)
        return start_us + roads_of(self.planners[node].site).shortest_us(segment, pick_up(call).segment)

    def solve(self, node: int, call: CallForProposals) -> Solution | None:
        """How a robot would do a task behind all that it has, around all plans and prospects."""
        planner = replace(self.planners[node], mirror=self._mirror(node), program=self._program(node), tentative={})
        planner.costs, planner.charging = self.planners[node].costs, self.planners[node].charging
        if planner.lower_bound(call, self.now_us) is None:
            return None
        solution, _ = planner.solve(call, self.now_us)
        return solution

    def after(self, node: int, solution: Solution) -> "Prospect":
        """The fleet once a robot has taken up a solution."""
        program = self._program(node)
        steps = [*program.remaining[: solution.kept], *solution.steps]
        ahead = Program(program.site, program.standing, version=program.version, stamp=program.stamp)
        ahead.replace(steps, Stamp(to_bus_ms(min(self.now_us, steps[0].begin_us)), 0, 0))
        return replace(self, programs={**self.programs, node: ahead})

    def _program(self, node: int) -> Program:
        return self.programs.get(node) or self.planners[node].program

    def _mirror(self, node: int) -> WayMirror:
        """The robot's own mirror, with what the others would plan."""
        others = {other: program for other, program in self.programs.items() if other != node}
        mirror = self.planners[node].mirror
        if not others:
            return mirror
        seen = copy.copy(mirror)
        seen.itineraries = dict(mirror.itineraries)
        seen.reservations = mirror.reservations.with_way_given(FOREVER)
        for other, program in others.items():
            itinerary = to_itinerary(other, program.version, Grade.FIRM, program.stamp, program.steps)
            begin_us = program.steps[0].begin_us
            seen.itineraries[other] = itinerary
            seen.reservations.release(other)
            seen.reservations.reserve(
                other,
                itinerary_windows(mirror.site, itinerary, self.now_us, begin_us),
                lift_uses(mirror.site, itinerary, self.now_us, begin_us),
            )
        return seen


def pick_up(call: CallForProposals) -> Station:
    """Where the car of a task stands when it is told."""
    return Station.from_number(call.from_station)


def serves_customer_us(call: CallForProposals, solution: Solution) -> int:
    """When a solution lets customers go on: their car is in the bay, or the bay is empty for the next."""
    if call.operation is Operation.RETRIEVE:
        return solution.finish_us
    return next(step.end_us for step in solution.steps if step.action is LegAction.WORK)
