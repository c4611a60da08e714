"""One robot in one round: which of the calls that stand it takes part in, one after the other.

It is the cheapest for it among those for which it is still the best as far as it has heard; whoever is beaten goes on
to the next. When to bid, and whether, is the core's: better bids are sent sooner, and none that beats nothing is sent.
As both sides order by the same cost, that ends in the one stable outcome whatever the order of frames (Gale and Shapley
1962): the lowest bid of all has won first, then the lowest among the rest.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from onboard.contract.messages import Bid, CallForProposals
from onboard.core.negotiation import Proposal
from onboard.core.site import Timing
from onboard.systems.mapd.calls import task_of
from onboard.systems.mapd.prospects import BidList
from onboard.work.plain import NoEstimator

#: Half of the longest delay is owed by a bid of 30 steps, us: most pick-ups in a warehouse are nearer.
HALF_US = 3_000_000
#: Share of a round's length that the longest delay may take, per cent: the rest is for those who are beaten late.
DELAY_PERCENT = 60
#: Share that the guard before the deadline may take, per cent, and once more behind it: one that the site file has for
#: calls may be longer than a round.
GUARD_PERCENT = 10


def bid_timing(timing: Timing, window_us: int) -> Timing:
    """The delay rule's constants for rounds of ``window_us``."""
    guard_us = min(timing.deadline_guard_us, window_us * GUARD_PERCENT // 100)
    delay_us = window_us * DELAY_PERCENT // 100
    return replace(timing, bid_delay_us=delay_us, bid_half_us=HALF_US, deadline_guard_us=guard_us)


@dataclass
class UnitGeneration(NoEstimator):
    """A robot's task-generation function: what each open task costs it in the round ``mark``, as it saw it then."""

    offers: BidList | None = None
    mark: int = 0

    def lower_bound(self, call: CallForProposals, now_us: int) -> int | None:
        """Hundredths of a step; None for a task that it does not know, or cannot reach."""
        return None if self.offers is None else self.offers.bid(call.task.number)

    def estimate(self, call: CallForProposals, now_us: int) -> Proposal | None:
        """The same: what is in the way is seen when the path is planned."""
        cost = self.lower_bound(call, now_us)
        return None if cost is None else Proposal(cost, None, (call.task.number,), (), version=self.mark)


@dataclass
class Round:
    """A round that was opened at ``begun_us``, and what this robot can offer in it."""

    node_id: int
    begun_us: int
    offers: BidList
    #: The task whose call it takes part in.
    looked_at: int | None = None
    bids: dict[int, list[Bid]] = field(default_factory=dict)
    _best: dict[int, tuple[int, int]] = field(default_factory=dict)
    #: Those that are looked at now, cheapest first, and how many of them were; all others are dearer.
    _near: Sequence[tuple[int, int]] = ()
    _next: int = 0

    def hear(self, bid: Bid) -> None:
        """Another robot's bid, of this round."""
        task, offered = task_of(bid), (bid.cost, bid.sender)
        self.bids.setdefault(task, []).append(bid)
        best = self._best.get(task)
        if best is None or offered < best:
            self._best[task] = offered

    @property
    def preferred(self) -> int | None:
        """The cheapest task for which nobody is better as far as is known; None where there is none."""
        while True:
            while self._next < len(self._near):
                cost, task = self._near[self._next]
                best = self._best.get(task)
                if best is None or (cost, self.node_id) <= best:
                    return task
                self._next += 1
            self._near, self._next = self.offers.look_on(), 0
            if not self._near:
                return None
