"""Tasks: one owner each, who was awarded it (design, section 4)."""

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field

from onboard.contract.codes import CallResult, Operation, TaskPhase
from onboard.contract.messages import Award, CallForProposals, Reference, TaskReport
from onboard.trace.check.event import Finding, LogEvent
from onboard.trace.check.picture import BusPicture
from onboard.trace.check.rule import Handlers, Rule

#: Operations that are tasks of their own; calls for a part of one name the same task.
TASKS = (Operation.PARK, Operation.RETRIEVE)
#: Phases that only the owner of the task tells.
OWNERS_PHASES = (TaskPhase.STARTED, TaskPhase.LOADED, TaskPhase.DONE)
#: Who hears its award again answers at once, us: what a full bus and a busy controller take.
ANSWER_US = 1_000_000
#: Tasks remembered; older ones are long over.
MOST_TASKS = 4_096


@dataclass
class TaskSeen:
    """A task by its awards: its owner (0: nobody), under which version, and who won some part of it.

    ``done_in`` holds the boot counters of the lives in which its owner told that it is done; ``asked_us`` is when the
    award to its owner was said again last, us of the log, None for never.
    """

    owner: int = 0
    version: int = -1
    done_in: set[int | None] = field(default_factory=set)
    winners: set[int] = field(default_factory=set)
    asked_us: int | None = None
    #: When it was called for first, us of the log.
    called_us: int = 0


class OneOwner(Rule):
    """A task is awarded to one machine, and only that machine tells its phases.

    It changes hands only after its owner gave it back, or by a raised version of the right to it.
    """

    name = "one-owner"
    title = "one owner a task"
    source = "design 4: acts only on the award; re-award by the custodian under a raised version"

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._tasks: OrderedDict[Reference, TaskSeen] = OrderedDict()
        self._calls: OrderedDict[tuple[int, int], bool] = OrderedDict()

    def handlers(self) -> Handlers:
        """Reads calls, awards and reports of tasks."""
        return {CallForProposals: self._on_call, Award: self._on_award, TaskReport: self._on_report}

    def _on_call(self, event: LogEvent[CallForProposals]) -> None:
        call = event.message
        whole = call.depth == 0 and call.operation in TASKS
        self._calls[call.sender, call.call] = whole
        if len(self._calls) > MOST_TASKS:
            self._calls.popitem(last=False)
        if whole:
            self._tasks.setdefault(call.task, TaskSeen(called_us=event.time_us))
        if len(self._tasks) > MOST_TASKS:
            self._tasks.popitem(last=False)

    def _on_award(self, event: LogEvent[Award]) -> None:
        award = event.message
        task = self._tasks.get(award.task)
        if task is None:
            return
        if award.result is CallResult.REJECTED and self._calls.get((award.sender, award.call)):
            task.owner = 0
        if award.result is not CallResult.AWARDED:
            return
        task.winners.add(award.winner)
        if award.winner == task.owner:
            # It is to say how the task stands, whatever it has said of it before.
            task.asked_us = event.time_us
        if not self._calls.get((award.sender, award.call)):
            return
        if task.owner not in (0, award.winner) and award.task_version == task.version:
            what = f"task {_name(award.task)} is awarded to {award.winner}, and {task.owner} owns it"
            self.find(event, (award.sender, award.winner, task.owner), what)
        task.owner, task.version = award.winner, award.task_version

    def _could_know(self, report: TaskReport, task: TaskSeen) -> bool:
        """Whether its machine was heard before the task was called for, or the site's first life is in the log.

        Else it may have won it before: all others were off for a while, and bus time began anew without it.
        """
        first_us = self.picture.first_us.get(report.sender)
        is_known = self.picture.tokens.from_start or (first_us is not None and first_us <= task.called_us)
        self.picture.unjudged += not is_known
        return is_known

    def _on_report(self, event: LogEvent[TaskReport]) -> None:
        report = event.message
        task = self._tasks.get(report.task)
        if task is None:
            self.picture.unjudged += 1
            return
        # Whoever called for it says DONE of a winner that has forgotten the task.
        is_callers = report.phase is TaskPhase.DONE and report.sender == report.task.origin
        is_others = report.sender != task.owner and not is_callers
        if report.phase in OWNERS_PHASES and is_others and (task.owner or self._could_know(report, task)):
            owner = f"which {task.owner} owns" if task.owner else "which nobody was awarded"
            what = f"tells {report.phase.name} of task {_name(report.task)}, {owner}"
            self.find(event, (report.sender, task.owner), what)
        elif report.phase is TaskPhase.AWARDED and report.sender not in task.winners and self._could_know(report, task):
            self.find(event, (report.sender,), f"takes task {_name(report.task)} on without an award")
        if report.phase is TaskPhase.DONE and report.sender == task.owner:
            # Whoever was killed right after it says so once more after its restart: nobody may have heard it.
            life = self.picture.boots.get(report.sender)
            is_answer = task.asked_us is not None and event.time_us - task.asked_us <= ANSWER_US
            if life in task.done_in and not is_answer:
                self.find(event, (report.sender,), f"tells DONE of task {_name(report.task)} again")
            task.done_in.add(life)
        elif report.phase in (TaskPhase.FORFEITED, TaskPhase.REFUSED) and report.sender == task.owner:
            task.owner = 0


def _name(task: Reference) -> str:
    return f"{task.origin}.{task.number}"
