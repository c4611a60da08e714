"""Calls: closed once and in time, by bids that came in time and went down (rows P05 to P12)."""

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field

from onboard.contract.codes import CallResult, Criterion, MachineState, TaskPhase
from onboard.contract.constants import NOBODY
from onboard.contract.messages import (
    Award,
    Bid,
    BusTime,
    CallForProposals,
    Halted,
    Heartbeat,
    LeftOut,
    Progress,
    Reference,
    SyncRequest,
    TaskReport,
)
from onboard.trace.check.event import Finding, LogEvent
from onboard.trace.check.picture import BusPicture
from onboard.trace.check.rule import Handlers, Rule

#: A call is closed at its deadline; a restart of the initiator, a journal write and a busy bus need less than this, us,
#: and so does a machine that has lost bus time: it closes nothing until two time messages (5 s apart) say the same.
CLOSED_WITHIN_US = 12_000_000
#: Closed calls are remembered so long, since awards are said again until the winner is heard, us.
REMEMBERED_US = 600_000_000
#: Two bids may cross on their way: the second was queued before the first was heard, us.
CROSSING_US = 20_000
#: Where seals are required one counts once its seal has come: at 125 kbit/s, with the offers of three others before
#: that, 62 ms after it was said (measured); some 17 ms for each bidder.
SEALED_CROSSING_US = 120_000
#: Bus time in the log is told by frames that take up to a few of these to come through, us.
CLOCK_TOLERANCE_US = 5_000
#: Who has won something and has not moved for so long may be an obstacle for all: its bids do not count then, us.
STANDS_US = 15_000_000
#: And so it may be once it has moved, with a task in hand that it waits to go on with, us.
WAITS_US = 600_000_000
#: Calls of which it is remembered who was left out.
MOST_LEFT_OUT = 256
_HALF_MS = 1 << 31


@dataclass
class CallSeen:
    """One call: when it was opened and is due (us of the log), its bids and its outcome."""

    call: CallForProposals
    event: LogEvent[CallForProposals]
    boot: int | None
    due_us: int | None
    bids: list[tuple[int, int, int]] = field(default_factory=list)
    option: bool = False
    outcome: Award | None = None
    is_reported: bool = False


class _CallRule(Rule):
    """Keeps the calls of the last minutes."""

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self.calls: OrderedDict[tuple[int, int], CallSeen] = OrderedDict()
        #: Before then, us of the log, none of them is long over.
        self._forget_us = 0

    def handlers(self) -> Handlers:
        """Calls, bids and awards."""
        return {CallForProposals: self._on_call, Bid: self._on_bid, Award: self._on_award}

    def tick(self, now_us: int) -> None:
        """Forget what is long over."""
        if now_us < self._forget_us:
            return
        while self.calls:
            self._forget_us = next(iter(self.calls.values())).event.time_us + REMEMBERED_US + 1
            if now_us < self._forget_us:
                return
            self.calls.popitem(last=False)

    def _on_call(self, event: LogEvent[CallForProposals]) -> None:
        call = event.message
        known = self.calls.get((call.sender, call.call))
        if known is not None and known.call == call:
            return
        due_us = self.picture.log_us(call.deadline_ms, event.time_us)
        seen = CallSeen(call, event, self.picture.boots.get(call.sender), due_us)
        self.calls.pop((call.sender, call.call), None)
        self.calls[call.sender, call.call] = seen
        self.opened(seen)

    def _on_bid(self, event: LogEvent[Bid]) -> None:
        bid = event.message
        seen = self.calls.get((bid.initiator, bid.call))
        if seen is not None:
            self.judge_bid(event, seen)
            seen.bids.append((event.time_us, bid.sender, bid.cost))

    def _on_award(self, event: LogEvent[Award]) -> None:
        seen = self.calls.get((event.message.sender, event.message.call))
        if seen is None:
            self.picture.unjudged += 1
            return
        self.judge_award(event, seen)

    def opened(self, seen: CallSeen) -> None:
        """A call is heard for the first time, or another under the number of an older one."""

    def judge_bid(self, event: LogEvent[Bid], seen: CallSeen) -> None:
        """A bid for a call that is known."""

    def judge_award(self, event: LogEvent[Award], seen: CallSeen) -> None:
        """An award for a call that is known."""


