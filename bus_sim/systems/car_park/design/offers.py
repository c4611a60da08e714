"""What the robots of the model offer for a task, as the plant's bid (``CarParkGeneration``).

A robot bids only for what one itinerary can tell with the work that it has in hand and the way to a refuge
(``MAX_STEPS``): on sites that are driven one way round that matters. Bids count what plans allow for, and not what is
really taken. Others' ways back are asked to yield to a task that is won, and to one for which there is no way else.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial

from bus_sim.systems.car_park.design.retreats import Retreats
from bus_sim.systems.car_park.design.robots import RobotModel, Trip, Work, Works, steps_us, work_steps_us
from bus_sim.systems.car_park.design.times import BID_AWARD_US, BID_RIDE_US, BID_WORK_US, LEG_US, REACH_US, WORK_US
from bus_sim.systems.car_park.design.ways import ModelLeg, ModelTraffic, arrival_us
from onboard.systems.car_park.generation import WORTH_US, YIELDING_US
from onboard.systems.car_park.program import MAX_STEPS
from onboard.systems.car_park.site import CarPark
from onboard.ways.kinematics import run_duration_us
from onboard.ways.reservations import FOREVER

#: So many times between others' turns are tried for taking a car: a rush has a handful of robots in one alley.
MOST_WAYS = 4
#: So many places are looked at for a way to one, and then for a sooner one: the nearest of hundreds are as good.
MOST_PLACES, MOST_SOONER = 12, 2


@dataclass(frozen=True)
class Offers:
    """What each robot of a site can offer in its traffic; nothing is taken for it."""

    site: CarPark
    traffic: ModelTraffic
    robots: Sequence[RobotModel]
    retreats: Retreats
    handle_us: int = field(init=False)
    _is_one_way: bool = field(init=False)

    def __post_init__(self) -> None:
        stroke_us = run_duration_us(self.site.shuttle_reach_mm, self.site.shuttle)
        object.__setattr__(self, "handle_us", 2 * stroke_us + self.site.timing.grip_us + WORK_US)
        object.__setattr__(self, "_is_one_way", any(track.one_way for track in self.site.tracks.values()))

    def best(self, works: Works, start_us: int, *, any_way: bool = False) -> tuple[Trip, RobotModel] | None:
        """The best bid for a task and whose it is; None: nobody can tell it, or, ``any_way``, whatever can be told."""
        roads, nearest, best = self.traffic.roads, next(works()), None
        rest_us = roads.shortest_us(nearest.take, nearest.leave) + 2 * self.handle_us
        bounds = []
        for number, robot in enumerate(self.robots):
            here, ready_us, _ = robot.branch(start_us, roads)
            bounds.append((ready_us + roads.shortest_us(here, nearest.take), number, robot))
        for bound_us, _, robot in sorted(bounds, key=lambda one: one[:2]):
            worst_us = FOREVER if best is None else best[0].bid_us
            if bound_us + rest_us > worst_us:
                break
            trip = self._offer(robot, works, start_us, worst_us, any_way=any_way)
            # Of equal bids the lower node-ID's is the better one.
            if trip is not None and (best is None or (trip.bid_us, robot.node) < (best[0].bid_us, best[1].node)):
                best = trip, robot
        return best

    def renewed(self, robot: RobotModel, work: Work, start_us: int) -> Trip:
        """What a robot really does for a task that it has won."""
        found, _ = self._told(robot, lambda: iter([work]), start_us)
        if found is None:
            with self.retreats.giving_way(robot):
                found, _ = self._told(robot, lambda: iter([work]), start_us, any_way=True)
        assert found is not None, "nobody is in the way for ever"
        return found

    def past_retreats(self, robot: RobotModel, works: Works, start_us: int, best: Trip | None) -> Trip | None:
        """A sooner trip than ``best`` that counts on others' ways back to yield; None without one.

        As in the plant (``CarParkGeneration._past_retreats``): each of them finds another way to a refuge, and together
        they come there later by no more than twice what is gained.
        """
        held = self.retreats.may_yield(robot, start_us)
        if not held or (best is not None and self._is_hardly_delayed(robot, works, start_us, best)):
            return None
        with self.traffic.tried():
            self.retreats.hold_back(held)
            found, _ = self._told(robot, works, start_us)
            if found is None or (best is not None and best.done_us - found.done_us < WORTH_US):
                return None
            self.traffic.give_back(robot.retreat[found.kept :])
            self.traffic.stands_no_more(*robot.resting)
            back = self.retreats.way_back(robot, found.work.leave, found.done_us)
        yielding = self.retreats.met(robot, found, back, held)
        later_us = self.retreats.later_us(robot, found, back, yielding, start_us)
        if later_us is None or (best is not None and 2 * (best.done_us - found.done_us) < later_us):
            return None
        return found._replace(yielding=tuple(yielding))

    def _is_hardly_delayed(self, robot: RobotModel, works: Works, start_us: int, best: Trip) -> bool:
        """Whether nobody is so much in its way that it pays to ask others to yield."""
        roads, (here, ready_us, _) = self.traffic.roads, robot.branch(start_us, self.traffic.roads)
        work = next(works())
        there_us = ready_us + roads.shortest_us(here, work.take)
        taken_us = self._done_us(work.take_ready_us, work.take_door_us, there_us)
        back_us = taken_us + roads.shortest_us(work.take, work.leave)
        return best.done_us - self._done_us(work.leave_ready_us, work.leave_door_us, back_us) < WORTH_US

    # --- one robot's -------------------------------------------------------------------------------------------

    def _offer(self, robot: RobotModel, works: Works, start_us: int, worst_us: int, *, any_way: bool) -> Trip | None:
        """A robot's soonest trip for any of these that it can tell; none after ``worst_us``.

        Where it has none, others' ways back are asked to yield to it, and who rests to give way.
        """
        found, is_late = self._told(robot, works, start_us, worst_us, any_way=any_way)
        if found is None and not is_late:
            found = self.past_retreats(robot, works, start_us, None)
            if found is None:
                with self.retreats.giving_way(robot, start_us + YIELDING_US):
                    found, _ = self._told(robot, works, start_us, any_way=any_way)
        return found

    def _told(
        self, robot: RobotModel, works: Works, start_us: int, worst_us: int = FOREVER, *, any_way: bool = False
    ) -> tuple[Trip | None, bool]:
        """The same around what all plan now, and whether there is one after ``worst_us``.

        Its way back is given up for it, but for what it has begun.
        """
        given_up = robot.retreat[robot.branch(start_us, self.traffic.roads)[2] :]
        self.traffic.give_back(given_up)
        # Which place is the best of all is the same for whoever bids: no bid of another bounds what it costs.
        found, is_late, least_us = None, False, FOREVER if next(works()).cost_us else worst_us
        tries = MOST_PLACES
        for least_cost_us, trip_to in self._trips(robot, works, start_us, through=any_way):
            if least_cost_us > least_us or not tries:
                # From here on no place is sooner.
                is_late = True
                break
            tries -= 1
            trip = trip_to()
            if trip is not None and trip.done_us > worst_us:
                is_late = True
                continue
            is_better = trip is not None and (found is None or trip.cost_us < found.cost_us)
            if trip is not None and is_better and (any_way or self._is_told(robot, trip, start_us)):
                found, least_us = trip, trip.cost_us - 1
                tries = min(tries, MOST_SOONER)
        self.traffic.take(given_up)
        return found, is_late

    def _trips(
        self, robot: RobotModel, works: Works, start_us: int, *, through: bool
    ) -> Iterator[tuple[int, Callable[[], Trip | None]]]:
        """For each of these when it is done at the soonest, with its cost, and the trip, None: nothing leads on.

        ``through`` others that stand, or work, or come by while this robot does; else there may be none at all.
        """
        traffic, (here, ready_us, _) = self.traffic, robot.branch(start_us, self.traffic.roads)
        first = next(works())
        takes = None if through else partial(self._done_us, first.take_ready_us, first.take_door_us)
        ways = traffic.plans(here, ready_us, frozenset((first.take,)), robot.node, takes)
        firsts = [*_next_of(ways)]
        if not firsts:
            return

        def trip_to(work: Work) -> Trip | None:
            """Where nothing leads on from there, the car is taken between other turns of the others."""
            for number in range(MOST_WAYS):
                if number == len(firsts):
                    firsts.extend(_next_of(ways))
                if number == len(firsts):
                    return None
                trip = self._trip(robot, work, firsts[number], start_us, through=through)
                if trip is not None:
                    return trip
            return None

        there_us = arrival_us(firsts[0], ready_us)
        taken_us = self._done_us(first.take_ready_us, first.take_door_us, there_us)
        for work in works():
            soonest_us = taken_us + traffic.roads.shortest_us(work.take, work.leave)
            done_us = self._done_us(work.leave_ready_us, work.leave_door_us, soonest_us)
            yield done_us + work.cost_us, partial(trip_to, work)

    def _trip(
        self, robot: RobotModel, work: Work, first: list[ModelLeg], start_us: int, *, through: bool
    ) -> Trip | None:
        """A trip that comes to the car by a given way."""
        _, ready_us, kept = robot.branch(start_us, self.traffic.roads)
        there_us = arrival_us(first, ready_us)
        taken_us = self._done_us(work.take_ready_us, work.take_door_us, there_us)
        leaves = partial(self._done_us, work.leave_ready_us, work.leave_door_us)
        goals = frozenset((work.leave,))
        second = self.traffic.plan(work.take, taken_us, goals, robot.node, None if through else leaves)
        if second is None:
            return None
        back_us = arrival_us(second, taken_us)
        left_us = leaves(back_us)
        begun_us = [*steps_us(first, ready_us), *work_steps_us(there_us, work.take_ready_us, taken_us)]
        ended_us = [*steps_us(second, taken_us), *work_steps_us(back_us, work.leave_ready_us, left_us)]
        award_us = 0 if ready_us > start_us else BID_AWARD_US
        bid_us = self._bid_us(work, first, there_us + award_us, second, back_us - taken_us)
        times_us = (there_us, taken_us), (back_us, left_us)
        return Trip(left_us, *times_us, first, second, kept, work, [*begun_us, *ended_us], bid_us)

    def _bid_us(
        self, work: Work, first: list[ModelLeg], there_us: int, second: list[ModelLeg], second_takes_us: int
    ) -> int:
        """When a trip is over if all takes as long as plans allow for."""
        there_us += sum(map(_allowed_us, first))
        # Plans allow for the right to reach in with the rest of the work.
        doors_us = [max(0, one - REACH_US) for one in (work.take_door_us, work.leave_door_us)]
        taken_us = self._done_us(work.take_ready_us, doors_us[0], there_us) + BID_WORK_US
        back_us = taken_us + second_takes_us + sum(map(_allowed_us, second))
        return self._done_us(work.leave_ready_us, doors_us[1], back_us) + BID_WORK_US

    def _done_us(self, ready_us: int, door_us: int, there_us: int) -> int:
        """When a car is taken or left by who is there at a time."""
        return max(there_us, ready_us) + door_us + self.handle_us

    def _is_told(self, robot: RobotModel, trip: Trip, start_us: int) -> bool:
        """Whether one itinerary tells a trip with what the robot has in hand, and the way to a refuge behind it."""
        count = len(robot.in_hand_us(start_us, self.traffic.roads)) + len(trip.steps_us)
        if 2 * count < MAX_STEPS and not self._is_one_way:
            # No way to a refuge is longer than all that, where none leads round a floor.
            return True
        back_us = steps_us(self.retreats.way_back(robot, trip.work.leave, trip.done_us), trip.done_us)
        return count + len(back_us) < MAX_STEPS


def _next_of(ways: Iterator[list[ModelLeg]]) -> Iterator[list[ModelLeg]]:
    found = next(ways, None)
    if found is not None:
        yield found


def _allowed_us(leg: ModelLeg) -> int:
    """By how much longer a leg takes in plans."""
    return (BID_RIDE_US if leg.ride is not None else 0) - LEG_US
