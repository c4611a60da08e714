"""When a customer's car will be there: told once to each who asks, with an interval that nine of ten are in.

Who has nobody before them is told with the award: when the winner has done its work at the bay, and what it took from
there lately. Who is in a queue is told when the bay is done with what it has in hand by the winners' plans, and what
each car behind that took lately. Both are learned by this compartment alone, in memory (``Calibration``), from cases
alike; before anything is known, the site's own constants say it.
"""

from collections import deque
from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple

from onboard.contract.car_park import Promise
from onboard.contract.codes import LegAction, Operation
from onboard.contract.messages import Reference
from onboard.core.effects import Effect, Send
from onboard.core.serial import from_bus_ms, to_bus_ms
from onboard.systems.car_park.bay_calls import BayCalls
from onboard.systems.car_park.bay_generation import BayGeneration
from onboard.systems.car_park.bay_task import BayPhase, BayTask
from onboard.systems.car_park.calibration import Calibration, WaitInterval
from onboard.systems.car_park.outputs import BayOutputs
from onboard.systems.car_park.site import CarPark

#: Who asks is told within this, us: with nobody before them the bay is locked for who asks, and an award made, in
#: three and a half seconds at the defaults (``QUEUED_US``, ``call_window_ms``). A person has just put the ticket away.
TOLD_US = 4_000_000
#: Intervals are told in steps of this to both sides, us, at least one and at most 255 of them (dbc/car_park.dbc).
STEP_US = 500_000
MOST_STEPS = 255
#: What one car takes a bay, before anything is known, in times of its doors, shuttle and driver: its robot is there
#: before the bay is ready for it, or comes from the other end of the site and has to wait for others.
LEAST_CYCLES, MOST_CYCLES = 1, 4
#: The output door behind a robot that is done, before anything is known, in times of its way.
MOST_DOORS = 2


class PromiseCase(Enum):
    """What was known of a car when it was promised: its robot is ALONE, or others work too; or so many are before it.

    Of four and more each is taken to take as long as of three.
    """

    ALONE = 0
    AMONG_OTHERS = -1
    BEHIND_ONE = 1
    BEHIND_TWO = 2
    BEHIND_MORE = 3


class Expected(NamedTuple):
    """What a promise was made from, and what it said: the car is there within ``spread_us`` of ``ready_us``.

    From ``from_us`` on ``times`` cars, or this one alone, take a while each. All bus us.
    """

    case: PromiseCase
    times: int
    from_us: int
    ready_us: int
    spread_us: int

    def each_us(self, there_us: int) -> int:
        """What each took, where the car is there at this time."""
        return (there_us - self.from_us) // self.times

    def is_kept(self, there_us: int) -> bool:
        """Whether that is within what was said."""
        return abs(there_us - self.ready_us) <= self.spread_us


@dataclass
class AskedCar:
    """Somebody who waits for a car: since when, bus us, and what was said; ``is_over``: it is there, or never was."""

    since_us: int
    said: Expected | None = None
    is_over: bool = False


