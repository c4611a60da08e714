"""What a second offer could gain: is another robot through sooner with a task that was awarded and is not begun?

Run: ``python bench/second_offer.py [SITE [MEAN SIGMA CARS [SEEDS [WHO]]]]``, by default 12 cars at 30 +- 15 s on
``standard``, seed 1. WHO decides is a row of ``bus-sim compare``: ``random`` shows what is found where the wrong robots
are chosen.

Nothing is changed in the run. Every ``LOOK_US`` each other robot's own planner is asked when it would be through with
each such task if it were called now, and that is held against what the winner plans:

- "as planned": around all plans as they are, which is what a bidder sees;
- "without the task": around the winner's plan made anew without it, as it would be once the task had moved;
- "without the winner": as if that were not on the site, which is more than anybody can have.

Of each task the most that any look found counts. Virtual time: the figures are the same on every machine.
"""

import asyncio
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import NamedTuple

from bench._arguments import a_count, a_site, given
from bus_sim.options import RunOptions
from bus_sim.run import run_until
from bus_sim.sites import find_site
from bus_sim.systems.car_park.compare import obedience
from bus_sim.systems.car_park.compare.dispatcher import Dispatcher
from bus_sim.systems.car_park.compare.plays import MIP, POLICIES
from bus_sim.systems.car_park.demand import Demand
from bus_sim.systems.car_park.simulation import Simulation, build
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.contract.codes import Grade
from onboard.contract.messages import CallForProposals, Reference
from onboard.core.serial import from_bus_ms, to_bus_ms
from onboard.core.site import Site
from onboard.systems.car_park.compartment import Compartment
from onboard.systems.car_park.program import standing_itinerary, to_itinerary
from onboard.systems.car_park.robot import ParkingRobot
from onboard.ways.occupancy import itinerary_windows, lift_uses
from onboard.ways.reservations import Reservations
from onboard.ways.told_way import BegunItinerary

#: Customers come this long after power-up, us; a run that takes longer has got stuck.
ORIGIN_US, LIMIT_US = 10_000_000, 4 * 3_600_000_000
#: Between two looks, us.
LOOK_US = 5_000_000
#: Sooner by less than this is no reason to call again, us: a call alone takes a second.
WORTH_US = 5_000_000
#: A call number that no call of the run has: a robot's own bids are told apart by it.
NO_CALL = 0xFFFF


class Around(Enum):
    """What the other robots plan around."""

    AS_PLANNED = "as planned"
    WITHOUT_TASK = "without the task"
    WITHOUT_WINNER = "without the winner"


class Waiting(NamedTuple):
    """A task that was awarded and is not begun: the call that its winner won, and when that is through, bus us."""

    winner: ParkingRobot
    call: CallForProposals
    promised_us: int


@dataclass
class Probe:
    """Looks at one run; ``gains_us`` has for each task and case how much sooner another could be through at most."""

    simulation: Simulation
    gains_us: dict[tuple[Reference, Around], int] = field(default_factory=dict)
    tasks: set[Reference] = field(default_factory=set)
    _due_us: int = 0

    def look(self) -> None:
        """Every ``LOOK_US`` of virtual time."""
        loop_us = self.simulation.loop.now_us()
        if loop_us < self._due_us:
            return
        self._due_us = loop_us + LOOK_US
        now_us = max(one.holon.clock.bus_us(loop_us) for one in self.simulation.controllers.values())
        for waiting in self._waiting():
            self.tasks.add(waiting.call.task)
            self._ask_others(waiting, now_us)

    def _robots(self) -> Iterator[ParkingRobot]:
        for controller in self.simulation.controllers.values():
            behaviour = controller.holon.behaviour
            if isinstance(behaviour, ParkingRobot) and behaviour.starting.is_over:
                yield behaviour

    def _waiting(self) -> Iterator[Waiting]:
        robots = {robot.fleet.node_id: robot for robot in self._robots()}
        bays = [one.holon.behaviour for one in self.simulation.controllers.values()]
        for task in [task for bay in bays if isinstance(bay, Compartment) for task in bay.calls.in_hand()]:
            winner = robots.get(task.winner)
            if winner is None or task.task not in winner.going_around.untouched():
                continue
            steps = [one for one in winner.program.remaining if one.work and one.work.call.task == task.task]
            if len(steps) == 2 and steps[0].work is not None:
                yield Waiting(winner, steps[0].work.call, steps[-1].end_us)

    def _ask_others(self, waiting: Waiting, now_us: int) -> None:
        call = _called_now(waiting.call, now_us)
        plan = _plan_without(waiting, now_us)
        for robot in self._robots():
            if robot is waiting.winner or robot.generation.lower_bound(call, now_us) is None:
                continue
            for case in Around:
                if case is Around.WITHOUT_TASK and plan is None:
                    continue
                around = _reservations(robot, waiting.winner.fleet.node_id, case, plan, now_us)
                finish_us = _through_us(robot, call, around, now_us)
                if finish_us is not None:
                    key, sooner_us = (call.task, case), waiting.promised_us - finish_us
                    self.gains_us[key] = max(self.gains_us.get(key, 0), sooner_us)


