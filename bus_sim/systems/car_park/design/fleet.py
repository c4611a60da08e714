"""The robots of the model: each call goes to whoever is done first, as by the bids; then they go to a refuge.

As in the plant a robot bids only for what one itinerary can tell with the work that it has in hand and the way to a
refuge (``MAX_STEPS``), and no car is left where no robot could fetch it by one (``to_fetch_from``): on sites that are
driven one way round both matter.
"""

from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from itertools import takewhile
from typing import NamedTuple

from bus_sim.systems.car_park.design.times import AWARD_US, LEG_US, REACH_US, WORK_US
from bus_sim.systems.car_park.design.ways import ModelLeg, ModelTraffic, arrival_us
from onboard.contract.codes import KindCode
from onboard.core.site import Segment, Station
from onboard.systems.car_park.fetching import to_fetch_from
from onboard.systems.car_park.pipeline import ENTERED_US
from onboard.systems.car_park.program import MAX_STEPS
from onboard.systems.car_park.site import CarPark
from onboard.ways.kinematics import run_duration_us
from onboard.ways.refuges import open_refuges, refuges
from onboard.ways.reservations import FOREVER
from onboard.ways.roads import Roads

#: Calls after which turns that are long over are dropped.
TIDY_EVERY = 4


class ServedCall(NamedTuple):
    """What came of a call, us: when the car was set down (retrieval) or taken (parking) at the bay, and parked."""

    at_bay_us: int
    done_us: int
    place: Station | None = None


class _Trip(NamedTuple):
    """A robot's offer: its way to the car, and with it; times of the work at both ends; when each step of it ends."""

    done_us: int
    take_us: tuple[int, int]
    leave_us: tuple[int, int]
    first: list[ModelLeg]
    second: list[ModelLeg]
    kept: int
    work: "_Work"
    steps_us: list[int]


class _Work(NamedTuple):
    """A task: where the car is taken and left, and when the bay's side of it is ready, us; the place of a parking."""

    take: Segment
    leave: Segment
    take_ready_us: int
    leave_ready_us: int
    take_door_us: int
    leave_door_us: int
    place: Station | None = None


#: All that a task may come to, the most promising first: each takes the same car, at the same time.
_Works = Callable[[], Iterator[_Work]]


@dataclass
class RobotModel:
    """One robot: where and when its work ends, and how it goes to a refuge from there."""

    node: int
    at: Segment
    free_us: int = 0
    retreat: list[ModelLeg] = field(default_factory=list)
    busy_us: int = 0
    distance_mm: int = 0
    #: When each step of its work ends that was not over at the last call.
    steps_us: list[int] = field(default_factory=list)

    @property
    def rests_at(self) -> Segment:
        """Where it will stand until somebody calls."""
        return self.retreat[-1].there if self.retreat else self.at

    @property
    def resting(self) -> tuple[Segment, int, int, int]:
        """Where and from when on it will stand, for ever as far as anybody knows, and who it is."""
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

    def in_hand_us(self, time_us: int, roads: Roads) -> list[int]:
        """When the steps end that are to be told with whatever it takes up: its work, and a run that is under way."""
        begun = _steps_us(self.retreat[: self.branch(time_us, roads)[2]], self.free_us)
        return [end_us for end_us in (*self.steps_us, *begun) if end_us > time_us]


