"""One demand played under one policy: same plant, same controllers, same planner, in virtual time."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from bus_sim.options import RunOptions
from bus_sim.run import run_until
from bus_sim.systems.car_park.bounds.visits import VisitLog
from bus_sim.systems.car_park.bounds.waiting import WaitBounds
from bus_sim.systems.car_park.compare import obedience
from bus_sim.systems.car_park.compare.dispatcher import Dispatcher
from bus_sim.systems.car_park.compare.policies import AnyFirst, JointChoice, NearestFirst, Policy
from bus_sim.systems.car_park.demand import Demand
from bus_sim.systems.car_park.plant.customer import Customer, VisitOutcome
from bus_sim.systems.car_park.simulation import Simulation, build
from bus_sim.systems.car_park.window import DayWindow
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.config.site import site_digest
from onboard.core.site import Site
from onboard.systems.car_park.site import CarPark, PlacePolicy
from onboard.trace.indicators import Indicators
from onboard.ways.site import way_site

MIP = "MIP, nobody in charge"
#: All policies that can be played, by name; None is our protocol. The joint choice is what others are compared with.
POLICIES: dict[str, Callable[[int], Policy | None]] = {
    MIP: lambda _: None,
    JointChoice.name: lambda _: JointChoice(),
    NearestFirst.name: lambda _: NearestFirst(),
    AnyFirst.name: AnyFirst,
}

#: The run begins so long before the first customer, us: the machines find their places first.
LEAD_US = 10_000_000
#: Whoever waits so long after the last customer's time is not served any more, us.
PATIENCE_US = 2 * 3_600_000_000
#: Looks at whether all is over, us.
STEP_US = 1_000_000
_SENT_AWAY = (VisitOutcome.FULL, VisitOutcome.TOO_LARGE, VisitOutcome.NO_CHARGING)


@dataclass(frozen=True)
class Play:
    """What came of it: waiting times in us, ``left`` customers still waiting at the end, and the bus's figures.

    ``parked_us`` and ``gone_us`` are when the customers of ``in_us`` and ``out_us`` were through, in the demand's time;
    ``refused`` those who were sent away; ``bounds`` what all were to wait at least.
    """

    policy: str
    seed: int
    in_us: tuple[int, ...]
    out_us: tuple[int, ...]
    seconds_s: float
    tasks: int
    travel_mm: int
    empty_mm: int
    messages: float
    left: int
    faults: tuple[str, ...]
    parked_us: tuple[int, ...] = ()
    gone_us: tuple[int, ...] = ()
    refused: int = 0
    bounds: WaitBounds = field(default_factory=WaitBounds)
    #: The choice of places, where several are compared; else empty.
    place: str = ""


def play(site: Site, demand: Demand, policy: str, seed: int, window: DayWindow | None = None) -> Play:
    """Play a demand to its end, or to the end of a window, whose customers alone count and are still served.

    Raises ``KeyError`` for a policy that is not in ``POLICIES``.
    """
    loop = VirtualTimeLoop()
    try:
        asyncio.set_event_loop(loop)
        return loop.run_until_complete(_Run(site, demand, policy, seed, window, loop).play())
    finally:
        asyncio.set_event_loop(None)
        loop.close()


class Wanted(NamedTuple):
    """What is to be played, as one value that another process can be sent."""

    site: CarPark
    demand: Demand
    policy: str
    seed: int
    window: DayWindow | None = None
    #: By which the site chooses places, where several are compared; empty: by its own.
    place: str = ""


def play_wanted(wanted: Wanted) -> Play:
    """Play what was wanted to its end; raises ``KeyError`` as ``play`` does."""
    site = wanted.site
    if wanted.place:
        site = replace(site, place=PlacePolicy(wanted.place))
        site = replace(site, digest=site_digest(site))
    found = play(site, wanted.demand, wanted.policy, wanted.seed, wanted.window)
    return replace(found, place=wanted.place)


class _Run:
    def __init__(
        self, site: Site, demand: Demand, policy: str, seed: int, window: DayWindow | None, loop: VirtualTimeLoop
    ) -> None:
        self._policy, self._seed, self._window, self._demand = policy, seed, window, demand
        self._origin_us = LEAD_US - min((stay.arrival_us for stay in demand.stays), default=0)
        self._loop = loop
        self._indicators = Indicators(site)
        self._simulation = build(site, RunOptions(seed=seed), loop)
        self._simulation.observers.append(self._indicators.feed)
        self._visits = VisitLog(self._simulation.plant, seed)

    async def play(self) -> Play:
        """The whole run."""
        simulation, policy = self._simulation, POLICIES[self._policy](self._seed)
        simulation.plant.street.add_all(self._demand, self._origin_us)
        if policy is None:
            simulation.start()
        else:
            simulation.factories = obedience.factories
            simulation.start()
            Dispatcher(simulation, policy, obedience.install(simulation))
        begin_us = 0
        if self._window is not None:
            begin_us = self._window.begin_us + self._origin_us
            await self._until(begin_us)
            self._indicators.begin(self._loop.now_us())
        await self._to_the_end()
        visits = self._told(begin_us)
        for controller in simulation.controllers.values():
            await controller.stop()
        return visits

    async def _until(self, limit_us: int, done: Callable[[], bool] = lambda: False) -> None:
        await run_until(self._simulation, done, limit_us, STEP_US)

    async def _to_the_end(self) -> None:
        times = [stay.departure_us or stay.arrival_us for stay in self._demand.stays]
        last_us = self._window.end_us if self._window is not None else max(times, default=0)
        if self._window is not None:
            await self._until(last_us + self._origin_us)
        await self._until(last_us + self._origin_us + PATIENCE_US, lambda: not self._waiting())

    def _counts(self, moment_us: int | None) -> bool:
        """Whether somebody who came, or asked, at a loop time is among those measured."""
        if moment_us is None or self._window is None:
            return moment_us is not None
        return self._window.begin_us <= moment_us - self._origin_us < self._window.end_us

    def _waiting(self) -> int:
        """Customers who are to come yet, or wait."""
        if self._window is None:
            return 0 if self._simulation.plant.street.is_over else len(_waiting(self._simulation)) or 1
        return sum(
            self._counts(one.visit.arrived_us if one.visit.asked_us is None else one.visit.asked_us)
            for one in _waiting(self._simulation)
        )

    def _told(self, begin_us: int) -> Play:
        simulation, now_us = self._simulation, self._loop.now_us()
        fleet = self._indicators.figures(now_us)
        visits = [one.visit for one in simulation.plant.street.customers]
        parked = [one for one in visits if one.in_wait_us is not None and self._counts(one.arrived_us)]
        served = [one for one in visits if one.outcome is VisitOutcome.SERVED and self._counts(one.asked_us)]
        faults = [str(violation) for violation in simulation.plant.oracle.finish()]
        faults += [
            f"{controller.holon.machine.name} halted: {controller.holon.halted}"
            for controller in simulation.controllers.values()
            if controller.holon.halted is not None
        ]
        return Play(
            self._policy,
            self._seed,
            tuple(one.in_wait_us for one in parked if one.in_wait_us is not None),
            tuple(one.out_wait_us for one in served if one.out_wait_us is not None),
            (now_us - begin_us) / 1e6,
            fleet.tasks,
            fleet.robots_travel_mm,
            fleet.robots_empty_mm,
            fleet.messages_per_task * fleet.tasks,
            self._waiting(),
            tuple(faults),
            tuple(one.parked_us - self._origin_us for one in parked if one.parked_us is not None),
            tuple(one.gone_us - self._origin_us for one in served if one.gone_us is not None),
            sum(one.outcome in _SENT_AWAY for one in visits),
            WaitBounds.of(way_site(simulation.site), self._visits.visits(self._counts)),
        )


def _waiting(simulation: Simulation) -> list[Customer]:
    """Customers who came, or came back, and are not through."""
    return [
        one
        for one in simulation.plant.street.customers
        if one.visit.outcome is VisitOutcome.STAYING
        and one.visit.arrived_us is not None
        and (one.visit.parked_us is None or one.visit.asked_us is not None)
    ]
