"""Why a customer waited: the time of one task, from its call to its end, cut into parts with a cause and a culprit.

Every moment belongs to exactly one part, so the parts sum to the waiting time. What a part is put down to is what the
fleet bus said last before it: silence, a wait that was announced, a refusal, a plan, a place.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

from onboard.contract.codes import CallResult, LegAction, Operation, Reason, TaskPhase, TokenKind
from onboard.contract.messages import CallForProposals, Leg, Message, Reference, TaskReport
from onboard.core.serial import ms_after
from onboard.core.site import Segment, Site, Station
from onboard.history.calls import CallAnswered, CallOpened, is_task
from onboard.history.history import History
from onboard.history.lives import Beat
from onboard.history.tasks import TASKS_IN_HAND, TASKS_OVER, TaskTold
from onboard.systems.words import plain
from onboard.trace.words import Words
from onboard.ways.site import way_site

#: Heartbeats missed in a row after which a machine counts as silent.
MISSED_BEATS = 2
#: A refusal explains standing for this long; a request that still waits is repeated sooner, us.
_REFUSAL_US = 3_000_000
_BEGUN = (*TASKS_IN_HAND, TaskPhase.DONE)


class Cause(NamedTuple):
    """What a part was spent on, in words, and the machine that it was spent on, 0 for none."""

    what: str
    whom: int = 0


@dataclass
class WaitingPart:
    """One stretch of time, us of the log."""

    cause: Cause
    begin_us: int
    end_us: int

    @property
    def length_us(self) -> int:
        """How long this part of the wait lasted, us."""
        return self.end_us - self.begin_us


@dataclass
class TaskStory:
    """One task; ``end_us`` None while it is going on. ``phases``: when each phase was first told."""

    task: Reference
    operation: Operation
    caller: int
    begin_us: int
    parts: list[WaitingPart] = field(default_factory=list)
    phases: dict[TaskPhase, int] = field(default_factory=dict)
    owner: int = 0
    calls: int = 1
    #: Number of the place at which the load is taken.
    source: int = 0
    end_us: int | None = None
    #: The call's state: its result if it was closed without an owner.
    result: CallResult | None = None
    reason: Reason = Reason.NONE

    @property
    def waited_us(self) -> int:
        """From the call to the end, or as far as the log goes."""
        return (self.parts[-1].end_us if self.parts else self.begin_us) - self.begin_us

    @property
    def is_called_off(self) -> bool:
        """Whether its caller wants it no more: until it is called anew, or begun all the same."""
        return self.end_us is not None and self.result is CallResult.WITHDRAWN


class WaitingStory:
    """A view of a history of its own: feed every message in the order of the log, then ``finish``."""

    def __init__(self, site: Site, words: Words | None = None) -> None:
        self.tasks: dict[Reference, TaskStory] = {}
        self._site = site
        self._words = words or Words(site)
        self._history = History(site, is_bounded=False)
        self._lives = self._history.lives
        #: What each does by its own last word, in a system whose machines tell that.
        self._deeds: dict[int, str] = {}
        self._open: list[TaskStory] = []
        self._silence_us = MISSED_BEATS * site.timing.heartbeat_us
        self._now_us: int | None = None

    def feed(self, message: Message, time_us: int) -> None:
        """Take up one message; times that go back are held."""
        time_us = max(time_us, self._now_us or time_us)
        self._settle(time_us)
        self._now_us = time_us
        fact = self._history.feed(message, time_us)
        if isinstance(fact, Beat) and fact.is_restart:
            self._on_restart(message.sender, fact.heard_us, time_us)
        self._words.hear(message)
        self._deeds[message.sender] = self._words.system.deed(message) or self._deeds.get(message.sender, "")
        done = self.tasks.get(self._words.system.finished(message) or Reference(0, 0))
        if done is not None and done.end_us is None:
            done.phases.setdefault(TaskPhase.DONE, time_us)
            self._end(done, time_us)
        match fact:
            case CallOpened() if is_task(fact.call.terms):
                self._on_call(fact.call.terms, time_us)
            case CallAnswered():
                self._on_answer(fact)
            case TaskTold():
                self._on_report(fact.report, time_us)

    def finish(self) -> None:
        """The log has ended: what is still waited for lasts until then."""
        if self._now_us is not None:
            self._settle(self._now_us)

    # --- messages ----------------------------------------------------------------------------------------------

    def _on_restart(self, node: int, heard_us: int, time_us: int) -> None:
        for story in self._open:
            if node == (story.owner or story.caller):
                _put_down(story, heard_us, time_us, Cause("was off, and started anew", node))

    def _on_call(self, call: CallForProposals, time_us: int) -> None:
        story = self._going(call.task)
        if story is not None:
            story.calls += call.attempt > story.calls
            story.result = None
            return
        story = TaskStory(call.task, call.operation, call.sender, time_us, source=call.from_station)
        self.tasks[call.task] = story
        self._open.append(story)

    def _going(self, task: Reference) -> TaskStory | None:
        """The story of a task that is not over; one that was called off goes on."""
        story = self.tasks.get(task)
        if story is not None and story.is_called_off:
            story.end_us = story.result = None
            self._open.append(story)
        return None if story is None or story.end_us is not None else story

    def _on_answer(self, fact: CallAnswered) -> None:
        award = fact.award
        story = self.tasks.get(award.task)
        if story is None or story.end_us is not None or award.sender != story.caller:
            return
        if award.result is CallResult.AWARDED:
            story.owner = award.winner
            if story.operation is Operation.RECEIVE and story.owner == story.caller:
                self._is_received(story, self._now_us or story.begin_us)
        else:
            story.result, story.reason = award.result, award.reason
            if fact.is_withdrawal:
                self._end(story, self._now_us or story.begin_us)

    def _is_received(self, story: TaskStory, time_us: int) -> None:
        """It is known where a load is handed out: whoever does it calls for that under a task of its own."""
        story.phases.setdefault(TaskPhase.DONE, time_us)
        self._end(story, time_us)

    def _on_report(self, report: TaskReport, time_us: int) -> None:
        story = self.tasks.get(report.task)
        if story is None or report.sender not in (story.owner, story.caller):
            return
        if report.phase in _BEGUN:
            self._going(report.task)
        if story.end_us is not None:
            return
        story.phases.setdefault(report.phase, time_us)
        if report.phase in TASKS_OVER:
            self._end(story, time_us)
        elif story.operation is Operation.RECEIVE and report.phase is TaskPhase.AWARDED:
            self._is_received(story, time_us)
        elif report.phase is TaskPhase.FORFEITED:
            story.owner = 0

    def _end(self, story: TaskStory, time_us: int) -> None:
        story.end_us = time_us
        self._open.remove(story)

    # --- time --------------------------------------------------------------------------------------------------

    def _settle(self, now_us: int) -> None:
        """Book the time since the last message of each open task."""
        for story in self._open:
            begin_us = story.parts[-1].end_us if story.parts else story.begin_us
            whom = story.owner or story.caller
            heard_us = self._lives.heard_us.get(whom, 0)
            if self._is_silent(whom, now_us):
                # Nobody could know at first; now all since its last word is put down to the silence.
                _put_down(story, heard_us, now_us, Cause("silent: crashed, cut off or switched off", whom))
            elif now_us > begin_us:
                _put_down(story, begin_us, now_us, self._cause(story, begin_us))

    def _cause(self, story: TaskStory, now_us: int) -> Cause:
        if not story.owner:
            return self._negotiation(story)
        if self._history.hands.is_at_rest(story.owner):
            return Cause("held by a person", story.owner)
        before = next((one for one in self._open if one is not story and self._goes_first(one, story)), None)
        if before is not None:
            return Cause(f"still busy with task {self._words.reference(before.task)}", story.owner)
        if not way_site(self._site).tracks:
            # Machines of other systems tell no place that this fold knows; what they do is in their system's words.
            phase = max(story.phases, default=TaskPhase.AWARDED)
            return Cause(self._deeds.get(story.owner) or f"has the task, {plain(phase.name)}", story.owner)
        at = self._at(story.owner)
        lift = way_site(self._site).platforms.get(at) if at is not None else None
        if lift is not None:
            return self._ride(story, lift, now_us)
        if self._is_moving(story.owner):
            return Cause("drives", story.owner)
        return self._standing(story, now_us)

    def _negotiation(self, story: TaskStory) -> Cause:
        if story.result is not None:
            why = self._words.system.reason(story.reason)
            return Cause(f"call {story.result.name.lower()}: {why}", story.caller)
        again = f", attempt {story.calls}" if story.calls > 1 else ""
        return Cause(f"call open: bids until its deadline{again}", story.caller)

    def _goes_first(self, other: TaskStory, story: TaskStory) -> bool:
        if other.owner != story.owner:
            return False
        begun = TaskPhase.STARTED in story.phases or TaskPhase.LOADED in story.phases
        return not begun and (TaskPhase.STARTED in other.phases or other.begin_us < story.begin_us)

    def _is_silent(self, node: int, now_us: int) -> bool:
        return now_us - self._lives.heard_us.get(node, 0) > self._silence_us

    def _at(self, node: int) -> Segment | None:
        """Where a machine is, before its first word at home; None for who is no machine of the site."""
        place = self._history.places.by_node.get(node)
        return place.segment if place is not None else None

    def _is_moving(self, node: int) -> bool:
        place = self._history.places.by_node.get(node)
        return place is not None and place.speed_mm_s != 0 and node not in self._lives.fresh

    def _ride(self, story: TaskStory, lift: int, now_us: int) -> Cause:
        node = self._site.stewards[lift]
        if self._is_silent(node, now_us):
            return Cause("silent, with the robot on its platform", node)
        if self._is_moving(story.owner):
            return Cause("drives over the sill", story.owner)
        return Cause("carries the robot", node)

    def _lift_awaited(self, node: int, now_us: int) -> Cause:
        if self._is_silent(node, now_us):
            return Cause("silent while awaited at the sill", node)
        is_fresh = node in self._lives.fresh
        return Cause("started anew, awaited at the sill" if is_fresh else "is not ready at the sill", node)

    def _standing(self, story: TaskStory, now_us: int) -> Cause:
        owner = story.owner
        _, wait = self._lives.waits.get(owner, (0, None))
        if wait is not None:
            if wait.track in way_site(self._site).lifts:
                return self._lift_awaited(self._site.stewards[wait.track], now_us)
            at, why = self._words.system.slot(wait.track, wait.index), plain(wait.reason.name)
            return Cause(f"in the way at {at}: {why}", wait.blocker or owner)
        near = self._near(story)
        leg, following = near[0] if near else None, near[1] if len(near) > 1 else None
        work = self._work(story, near)
        if work is not None:
            place = self._words.system.place(_place(work))
            done, noun = TaskPhase.LOADED in story.phases, self._words.system.noun
            return Cause(f"{'leaves' if done else 'takes'} the {noun} at {place}", owner)
        if owner in self._lives.fresh:
            return Cause("started anew: finds its place and the others' plans first", owner)
        refused = self._refused(owner, now_us)
        if refused is not None:
            return refused
        ride = next((one for one in (leg, following) if one is not None and one.action is LegAction.RIDE), None)
        if ride is not None and (leg is ride or self._is_at_end(owner, leg)):
            return self._lift_awaited(self._site.stewards.get(ride.track, 0), now_us)
        if leg is not None and leg.action is LegAction.STAND:
            return self._planned_wait(story, following)
        return Cause("about to move: rights asked for, orders on their way", owner)

    def _near(self, story: TaskStory) -> tuple[Leg, ...]:
        """The leg in hand and the next. Who stands as planned says no place anew: what is over is told by its end."""
        owner, near = story.owner, self._history.plans.ahead(story.owner)[:4]
        if near and near[0].action is LegAction.TRAVEL and self._is_at_end(owner, near[0]):
            near = near[1:]
        if near and near[0].action is LegAction.WORK and self._is_taken(story, near[0]):
            near = near[1:]
        return near[:2]

    def _is_taken(self, story: TaskStory, leg: Leg) -> bool:
        return TaskPhase.LOADED in story.phases and _place(leg) == story.source

    def _work(self, story: TaskStory, near: tuple[Leg, ...]) -> Leg | None:
        """The plan's leg of taking or leaving a car right here: progress counts it with the way before it."""
        owner = story.owner
        for leg in near:
            is_here = leg.action is LegAction.WORK and self._at(owner) == Segment(leg.track, leg.from_index)
            if is_here and not self._is_taken(story, leg) and (leg is near[0] or self._is_at_end(owner, near[0])):
                return leg
        return None

    def _is_at_end(self, owner: int, leg: Leg | None) -> bool:
        return leg is not None and self._at(owner) == Segment(leg.track, leg.to_index)

    def _refused(self, owner: int, now_us: int) -> Cause | None:
        told_us, refusal = self._lives.refusals.get(owner, (0, None))
        if refusal is None or now_us - told_us > _REFUSAL_US:
            return None
        if refusal.token_kind is TokenKind.SEGMENT and refusal.token >> 8 in way_site(self._site).lifts:
            # Platform and gate are asked for in turn: to the customer it is one wait.
            return self._lift_awaited(refusal.sender, now_us)
        why = self._words.system.reason(refusal.reason)
        token = self._words.system.resource(refusal.token_kind, refusal.token)
        return Cause(f"refuses {token}: {why}", refusal.sender)

    def _planned_wait(self, story: TaskStory, following: Leg | None) -> Cause:
        """A plan that has a machine stand lets another go first: whoever's plan is on the next run of segments."""
        if following is None:
            return Cause("stands as planned", story.owner)
        low, high = sorted((following.from_index, following.to_index))
        for node, plan in self._history.plans.firm.items():
            if node != story.owner and any(
                leg.track == following.track and low <= max(leg.from_index, leg.to_index)
                and min(leg.from_index, leg.to_index) <= high and ms_after(leg.end_ms, following.end_ms) <= 0
                for leg in plan.legs
            ):  # fmt: skip
                return Cause("goes first, by plan", node)
        return Cause("stands as planned", story.owner)


