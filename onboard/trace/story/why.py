"""Why a customer waited: the time of one task, from its call to its end, cut into parts with a cause and a culprit.

Every moment belongs to exactly one part, so the parts sum to the waiting time. What a part is put down to is what the
fleet bus said last before it: silence, a wait that was announced, a refusal, a plan, a place.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

from onboard.contract.codes import CallResult, Grade, LegAction, ManualMode, Operation, Reason, TaskPhase, TokenKind
from onboard.contract.messages import (
    CallForProposals,
    Heartbeat,
    Itinerary,
    Leg,
    ManualState,
    Message,
    Progress,
    Reference,
    TaskReport,
    TokenRefusal,
    Waiting,
)
from onboard.core.serial import ms_after
from onboard.core.site import Segment, Site, Station
from onboard.history.calls import CallAnswered, CallOpened, Calls, is_task
from onboard.systems.words import plain
from onboard.trace.words import Words
from onboard.ways.site import way_site

#: Heartbeats missed in a row after which a machine counts as silent.
MISSED_BEATS = 2
#: A refusal explains standing for this long; a request that still waits is repeated sooner, us.
_REFUSAL_US = 3_000_000
_ENDS = (TaskPhase.DONE, TaskPhase.REFUSED)


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
    end_us: int | None = None
    #: The call's state: its result if it was closed without an owner.
    result: CallResult | None = None
    reason: Reason = Reason.NONE

    @property
    def waited_us(self) -> int:
        """From the call to the end, or as far as the log goes."""
        return (self.parts[-1].end_us if self.parts else self.begin_us) - self.begin_us


@dataclass
class _WaitingMachine:
    at: Segment | None = None
    is_moving: bool = False
    heard_us: int = 0
    legs: tuple[Leg, ...] = ()
    leg: int = 0
    wait: Waiting | None = None
    refusal: tuple[int, TokenRefusal] | None = None
    boot: int | None = None
    #: Started anew and has not moved since.
    is_fresh: bool = False
    #: A person holds it, and it has come to rest.
    is_held: bool = False
    #: What it does by its own last word, in a system whose machines tell that.
    deed: str = ""


class WaitingStory:
    """A fold over the fleet bus: feed every message in the order of the log, then ``finish``."""

    def __init__(self, site: Site, words: Words | None = None) -> None:
        self.tasks: dict[Reference, TaskStory] = {}
        self._site = site
        self._words = words or Words(site)
        self._calls = Calls()
        self._bodies: dict[int, _WaitingMachine] = {}
        self._open: list[TaskStory] = []
        self._silence_us = MISSED_BEATS * site.timing.heartbeat_us
        self._now_us: int | None = None

    def feed(self, message: Message, time_us: int) -> None:
        """Take up one message; times that go back are held."""
        time_us = max(time_us, self._now_us or time_us)
        self._settle(time_us)
        self._now_us = time_us
        body = self._body(message.sender)
        if isinstance(message, Heartbeat):
            self._on_heartbeat(body, message, time_us)
        body.heard_us = time_us
        self._words.hear(message)
        body.deed = self._words.system.deed(message) or body.deed
        self._deal(message, time_us)
        match message:
            case TaskReport():
                self._on_report(message, time_us)
            case Progress():
                self._on_progress(body, message)
            case Itinerary() if message.grade is Grade.FIRM:
                body.legs, body.leg = message.legs, 0
            case Waiting():
                body.wait = message
            case ManualState():
                body.is_held = message.at_rest and message.manual_mode is not ManualMode.AUTOMATIC
            case TokenRefusal():
                self._body(message.requester).refusal = (time_us, message)

    def _deal(self, message: Message, time_us: int) -> None:
        """What a message tells of calls, and of tasks that no report ends."""
        done = self.tasks.get(self._words.system.finished(message) or Reference(0, 0))
        if done is not None and done.end_us is None:
            done.phases.setdefault(TaskPhase.DONE, time_us)
            self._end(done, time_us)
        match self._calls.feed(message, time_us):
            case CallOpened() as fact if is_task(fact.call.terms):
                self._on_call(fact.call.terms, time_us)
            case CallAnswered() as fact:
                self._on_answer(fact)

    def finish(self) -> None:
        """The log has ended: what is still waited for lasts until then."""
        if self._now_us is not None:
            self._settle(self._now_us)

    # --- messages ----------------------------------------------------------------------------------------------

    def _body(self, node: int) -> _WaitingMachine:
        return self._bodies.setdefault(node, _WaitingMachine())

    def _on_heartbeat(self, body: _WaitingMachine, beat: Heartbeat, time_us: int) -> None:
        if body.boot is not None and body.boot != beat.boot:
            body.is_fresh, body.is_moving, body.wait, body.refusal = True, False, None, None
            for story in self._open:
                if beat.sender == (story.owner or story.caller):
                    _put_down(story, body.heard_us, time_us, Cause("was off, and started anew", beat.sender))
        body.boot = beat.boot

    def _on_call(self, call: CallForProposals, time_us: int) -> None:
        story = self.tasks.get(call.task)
        if story is not None and story.end_us is None:
            story.calls += call.attempt > story.calls
            story.result = None
            return
        story = self.tasks[call.task] = TaskStory(call.task, call.operation, call.sender, time_us)
        self._open.append(story)

    def _on_answer(self, fact: CallAnswered) -> None:
        award = fact.award
        story = self.tasks.get(award.task)
        if story is None or story.end_us is not None or award.sender != story.caller:
            return
        if award.result is CallResult.AWARDED:
            story.owner = award.winner
        else:
            story.result, story.reason = award.result, award.reason

    def _on_report(self, report: TaskReport, time_us: int) -> None:
        story = self.tasks.get(report.task)
        if story is None or story.end_us is not None or report.sender not in (story.owner, story.caller):
            return
        story.phases.setdefault(report.phase, time_us)
        if report.phase in _ENDS:
            self._end(story, time_us)
        elif report.phase is TaskPhase.FORFEITED:
            story.owner = 0

    def _end(self, story: TaskStory, time_us: int) -> None:
        story.end_us = time_us
        self._open.remove(story)

    def _on_progress(self, body: _WaitingMachine, progress: Progress) -> None:
        at = Segment(progress.track, progress.index)
        is_moving = progress.speed_mm_s != 0
        if is_moving or at != body.at:
            body.wait = body.refusal = None
            body.is_fresh = False
        body.at, body.is_moving, body.leg = at, is_moving, progress.leg

    # --- time --------------------------------------------------------------------------------------------------

    def _settle(self, now_us: int) -> None:
        """Book the time since the last message of each open task."""
        for story in self._open:
            begin_us = story.parts[-1].end_us if story.parts else story.begin_us
            whom = story.owner or story.caller
            heard_us = self._body(whom).heard_us
            if now_us - heard_us > self._silence_us:
                # Nobody could know at first; now all since its last word is put down to the silence.
                _put_down(story, heard_us, now_us, Cause("silent: crashed, cut off or switched off", whom))
            elif now_us > begin_us:
                _put_down(story, begin_us, now_us, self._cause(story, begin_us))

    def _cause(self, story: TaskStory, now_us: int) -> Cause:
        if not story.owner:
            return self._negotiation(story)
        if self._body(story.owner).is_held:
            return Cause("held by a person", story.owner)
        before = next((one for one in self._open if one is not story and self._goes_first(one, story)), None)
        if before is not None:
            return Cause(f"still busy with task {self._words.reference(before.task)}", story.owner)
        body = self._body(story.owner)
        if not way_site(self._site).tracks:
            # Machines of other systems tell no place that this fold knows; what they do is in their system's words.
            phase = max(story.phases, default=TaskPhase.AWARDED)
            return Cause(body.deed or f"has the task, {plain(phase.name)}", story.owner)
        lift = self._lift_under(body)
        if lift is not None:
            return self._ride(story, body, lift, now_us)
        if body.is_moving:
            return Cause("drives", story.owner)
        return self._standing(story, body, now_us)

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

    def _lift_under(self, body: _WaitingMachine) -> int | None:
        """Lift track of the platform on which a robot stands."""
        return way_site(self._site).platforms.get(body.at) if body.at is not None else None

    def _ride(self, story: TaskStory, body: _WaitingMachine, lift: int, now_us: int) -> Cause:
        node = self._site.stewards[lift]
        cabin = self._body(node)
        if now_us - cabin.heard_us > self._silence_us:
            return Cause("silent, with the robot on its platform", node)
        if body.is_moving:
            return Cause("drives over the sill", story.owner)
        return Cause("carries the robot", node)

    def _lift_awaited(self, node: int, now_us: int) -> Cause:
        cabin = self._body(node)
        if now_us - cabin.heard_us > self._silence_us:
            return Cause("silent while awaited at the sill", node)
        return Cause("started anew, awaited at the sill" if cabin.is_fresh else "is not ready at the sill", node)

    def _standing(self, story: TaskStory, body: _WaitingMachine, now_us: int) -> Cause:
        if body.wait is not None:
            if body.wait.track in way_site(self._site).lifts:
                return self._lift_awaited(self._site.stewards[body.wait.track], now_us)
            at, why = self._words.system.slot(body.wait.track, body.wait.index), plain(body.wait.reason.name)
            return Cause(f"in the way at {at}: {why}", body.wait.blocker or story.owner)
        leg = body.legs[body.leg] if body.leg < len(body.legs) else None
        following = body.legs[body.leg + 1] if body.leg + 1 < len(body.legs) else None
        work = self._work(body)
        if work is not None:
            place = self._words.system.place(Station(work.track, work.from_index, work.side).number)
            done, noun = TaskPhase.LOADED in story.phases, self._words.system.noun
            return Cause(f"{'leaves' if done else 'takes'} the {noun} at {place}", story.owner)
        if body.is_fresh:
            return Cause("started anew: finds its place and the others' plans first", story.owner)
        refused = self._refused(body, now_us)
        if refused is not None:
            return refused
        ride = next((one for one in (leg, following) if one is not None and one.action is LegAction.RIDE), None)
        if ride is not None and (leg is ride or self._is_at_end(body, leg)):
            return self._lift_awaited(self._site.stewards.get(ride.track, 0), now_us)
        if leg is not None and leg.action is LegAction.STAND:
            return self._planned_wait(story, following)
        return Cause("about to move: rights asked for, orders on their way", story.owner)

    def _work(self, body: _WaitingMachine) -> Leg | None:
        """The plan's leg of taking or leaving a car right here: progress counts it with the way before it."""
        near = body.legs[body.leg : body.leg + 2]
        for leg in near:
            is_here = leg.action is LegAction.WORK and body.at == Segment(leg.track, leg.from_index)
            if is_here and (leg is near[0] or self._is_at_end(body, near[0])):
                return leg
        return None

    def _is_at_end(self, body: _WaitingMachine, leg: Leg | None) -> bool:
        return leg is not None and body.at == Segment(leg.track, leg.to_index)

    def _refused(self, body: _WaitingMachine, now_us: int) -> Cause | None:
        if body.refusal is None or now_us - body.refusal[0] > _REFUSAL_US:
            return None
        refusal = body.refusal[1]
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
        for node, other in self._bodies.items():
            if node != story.owner and any(
                leg.track == following.track and low <= max(leg.from_index, leg.to_index)
                and min(leg.from_index, leg.to_index) <= high and ms_after(leg.end_ms, following.end_ms) <= 0
                for leg in other.legs
            ):  # fmt: skip
                return Cause("goes first, by plan", node)
        return Cause("stands as planned", story.owner)


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
