"""The lift's task-generation function: when would a ride be over, in the schedule that the robots' plans make."""

from dataclasses import dataclass

from onboard.core.codes import Criterion, LegAction, Operation
from onboard.core.kinematics import run_duration_us
from onboard.core.lifts import sill
from onboard.core.messages import CallForProposals
from onboard.core.mirror import Mirror
from onboard.core.negotiation import Proposal
from onboard.core.serial import to_bus_ms
from onboard.core.site import Machine, Site


@dataclass
class LiftGeneration:
    """Estimates for calls of operation RIDE between two of this lift's sills (segment numbers as stations)."""

    site: Site
    machine: Machine
    mirror: Mirror

    def floor(self, call: CallForProposals, now_us: int) -> int:
        """The ride alone, begun now (bus ms)."""
        return to_bus_ms(now_us + self._ride_us(call))

    def lower_bound(self, call: CallForProposals, now_us: int) -> int | None:
        """The end of the ride as the caller planned it around all others, or None where it is not a ride of mine."""
        if call.operation is not Operation.RIDE or call.criterion is not Criterion.FINISH_TIME:
            return None
        indices = self._indices(call)
        itinerary = self.mirror.itineraries.get(call.sender)
        if indices is None or itinerary is None:
            return None
        for leg in itinerary.legs:
            mine = leg.action is LegAction.RIDE and leg.track == self.machine.home.track
            if mine and (leg.from_index, leg.to_index) == indices:
                return leg.end_ms
        return None

    def estimate(self, call: CallForProposals, now_us: int) -> Proposal | None:
        """The same as the bound: the caller's plan was made around everybody's."""
        cost = self.lower_bound(call, now_us)
        return None if cost is None else Proposal(cost, None, (), ())

    def _indices(self, call: CallForProposals) -> tuple[int, int] | None:
        track = self.machine.home.track
        numbers = [sill(self.site, track, index).number for index in range(1, self.site.tracks[track].length + 1)]
        if call.from_station not in numbers or call.to_station not in numbers:
            return None
        return numbers.index(call.from_station) + 1, numbers.index(call.to_station) + 1

    def _ride_us(self, call: CallForProposals) -> int:
        indices = self._indices(call)
        if indices is None:
            return 0
        floors = abs(indices[0] - indices[1])
        return run_duration_us(floors * self.site.tracks[self.machine.home.track].pitch_mm, self.site.lift)