def _place(work: Leg) -> int:
    """The number of the place at which a leg takes or leaves something."""
    return Station(work.track, work.from_index, work.side).number


def _put_down(story: TaskStory, begin_us: int, end_us: int, cause: Cause) -> None:
    """All from ``begin_us`` to ``end_us`` was spent on this, whatever was thought of it before."""
    begin_us = max(begin_us, story.begin_us)
    while story.parts and story.parts[-1].begin_us >= begin_us:
        story.parts.pop()
    if story.parts:
        story.parts[-1].end_us = min(story.parts[-1].end_us, begin_us)
    if story.parts and story.parts[-1].cause == cause:
        story.parts[-1].end_us = end_us
    elif end_us > begin_us:
        story.parts.append(WaitingPart(cause, begin_us, end_us))


def task_lines(story: TaskStory, words: Words, start_us: int) -> list[str]:
    """The story of one task: its parts in order, then how much each machine and cause took."""
    what = words.system.operation(story.operation)
    state = (
        "served" if TaskPhase.DONE in story.phases else "not served in this log" if story.end_us is None else "refused"
    )
    state = "called off" if story.is_called_off else state
    if story.operation is Operation.RECEIVE and story.owner:
        what += f" at {words.machine(story.owner)}"
    lines = [
        f"task {words.reference(story.task)}: {what}, called by {words.machine(story.caller)} at "
        f"{(story.begin_us - start_us) / 1e6:.3f} s, {state}; waited {story.waited_us / 1e6:.3f} s"
    ]
    lines += [
        f"  {(part.begin_us - start_us) / 1e6:10.3f} s  {part.length_us / 1e6:9.3f} s  {_cause(part.cause, words)}"
        for part in story.parts
    ]
    totals: dict[Cause, int] = {}
    for part in story.parts:
        totals[part.cause] = totals.get(part.cause, 0) + part.length_us
    lines.append("  longest first:")
    for cause, length_us in sorted(totals.items(), key=lambda item: (-item[1], item[0])):
        share = length_us / story.waited_us if story.waited_us else 0.0
        lines.append(f"  {share:6.1%}  {length_us / 1e6:9.3f} s  {_cause(cause, words)}")
    lines.append(f"  {'sum':>6}  {sum(totals.values()) / 1e6:9.3f} s")
    return lines


def _cause(cause: Cause, words: Words) -> str:
    return f"{words.machine(cause.whom)}: {cause.what}" if cause.whom else cause.what
