"""A robot as manager of the rests of its goals: called for, asked after, taken back (rows C05 to C07, C17, C18).

Whoever brings a part not all the way has a sub-goal for the rest of it, which is another robot's contract.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

from onboard.contract.codes import CallResult, Reason, TaskPhase
from onboard.contract.messages import ManualState, Reference, SyncRequest, TaskReport
from onboard.core.behaviour import Fleet
from onboard.core.effects import Effect, Send
from onboard.core.negotiation import Closed, NegotiationEvent
from onboard.systems.cell.contracts import Goal, part_token
from onboard.systems.cell.generation import call_terms
from onboard.systems.cell.memory import Undertaking, stage_record
from onboard.systems.cell.records import ContractStage
from onboard.work.manual import says_held
from onboard.work.told_once import ToldOnce
from onboard.work.undertaking import TaskEvent, Undertakings

#: A sub-goal that found nobody is called for again after this, us: an arm that was busy may be free.
CALL_AGAIN_US = 5_000_000
#: A sub-contractor that has the part is asked this often how it stands, us; so a lost word costs time only.
ASK_AGAIN_US = 20_000_000


@dataclass
class GoalRests:
    """The rests of the goals of one robot's contracts, each by the task of its contract."""

    fleet: Fleet
    tasks: Undertakings[Undertaking]
    _call_at_us: dict[Reference, int] = field(default_factory=dict)
    _ask_at_us: dict[Reference, int] = field(default_factory=dict)
    #: Rests whose calls an earlier life made: somebody may have won one.
    _unsure: set[Reference] = field(default_factory=set)
    #: Rests of contracts that were lost while nobody had them: the calls for them are void.
    _void: list[Goal] = field(default_factory=list)
    #: Robots in which a person has a hand.
    _held: set[int] = field(default_factory=set)
    _told: ToldOnce = field(default_factory=ToldOnce)

    def remember(self, one: Undertaking) -> None:
        """A contract of the journal: where nobody has its rest, somebody may have won a call that I do not know."""
        if one.sub_goal is not None and not one.successor:
            self._call_at_us[one.task] = 0
            self._unsure.add(one.task)

    def start(self, now_us: int) -> None:
        """Who has the rests of the journal's contracts is looked after from now on."""
        for one in self.tasks.in_hand.values():
            if one.sub_goal is not None and one.successor:
                self.fleet.winners.takes(one.sub_goal.task, one.successor, now_us)

    def begin(self, one: Undertaking, now_us: int) -> None:
        """A contract that was won: where its option has lapsed the rest of the goal is called for anew."""
        if one.sub_goal is not None and not one.successor:
            self._call_at_us[one.task] = now_us

    def lose(self, one: Undertaking) -> list[Effect]:
        """A contract that is another's: whoever has its rest hears that nobody needs it."""
        effects: list[Effect] = []
        if one.sub_goal is not None and one.successor:
            effects += self.fleet.winners.let_go(one.sub_goal.task)
        elif one.sub_goal is not None:
            self._void.append(one.sub_goal)
        self._forget(one)
        return effects

    def put_down(self, one: Undertaking, now_us: int) -> None:
        """The part lies where its sub-contractor takes it over: from now on that is to work."""
        if one.sub_goal is not None and one.successor and one.was_heard:
            self.fleet.winners.takes(one.sub_goal.task, one.successor, now_us)

    def achieve(self, one: Undertaking) -> list[Effect]:
        """A goal is reached; the manager is told of completion and of nothing before (row C18)."""
        one.stage = ContractStage.OVER
        self.tasks.meet(one.task, TaskEvent.END)
        self._forget(one)
        return [stage_record(one), self.tasks.report(one.task)]

    def next_wake(self) -> int | None:
        """When the next call or question is due, us."""
        return min((*self._call_at_us.values(), *self._ask_at_us.values()), default=None)

    # --- words of others ---------------------------------------------------------------------------------------

    def on_report(self, report: TaskReport, now_us: int) -> list[Effect]:
        """A sub-contractor has the goal in hand, or has achieved it: then mine is achieved too (row C18)."""
        one = self._of_rest(report.task)
        if one is None:
            # A rest of mine that was awarded once, and whose contract I have lost since: nobody is to bring it there.
            is_claim = report.phase is TaskPhase.AWARDED and report.task.origin == self.fleet.node_id
            return self.fleet.winners.remind(report.task, report.sender) if is_claim else []
        assert one.sub_goal is not None
        effects: list[Effect] = []
        if not one.successor and self._may_claim(one, report, now_us):
            # It has won a call that I do not remember.
            one.successor, one.was_heard = report.sender, True
            self._unsure.discard(one.task)
            self.fleet.winners.takes(one.sub_goal.task, one.successor, now_us)
            effects.append(stage_record(one))
            self._call_at_us.pop(one.task, None)
            effects += self._withdraw(one.sub_goal, now_us)
        if report.sender != one.successor:
            is_claim = report.phase is TaskPhase.AWARDED
            return self.fleet.winners.remind(report.task, report.sender) if is_claim else []
        self._ask_at_us.pop(one.task, None)
        if report.phase is TaskPhase.DONE and report.sender == one.successor and one.stage is ContractStage.PUT:
            return [*effects, *self.achieve(one)]
        return effects

    def on_closed(self, event: Closed, now_us: int) -> list[Effect]:
        """A call of mine is over: for an option that rests on no contract nothing follows."""
        task = event.call.task
        one = self._of_rest(task)
        if one is None or one.stage is ContractStage.OVER:
            return []
        if event.winner:
            one.successor, one.was_heard = event.winner, True
            self._unsure.discard(one.task)
            self.fleet.winners.takes(task, event.winner, now_us, event.call.call)
            return [stage_record(one), *self._news()]
        if one.successor and event.result is not CallResult.REJECTED:
            return []
        one.successor, one.was_heard = 0, False
        self._call_at_us[one.task] = now_us + CALL_AGAIN_US
        return [stage_record(one), *self._news()]

    def on_manual(self, word: ManualState) -> list[Effect]:
        """A person has a hand in another robot, or no more: told of each rest that waits for it."""
        (self._held.add if says_held(word) else self._held.discard)(word.sender)
        return self._news()

    def _news(self) -> list[Effect]:
        return self._told.news(self._waiting())

    def _waiting(self) -> Iterator[tuple[str, str]]:
        """Rests that wait for a person to let a robot go: it has them, or nobody else can do them."""
        if not self._held:
            return
        machines = self.fleet.site.machines
        for one in self.tasks.in_hand.values():
            what = f"the rest of goal {one.task.number} of {machines[one.task.origin].name}"
            if one.sub_goal is not None and one.successor in self._held:
                yield what, f"{machines[one.successor].name} has it, and is held"
            elif one.sub_goal is not None and not one.successor:
                yield what, "nobody can do it while machines are held"

    def _of_rest(self, task: Reference) -> Undertaking | None:
        """The contract whose rest is another's goal by this name."""
        return next((one for one in self.tasks.in_hand.values() if one.sub_goal and one.sub_goal.task == task), None)

    def _may_claim(self, one: Undertaking, report: TaskReport, now_us: int) -> bool:
        may_claim = one.task in self._unsure and report.phase is not TaskPhase.FORFEITED
        return may_claim and self.fleet.winners.may_claim(report.task, report.sender, now_us)

    # --- what is due -------------------------------------------------------------------------------------------

    def manage(self, now_us: int) -> list[Effect]:
        """Call for rests that nobody has, and ask sub-contractors that have had the part for long (row C17)."""
        effects: list[Effect] = []
        while self._void:
            effects += self._withdraw(self._void.pop(), now_us)
        for task, due_us in list(self._call_at_us.items()):
            one = self.tasks.in_hand.get(task)
            if one is None or one.sub_goal is None:
                del self._call_at_us[task]
            elif due_us <= now_us:
                del self._call_at_us[task]
                effects += self.fleet.negotiation.open(call_terms(one.sub_goal), now_us)
        for task, one in list(self.tasks.in_hand.items()):
            effects += self._take_back(one, now_us)
            if one.stage is ContractStage.PUT and one.sub_goal is None:
                # The controller stopped between putting the part down and saying so.
                effects += self.achieve(one)
            if one.stage is not ContractStage.PUT or not one.successor:
                self._ask_at_us.pop(task, None)
                continue
            due_us = self._ask_at_us.setdefault(task, now_us + ASK_AGAIN_US)
            if due_us <= now_us:
                self._ask_at_us[task] = now_us + ASK_AGAIN_US
                effects.append(Send(SyncRequest(self.fleet.node_id, one.successor)))
        return effects

    def _take_back(self, one: Undertaking, now_us: int) -> list[Effect]:
        """A sub-contractor that is lost while its part is in my custody: the rest is called for anew, without it."""
        if one.sub_goal is None or not self.fleet.tokens.holds(part_token(one.sub_goal.part)):
            return []
        reason = self.fleet.winners.lost(one.sub_goal.task, now_us)
        # Before the part lies where it is to be taken it has nothing to do but to wait.
        if reason is Reason.NONE or (reason is Reason.FALSE_STATEMENT and one.stage is not ContractStage.PUT):
            return []
        one.successor, one.was_heard = 0, False
        self._call_at_us[one.task] = now_us + CALL_AGAIN_US
        if one.stage is not ContractStage.WON:
            self.fleet.winners.blame(one.sub_goal.task, now_us)
        return [*self.fleet.winners.take_back(one.sub_goal.task, reason, now_us), stage_record(one)]

    def _withdraw(self, rest: Goal, now_us: int) -> list[Effect]:
        """Close the call for the rest of a goal, where one is open."""
        said = self.fleet.negotiation.withdraw(call_terms(rest), now_us)
        return [item for item in said if not isinstance(item, NegotiationEvent)]

    def _forget(self, one: Undertaking) -> None:
        for times in (self._ask_at_us, self._call_at_us):
            times.pop(one.task, None)
        if one.sub_goal is not None:
            self.fleet.winners.over(one.sub_goal.task)
