"""The compartment's task-generation function: when could this bay receive a car for its customer?

Independent of the others' plans (row P21), unlike the robot's: it knows only its own doors and its own queue.
"""

from dataclasses import dataclass

from onboard.contract.codes import Criterion, Operation
from onboard.contract.messages import CallForProposals
from onboard.core.negotiation import Proposal
from onboard.core.serial import from_bus_ms, to_bus_ms
from onboard.core.site import Machine
from onboard.systems.car_park.site import CarPark
from onboard.ways.kinematics import run_duration_us
from onboard.ways.site import BayUse

#: A driver gets in and drives out within this, us: 10 to 30 s (constants of the SimPy study in the systems list).
DRIVER_US = 20_000_000
#: The operating sequence for a car that is to be given out, in the order of its steps.
PROGRAM = (
    "turn the light red",
    "lock the input door",
    "call for a robot",
    "open the output door",
    "receive the car",
    "lock the output door",
    "open the input door",
    "show whose car is ready",
)


@dataclass
class BayGeneration:
    """Estimates for calls of operation RECEIVE. ``is_free`` and ``queue`` are kept up to date by the compartment."""

    site: CarPark
    machine: Machine
    is_free: bool = False
    queue: int = 0

    def floor(self, call: CallForProposals, now_us: int) -> int:
        """A free bay has only to lock its input door (bus ms)."""
        return to_bus_ms(from_bus_ms(call.deadline_ms, now_us) + self.site.timing.door_us)

    def lower_bound(self, call: CallForProposals, now_us: int) -> int | None:
        """When this bay stands locked and empty (bus ms), or None for anything but RECEIVE."""
        if self.site.bay_uses.get(self.machine.node_id) is BayUse.ENTRY:
            return None
        if call.operation is not Operation.RECEIVE or call.criterion is not Criterion.FINISH_TIME:
            return None
        ready_us = from_bus_ms(call.deadline_ms, now_us) + self.site.timing.door_us
        cycles = self.queue + (0 if self.is_free else 1)
        return to_bus_ms(ready_us + cycles * self._cycle_us())

    def estimate(self, call: CallForProposals, now_us: int) -> Proposal | None:
        """The same as the bound: nothing that others plan changes it. The program is what the bay will do."""
        cost = self.lower_bound(call, now_us)
        return None if cost is None else Proposal(cost, None, PROGRAM, ())

    def _cycle_us(self) -> int:
        """One customer served: both doors twice, the shuttle's stroke twice, grip, and the driver."""
        park = self.site
        stroke_us = run_duration_us(park.shuttle_reach_mm, park.shuttle)
        return 4 * self.site.timing.door_us + 2 * stroke_us + self.site.timing.grip_us + DRIVER_US
