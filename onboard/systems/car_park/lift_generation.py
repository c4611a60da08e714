"""The lift's task-generation function: when would a ride be over, in the schedule that the robots' plans make.

A call before a bid is answered from the schedule: the others' rides, and the options that this lift has given. A ride
that stands in a firm itinerary needs no call.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

from onboard.contract.codes import Criterion, Operation
from onboard.contract.messages import CallForProposals, Reference
from onboard.core.negotiation import CallKey, Proposal
from onboard.core.serial import from_bus_ms, to_bus_ms
from onboard.core.site import Machine
from onboard.ways.lift_uses import lift_gaps, ride_us, run_up_us
from onboard.ways.lifts import sill
from onboard.ways.mirror import WayMirror
from onboard.ways.occupancy import leg_sweeps
from onboard.ways.reservations import Use
from onboard.ways.site import WaySite


@dataclass(frozen=True, slots=True)
class Promise:
    """A ride that an option of this lift stands for, and the call that it is a part of (initiator, call)."""

    use: Use
    whole: Reference


@dataclass
class LiftGeneration:
    """Estimates for calls of operation RIDE between two of this lift's sills (segment numbers as stations).

    ``index`` is where the platform stands, kept up to date by the lift; ``promises`` are its options, by call.
    """

    site: WaySite
    machine: Machine
    mirror: WayMirror
    index: int = 1
    promises: dict[CallKey, Promise] = field(default_factory=dict)

    def floor(self, call: CallForProposals, now_us: int) -> int:
        """The ride alone, begun when it is wanted (bus ms)."""
        return to_bus_ms(max(now_us, self._ready_us(call, now_us)) + self._run_us(call))

    def lower_bound(self, call: CallForProposals, now_us: int) -> int | None:
        """The end of the ride in the schedule (bus ms), or None where it is not a ride of mine."""
        indices, use = self._use(call, now_us)
        return None if use is None else to_bus_ms(use.to_us - self._leaving_us(indices[1]))

    def estimate(self, call: CallForProposals, now_us: int) -> Proposal | None:
        """The same as the bound; the option carries the use of the platform that it stands for."""
        cost = self.lower_bound(call, now_us)
        _, use = self._use(call, now_us)
        return None if cost is None or use is None else Proposal(cost, None, (Promise(use, call.parent),), ())

    def _use(self, call: CallForProposals, now_us: int) -> tuple[tuple[int, int], Use | None]:
        """From where to where a call goes, and the first use of the platform for it; None where it is not mine."""
        is_ride = call.operation is Operation.RIDE and call.criterion is Criterion.FINISH_TIME and call.hold_ms
        indices = self._indices(call) if is_ride else None
        return ((0, 0), None) if indices is None else (indices, self._earliest(call, indices, now_us))

    # --- a ride in a gap of the schedule -----------------------------------------------------------------------

    def _earliest(self, call: CallForProposals, indices: tuple[int, int], now_us: int) -> Use | None:
        """The first use of the platform, from entering to having left, that fits between all others."""
        track, (board, leave) = self.machine.home.track, indices
        duration_us = ride_us(self.site, track, board, leave)
        ready_us = self._ready_us(call, now_us)
        for gap in lift_gaps(sorted(self._uses(call), key=_begin), now_us, self.index):
            there_us = gap.from_us + run_up_us(self.site, track, gap.from_index, board)
            begin_us = max(ready_us, there_us + self._boarding_us(board))
            away_us = 0 if gap.to_index is None else run_up_us(self.site, track, leave, gap.to_index)
            left_us = begin_us + duration_us + self._leaving_us(leave)
            if left_us + away_us <= gap.to_us:
                return Use(track, board, leave, begin_us - self._boarding_us(board), left_us, call.sender)
        return None

    def _uses(self, call: CallForProposals) -> Iterator[Use]:
        """Rides of all but the caller, whose plan changes with its bid, and options but those for the same call.

        Of all bids for one call one wins at most, so their options exclude each other; parts of one bid come one after
        the other by the bidder's plan.
        """
        yield from self.mirror.reservations.uses(self.machine.home.track, excluding=call.sender)
        yield from (promise.use for promise in self.promises.values() if promise.whole != call.parent)

    def _ready_us(self, call: CallForProposals, now_us: int) -> int:
        return from_bus_ms(call.deadline_ms, now_us) + call.ready_ms * 1000

    def _boarding_us(self, lift_index: int) -> int:
        """From the body's entering the platform to its standing aboard, for a run from the sill."""
        sweeps = leg_sweeps(self.site, sill(self.site, self.machine.home.track, lift_index).track, 1)
        entering = next(sweep for sweep in sweeps if sweep.offset == 1)
        return entering.leave_us - entering.enter_us

    def _leaving_us(self, lift_index: int) -> int:
        """From setting off aboard to the body's having left the platform, for a run to the sill."""
        sweeps = leg_sweeps(self.site, sill(self.site, self.machine.home.track, lift_index).track, 1)
        return next(sweep for sweep in sweeps if sweep.offset == 0).leave_us

    # --- inner works -------------------------------------------------------------------------------------------

    def _indices(self, call: CallForProposals) -> tuple[int, int] | None:
        track = self.machine.home.track
        numbers = [sill(self.site, track, index).number for index in range(1, self.site.tracks[track].length + 1)]
        if call.from_station not in numbers or call.to_station not in numbers:
            return None
        return numbers.index(call.from_station) + 1, numbers.index(call.to_station) + 1

    def _run_us(self, call: CallForProposals) -> int:
        indices = self._indices(call)
        if indices is None:
            return 0
        return run_up_us(self.site, self.machine.home.track, *indices)


def _begin(use: Use) -> tuple[int, int, int]:
    return use.from_us, use.to_us, use.owner