def _called_now(call: CallForProposals, now_us: int) -> CallForProposals:
    """The same call, opened now; the bay can take the car when it could."""
    ready_us = from_bus_ms(call.deadline_ms, now_us) + call.ready_ms * 1_000
    deadline_us = now_us + 1_000_000
    ready_ms = max(1, (ready_us - deadline_us) // 1_000)
    return replace(call, call=NO_CALL, deadline_ms=to_bus_ms(deadline_us), ready_ms=ready_ms)


def _through_us(robot: ParkingRobot, call: CallForProposals, around: Reservations, now_us: int) -> int | None:
    """When a robot would be through with a call if that were all that is reserved; None where it finds no way."""
    mirror = robot.generation.mirror
    real, mirror.reservations = mirror.reservations, around
    try:
        found, _ = robot.generation.solve(call, now_us)
    finally:
        mirror.reservations = real
    return None if found is None else found.finish_us


def _plan_without(waiting: Waiting, now_us: int) -> BegunItinerary | None:
    """What the winner would do without the task; None where it finds no way."""
    winner, task = waiting.winner, waiting.call.task
    works = [work for work in winner.program.works() if work.call.task != task]
    kept, origin, start_us = winner.going_around.turning([task], now_us)
    begun = [step.work for step in winner.program.remaining[:kept]]
    steps = winner.generation.reroute(origin, start_us, [work for work in works if work not in begun], now_us)
    if steps is None:
        return None
    node, stamp, whole = winner.fleet.node_id, winner.program.stamp, [*winner.program.remaining[:kept], *steps]
    if not whole:
        return BegunItinerary(standing_itinerary(node, 1, stamp, origin, start_us), start_us)
    return BegunItinerary(to_itinerary(node, 1, Grade.FIRM, stamp, whole), whole[0].begin_us)


def _reservations(
    robot: ParkingRobot, winner: int, case: Around, plan: BegunItinerary | None, now_us: int
) -> Reservations:
    found = robot.fleet.mirror.reservations.copy()
    if case is not Around.AS_PLANNED:
        found.release(winner)
    if case is Around.WITHOUT_TASK and plan is not None:
        told = robot.fleet.site, plan.itinerary, now_us, plan.first_begin_us
        found.reserve(winner, itinerary_windows(*told), lift_uses(*told))
    return found


async def _play(site: Site, demand: Demand, who: str, seed: int, loop: VirtualTimeLoop) -> Probe:
    simulation, policy = build(site, RunOptions(seed=seed), loop), POLICIES[who](seed)
    probe, street = Probe(simulation), simulation.plant.street
    street.add_all(demand, ORIGIN_US)
    if policy is not None:
        simulation.factories = obedience.factories
    simulation.start()
    if policy is not None:
        Dispatcher(simulation, policy, obedience.install(simulation))

    def is_over() -> bool:
        probe.look()
        return street.is_over

    await run_until(simulation, is_over, LIMIT_US, 1_000_000)
    for controller in simulation.controllers.values():
        await controller.stop()
    return probe


def probed(site: Site, interval_s: tuple[float, float], cars: int, who: str, seed: int) -> Probe:
    """One run to its end, looked at as it went."""
    loop = VirtualTimeLoop()
    try:
        asyncio.set_event_loop(loop)
        demand = Demand.by_mean(*interval_s, seed, count=cars)
        return loop.run_until_complete(_play(site, demand, who, seed, loop))
    finally:
        asyncio.set_event_loop(None)
        loop.close()


def main() -> None:
    """One row for each case and seed."""
    words = given(
        site=(a_site, "standard"), mean=(float, 30.0), sigma=(float, 15.0), cars=(a_count, 12), seeds=(a_count, 1),
        who=(str, MIP),
    )  # fmt: skip
    name, mean, sigma, cars, seeds, who = words.site, words.mean, words.sigma, words.cars, words.seeds, words.who
    interval_s = mean, sigma
    print(f"{name}: {cars} cars in and out, intervals {mean:g} s +- {sigma:g} s; {who}\n")
    print("| seed | the others plan | tasks that waited | sooner by 5 s or more | together, s | a task of all, s |")
    print("|---|---|---|---|---|---|")
    for seed in range(1, 1 + seeds):
        probe = probed(find_site(name), interval_s, cars, who, seed)
        for case in Around:
            gains = [us for (_, one), us in probe.gains_us.items() if one is case and us >= WORTH_US]
            total_s = sum(gains) / 1e6
            mean_s = total_s / (2 * cars)
            print(
                f"| {seed} | {case.value} | {len(probe.tasks)} | {len(gains)} | {total_s:.0f} | {mean_s:.2f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