class CallsClosed(_CallRule):
    """Each call gets exactly one final outcome, at its deadline; an award is idempotent.

    A winner may give the task back before it was heard (REJECTED after AWARDED). An option that nobody
    decides on lapses without a frame. A call whose initiator fell silent or started anew is over; one that is held, or
    asks what it has missed, or does not hear who tells the time of the bus, closes it when it goes on.
    """

    name = "calls-closed"
    title = "calls closed, once and in time"
    source = "rows P11, P12, P14; dbc/fleet.dbc, Award"

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        #: When a machine last said that it is held, has slept, or asked: it closes its calls once it goes on.
        self._held_us: dict[int, int] = {}
        #: Who told the time of the bus last, and when somebody said last that it does not hear it: one speaks for all
        #: that are cut off together.
        self._teller, self._untimed_us = NOBODY, 0
        #: Calls that somebody is still to close, in their order.
        self._open: dict[tuple[int, int], CallSeen] = {}

    def handlers(self) -> Handlers:
        """Beside calls, machines that do nothing any more for a while."""
        return {
            **super().handlers(),
            Halted: self._on_halted,
            Heartbeat: self._on_heartbeat,
            SyncRequest: self._on_question,
            BusTime: self._on_bus_time,
        }

    def _on_bus_time(self, event: LogEvent[BusTime]) -> None:
        self._teller = event.message.sender

    def _on_heartbeat(self, event: LogEvent[Heartbeat]) -> None:
        if event.message.state is MachineState.OBSTACLE:
            self._held_us[event.message.sender] = event.time_us

    def _on_halted(self, event: LogEvent[Halted]) -> None:
        if event.message.machine == event.message.sender:
            self._held_us[event.message.sender] = event.time_us
        if event.message.machine == self._teller:
            self._untimed_us = event.time_us

    def _on_question(self, event: LogEvent[SyncRequest]) -> None:
        self._held_us[event.message.sender] = event.time_us

    def opened(self, seen: CallSeen) -> None:
        """It is to be closed, where the log tells when."""
        key = seen.call.sender, seen.call.call
        self._open.pop(key, None)
        if seen.due_us is not None:
            self._open[key] = seen

    def judge_award(self, event: LogEvent[Award], seen: CallSeen) -> None:
        """Another outcome than the first."""
        award, before = event.message, seen.outcome
        self._open.pop((award.sender, award.call), None)
        if award.result is CallResult.OPTION:
            if before is not None:
                self.find(event, (award.sender,), f"call {award.call} becomes an option after {before.result.name}")
            seen.option = True
            return
        if before is None or (before.result, award.result) == (CallResult.AWARDED, CallResult.REJECTED):
            seen.outcome = award
        elif (before.result, before.winner) != (award.result, award.winner):
            what = f"call {award.call} ends {_outcome(award)}, after it ended {_outcome(before)}"
            self.find(event, (award.sender, award.winner), what)

    def tick(self, now_us: int) -> None:
        """Calls that should be closed by now."""
        super().tick(now_us)
        if not self._open:
            return
        for key, seen in list(self._open.items()):
            if now_us - seen.event.time_us > REMEMBERED_US or self._is_judged(seen):
                del self._open[key]

    def _is_judged(self, seen: CallSeen) -> bool:
        """Whether a call that nobody has closed is late, or never will be judged."""
        if seen.due_us is None:
            return True
        # A sign of the same life after the time is over: before it, the initiator may have died without a word.
        lived_us = self.picture.heard_us.get(seen.call.sender, 0)
        # A caller whose clock is behind may name a deadline that is over when the call is heard.
        held_us = self._held_us.get(seen.call.sender, 0)
        due_us = max(seen.due_us, seen.event.time_us, self.picture.clock_settles_us, held_us, self._untimed_us)
        if due_us <= self.picture.spoiled_until_us:
            # It may have closed it by a word that came to nothing: its bidders end by their own clocks.
            return True
        if lived_us - due_us <= CLOSED_WITHIN_US or not self.picture.is_alive(seen.call.sender, seen.boot):
            return False
        self.find(seen.event, (seen.call.sender,), f"call {seen.call.call} was never closed")
        return True


