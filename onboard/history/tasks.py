"""Every task of a bus: what it asks for, who has it, the phases told of it, and what was promised."""

from dataclasses import dataclass, field

from onboard.contract.codes import CallResult, Criterion, Operation, TaskPhase
from onboard.contract.messages import Award, Reference, TaskReport
from onboard.history.bounds import drop_oldest
from onboard.history.calls import CallAnswered, CallOpened

#: Phases of tasks after which nothing is waited for.
TASKS_OVER = (TaskPhase.DONE, TaskPhase.REFUSED)
#: Phases of tasks that are begun.
TASKS_IN_HAND = (TaskPhase.STARTED, TaskPhase.LOADED)
#: Ends of a call after which its task has neither an owner nor a call.
CALLS_OVER = (CallResult.REFUSED, CallResult.WITHDRAWN, CallResult.REJECTED)


@dataclass(slots=True)
class TaskHistory:
    """One task: the last phase told, when each phase was first told (us of the log), and its calls."""

    operation: Operation
    calls: int = 0
    owner: int = 0
    phase: TaskPhase = TaskPhase.OPEN
    phase_us: dict[TaskPhase, int] = field(default_factory=dict)
    promised_ms: int | None = None
    depth: int = 0
    #: What is carried or worked on; where no call told it, the task's own name.
    load: Reference | None = None
    #: Whether its last call ended without a winner, or its caller wants it no more: until it is called once more, or
    #: begun all the same.
    is_closed: bool = False

    @property
    def is_over(self) -> bool:
        """Whether it was done or refused."""
        return self.phase in TASKS_OVER

    def is_aside(self, name: Reference) -> bool:
        """Whether a task of this ``name`` parks what is inside already; who comes in gives its name to the task."""
        return self.operation is Operation.PARK and self.load not in (None, name)

    @property
    def is_waiting(self) -> bool:
        """Whether somebody waits for its end; a sub-task is nobody's until it is awarded."""
        return not self.is_over and not self.is_closed and (self.depth == 0 or self.owner != 0)


@dataclass(frozen=True, slots=True)
class TaskTold:
    """A report; its phase ``before``, and whether this one is told for the first time.

    Of a task that nobody has heard of ``task`` and ``before`` are None, and nothing is its first.
    """

    task: TaskHistory | None
    report: TaskReport
    before: TaskPhase | None
    is_first: bool


class TaskFold:
    """A fold over what calls and reports tell; ``most`` tasks are kept, None for all."""

    def __init__(self, most: int | None) -> None:
        self.by_name: dict[Reference, TaskHistory] = {}
        self._most = most

    def open(self, reference: Reference, operation: Operation, time_us: int) -> bool:
        """A task is told for the first time, by a call or otherwise; False where it was known."""
        if reference in self.by_name:
            return False
        self.by_name[reference] = TaskHistory(operation, phase_us={TaskPhase.OPEN: time_us})
        if self._most is not None:
            drop_oldest(self.by_name, self._most, lambda task: not task.is_waiting)
        return True

    def own(self, reference: Reference, owner: int) -> None:
        """Who has a task, 0 for nobody any more, where no award of a call tells it."""
        if reference in self.by_name:
            self.by_name[reference].owner = owner
            self.by_name[reference].phase = TaskPhase.AWARDED if owner else TaskPhase.OPEN

    def on_call(self, fact: CallOpened) -> None:
        """A call for a task, or for a part of one."""
        call = fact.call.terms
        is_new = self.open(call.task, call.operation, fact.call.opened_us)
        task = self.by_name[call.task]
        if is_new:
            task.depth = call.depth
        task.calls += 1
        task.is_closed = False
        task.load = call.car

    def on_answer(self, fact: CallAnswered) -> None:
        """The end of a call: somebody has the task, or nobody any more."""
        if fact.is_withdrawal:
            self._on_withdrawal(fact.award)
        if fact.call is None or not fact.is_end:
            return
        call, award = fact.call.terms, fact.award
        self.open(call.task, call.operation, fact.call.opened_us)
        task = self.by_name[call.task]
        if call.operation is not task.operation:
            return
        if award.result in CALLS_OVER:
            task.is_closed = True
        if award.result is CallResult.AWARDED:
            task.owner = award.winner
            if call.criterion is Criterion.FINISH_TIME:
                task.promised_ms = fact.call.cost_of(award.winner)

    def _on_withdrawal(self, award: Award) -> None:
        """Its caller wants it no more, in whatever call it was; who had it already may be at it all the same."""
        task = self.by_name.get(award.task)
        if task is not None:
            task.is_closed = True

    def on_report(self, report: TaskReport, time_us: int) -> TaskTold:
        """What its owner or its caller says of it."""
        task = self.by_name.get(report.task)
        if task is None:
            return TaskTold(None, report, None, is_first=False)
        is_first, before = report.phase not in task.phase_us, task.phase
        task.phase = report.phase
        if report.phase in TASKS_IN_HAND and report.sender == task.owner:
            task.is_closed = False
        if is_first and report.phase is TaskPhase.AWARDED and not task.owner:
            # Ordered by name, without a call.
            task.owner = report.sender
        task.phase_us.setdefault(report.phase, time_us)
        return TaskTold(task, report, before, is_first)
