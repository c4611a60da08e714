"""Where the time of an overloaded car park goes: that of its bays, of its robots, and who brings the next car.

Run: ``python bench/overload.py [SITE [MEAN SIGMA CARS [SEED]]]``, by default 30 cars at 15 +- 5 s on ``standard``, seed
1.

Nothing is changed in the run: it is looked at each half second, from the 10th car that was in or out to the last but
ten. What a bay waits for is told by what the robot does that has won its task; ``before`` is a task that this one has
first. Virtual time: the figures are the same on every machine.
"""

import asyncio
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from bench._arguments import a_count, a_site, given
from bus_sim.options import RunOptions
from bus_sim.run import run_until
from bus_sim.sites import find_site
from bus_sim.systems.car_park.demand import Demand
from bus_sim.systems.car_park.simulation import Simulation, build
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.contract.codes import LegAction, Operation
from onboard.core.site import Site
from onboard.systems.car_park.bay_task import BayPhase
from onboard.systems.car_park.compartment import Compartment
from onboard.systems.car_park.program import CarHandling
from onboard.systems.car_park.robot import ParkingRobot
from onboard.ways.site import TrackKind

#: Customers come this long after power-up, us; a run that takes longer has got stuck; between two looks.
ORIGIN_US, LIMIT_US, LOOK_US = 10_000_000, 6 * 3_600_000_000, 500_000
#: So many cars at the beginning and at the end are left out: the park fills, and empties.
EDGE = 10
#: Less than this of the time is not told.
LEAST_SHARE = 0.003


class Look(NamedTuple):
    """One moment: what each bay does, by its node, and what each robot does."""

    at_us: int
    bays: dict[int, str]
    robots: tuple[str, ...]


@dataclass
class Probe:
    """Looks at one run.

    ``brought``: of each car that an empty bay waited for when its robot came, whether that had parked the one before,
    and for how long the bay had waited; all times in us.
    """

    simulation: Simulation
    looks: list[Look] = field(default_factory=list)
    brought: list[tuple[int, bool, int]] = field(default_factory=list)
    _parker: dict[int, int] = field(default_factory=dict)
    _empty_us: dict[int, int] = field(default_factory=dict)

    def look(self) -> None:
        """Called every ``LOOK_US`` of virtual time."""
        behaviours = [controller.holon.behaviour for controller in self.simulation.controllers.values()]
        robots = {one.fleet.node_id: one for one in behaviours if isinstance(one, ParkingRobot)}
        bays = [one for one in behaviours if isinstance(one, Compartment)]
        now_us = self.simulation.loop.now_us()
        told = {bay.fleet.node_id: _bay_does(bay, robots) for bay in bays}
        self.looks.append(Look(now_us, told, tuple(_robot_does(one) for one in robots.values())))
        for bay in bays:
            self._follow(bay, now_us)

    def _follow(self, bay: Compartment, now_us: int) -> None:
        node, job = bay.fleet.node_id, bay.job
        if job is None:
            return
        if job.operation is Operation.PARK:
            self._empty_us.pop(node, None)
            self._parker[node] = job.winner
        elif bay.phase is BayPhase.AWAITING:
            self._empty_us.setdefault(node, now_us)
        elif bay.phase is BayPhase.OPENING and node in self._empty_us:
            waited_us = now_us - self._empty_us.pop(node)
            self.brought.append((now_us, job.winner == self._parker.pop(node, 0), waited_us))


def _bay_does(bay: Compartment, robots: dict[int, ParkingRobot]) -> str:
    job, phase = bay.job, bay.phase
    if job is None or phase is BayPhase.ENTERING:
        return phase.value
    told = f"{phase.value} {'in' if job.operation is Operation.PARK else 'out'}"
    if phase not in (BayPhase.AWAITING, BayPhase.LOCKING):
        return told
    if job.winner not in robots:
        return f"{told}, nobody won it"
    works = robots[job.winner].program.works()
    before = "" if works and works[0].call.task == job.task else "before: "
    return f"{told}, {before}{_robot_does(robots[job.winner])}"


