"""What a machine has undertaken: from the bid that won to the word that it is over, one table for every system.

What is won is journalled before it is told, and told again whenever its award or its call is heard again. An award for
a bid of which nothing is known, as the journal was lost or the machine was started again before it was written, is
given back at once.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from typing import Generic, TypeVar

from onboard.contract.codes import CallResult, Reason, TaskPhase
from onboard.contract.messages import Award, CallForProposals, Message, Reference, TaskReport
from onboard.core.behaviour import Fleet
from onboard.core.effects import Effect, Send
from onboard.core.journal_records import MOST_OVER

#: Of these the newest so many are told again to whoever asks for all.
MOST_TOLD = 32


class TaskStanding(Enum):
    """How a task stands with this machine."""

    UNKNOWN = "nothing is known of it, or it is another's"
    WON = "it is in hand, and not begun"
    BEGUN = "it is begun: nobody else can do it"
    OVER = "it is over"


class TaskEvent(Enum):
    """What happens to a task."""

    WIN = "a bid for it has won, or its giver names this machine"
    AWARDED_AGAIN = "its award to this machine is heard, beside the bid that it is for"
    CALLED = "it is called for"
    TO_ANOTHER = "its giver awards it to another, or to nobody"
    END = "it is done, or its giver takes it back"
    GIVE_UP = "this machine cannot do it"


class UndertakingAnswer(Enum):
    """What is said of it."""

    NOTHING = "nothing"
    REPORT = "how it stands"
    GIVES_BACK = "that its bid is forgotten"


_UNKNOWN, _WON, _BEGUN, _OVER = TaskStanding
#: What follows, and what is said; an event that has no line here changes nothing, and nothing is said.
TABLE: dict[tuple[TaskStanding, TaskEvent], tuple[TaskStanding, UndertakingAnswer]] = {
    (_UNKNOWN, TaskEvent.WIN): (_WON, UndertakingAnswer.REPORT),
    (_UNKNOWN, TaskEvent.AWARDED_AGAIN): (_UNKNOWN, UndertakingAnswer.GIVES_BACK),
    # Its giver takes back what this machine was never told of.
    (_UNKNOWN, TaskEvent.END): (_OVER, UndertakingAnswer.REPORT),
    (_WON, TaskEvent.WIN): (_WON, UndertakingAnswer.REPORT),
    (_WON, TaskEvent.AWARDED_AGAIN): (_WON, UndertakingAnswer.REPORT),
    (_WON, TaskEvent.CALLED): (_WON, UndertakingAnswer.REPORT),
    (_WON, TaskEvent.TO_ANOTHER): (_UNKNOWN, UndertakingAnswer.NOTHING),
    (_WON, TaskEvent.END): (_OVER, UndertakingAnswer.REPORT),
    (_WON, TaskEvent.GIVE_UP): (_UNKNOWN, UndertakingAnswer.NOTHING),
    (_BEGUN, TaskEvent.WIN): (_BEGUN, UndertakingAnswer.REPORT),
    (_BEGUN, TaskEvent.AWARDED_AGAIN): (_BEGUN, UndertakingAnswer.REPORT),
    (_BEGUN, TaskEvent.CALLED): (_BEGUN, UndertakingAnswer.REPORT),
    (_BEGUN, TaskEvent.END): (_OVER, UndertakingAnswer.REPORT),
    (_BEGUN, TaskEvent.GIVE_UP): (_UNKNOWN, UndertakingAnswer.NOTHING),
    (_OVER, TaskEvent.WIN): (_OVER, UndertakingAnswer.REPORT),
    (_OVER, TaskEvent.AWARDED_AGAIN): (_OVER, UndertakingAnswer.REPORT),
    (_OVER, TaskEvent.CALLED): (_OVER, UndertakingAnswer.REPORT),
    (_OVER, TaskEvent.END): (_OVER, UndertakingAnswer.REPORT),
}

AWork = TypeVar("AWork")


def gives_back(fleet: Fleet, award: Award) -> list[Effect]:
    """The one rule for a lost journal: an award to me for a bid that I do not know is given back, and why is said."""
    if fleet.negotiation.knows(award.sender, award.call):
        return []
    return [Send(TaskReport(fleet.node_id, award.task, TaskPhase.FORFEITED, 0, Reason.JOURNAL_LOST))]


@dataclass
class Undertakings(Generic[AWork]):
    """All tasks of one machine, in the order in which it took them on.

    ``is_begun`` tells whether one can be another's no more; ``may_give``, whether a node may give it to another;
    ``lose`` what follows where it does; ``changed`` is called after any has come or gone.
    """

    fleet: Fleet
    is_begun: Callable[[AWork], bool]
    may_give: Callable[[AWork, int], bool]
    lose: Callable[[AWork], list[Effect]]
    changed: Callable[[], None] = lambda: None
    in_hand: dict[Reference, AWork] = field(default_factory=dict)
    over: dict[Reference, None] = field(default_factory=dict)
    #: Of these, what was taken back by who gave it.
    cancelled: set[Reference] = field(default_factory=set)
    #: Of ``in_hand``, what another may do, as a person holds this machine: said until it is called for.
    left: set[Reference] = field(default_factory=set)

    def standing(self, task: Reference) -> TaskStanding:
        """How a task stands here: unknown, won, begun or over."""
        if task in self.in_hand:
            return _BEGUN if self.is_begun(self.in_hand[task]) else _WON
        return _OVER if task in self.over else _UNKNOWN

    def knows(self, task: Reference) -> bool:
        """Whether it is in hand, or over."""
        return task in self.in_hand or task in self.over

    # --- events ------------------------------------------------------------------------------------------------

    def meet(self, task: Reference, event: TaskEvent, work: AWork | None = None) -> UndertakingAnswer:
        """What an event does to a task; ``work`` is what is taken on, where it is won. What is to be said of it."""
        was = self.standing(task)
        following, answer = TABLE.get((was, event), (was, UndertakingAnswer.NOTHING))
        if following is was:
            return answer
        self.left.discard(task)
        if following is _WON:
            assert work is not None, "what is won has work in it"
            self.in_hand[task] = work
        else:
            self.in_hand.pop(task, None)
        if following is _OVER:
            self.remember(task)
        self.changed()
        return answer

    def hear(self, message: Message) -> list[Effect]:
        """Awards and calls for what is in hand, or was."""
        match message:
            case Award() if message.winner == self.fleet.node_id and message.result is CallResult.AWARDED:
                if self.meet(message.task, TaskEvent.AWARDED_AGAIN) is UndertakingAnswer.GIVES_BACK:
                    return gives_back(self.fleet, message)
                return [self.report(message.task)]
            case Award(result=CallResult.AWARDED | CallResult.REJECTED) if message.task in self.in_hand:
                one = self.in_hand[message.task]
                if not self.may_give(one, message.sender):
                    return []
                self.meet(message.task, TaskEvent.TO_ANOTHER)
                return self.lose(one) if message.task not in self.in_hand else []
            case CallForProposals() if message.task in self.left:
                return self._is_called(message.task, message.sender)
            case CallForProposals():
                answer = self.meet(message.task, TaskEvent.CALLED)
                return [self.report(message.task)] if answer is UndertakingAnswer.REPORT else []
        return []

    def _is_called(self, task: Reference, caller: int) -> list[Effect]:
        """What I have left is called for by who gave it: it is nobody's now, and may be mine again."""
        one = self.in_hand[task]
        if not self.may_give(one, caller):
            return []
        self.meet(task, TaskEvent.GIVE_UP)
        return self.lose(one)

    def remember(self, task: Reference) -> None:
        """It is over, as the journal says."""
        self.in_hand.pop(task, None)
        self.over[task] = None
        if len(self.over) > MOST_OVER:
            oldest = next(iter(self.over))
            del self.over[oldest]
            self.cancelled.discard(oldest)

    # --- words -------------------------------------------------------------------------------------------------

    def report(self, task: Reference) -> Send:
        """How a task that is known stands."""
        phase, reason = TaskPhase.AWARDED if task in self.in_hand else TaskPhase.DONE, Reason.NONE
        if task in self.cancelled:
            phase, reason = TaskPhase.REFUSED, Reason.CANCELLED
        if task in self.left:
            phase, reason = TaskPhase.FORFEITED, Reason.OPERATOR
        return Send(TaskReport(self.fleet.node_id, task, phase, 0, reason))

    def reports(self) -> list[Effect]:
        """What is in hand, and the newest of what is over."""
        return [self.report(task) for task in (*self.in_hand, *sorted([*self.over][-MOST_TOLD:]))]