class BidsInTime(_CallRule):
    """Who wins has bid, before the deadline: no bid after it counts."""

    name = "bids-in-time"
    title = "no bid after the deadline counts"
    source = "row P05; docs/decisions.md, flag 11"

    def judge_award(self, event: LogEvent[Award], seen: CallSeen) -> None:
        """The winner must have bid before the deadline less the guard."""
        award = event.message
        if award.result not in (CallResult.AWARDED, CallResult.OPTION) or award.winner == NOBODY or seen.is_reported:
            return
        times_us = [time_us for time_us, node, _ in seen.bids if node == award.winner]
        due_us = seen.due_us
        if times_us and (due_us is None or min(times_us) <= due_us + CLOCK_TOLERANCE_US):
            return
        is_own = award.winner == award.sender
        if times_us and (is_own or seen.event.time_us < self.picture.clock_settles_us):
            # The caller's deadline was over when its own clock said so; or it bid itself, which only others hear by a
            # frame, that waits as long as the bus is dead.
            return
        seen.is_reported = True
        late_us = min(times_us) - (due_us or 0) if times_us else 0
        what = f"bid {late_us} us after the deadline" if times_us else "never bid"
        self.find(event, (award.sender, award.winner), f"call {award.call} goes to {award.winner}, who {what}")