def _robot_does(robot: ParkingRobot) -> str:
    works, step = robot.program.works(), robot.program.step
    site = robot.generation.site
    if not works:
        kind = "nothing to do" if step is None else "way back"
    else:
        is_bay = works[0].station in site.compartments.values()
        there = "bay" if is_bay else "place"
        kind = f"{'empty' if works[0].handling is CarHandling.TAKE else 'loaded'} to {there}"
    if step is None:
        return kind
    if step.work is not None:
        return f"{kind}, {'shuttle' if robot.shuttle.is_out else 'waits at it'}"
    if step.action is LegAction.RIDE:
        return f"{kind}, rides"
    slot = robot.carriage.blocked
    if slot is not None:
        track = site.tracks.get(slot.track)
        return f"{kind}, waits for {'a lift' if track is None or track.kind is TrackKind.LIFT else 'a slot'}"
    return f"{kind}, {'stands by its plan' if step.action is LegAction.STAND else 'drives'}"


async def _play(site: Site, demand: Demand, seed: int, loop: VirtualTimeLoop) -> Probe:
    simulation = build(site, RunOptions(seed=seed), loop)
    probe, street = Probe(simulation), simulation.plant.street
    street.add_all(demand, ORIGIN_US)
    simulation.start()

    def is_over() -> bool:
        probe.look()
        return street.is_over

    await run_until(simulation, is_over, LIMIT_US, LOOK_US)
    for controller in simulation.controllers.values():
        await controller.stop()
    return probe


def probed(site: Site, interval_s: tuple[float, float], cars: int, seed: int) -> Probe:
    """One run to its end, looked at as it went."""
    return played(site, Demand.by_mean(*interval_s, seed, count=cars), seed)


def played(site: Site, demand: Demand, seed: int) -> Probe:
    """The same of any demand."""
    loop = VirtualTimeLoop()
    try:
        asyncio.set_event_loop(loop)
        return loop.run_until_complete(_play(site, demand, seed, loop))
    finally:
        asyncio.set_event_loop(None)
        loop.close()


def _table(head: str, seen: Counter[str], tasks: int) -> Iterator[str]:
    """Rows of what ``head`` did, as a share of all that was seen and as seconds a task of all its machines."""
    yield f"\n| {head} | share | s a task |"
    yield "|---|---|---|"
    total = seen.total()
    for what, times in seen.most_common():
        if times >= LEAST_SHARE * total:
            yield f"| {what} | {times / total:.1%} | {times * LOOK_US / 1e6 / tasks:.1f} |"


def lines(probe: Probe) -> Iterator[str]:
    """The tables of one run."""
    visits = [customer.visit for customer in probe.simulation.plant.street.customers]
    ends = sorted(us for visit in visits for us in (visit.parked_us, visit.gone_us) if us is not None)
    tasks = len(ends) - 2 * EDGE
    if tasks < 1:
        yield f"{len(ends)} cars were in or out: too few to tell"
        return
    begin_us, end_us = ends[EDGE - 1], ends[-EDGE - 1]
    span_s = (end_us - begin_us) / 1e6
    looks = [look for look in probe.looks if begin_us <= look.at_us < end_us]
    yield f"{tasks * 3600 / span_s:.1f} tasks an hour between the {EDGE}th and the last but {EDGE}"
    yield from _table("a bay", Counter(what for look in looks for what in look.bays.values()), tasks)
    yield from _table("a robot", Counter(what for look in looks for what in look.robots), tasks)
    yield "\n| the next car comes with | cars | the empty bay waits, s |"
    yield "|---|---|---|"
    for is_same, who in ((True, "the robot that parks the one before"), (False, "another")):
        waits = [us for at_us, same, us in probe.brought if same is is_same and begin_us <= at_us < end_us]
        yield f"| {who} | {len(waits)} | {sum(waits) / 1e6 / len(waits) if waits else 0:.1f} |"


def main() -> None:
    """Play one overloaded run and print its tables: tasks an hour, bays, robots, and who brings the next car."""
    words = given(
        site=(a_site, "standard"), mean=(float, 15.0), sigma=(float, 5.0), cars=(a_count, 30), seed=(a_count, 1)
    )
    print(f"{words.site}: {words.cars} cars in and out, {words.mean:g} +- {words.sigma:g} s, seed {words.seed}\n")
    for line in lines(probed(find_site(words.site), (words.mean, words.sigma), words.cars, words.seed)):
        print(line)


if __name__ == "__main__":
    main()
