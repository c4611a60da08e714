"""One trial: a scenario is played to its end, and judged first for safety, then for what became of its customers."""

import asyncio
from collections import Counter
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from bus_sim.campaign.judges import Judges
from bus_sim.campaign.recovery import Recovery
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
#: With all faults over and all customers gone, all machines run and all mirrors are equal within this, us (ours).
CONVERGED_US = 120_000_000
#: A wait that is longer than the same run's longest without faults by this counts as delayed, us (ours).
DELAY_US = 60_000_000


class Verdict(StrEnum):
    """What came of a run, the worst first."""

    VIOLATION = "VIOLATION"
    CRASHED = "program error"
    STOPPED = "stopped safely"
    NOT_SERVED = "not served"
    NOT_LIVE = "stood still"
    APART = "not converged"
    DELAYED = "delayed"
    TOLD = "told why"
    SERVED = "served"


#: What makes a campaign look closer: a trace and a shrunk scenario are kept.
FAILURES = (
    Verdict.VIOLATION,
    Verdict.CRASHED,
    Verdict.STOPPED,
    Verdict.NOT_SERVED,
    Verdict.NOT_LIVE,
    Verdict.APART,
)


@dataclass(frozen=True)
class Report:
    """What one trial came to; times in s of simulated time.

    ``violations``: what the plant's oracle saw happen, and rules of safety that the checkers saw broken on the buses.
    ``stalls``: rules of liveness that were broken in time without faults. ``recovery``: longest time by measure, us.
    """

    scenario: Scenario
    verdict: Verdict
    violations: tuple[str, ...] = ()
    stalls: tuple[str, ...] = ()
    halted: tuple[str, ...] = ()
    served: int = 0
    told: int = 0
    full: int = 0
    waiting: int = 0
    longest_wait_s: float = 0.0
    simulated_s: float = 0.0
    struck: tuple[tuple[str, int], ...] = ()
    recovery: tuple[tuple[str, int], ...] = ()
    is_apart: bool = False
    error: str = ""

    def why(self) -> str:
        """One line for a person."""
        if self.error:
            return self.error
        said = self.violations or self.halted or (() if self.waiting else self.stalls)
        if not said and self.is_apart and not self.waiting:
            return f"mirrors differ {CONVERGED_US // 1_000_000} s after all faults and all work"
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
    judges = Judges(simulation, disturbed=bool(scenario.faults))
    recovery = Recovery(simulation, scenario.faults)
    oracle = simulation.plant.oracle
    error, ends = "", _End(simulation, recovery)
    try:
        simulation.start()
        await run_until(
            simulation,
            lambda: bool(oracle.violations) or judges.is_unsafe or ends(loop.now_us()),
            round(scenario.limit_s * 1e6),
            STEP_US,
            lambda: judges.excuse(recovery.healed_us),
        )
    except Exception as problem:  # noqa: BLE001  # a program error in one seed must not end the campaign: it is a result
        error = f"{type(problem).__name__}: {problem}"
    finally:
        simulation.close()
    return _judge(simulation, scenario, usual_wait_s, error, judges, recovery)


class _End:
    """When a trial is over: safety comes first, then all heals, then everything must converge."""

    def __init__(self, simulation: Simulation, recovery: Recovery) -> None:
        self._simulation = simulation
        self._recovery = recovery
        self._over_us: int | None = None

    def __call__(self, now_us: int) -> bool:
        """All customers are gone, all faults are over, and the mirrors agree or had all the time to."""
        if now_us < self._recovery.healed_us or not is_over(self._simulation.plant.street):
            return False
        self._over_us = max(self._over_us or now_us, self._recovery.healed_us)
        return self._recovery.mirrors_agree() or now_us - self._over_us >= CONVERGED_US


def is_over(street: Street) -> bool:
    """Whoever has lost the ticket is not waited for: no machine can help there."""
    return all(
        customer.state is State.GONE
        or (customer.state is State.PARKED and customer.stay.departure_us is None)
        or (customer.state is State.AT_DESK and customer.has_lost_ticket)
        for customer in street.customers
    )


def _judge(
    simulation: Simulation,
    scenario: Scenario,
    usual_wait_s: float | None,
    error: str,
    judges: Judges,
    recovery: Recovery,
) -> Report:
    street = simulation.plant.street
    unsafe, stalls = judges.finish()
    violations = (*(str(one) for one in simulation.plant.oracle.finish()), *unsafe)
    is_apart = is_over(street) and not recovery.mirrors_agree()
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
        (bool(stalls), Verdict.NOT_LIVE),
        (is_apart, Verdict.APART),
        (is_late, Verdict.DELAYED),
        (bool(told), Verdict.TOLD),
        (True, Verdict.SERVED),
    )
    return Report(
        scenario,
        next(verdict for holds, verdict in verdicts if holds),
        violations,
        stalls,
        halted,
        outcomes[Outcome.SERVED] + outcomes[Outcome.CANCELLED],
        told,
        outcomes[Outcome.FULL],
        waiting,
        longest_s,
        simulation.loop.now_us() / 1e6,
        _struck(simulation),
        tuple((measure.value, us) for measure, us in sorted(recovery.longest_us.items())),
        is_apart,
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
