"""The robots of the model: each call goes to whoever is done first, as by the bids; then they go to a refuge."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

from bus_sim.systems.car_park.design.ways import ModelLeg, ModelTraffic, arrival_us
from onboard.contract.codes import KindCode
from onboard.core.site import Segment, Station
from onboard.systems.car_park.generation import AWARD_LATENCY_US, HANDLING_OVERHEAD_US
from onboard.systems.car_park.site import CarPark
from onboard.ways.kinematics import run_duration_us
from onboard.ways.refuges import open_refuges, refuges

#: Calls after which turns that are long over are dropped.
TIDY_EVERY = 4


class ServedCall(NamedTuple):
    """What came of a call, us: when the car was set down (retrieval) or taken (parking) at the bay, and parked."""

    at_bay_us: int
    done_us: int
    place: Station | None = None


class _Trip(NamedTuple):
    """A robot's offer: its way to the car, and with it; times of the work at both ends."""

    done_us: int
    take_us: tuple[int, int]
    leave_us: tuple[int, int]
    first: list[ModelLeg]
    second: list[ModelLeg]
    kept: int


class _Work(NamedTuple):
    """A task: where the car is taken and left, and when the bay's side of it is ready, us."""

    take: Segment
    leave: Segment
    take_ready_us: int
    leave_ready_us: int
    take_door_us: int
    leave_door_us: int


@dataclass
class RobotModel:
    """One robot: where and when its work ends, and how it goes to a refuge from there."""

    node: int
    at: Segment
    free_us: int = 0
    retreat: list[ModelLeg] = field(default_factory=list)
    busy_us: int = 0
    distance_mm: int = 0

    @property
    def rests_at(self) -> Segment:
        """Where it will stand until somebody calls."""
        return self.retreat[-1].there if self.retreat else self.at

    def branch(self, time_us: int) -> tuple[Segment, int, int]:
        """From where and when it can take something up, and how many legs of its retreat it drives before."""
        here, ready_us, kept = self.at, self.free_us, 0
        for leg in self.retreat:
            if leg.begin_us >= time_us:
                break
            here, ready_us, kept = leg.there, leg.end_us, kept + 1
        return here, max(ready_us, time_us), kept


