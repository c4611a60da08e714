"""One robot in one round: bids for the task that is cheapest for it among those for which it is still the best.

A bid is sent only where it beats what was heard for that task, better bids are sent sooner (design, section 4), and a
later bid takes the earlier one back. Whoever is beaten goes on to its next best task. As both sides order by the same
cost, that ends in the one stable outcome whatever the order of frames (Gale and Shapley 1962): the lowest bid of all
has won first, then the lowest among the rest.
"""

from dataclasses import dataclass, field, replace

from onboard.core.codes import Criterion
from onboard.core.negotiation.bidding import delay_us
from onboard.core.site import Timing
from onboard.systems.mapd.messages import NO_TASK, TransportBid

#: Half of the longest delay is owed by a bid of 30 steps, us. Ours: most pick-ups in a warehouse are nearer.
HALF_US = 3_000_000
#: Share of a round's length that the longest delay may take, per cent: the rest is for those who are beaten late.
DELAY_PERCENT = 60


def bid_timing(timing: Timing, window_us: int) -> Timing:
    """The delay rule's constants for rounds of ``window_us``."""
    return replace(timing, bid_delay_us=window_us * DELAY_PERCENT // 100, bid_half_us=HALF_US)


@dataclass
class Round:
    """A round that is open: ``wishes`` are (cost, task), cheapest first; ``begun_us`` when it was heard."""

    node_id: int
    step: int
    attempt: int
    begun_us: int
    timing: Timing
    wishes: list[tuple[int, int]]
    standing: dict[int, tuple[int, int]] = field(default_factory=dict)
    last: TransportBid | None = None
    _next: int = 0

    def hear(self, bid: TransportBid) -> None:
        """Another robot's bid, of this round."""
        if bid.attempt != self.attempt or bid.step_low != self.step & 0xFFFF or bid.task == NO_TASK:
            return
        best = self.standing.get(bid.task)
        if best is None or (bid.cost, bid.sender) < best:
            self.standing[bid.task] = (bid.cost, bid.sender)

    @property
    def wish(self) -> tuple[int, int] | None:
        """The cheapest task for which nobody is better as far as is known; None where there is none."""
        while self._next < len(self.wishes):
            cost, task = self.wishes[self._next]
            best = self.standing.get(task)
            if best is None or (cost, self.node_id) <= best:
                return self.wishes[self._next]
            self._next += 1
        return None

    def due_us(self) -> int | None:
        """When the next bid is to be sent; None where there is nothing to say."""
        wish = self.wish
        if wish is None or (self.last is not None and self.last.task == wish[1]):
            return None
        return self.begun_us + delay_us(wish[0], 0, Criterion.LENGTH, self.timing)

    def speak(self, now_us: int) -> list[TransportBid]:
        """The bid that is due."""
        due_us, wish = self.due_us(), self.wish
        if due_us is None or wish is None or now_us < due_us:
            return []
        cost, task = wish
        self.standing[task] = (cost, self.node_id)
        self.last = TransportBid(self.node_id, self.step & 0xFFFF, self.attempt, task, cost)
        return [self.last]


@dataclass
class Tally:
    """The bids of a round as the desk heard them: of each robot its last, and who wants a turn without a task."""

    step: int
    attempt: int
    last: dict[int, tuple[int, int]] = field(default_factory=dict)
    yielding: set[int] = field(default_factory=set)

    def hear(self, bid: TransportBid) -> None:
        """A bid of this round; others are too late or too old."""
        if bid.attempt != self.attempt or bid.step_low != self.step & 0xFFFF:
            return
        if bid.task == NO_TASK:
            self.yielding.add(bid.sender)
        else:
            self.last[bid.sender] = (bid.cost, bid.task)

    def winners(self) -> dict[int, tuple[int, int]]:
        """Task and cost of each robot whose last bid is the best for its task, by robot."""
        best: dict[int, tuple[int, int]] = {}
        for robot, (cost, task) in self.last.items():
            if task not in best or (cost, robot) < best[task]:
                best[task] = (cost, robot)
        return {robot: (task, cost) for task, (cost, robot) in best.items()}