@dataclass
class Promises:
    """One compartment's promises. ``tickets`` are those that its bay serves."""

    park: CarPark
    generation: BayGeneration
    calls: BayCalls
    tickets: deque[Reference]
    outputs: BayOutputs
    waiting: dict[Reference, AskedCar] = field(default_factory=dict)
    _learned: dict[PromiseCase, Calibration] = field(
        default_factory=lambda: {case: Calibration() for case in PromiseCase}
    )

    def __post_init__(self) -> None:
        # Who asked before this life began was told then, if ever: what is told once is not told otherwise.
        cars = self._asked_for() if self.park.promises else []
        self.waiting = {car: AskedCar(0, is_over=True) for car in cars}

    def review(self, phase: BayPhase, now_us: int) -> list[Effect]:
        """Tell who has asked, as soon as there is something to tell; and learn from a car that is there."""
        self.waiting = {car: self.waiting.get(car, AskedCar(now_us)) for car in self._asked_for()}
        job = self.calls.job
        if phase is BayPhase.HANDOVER and job is not None and job.car in self.waiting:
            self._is_there(self.waiting[job.car], now_us)
        is_after_driver = phase is not BayPhase.HANDOVER and job is not None and job.operation is Operation.RETRIEVE
        # When its robot may come to the bay is a guess while a driver is yet to come to his car before.
        guessed = self.calls.ahead.car if is_after_driver and self.calls.ahead is not None else None
        return [
            effect
            for car, one in self.waiting.items()
            for effect in self._tell(car, one, now_us, is_guessed=car == guessed)
        ]

    def next_wake(self) -> int | None:
        """When somebody has waited long enough to be told what can be told."""
        untold = [one.since_us + TOLD_US for one in self.waiting.values() if one.said is None and not one.is_over]
        return min(untold, default=None)

    def statements(self) -> list[Effect]:
        """What was promised and has not come yet, for whoever was away."""
        return [Send(self._word(car, one.said)) for car, one in self.waiting.items() if one.said and not one.is_over]

    def _asked_for(self) -> list[Reference]:
        return [*(task.car for task in self._fetched()), *self.tickets]

    def _fetched(self) -> list[BayTask]:
        return [task for task in self.calls.in_hand() if task.operation is Operation.RETRIEVE]

    def _is_there(self, one: AskedCar, now_us: int) -> None:
        if one.said is not None and not one.is_over:
            self._learned[one.said.case].learn(one.said.each_us(now_us), is_kept=one.said.is_kept(now_us))
        one.is_over = True

    def _tell(self, car: Reference, one: AskedCar, now_us: int, *, is_guessed: bool) -> list[Effect]:
        if one.said is not None or one.is_over:
            return []
        mine = next((task for task in self._fetched() if task.car == car), None)
        done_us = None if is_guessed else self.calls.done_at_us(mine, now_us)
        if mine is not None and done_us is not None:
            case = PromiseCase.AMONG_OTHERS if self._is_work_of_others(mine.winner, now_us) else PromiseCase.ALONE
            constants = WaitInterval(0, MOST_DOORS * self.park.timing.door_us)
            one.said = self._expected(case, 1, done_us, constants)
        elif now_us >= one.since_us + TOLD_US:
            one.said = self._behind(car, now_us)
        else:
            return []
        return [
            Send(self._word(car, one.said)),
            self.outputs.promise(car, one.said.ready_us, one.said.spread_us, now_us),
        ]

    def _is_work_of_others(self, winner: int, now_us: int) -> bool:
        """Whether anybody else has something to do by its plan: that may be in the way."""
        plans = self.calls.fleet.mirror.itineraries.items()
        works = [leg for node, plan in plans if node != winner for leg in plan.legs if leg.action is LegAction.WORK]
        return any(from_bus_ms(leg.end_ms, now_us) > now_us for leg in works)

    def _behind(self, car: Reference, now_us: int) -> Expected:
        """Behind what the bay has in hand, and the tickets before this one."""
        others = [task for task in self.calls.in_hand() if task.car != car or task.operation is Operation.PARK]
        known = [self.calls.done_at_us(task, now_us) for task in others]
        times = 1 + known.count(None) + (self.tickets.index(car) if car in self.tickets else 0)
        from_us = max([now_us, *(one for one in known if one is not None)])
        cycle_us = self.generation.cycle_us()
        constants = WaitInterval(LEAST_CYCLES * cycle_us, MOST_CYCLES * cycle_us)
        return self._expected(PromiseCase(min(times, PromiseCase.BEHIND_MORE.value)), times, from_us, constants)

    def _expected(self, case: PromiseCase, times: int, from_us: int, constants: WaitInterval) -> Expected:
        """Steps that are more than the interval are told before it: the car comes no later than learned.

        Of one that is wider than can be told, what lies about the median is told.
        """
        learned = self._learned[case]
        low_us, high_us = (from_us + times * end_us for end_us in learned.interval(constants))
        steps = min(max(1, -((low_us - high_us) // (2 * STEP_US))), MOST_STEPS)
        ready_us = min(high_us - steps * STEP_US, (low_us + high_us) // 2)
        middle_us = learned.middle_us()
        if middle_us is not None and 2 * steps * STEP_US < high_us - low_us:
            ready_us = max(low_us + steps * STEP_US, min(from_us + times * middle_us, ready_us))
        return Expected(case, times, from_us, ready_us // 1000 * 1000, steps * STEP_US)

    def _word(self, car: Reference, said: Expected) -> Promise:
        return Promise(self.outputs.node_id, car, to_bus_ms(said.ready_us), said.spread_us // 1000)
