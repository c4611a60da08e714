"""Calls, bids, tasks, promises and plans told anew: what the machines of a site dealt out among themselves.

All of it from messages of the fleet bus. A task is a call to park or to fetch that no other call stands behind; calls
for a part of it (a ride) are sub-calls.
"""

from collections import Counter
from dataclasses import dataclass, field

from onboard.contract.codes import CallResult, LegAction, Operation, TaskPhase
from onboard.contract.messages import CallForProposals, Leg, Message
from onboard.core.serial import ms_after
from onboard.history.calls import BidMade, CallAnswered, CallHistory, CallOpened
from onboard.history.history import Fact, History
from onboard.history.lives import WaitTold
from onboard.history.plans import PlanTold
from onboard.history.tasks import TaskTold

TASKS = (Operation.PARK, Operation.RETRIEVE)
#: A plan told anew so soon after another machine's plan is the answer to it, us. Machines answer within one turn, and a
#: plan of 31 legs takes 10 ms on a bus of 500 kbit/s.
ANSWER_US = 50_000
#: Why a plan was told anew: in answer to another's.
ANSWER = "another's plan"


@dataclass
class NegotiationCounts:
    """Everything counted since the last ``begin``; times in us of the log, slack in ms."""

    messages: Counter[str] = field(default_factory=Counter)
    calls: int = 0
    sub_calls: int = 0
    opened_again: int = 0
    refused: int = 0
    give_way_calls: int = 0
    bids: int = 0
    parked_us: list[int] = field(default_factory=list)
    fetched_us: list[int] = field(default_factory=list)
    #: Promised minus actual finishing time of each task done.
    slack_ms: list[int] = field(default_factory=list)
    #: By what changed (``times`` or ``way``) and why (``own time``, ``another's plan``, ``wait: REASON``).
    replans: Counter[tuple[str, str]] = field(default_factory=Counter)
    #: Ways taken without a task and not in answer to another's plan.
    unasked_moves: int = 0


class NegotiationFold:
    """A view of a history: give it every message of the fleet bus in the order of the log, and what was told by it."""

    def __init__(self, history: History) -> None:
        self.counts = NegotiationCounts()
        self._tasks = history.tasks
        self._plans = history.plans
        #: What each has waited for since it told its plan.
        self._waited: dict[int, str] = {}
        #: Stamps of awards whose winner has not told its plan yet.
        self._fresh: set[tuple[int, int, int]] = set()
        self._told_us: tuple[int, int] = (0, -ANSWER_US)
        self._clock = history.clock

    def begin(self) -> None:
        """Count from now on; open calls and tasks are kept."""
        self.counts = NegotiationCounts()

    def take(self, message: Message, fact: Fact | None, time_us: int) -> None:
        """Takes up a message of the fleet bus and what the history made of it, at ``time_us``."""
        self.counts.messages[type(message).__name__] += 1
        match fact:
            case WaitTold(word=word) if word.sender in self._plans.firm:
                self._waited[word.sender] = word.reason.name
            case PlanTold() if fact.is_firm:
                self._on_plan(fact, time_us)
            case CallOpened():
                self._on_call(fact.call.terms)
            case BidMade():
                self.counts.bids += 1
            case CallAnswered() if fact.call is not None and fact.is_end:
                self._on_end(fact.call, fact)
            case TaskTold() if fact.is_first and fact.report.phase is TaskPhase.DONE:
                self._on_done(fact, time_us)

    # --- calls and tasks ---------------------------------------------------------------------------------------

    def _on_call(self, call: CallForProposals) -> None:
        counts = self.counts
        counts.calls += 1
        counts.sub_calls += call.depth > 0
        counts.opened_again += call.attempt > 1
        counts.give_way_calls += call.operation is Operation.GIVE_WAY

    def _on_end(self, call: CallHistory, end: CallAnswered) -> None:
        award = end.award
        self.counts.refused += award.result is CallResult.REFUSED
        if award.result is CallResult.AWARDED and not call.terms.depth and call.terms.operation in TASKS:
            self._fresh.add((award.winner, award.sender, award.call & 0xFF))

    def _on_done(self, statement: TaskTold, time_us: int) -> None:
        task = statement.task
        if task is None or task.operation not in TASKS or task.is_aside(statement.report.task):
            return
        done = self.counts.parked_us if task.operation is Operation.PARK else self.counts.fetched_us
        done.append(time_us)
        if task.promised_ms is not None and task.owner == statement.report.sender:
            self.counts.slack_ms.append(-ms_after((time_us - (self._clock.offset_us or 0)) // 1000, task.promised_ms))

    # --- plans -------------------------------------------------------------------------------------------------

    def _on_plan(self, fact: PlanTold, time_us: int) -> None:
        itinerary, old = fact.plan, fact.before
        if old is not None and old.version == itinerary.version:
            return
        waited = self._waited.pop(itinerary.sender, None)
        teller, told_us = self._told_us
        self._told_us = (itinerary.sender, time_us)
        award = (itinerary.sender, itinerary.stamp.initiator, itinerary.stamp.call)
        if award in self._fresh:
            self._fresh.discard(award)
            return
        if old is None:
            return
        why = "own time" if waited is None else f"wait: {waited}"
        if teller != itinerary.sender and time_us - told_us <= ANSWER_US:
            why = ANSWER
        what = "times" if _is_rest_of(itinerary.legs, old.legs) else "way"
        self.counts.replans[what, why] += 1
        if what == "way" and why != ANSWER and not self._has_task(itinerary.sender):
            self.counts.unasked_moves += 1

    def _has_task(self, node: int) -> bool:
        return any(
            task.owner == node and not task.is_over and task.operation in TASKS for task in self._tasks.by_name.values()
        )


def _is_rest_of(new: tuple[Leg, ...], old: tuple[Leg, ...]) -> bool:
    """Whether the new plan goes the old one's way from somewhere on; waits may come, go and change."""
    after, before = ([_way(leg) for leg in legs if leg.action is not LegAction.STAND] for legs in (new, old))
    return before[len(before) - len(after) :] == after if len(after) <= len(before) else False


def _way(leg: Leg) -> tuple[int, int, int, int]:
    return leg.action, leg.track, leg.to_index, leg.side
