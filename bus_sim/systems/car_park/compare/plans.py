"""The best plan of a small case from any situation, proven by branch and bound: which car has the bay next, by whom.

All that is known may be used: a robot goes on to where it is needed before it is called there. From the first moment
with everybody known it is the clairvoyant optimum, as in ``optimum``, whose solver proves it for three cars only.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from heapq import heappop, heappush
from itertools import count
from typing import NamedTuple

from bus_sim.systems.car_park.bounds.bay_order import BayJob, preemptive_ends_us
from bus_sim.systems.car_park.compare.small_case import Case

#: Situations looked at in one search at most, so that it ends; a stored case needs some ten thousand.
MOST_LOOKS = 3_000_000


class Robot(NamedTuple):
    """Where a robot is, or will be, once it has nothing more to do (ms)."""

    at: int
    free_ms: int


class Stored(NamedTuple):
    """A car in a place since ``parked_ms``, asked for at ``asked_ms``; None: nobody is known to."""

    car: int
    place: int
    parked_ms: int
    asked_ms: int | None


class Situation(NamedTuple):
    """How it stands at the bay: when it is free, the robots, the cars in places and those that wait, or will come."""

    bay_ms: int
    robots: tuple[Robot, ...]
    stored: tuple[Stored, ...]
    coming: tuple[int, ...]

    @classmethod
    def of(cls, case: Case) -> "Situation":
        """Before anybody has come, all known."""
        return cls(0, tuple(sorted(Robot(home, 0) for home in case.homes)), (), tuple(range(len(case.visitors))))


class Service(NamedTuple):
    """One car at the bay from ``begin_ms`` to ``end_ms``: its customer is through at ``through_ms``.

    Its robot, one that stood at ``origin``, is needed at ``target`` at ``need_ms`` and stands at ``left_at`` from
    ``done_ms`` on. ``place`` is where the car is put, or was.
    """

    car: int
    fetches: bool
    begin_ms: int
    end_ms: int
    through_ms: int
    place: int
    robot: Robot
    target: int
    need_ms: int
    left_at: int
    done_ms: int


class PlanError(RuntimeError):
    """No optimum was proven within ``MOST_LOOKS``."""


def park(case: Case, now: Situation, car: int, robot: Robot, place: int) -> Service:
    """A car is driven in and put into a place."""
    visitor = case.visitors[car]
    begin_ms = max(visitor.arrival_ms, now.bay_ms)
    out_ms = begin_ms + case.react_ms + visitor.drive_in_ms + visitor.walk_ms
    need_ms = max(robot.free_ms + case.way_ms[robot.at][case.bay], out_ms + case.close_ms)
    taken_ms = need_ms + case.open_ms + case.handle_ms
    parked_ms = taken_ms + case.way_ms[case.bay][place] + case.handle_ms
    end_ms = taken_ms + case.close_ms + case.open_ms
    return Service(car, False, begin_ms, end_ms, out_ms, place, robot, case.bay, need_ms, place, parked_ms)


def fetch(case: Case, now: Situation, stored: Stored, robot: Robot) -> Service:
    """A car that is asked for is brought, and driven out."""
    assert stored.asked_ms is not None, "only who asks has his car fetched"
    visitor = case.visitors[stored.car]
    begin_ms = max(stored.asked_ms, stored.parked_ms, now.bay_ms)
    need_ms = max(robot.free_ms + case.way_ms[robot.at][stored.place], begin_ms + case.close_ms)
    brought_ms = need_ms + 2 * case.handle_ms + case.way_ms[stored.place][case.bay] + case.open_ms
    gone_ms = brought_ms + case.close_ms + case.open_ms + case.react_ms + visitor.drive_out_ms
    place, bay = stored.place, case.bay
    return Service(stored.car, True, begin_ms, gone_ms, gone_ms, place, robot, place, need_ms, bay, brought_ms)


def after(case: Case, now: Situation, one: Service) -> Situation:
    """The situation behind a service."""
    robots = list(now.robots)
    robots.remove(one.robot)
    robots.append(Robot(one.left_at, one.done_ms))
    stored = tuple(other for other in now.stored if other.car != one.car)
    if not one.fetches:
        leaves_ms = case.visitors[one.car].departure_ms
        asked_ms = None if leaves_ms is None else max(leaves_ms, one.through_ms)
        stored = tuple(sorted((*stored, Stored(one.car, one.place, one.done_ms, asked_ms))))
    coming = tuple(car for car in now.coming if car != one.car)
    return Situation(one.end_ms, tuple(sorted(robots)), stored, coming)


class _Ahead(NamedTuple):
    """What is known of a situation: nobody waits less than ``least_ms`` in all; ``spent_ms`` is from asking, or coming.

    Compared by the first, by ``tidy_ms``, by how much is left, and by ``serial``.
    """

    least_ms: int
    tidy_ms: int
    left: int
    serial: int
    spent_ms: int
    now: Situation
    way: tuple[Service, ...]


@dataclass
class CasePlanner:
    """Plans of one case. ``is_tidy``: of plans with equal waiting the one whose robots are done first, all together.

    Who does not know who will ask would else put cars anywhere, as no place is worse for those who are known.
    """

    case: Case
    is_tidy: bool = False
    looks: int = 0
    _nearest_ms: int = field(init=False)
    _twin: list[int] = field(init=False)
    #: A robot that is free so long before the bay is, by where it is, is nowhere too late.
    _early_ms: list[int] = field(init=False)

    def __post_init__(self) -> None:
        case = self.case
        self._nearest_ms = min(case.way_ms[case.bay][place] for place in range(len(case.places)))
        # Places that are as far from everywhere are one another's stead: the lowest that is free will do.
        rows = [case.way_ms[place] for place in range(len(case.places))]
        self._twin = [rows.index(row) for row in rows]
        self._early_ms = [max(row[: len(case.places) + 1]) - case.close_ms for row in case.way_ms]

    def best(self, start: Situation) -> tuple[int, tuple[Service, ...]]:
        """The least waiting from here (ms, of those who still wait or will), and the services that lead to it.

        Raises ``PlanError`` where that takes too long.
        """
        serials, spent_ms = count(), -sum(one.asked_ms or 0 for one in start.stored)
        queue = [_Ahead(0, 0, 0, next(serials), spent_ms, start, ())]
        seen: dict[object, list[tuple[int, ...]]] = {}
        while True:
            one = heappop(queue)
            if not one.now.coming and all(other.asked_ms is None for other in one.now.stored):
                return one.least_ms, one.way
            if self._is_worse(one, seen):
                continue
            for service in self._services(one.now):
                self.looks += 1
                if self.looks > MOST_LOOKS:
                    raise PlanError(f"no optimum proven in {MOST_LOOKS:,} looks")
                heappush(queue, self._ahead(one, service, next(serials)))

    def _ahead(self, before: _Ahead, service: Service, serial: int) -> _Ahead:
        now = after(self.case, before.now, service)
        spent_ms = before.spent_ms + service.through_ms
        if not service.fetches:
            asked_ms = next(one.asked_ms for one in now.stored if one.car == service.car)
            spent_ms -= self.case.visitors[service.car].arrival_ms + (asked_ms or 0)
        least_ms = max(before.least_ms, spent_ms + self._least_ms(now))
        left = 2 * len(now.coming) + len(now.stored)
        tidy_ms = before.tidy_ms + service.done_ms if self.is_tidy else 0
        return _Ahead(least_ms, tidy_ms, left, serial, spent_ms, now, (*before.way, service))

    def _services(self, now: Situation) -> Iterator[Service]:
        """What the bay may do next, each with every robot and place that is not another's stead."""
        taken = {one.place for one in now.stored}
        free = {self._twin[place]: place for place in range(len(self.case.places) - 1, -1, -1) if place not in taken}
        for robot in dict.fromkeys(now.robots):
            for car in now.coming:
                for place in free.values():
                    yield park(self.case, now, car, robot, place)
            for stored in now.stored:
                if stored.asked_ms is not None:
                    yield fetch(self.case, now, stored, robot)

    def _is_worse(self, one: _Ahead, seen: dict[object, list[tuple[int, ...]]]) -> bool:
        """Whether a situation with the same cars in the same places is in all times as early; else it is kept."""
        now = one.now
        stored = tuple((car.car, self._twin[car.place]) for car in now.stored)
        key = now.coming, stored, tuple(robot.at for robot in now.robots)
        ready = (max(car.parked_ms, car.asked_ms or 0, now.bay_ms) for car in now.stored)
        free = (max(robot.free_ms, now.bay_ms - self._early_ms[robot.at]) for robot in now.robots)
        times = one.spent_ms, one.tidy_ms, now.bay_ms, *free, *ready
        others = seen.setdefault(key, [])
        if any(all(a <= b for a, b in zip(other, times, strict=True)) for other in others):
            return True
        others.append(times)
        return False

    def _least_ms(self, now: Situation) -> int:
        """A bound of what is to be added: the bay serves one at a time, and its robot is there at once.

        Who asks for his car before he has the ticket waits from then on. Either all ask later than that, or one of them
        waits for his whole stay at least, and the others as long as they must.
        """
        case, turn_ms = self.case, self.case.close_ms + self.case.open_ms
        jobs, less_ms, alone_ms, whole_ms = [], 0, 0, None
        for stored in now.stored:
            if stored.asked_ms is not None:
                way_ms = case.way_ms[stored.place][case.bay]
                busy_ms = self._fetching_ms(stored.car, way_ms)
                begin_ms = max(stored.asked_ms, stored.parked_ms, now.bay_ms)
                jobs.append(BayJob(max(stored.asked_ms, stored.parked_ms), busy_ms, True))
                alone_ms += begin_ms + busy_ms
        for car in now.coming:
            visitor = case.visitors[car]
            in_ms = case.react_ms + visitor.drive_in_ms + visitor.walk_ms
            behind_ms = 2 * turn_ms + case.handle_ms
            jobs.append(BayJob(visitor.arrival_ms, in_ms + behind_ms, False))
            less_ms += behind_ms + visitor.arrival_ms
            first_ms = max(visitor.arrival_ms, now.bay_ms) + in_ms
            alone_ms += first_ms - visitor.arrival_ms
            if visitor.departure_ms is not None:
                busy_ms = self._fetching_ms(car, self._nearest_ms)
                stored_ms = first_ms + turn_ms + 2 * case.handle_ms + self._nearest_ms
                jobs.append(BayJob(max(visitor.departure_ms, stored_ms), busy_ms, True))
                less_ms += visitor.departure_ms
                out_ms = max(stored_ms, visitor.departure_ms) + busy_ms - max(visitor.departure_ms, first_ms)
                alone_ms += out_ms
                # In and out: from coming to going.
                longer_ms = visitor.departure_ms + busy_ms - visitor.arrival_ms
                more_ms = longer_ms - out_ms - (first_ms - visitor.arrival_ms)
                whole_ms = more_ms if whole_ms is None else min(whole_ms, more_ms)
        jobs.sort()
        together_ms = preemptive_ends_us(jobs, now.bay_ms) - less_ms
        return together_ms if whole_ms is None else min(together_ms, alone_ms + max(0, whole_ms))

    def _fetching_ms(self, car: int, way_ms: int) -> int:
        case = self.case
        doors_ms = 2 * (case.close_ms + case.open_ms)
        return doors_ms + 2 * case.handle_ms + way_ms + case.react_ms + case.visitors[car].drive_out_ms
