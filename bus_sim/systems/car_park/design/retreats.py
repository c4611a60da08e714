"""Ways back to refuges in the model, and how they yield to work, as in the plant (``onboard.ways.retreats``)."""

from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from bus_sim.systems.car_park.design.robots import HeldBack, RobotModel, Trip
from bus_sim.systems.car_park.design.ways import ModelLeg, ModelTraffic, arrival_us
from onboard.core.site import Segment
from onboard.systems.car_park.generation import HEARD_US
from onboard.systems.car_park.site import CarPark
from onboard.ways.refuges import open_refuges, refuges
from onboard.ways.reservations import FOREVER
from onboard.ways.retreats import AGES_AFTER_MS


@dataclass(frozen=True)
class Retreats:
    """The ways back of all robots of a site."""

    site: CarPark
    traffic: ModelTraffic
    robots: Sequence[RobotModel]

    def way_back(self, robot: RobotModel, here: Segment, since_us: int) -> list[ModelLeg]:
        """The way to the nearest place where it may stand while the others rest where they will."""
        others = [one.rests_at for one in self.robots if one is not robot]
        found = self._way_to_refuge(robot, here, since_us, others)
        if found is None:
            goals = _nearest_of(self._refuges(others), here)
            with self.giving_way(robot):
                found = self.traffic.plan(here, since_us, goals, robot.node)
        return found or []

    def _refuges(self, others: Collection[Segment]) -> Collection[Segment]:
        return open_refuges(self.site, others) or refuges(self.site)

    def _way_to_refuge(
        self, robot: RobotModel, here: Segment, since_us: int, others: Collection[Segment]
    ) -> list[ModelLeg] | None:
        """The same around all who rest; None: there is none."""
        goals = self._refuges(others)
        if here in goals:
            return []
        return self.traffic.plan(here, since_us, _nearest_of(goals, here), robot.node, lambda there_us: there_us)

    @contextmanager
    def giving_way(self, robot: RobotModel, by_us: int = 0) -> Iterator[None]:
        """Meanwhile nobody rests anywhere after a time but one, which is in nobody's way but its own."""
        with self.traffic.tried():
            self.traffic.give_way(by_us, robot.node)
            yield

    # --- yielding ----------------------------------------------------------------------------------------------

    def may_yield(self, robot: RobotModel, now_us: int) -> list[HeldBack]:
        """Who yields to work of a robot: who has not begun all of a way back that is not too old."""
        since_us = now_us - AGES_AFTER_MS * 1000
        held = [
            one.held_back(now_us + HEARD_US, self.traffic.roads)
            for one in self.robots
            if one is not robot and one.given_us >= since_us
        ]
        return [one for one in held if one is not None]

    def hold_back(self, held: Iterable[HeldBack]) -> None:
        """These give up their ways back and stand."""
        for one in held:
            self.traffic.stands_no_more(*one.robot.resting)
            self.traffic.give_back(one.given_up)
            self.traffic.stands(*one.standing)

    def go_back(self, held: Iterable[HeldBack], now_us: int) -> None:
        """These find other ways back, one after the other."""
        for one in held:
            robot = one.robot
            self.traffic.stands_no_more(*one.standing)
            robot.retreat[one.kept :] = self.way_back(robot, one.place, max(one.since_us, now_us))
            self.traffic.take(one.given_up)
            self.traffic.stands(*robot.resting)

    def met(self, robot: RobotModel, trip: Trip, back: list[ModelLeg], held: Iterable[HeldBack]) -> list[HeldBack]:
        """Whose ways back, or the ends of these, a trip with its own way back meets."""
        legs, stands = [*trip.first, *trip.second, *back], trip.stands(robot.node, back)
        return [one for one in held if self.traffic.meet(legs, stands, one.given_up, [one.robot.resting])]

    def later_us(
        self, robot: RobotModel, trip: Trip, back: list[ModelLeg], yielding: Sequence[HeldBack], now_us: int
    ) -> int | None:
        """By how much later those who yield to a trip come to a refuge, in sum, us; None: one does not."""
        traffic, stands, later_us = self.traffic, trip.stands(robot.node, back), 0
        ends = {one.node: one.rests_at for one in self.robots} | {robot.node: stands[-1][0]}
        with traffic.tried():
            traffic.stands_no_more(*robot.resting)
            traffic.give_back(robot.retreat[trip.kept :])
            self.hold_back(yielding)
            traffic.take([*trip.first, *trip.second, *back])
            for stand in stands:
                traffic.stands(*stand)
            for one in yielding:
                other, since_us = one.robot, max(one.since_us, now_us)
                traffic.stands_no_more(*one.standing)
                others = [end for node, end in ends.items() if node != other.node]
                legs = self._way_to_refuge(other, one.place, since_us, others)
                if legs is None:
                    return None
                traffic.take(legs)
                ends[other.node], there_us = legs[-1].there if legs else one.place, arrival_us(legs, since_us)
                traffic.stands(ends[other.node], there_us, FOREVER, other.node)
                later_us += max(0, there_us - arrival_us(other.retreat, other.free_us))
        return later_us


def _nearest_of(goals: Collection[Segment], here: Segment) -> frozenset[Segment]:
    """The ends of each stretch of goals, or the goal beside where one stands: nobody goes further in.

    A track has several stretches where lifts or mouths lie beside it.
    """
    every = frozenset(goals)
    beside = ((one, {one._replace(index=one.index - 1), one._replace(index=one.index + 1)}) for one in every)
    found = {one for one, both in beside if not both <= every}
    on_track = [one for one in every if one.track == here.track]
    if on_track:
        found.add(min(on_track, key=lambda one: (abs(one.index - here.index), one)))
    return frozenset(found)