class FleetModel:
    """All robots of a site in its traffic."""

    def __init__(self, site: CarPark) -> None:
        self.site = site
        self.traffic = ModelTraffic(site)
        robots = [one for one in site.machines.values() if one.kind is KindCode.ROBOT]
        self.robots = [RobotModel(one.node_id, one.home) for one in robots]
        self.free = dict.fromkeys(site.places)
        self._by_front: dict[Segment, list[Station]] = {}
        self._calls = 0
        stroke_us = run_duration_us(site.shuttle_reach_mm, site.shuttle)
        self.handle_us = 2 * stroke_us + site.timing.grip_us + HANDLING_OVERHEAD_US
        self._start_us = site.timing.call_window_us + AWARD_LATENCY_US

    # --- tasks -------------------------------------------------------------------------------------------------

    def park(self, front: Segment, call_us: int, ready_us: int) -> ServedCall | None:
        """A car is taken from a bay that is locked at ``ready_us`` to the nearest free place; None: all are taken."""
        place = next((one for one in self._nearest(front) if one in self.free), None)
        if place is None:
            return None
        del self.free[place]
        work = _Work(front, place.segment, ready_us, 0, self.site.timing.door_us, 0)
        trip = self._give(work, call_us)
        return ServedCall(trip.take_us[1], trip.done_us, place)

    def retrieve(self, place: Station, front: Segment, call_us: int, ready_us: int) -> ServedCall:
        """A car is brought from its place to a bay that is empty and locked at ``ready_us``."""
        work = _Work(place.segment, front, 0, ready_us, 0, self.site.timing.door_us)
        trip = self._give(work, call_us)
        self.free[place] = None
        return ServedCall(trip.leave_us[1], trip.done_us)

    def _nearest(self, front: Segment) -> list[Station]:
        """All places, the nearest to a bay first; of places as near the site's order."""
        found = self._by_front.get(front)
        if found is None:
            roads = self.traffic.roads
            found = sorted(self.site.places, key=lambda one: roads.shortest_us(front, one.segment))
            self._by_front[front] = found
        return found

    def _give(self, work: _Work, call_us: int) -> _Trip:
        self._calls += 1
        if self._calls % TIDY_EVERY == 0:
            self.traffic.forget(call_us)
        start_us = call_us + self._start_us
        roads, best = self.traffic.roads, None
        bounds = []
        for number, robot in enumerate(self.robots):
            here, ready_us, _ = robot.branch(start_us)
            bounds.append((ready_us + roads.shortest_us(here, work.take), number, robot))
        rest_us = roads.shortest_us(work.take, work.leave) + 2 * self.handle_us
        for bound_us, _, robot in sorted(bounds, key=lambda one: one[:2]):
            if best is not None and bound_us + rest_us >= best[0].done_us:
                break
            trip = self._trip(robot, work, start_us)
            if best is None or trip.done_us < best[0].done_us:
                best = trip, robot
        assert best is not None, "a site has a robot"
        self._carry_out(*best, work, start_us)
        return best[0]

    def _trip(self, robot: RobotModel, work: _Work, start_us: int) -> _Trip:
        here, ready_us, kept = robot.branch(start_us)
        given_up = robot.retreat[kept:]
        self.traffic.give_back(given_up)
        first = self.traffic.plan(here, ready_us, frozenset((work.take,)), robot.node)
        assert first is not None, "every place is reached"
        there_us = arrival_us(first, ready_us)
        taken_us = max(there_us, work.take_ready_us) + work.take_door_us + self.handle_us
        second = self.traffic.plan(work.take, taken_us, frozenset((work.leave,)), robot.node)
        assert second is not None, "every bay is reached"
        self.traffic.take(given_up)
        back_us = arrival_us(second, taken_us)
        left_us = max(back_us, work.leave_ready_us) + work.leave_door_us + self.handle_us
        return _Trip(left_us, (there_us, taken_us), (back_us, left_us), first, second, kept)

    def _carry_out(self, trip: _Trip, robot: RobotModel, work: _Work, start_us: int) -> None:
        traffic, node = self.traffic, robot.node
        traffic.give_back(robot.retreat[trip.kept :])
        traffic.take(trip.first)
        traffic.take(trip.second)
        traffic.stands(work.take, *trip.take_us, node)
        traffic.stands(work.leave, *trip.leave_us, node)
        robot.busy_us += trip.done_us - max(start_us, robot.free_us)
        robot.distance_mm += sum(leg.distance_mm for leg in (*trip.first, *trip.second))
        robot.at, robot.free_us = work.leave, trip.done_us
        robot.retreat = self._retreat(robot)
        traffic.take(robot.retreat)

    # --- refuges -----------------------------------------------------------------------------------------------

    def _retreat(self, robot: RobotModel) -> list[ModelLeg]:
        """The way to the nearest place where it may stand while the others rest where they will."""
        others = [one.rests_at for one in self.robots if one is not robot]
        goals = open_refuges(self.site, others) or refuges(self.site)
        if robot.at in goals:
            return []
        return self.traffic.plan(robot.at, robot.free_us, _nearest_of(goals, robot.at), robot.node) or []


def _nearest_of(goals: Iterable[Segment], here: Segment) -> frozenset[Segment]:
    """Of each track the ends of its stretch of goals, or the goal beside where one stands: nobody goes further in."""
    by_track: dict[int, list[Segment]] = {}
    for goal in goals:
        by_track.setdefault(goal.track, []).append(goal)
    found: set[Segment] = set()
    for track, on_track in by_track.items():
        found |= {min(on_track), max(on_track)}
        if track == here.track:
            found.add(min(on_track, key=lambda one: (abs(one.index - here.index), one)))
    return frozenset(found)
