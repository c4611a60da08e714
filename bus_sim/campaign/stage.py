"""What a trial asks of the system that it plays: a run that is ready to start, its oracle, and what became of orders.

Everything else is the same for all (bus_sim/campaign/trial.py): faults, checkers, recovery, the end, the verdict.
"""

from collections.abc import Callable, Sequence
from typing import Protocol

from bus_sim.faults.injection import AnyFault
from bus_sim.faults.scenario import Scenario
from bus_sim.run import BusRun, RunOptions
from bus_sim.systems.orders import Tally
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.core.site import Site


class Stage(Protocol):
    """One run of a system, connected but not switched on."""

    #: Who comes: what the report counts.
    who: str

    @property
    def run(self) -> BusRun:
        """Buses, plant and controllers."""

    @property
    def is_broken(self) -> bool:
        """Whether the oracle has seen what must never happen."""

    @property
    def is_over(self) -> bool:
        """Whether everybody was served or told why."""

    def arm(self, faults: Sequence[AnyFault]) -> None:
        """Set up all faults but those of single frames, which the bus was built with."""

    def violations(self) -> list[str]:
        """What the oracle says; asked once, when the run is over."""

    def waits_since(self, time_us: int) -> int:
        """How many wait now who waited then already, us of loop time; 0 where a system does not tell."""

    def tally(self) -> Tally:
        """What became of everybody who came; asked once, when the run is over, before ``violations``."""


#: Sets one up for a scenario of a site, whose ``faults`` of single frames are in the options.
StageMaker = Callable[[Site, Scenario, RunOptions, VirtualTimeLoop], Stage]