class BidsGoDown(_CallRule):
    """The bids of one call strictly decrease on the bus (of equal ones the lower node-ID), and the last one wins."""

    name = "bids-go-down"
    title = "bids strictly better, and the best wins"
    source = "rows P06 to P10; dbc/fleet.dbc, Bid"
    undisturbed = True

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._left_out: OrderedDict[tuple[int, int], set[int]] = OrderedDict()
        self._places: dict[int, tuple[int, int, int]] = {}
        #: Since when a machine has not moved though it has won something.
        self._won_us: dict[int, int] = {}
        #: When each machine moved last, and what it has won and not done yet.
        self._moved_us: dict[int, int] = {}
        self._in_hand: dict[int, set[Reference]] = {}
        #: Bids that do not go with what was said before them: initiator, call and bidder.
        self._unsound: OrderedDict[tuple[int, int, int], None] = OrderedDict()

    def handlers(self) -> Handlers:
        """Beside calls, whose bids do not count."""
        own: Handlers = {LeftOut: self._on_left_out, Progress: self._on_progress, TaskReport: self._on_report}
        return {**super().handlers(), **own}

    def is_sound(self, bid: Bid, task: Reference) -> bool:
        """Whether a bid goes with what its bidder said before it, where a system's bids say more than a number."""
        return True

    def _on_left_out(self, event: LogEvent[LeftOut]) -> None:
        word = event.message
        named = {word.node_a, word.node_b, word.node_c, word.node_d, word.node_e, word.node_f}
        self._left_out.setdefault((word.sender, word.call), set()).update(named - {NOBODY})
        while len(self._left_out) > MOST_LEFT_OUT:
            self._left_out.popitem(last=False)

    def _on_progress(self, event: LogEvent[Progress]) -> None:
        progress = event.message
        place = progress.track, progress.index, progress.offset_mm
        if self._places.get(progress.sender) != place:
            self._places[progress.sender] = place
            self._won_us.pop(progress.sender, None)
            self._moved_us[progress.sender] = event.time_us

    def _on_report(self, event: LogEvent[TaskReport]) -> None:
        report = event.message
        if report.phase in (TaskPhase.DONE, TaskPhase.FORFEITED):
            self._is_nobodys(report.task)

    def _is_nobodys(self, task: Reference) -> None:
        for tasks in self._in_hand.values():
            tasks.discard(task)

    def _stands(self, node: int, now_us: int) -> bool:
        """Whether all may take a machine for one that does not do what it has won."""
        if now_us - self._won_us.get(node, now_us) >= STANDS_US:
            return True
        return bool(self._in_hand.get(node)) and now_us - self._moved_us.get(node, now_us) >= WAITS_US

    def _counts(self, node: int, seen: CallSeen, now_us: int) -> bool:
        """Whether a bid counts: not of who is left out, nor of who has won something and stands."""
        own, above = (seen.call.sender, seen.call.call), (seen.call.parent.origin, seen.call.parent.number)
        if self._stands(node, now_us) or (*own, node) in self._unsound:
            return False
        # Whom a call leaves out, that is left out of what is asked for a bid in it.
        return all(node not in self._left_out.get(call, ()) for call in (own, above))

    def judge_bid(self, event: LogEvent[Bid], seen: CallSeen) -> None:
        """Not better than one heard before."""
        bid = event.message
        if not self.is_sound(bid, seen.call.task):
            self._unsound[bid.initiator, bid.call, bid.sender] = None
            while len(self._unsound) > MOST_LEFT_OUT:
                self._unsound.popitem(last=False)
            return
        for time_us, node, cost in seen.bids:
            if (node, cost) == (bid.sender, bid.cost):
                return
            if not self._counts(node, seen, event.time_us):
                continue
            heard = event.time_us - time_us > (SEALED_CROSSING_US if self.picture.is_sealed else CROSSING_US)
            if heard and not _is_better(bid.cost, bid.sender, cost, node, seen.call.criterion):
                what = f"bids {bid.cost} for call {bid.call} of {bid.initiator} after {node} bid {cost}"
                self.find(event, (bid.sender, node), what)
                return

    def judge_award(self, event: LogEvent[Award], seen: CallSeen) -> None:
        """Given to another than the best bidder."""
        award = event.message
        if award.result is CallResult.AWARDED and award.winner:
            self._won_us.setdefault(award.winner, event.time_us)
            if award.task not in self._in_hand.setdefault(award.winner, set()):
                self._is_nobodys(award.task)
                self._in_hand[award.winner].add(award.task)
        if award.result not in (CallResult.AWARDED, CallResult.OPTION) or seen.is_reported or seen.due_us is None:
            return
        last_us = seen.due_us - CLOCK_TOLERANCE_US
        counted = [bid for bid in seen.bids if self._counts(bid[1], seen, event.time_us)]
        in_time = [(node, cost) for time_us, node, cost in counted if time_us <= last_us]
        seen.is_reported = True
        best = _best(in_time, seen.call.criterion)
        if best is not None and best[0] != award.winner and award.winner in {node for node, _ in in_time}:
            what = f"call {award.call} goes to {award.winner}, though {best[0]} bid {best[1]}"
            self.find(event, (award.sender, award.winner, best[0]), what)


def _best(bids: list[tuple[int, int]], criterion: Criterion) -> tuple[int, int] | None:
    best: tuple[int, int] | None = None
    for node, cost in bids:
        if best is None or _is_better(cost, node, best[1], best[0], criterion):
            best = (node, cost)
    return best


def _is_better(cost: int, node: int, than: int, of: int, criterion: Criterion) -> bool:
    difference = cost - than
    if criterion is Criterion.FINISH_TIME:
        # Bus time in ms wraps: of two times less than half of its range apart the earlier is better.
        difference = (difference + _HALF_MS) % (2 * _HALF_MS) - _HALF_MS
    return difference < 0 or (difference == 0 and node < of)


def _outcome(award: Award) -> str:
    return f"{award.result.name} for {award.winner}" if award.winner else award.result.name
