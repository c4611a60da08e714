"""What came of one trial: its verdict, and all that a table or a person may want to know of it."""

from collections import Counter
from dataclasses import dataclass
from enum import StrEnum

from bus_sim.campaign.recovery import Measure
from bus_sim.can.faults import InjectedFault
from bus_sim.faults.scenario import FaultScenario

#: With all faults over and everybody served, all machines run and all mirrors are equal within this, us: several rounds
#: of heartbeats and statements.
CONVERGED_US = 120_000_000
#: With all clocks right and nothing else disturbed, or rights made anew, whoever waits then is served within this, us.
SERVED_AGAIN_US = 300_000_000


class RunVerdict(StrEnum):
    """What came of a run, the worst first."""

    VIOLATION = "VIOLATION"
    CRASHED = "program error"
    HUNG = "hung"
    STOPPED = "stopped safely"
    HELD = "held, told"
    NOT_SERVED = "not served"
    NOT_LIVE = "stood still"
    APART = "not converged"
    LATE = "healed late"
    DELAYED = "delayed"
    TOLD = "told why"
    SERVED = "served"


#: What makes a campaign look closer: a trace and a shrunk scenario are kept.
FAILURES = (
    RunVerdict.VIOLATION,
    RunVerdict.CRASHED,
    RunVerdict.HUNG,
    RunVerdict.STOPPED,
    RunVerdict.NOT_SERVED,
    RunVerdict.NOT_LIVE,
    RunVerdict.APART,
    RunVerdict.LATE,
)


@dataclass(frozen=True)
class TrialReport:
    """What one trial came to; times in s of simulated time. customers, or orders, are counted.

    ``violations``: what the plant's oracle saw happen, and rules of safety that the checkers saw broken on the buses.
    ``stalls``: rules of liveness that were broken in time without faults. ``recovery``: longest time by measure, us.
    """

    scenario: FaultScenario
    verdict: RunVerdict
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
    #: What ``served``, ``told`` and ``waiting`` count.
    who: str = "customers"

    def why(self) -> str:
        """One line for a person."""
        if self.error:
            return self.error
        if self.verdict is RunVerdict.LATE:
            took, most_s = dict(self.recovery), SERVED_AGAIN_US / 1e6
            first_s = took.get(Measure.REPAIR_SERVES, 0) / 1e6
            if first_s > most_s:
                return f"the first who waited is served {first_s:.0f} s after the repair, not within {most_s:g} s"
            took_s = took[Measure.HEAL_SERVED] / 1e6
            return f"all are served {took_s:.0f} s after the clocks were right, not within {most_s:g} s"
        said = self.violations or self.halted or (() if self.waiting else self.stalls)
        if not said and self.is_apart and not self.waiting:
            return f"mirrors differ {CONVERGED_US // 1_000_000} s after all faults and all work"
        return said[0] if said else f"{self.waiting} still waiting after {self.simulated_s:.0f} s"


def kinds_of(scenario: FaultScenario) -> Counter[str]:
    """How many faults of each kind a scenario has."""
    return Counter(fault.kind.value if isinstance(fault, InjectedFault) else fault.kind for fault in scenario.faults)
