"""One trial: a scenario is played to its end, and judged first for safety, then for what became of its customers."""

import asyncio
from collections import Counter
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from bus_sim.can.faults import Fault
from bus_sim.faults.arm import arm, frame_faults
from bus_sim.faults.scenario import Scenario
from bus_sim.plant.customer import Outcome, State
from bus_sim.plant.street import Street
from bus_sim.run import RunOptions, Simulation, build, run_until
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.core.site import Site

#: Customers come so long after power-up, us.
ORIGIN_US = 10_000_000
#: Looks whether it is over, us.
STEP_US = 1_000_000
#: A wait that is longer than the same run's longest without faults by this counts as delayed, us (ours).
DELAY_US = 60_000_000


class Verdict(StrEnum):
    """What came of a run, the worst first."""

    VIOLATION = "VIOLATION"
    CRASHED = "program error"
    STOPPED = "stopped safely"
    NOT_SERVED = "not served"
    DELAYED = "delayed"
    TOLD = "told why"
    SERVED = "served"


#: What makes a campaign look closer: a trace and a shrunk scenario are kept.
FAILURES = (Verdict.VIOLATION, Verdict.CRASHED, Verdict.STOPPED, Verdict.NOT_SERVED)


@dataclass(frozen=True)
class Report:
    """What one trial came to; times in s of simulated time."""

    scenario: Scenario
    verdict: Verdict
    violations: tuple[str, ...] = ()
    halted: tuple[str, ...] = ()
    served: int = 0
    told: int = 0
    waiting: int = 0
    longest_wait_s: float = 0.0
    simulated_s: float = 0.0
    struck: tuple[tuple[str, int], ...] = ()
    error: str = ""

    def why(self) -> str:
        """One line for a person."""
        if self.error:
            return self.error
        said = self.violations or self.halted
        return said[0] if said else f"{self.waiting} still waiting after {self.simulated_s:.0f} s"


def play(site: Site, scenario: Scenario, *, usual_wait_s: float | None = None, trace: Path | None = None) -> Report:
    """Play a scenario; ``usual_wait_s`` is the longest wait without its faults, where it is known."""
    loop = VirtualTimeLoop()
    try:
        asyncio.set_event_loop(loop)
        return loop.run_until_complete(_play(site, scenario, usual_wait_s, trace, loop))
    finally:
        asyncio.set_event_loop(None)
        loop.close()


async def _play(
    site: Site, scenario: Scenario, usual_wait_s: float | None, trace: Path | None, loop: VirtualTimeLoop
) -> Report:
    options = RunOptions(seed=scenario.seed, trace=trace, faults=frame_faults(scenario.faults, site))
    simulation = build(site, options, loop)
    simulation.plant.street.add_all(scenario.arrivals.demand(scenario.seed), ORIGIN_US)
    arm(simulation, scenario.faults)
    street, oracle = simulation.plant.street, simulation.plant.oracle
    error = ""
    try:
        simulation.start()
        await run_until(
            simulation,
            lambda: bool(oracle.violations) or _is_over(street),
            round(scenario.limit_s * 1e6),
            STEP_US,
        )
    except Exception as problem:  # noqa: BLE001  # a program error in one seed must not end the campaign: it is a result
        error = f"{type(problem).__name__}: {problem}"
    finally:
        simulation.close()
    return _judge(simulation, scenario, usual_wait_s, error)


def _is_over(street: Street) -> bool:
    """Whoever has lost the ticket is not waited for: no machine can help there."""
    return all(
        customer.state is State.GONE
        or (customer.state is State.PARKED and customer.stay.departure_us is None)
        or (customer.state is State.AT_DESK and customer.has_lost_ticket)
        for customer in street.customers
    )


def _judge(simulation: Simulation, scenario: Scenario, usual_wait_s: float | None, error: str) -> Report:
    street = simulation.plant.street
    violations = tuple(str(one) for one in simulation.plant.oracle.finish())
    halted = tuple(
        f"{controller.holon.machine.name}: {controller.holon.halted}"
        for controller in simulation.controllers.values()
        if controller.holon.halted is not None
    )
    outcomes = Counter(customer.visit.outcome for customer in street.customers)
    waiting = sum(
        customer.state not in (State.COMING, State.PARKED, State.GONE)
        and not (customer.state is State.AT_DESK and customer.has_lost_ticket)
        for customer in street.customers
    )
    told = sum(outcomes[one] for one in (Outcome.FULL, Outcome.TOO_LARGE, Outcome.TICKET_UNKNOWN))
    summary = street.summary()
    longest_s = max((*summary.in_wait_us, *summary.out_wait_us), default=0) / 1e6
    is_late = usual_wait_s is not None and longest_s > usual_wait_s + DELAY_US / 1e6
    verdicts = (
        (bool(violations), Verdict.VIOLATION),
        (bool(error), Verdict.CRASHED),
        (bool(waiting and halted), Verdict.STOPPED),
        (bool(waiting), Verdict.NOT_SERVED),
        (is_late, Verdict.DELAYED),
        (bool(told), Verdict.TOLD),
        (True, Verdict.SERVED),
    )
    return Report(
        scenario,
        next(verdict for holds, verdict in verdicts if holds),
        violations,
        halted,
        outcomes[Outcome.SERVED] + outcomes[Outcome.CANCELLED],
        told,
        waiting,
        longest_s,
        simulation.loop.now_us() / 1e6,
        _struck(simulation),
        error,
    )


def _struck(simulation: Simulation) -> tuple[tuple[str, int], ...]:
    """How often faults of single frames struck, by kind of the frame fault."""
    struck: Counter[str] = Counter()
    for injector in simulation.fleet.injectors:
        struck[injector.fault.kind.value] += injector.struck
    return tuple(sorted(struck.items()))


def kinds_of(scenario: Scenario) -> Counter[str]:
    """How many faults of each kind a scenario has."""
    return Counter(fault.kind.value if isinstance(fault, Fault) else fault.kind for fault in scenario.faults)