class FleetModel:
    """All robots of a site in its traffic."""

    def __init__(self, site: CarPark) -> None:
        self.site = site
        self.traffic = ModelTraffic(site)
        robots = [one for one in site.machines.values() if one.kind is KindCode.ROBOT]
        self.robots = [RobotModel(one.node_id, one.home) for one in robots]
        for one in self.robots:
            self.traffic.stands(*one.resting)
        #: Places without a car, or with one that is about to be taken: since when, or from when on.
        self.free = dict.fromkeys(to_fetch_from(site, site.places), 0)
        self._by_front: dict[Segment, list[Station]] = {}
        self._calls = 0
        stroke_us = run_duration_us(site.shuttle_reach_mm, site.shuttle)
        self.handle_us = 2 * stroke_us + site.timing.grip_us + WORK_US
        self._door_us = site.timing.door_us + REACH_US
        self._is_one_way = any(track.one_way for track in site.tracks.values())
        self._start_us = site.timing.call_window_us + AWARD_US

    # --- tasks -------------------------------------------------------------------------------------------------

    def park(self, front: Segment, call_us: int, ready_us: int) -> ServedCall | None:
        """A car is taken from a bay that is locked at ``ready_us`` to the nearest free place; None: all are taken."""
        if not self.free:
            return None
        # Whoever bids does not know how long the driver takes.
        bid_us = call_us + ENTERED_US + self.site.timing.door_us
        free = {place for place, since_us in self.free.items() if since_us <= call_us} or {*self.free}
        trip = self._give(lambda: self._parkings(front, bid_us, free), call_us, ready_us)
        place = trip.work.place
        assert place is not None, "a parking ends at a place"
        del self.free[place]
        return ServedCall(trip.take_us[1], trip.done_us, place)

    def _parkings(self, front: Segment, ready_us: int, free: Collection[Station]) -> Iterator[_Work]:
        seen: set[Segment] = set()
        for place in self._nearest(front):
            # Both sides of a segment are reached alike.
            if place in free and place.segment not in seen:
                seen.add(place.segment)
                yield _Work(front, place.segment, ready_us, 0, self._door_us, 0, place)

    def retrieve(self, place: Station, front: Segment, call_us: int, ready_us: int) -> ServedCall:
        """A car is brought from its place to a bay that is empty and locked at ``ready_us``."""
        work = _Work(place.segment, front, 0, ready_us, 0, self._door_us)
        trip = self._give(lambda: iter([work]), call_us)
        self.free[place] = trip.take_us[1]
        return ServedCall(trip.leave_us[1], trip.done_us)

    def _nearest(self, front: Segment) -> list[Station]:
        """All places, the nearest to a bay first; of places as near the site's order."""
        found = self._by_front.get(front)
        if found is None:
            roads = self.traffic.roads
            found = sorted(self.site.places, key=lambda one: roads.shortest_us(front, one.segment))
            self._by_front[front] = found
        return found

    def _give(self, works: _Works, call_us: int, ready_us: int | None = None) -> _Trip:
        """Of these, the most promising first, each robot offers the first that it can tell; who is done first has it.

        Where nobody can, they are called again once somebody has less in hand. ``ready_us`` is when the car can be
        taken, where that is another time than is bid for.
        """
        self._calls += 1
        if self._calls % TIDY_EVERY == 0:
            self.traffic.forget(call_us)
        start_us = call_us + self._start_us
        best = self._best(works, start_us) or self._past_rests(works, start_us)
        while best is None:
            ends_us = [end_us for one in self.robots for end_us in one.in_hand_us(start_us, self.traffic.roads)]
            # Where one itinerary tells it of nobody, whatever is in hand, it is done all the same.
            start_us = min(ends_us, default=start_us)
            best = self._best(works, start_us) or self._past_rests(works, start_us, any_way=not ends_us)
        trip, robot = best
        if ready_us is not None:
            trip = self._renewed(robot, trip.work._replace(take_ready_us=ready_us), start_us)
        self._carry_out(trip, robot, start_us)
        return trip

    def _renewed(self, robot: RobotModel, work: _Work, start_us: int) -> _Trip:
        """What a robot really does for a task that it has won."""
        found = self._offer(robot, lambda: iter([work]), start_us, any_way=False)
        if found is None:
            with self._giving_way(robot):
                found = self._offer(robot, lambda: iter([work]), start_us, any_way=True)
        assert found is not None, "nobody is in the way for ever"
        return found

    def _past_rests(self, works: _Works, start_us: int, *, any_way: bool = False) -> tuple[_Trip, RobotModel] | None:
        """The same where whoever only stands in the way gives way."""
        with self._giving_way():
            return self._best(works, start_us, any_way=any_way)

    @contextmanager
    def _giving_way(self, robot: RobotModel | None = None) -> Iterator[None]:
        """Meanwhile nobody rests anywhere, or nobody but one of them, which is in nobody's way but its own."""
        resting = [one.resting for one in self.robots if one is not robot]
        for stands in resting:
            self.traffic.stands_no_more(*stands)
        yield
        for stands in resting:
            self.traffic.stands(*stands)

    def _best(self, works: _Works, start_us: int, *, any_way: bool = False) -> tuple[_Trip, RobotModel] | None:
        roads, nearest, best = self.traffic.roads, next(works()), None
        rest_us = roads.shortest_us(nearest.take, nearest.leave) + 2 * self.handle_us
        bounds = []
        for number, robot in enumerate(self.robots):
            here, ready_us, _ = robot.branch(start_us, roads)
            bounds.append((ready_us + roads.shortest_us(here, nearest.take), number, robot))
        for bound_us, _, robot in sorted(bounds, key=lambda one: one[:2]):
            if best is not None and bound_us + rest_us > best[0].done_us:
                break
            worst_us = FOREVER if best is None else best[0].done_us
            trip = self._offer(robot, works, start_us, any_way=any_way, worst_us=worst_us)
            # Of equal bids the lower node-ID's is the better one.
            if trip is not None and (best is None or (trip.done_us, robot.node) < (best[0].done_us, best[1].node)):
                best = trip, robot
        return best

    def _offer(
        self, robot: RobotModel, works: _Works, start_us: int, *, any_way: bool, worst_us: int = FOREVER
    ) -> _Trip | None:
        """A robot's trip for the first of these that it can tell, or for the first of all; none after ``worst_us``.

        Its way back is given up for it, but for what it has begun.
        """
        given_up = robot.retreat[robot.branch(start_us, self.traffic.roads)[2] :]
        self.traffic.give_back(given_up)
        trips = takewhile(lambda trip: trip.done_us <= worst_us, self._trips(robot, works, start_us, through=any_way))
        found = next((trip for trip in trips if any_way or self._is_told(robot, trip, start_us)), None)
        self.traffic.take(given_up)
        return found

    def _trips(self, robot: RobotModel, works: _Works, start_us: int, *, through: bool) -> Iterator[_Trip]:
        """A trip for each of these: the way to the car is the same for all.

        ``through`` others that stand, or work, or come by while this robot does; else there may be none.
        """
        here, ready_us, kept = robot.branch(start_us, self.traffic.roads)
        take, _, take_ready_us, _, take_door_us, *_ = next(works())
        takes = partial(self._done_us, take_ready_us, take_door_us)
        first = self.traffic.plan(here, ready_us, frozenset((take,)), robot.node, None if through else takes)
        if first is None:
            return
        there_us = arrival_us(first, ready_us)
        taken_us = takes(there_us)
        begun_us = [*_steps_us(first, ready_us), *_work_steps_us(there_us, take_ready_us, taken_us)]
        for work in works():
            leaves = partial(self._done_us, work.leave_ready_us, work.leave_door_us)
            goals = frozenset((work.leave,))
            second = self.traffic.plan(take, taken_us, goals, robot.node, None if through else leaves)
            if second is None:
                continue
            back_us = arrival_us(second, taken_us)
            left_us = leaves(back_us)
            ended_us = [*_steps_us(second, taken_us), *_work_steps_us(back_us, work.leave_ready_us, left_us)]
            times_us = (there_us, taken_us), (back_us, left_us)
            yield _Trip(left_us, *times_us, first, second, kept, work, [*begun_us, *ended_us])

    def _done_us(self, ready_us: int, door_us: int, there_us: int) -> int:
        """When a car is taken or left by who is there at a time."""
        return max(there_us, ready_us) + door_us + self.handle_us

    def _is_told(self, robot: RobotModel, trip: _Trip, start_us: int) -> bool:
        """Whether one itinerary tells a trip with what the robot has in hand, and the way to a refuge behind it."""
        count = len(robot.in_hand_us(start_us, self.traffic.roads)) + len(trip.steps_us)
        if 2 * count < MAX_STEPS and not self._is_one_way:
            # No way to a refuge is longer than all that, where none leads round a floor.
            return True
        back_us = _steps_us(self._retreat(robot, trip.work.leave, trip.done_us), trip.done_us)
        return count + len(back_us) < MAX_STEPS

    def _carry_out(self, trip: _Trip, robot: RobotModel, start_us: int) -> None:
        traffic, node, work = self.traffic, robot.node, trip.work
        robot.steps_us = [*robot.in_hand_us(start_us, self.traffic.roads), *trip.steps_us]
        traffic.stands_no_more(*robot.resting)
        traffic.give_back(robot.retreat[trip.kept :])
        traffic.take(trip.first)
        traffic.take(trip.second)
        traffic.stands(work.take, *trip.take_us, node)
        traffic.stands(work.leave, *trip.leave_us, node)
        robot.busy_us += trip.done_us - max(start_us, robot.free_us)
        robot.distance_mm += sum(leg.distance_mm for leg in (*trip.first, *trip.second))
        robot.at, robot.free_us = work.leave, trip.done_us
        robot.retreat = self._retreat(robot, robot.at, robot.free_us)
        traffic.take(robot.retreat)
        traffic.stands(*robot.resting)

    # --- refuges -----------------------------------------------------------------------------------------------

    def _retreat(self, robot: RobotModel, here: Segment, since_us: int) -> list[ModelLeg]:
        """The way to the nearest place where it may stand while the others rest where they will."""
        others = [one.rests_at for one in self.robots if one is not robot]
        goals = open_refuges(self.site, others) or refuges(self.site)
        if here in goals:
            return []
        goals = _nearest_of(goals, here)
        found = self.traffic.plan(here, since_us, goals, robot.node, lambda there_us: there_us)
        if found is None:
            with self._giving_way(robot):
                found = self.traffic.plan(here, since_us, goals, robot.node)
        return found or []


def _steps_us(legs: Iterable[ModelLeg], since_us: int) -> list[int]:
    """When the steps of an itinerary end by which legs are told: a wait before a leg is one."""
    found: list[int] = []
    for leg in legs:
        if leg.begin_us > since_us:
            found.append(leg.begin_us)
        found.append(leg.end_us)
        since_us = leg.end_us + LEG_US
    return found


def _work_steps_us(there_us: int, ready_us: int, done_us: int) -> list[int]:
    """The same of a work: a wait for the bay, and itself."""
    return [ready_us, done_us] if ready_us > there_us else [done_us]


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
