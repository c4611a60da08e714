"""A small case solved anew whenever somebody comes or asks: the best that can be done without knowing beforehand.

Each plan is the proven optimum of what is known by then (``plans``), and of equal ones the one whose robots are done
first. What has begun stays: a car whose bay time has begun goes on as planned, and a robot that has set off for another
goes there, as late as the plan allows; from there it may be sent elsewhere. All in the model's own times: plans and
words take none.
"""

from dataclasses import replace

from bus_sim.systems.car_park.compare.plans import CasePlanner, Robot, Service, Situation, after
from bus_sim.systems.car_park.compare.small_case import Case


def resolved_waiting_ms(case: Case) -> int:
    """The customers' total waiting (ms). Raises ``PlanError`` where one of the optima takes too long to prove."""
    return _Day(case).waiting_ms()


class _Day:
    """A case as it goes on; of who will ask when, only this knows."""

    def __init__(self, case: Case) -> None:
        self._case = case
        #: What is known: nobody has said when the car will be fetched.
        self._known = replace(case, visitors=tuple(one._replace(departure_ms=None) for one in case.visitors))
        self._now = Situation.of(case)._replace(coming=())
        self._comes = {number: one.arrival_ms for number, one in enumerate(case.visitors)}
        self._asks: dict[int, int] = {}
        self._waited_ms = 0

    def waiting_ms(self) -> int:
        """All plans one after the other."""
        while self._comes or self._asks:
            self._hear(min([*self._comes.values(), *self._asks.values()]))
            _, plan = CasePlanner(self._known, is_tidy=True).best(self._now)
            self._carry_out(plan)
        return self._waited_ms

    def _hear(self, moment_ms: int) -> None:
        """Who comes and who asks now; from now on the bay may begin, and robots set off."""
        now = self._now
        came = [number for number, comes_ms in self._comes.items() if comes_ms == moment_ms]
        asked = [number for number, asks_ms in self._asks.items() if asks_ms == moment_ms]
        stored = tuple(one._replace(asked_ms=moment_ms) if one.car in asked else one for one in now.stored)
        robots = tuple(sorted(Robot(one.at, max(one.free_ms, moment_ms)) for one in now.robots))
        self._now = Situation(max(now.bay_ms, moment_ms), robots, stored, tuple(sorted((*now.coming, *came))))
        for number in came:
            del self._comes[number]
        for number in asked:
            del self._asks[number]

    def _carry_out(self, plan: tuple[Service, ...]) -> None:
        """What begins before something new is heard, and whose robot sets off before."""
        for at, service in enumerate(plan):
            if self._is_later(service.begin_ms):
                self._send_ahead(plan[at:])
                return
            visitor = self._case.visitors[service.car]
            since_ms = visitor.arrival_ms
            if service.fetches:
                since_ms = next(one.asked_ms or 0 for one in self._now.stored if one.car == service.car)
            elif visitor.departure_ms is not None:
                self._asks[service.car] = max(visitor.departure_ms, service.through_ms)
            self._waited_ms += service.through_ms - since_ms
            self._now = after(self._known, self._now, service)

    def _send_ahead(self, plan: tuple[Service, ...]) -> None:
        idle = list(self._now.robots)
        for service in plan:
            if service.robot in idle:
                idle.remove(service.robot)
                way_ms = self._case.way_ms[service.robot.at][service.target]
                leaves_ms = max(service.robot.free_ms, service.need_ms - way_ms)
                is_later = self._is_later(leaves_ms)
                there = service.robot if is_later else Robot(service.target, leaves_ms + way_ms)
                robots = list(self._now.robots)
                robots.remove(service.robot)
                self._now = self._now._replace(robots=tuple(sorted((*robots, there))))

    def _is_later(self, moment_ms: int) -> bool:
        return any(moment_ms >= heard_ms for heard_ms in (*self._comes.values(), *self._asks.values()))
