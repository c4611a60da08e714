"""Words that come late: a robot's task was taken from it, and its compartment failed before it gave it anew.

The robot has the task by its journal, or not any more; what both said of it before is still on the bus.
"""

from dataclasses import dataclass

from onboard.contract.codes import CallResult, Reason, TaskPhase
from onboard.contract.constants import NOBODY
from onboard.contract.messages import Award, Message, TaskReport, TokenRequest
from onboard.core.records import BootRecord
from onboard.systems.car_park.bay_memory import winner_record
from onboard.systems.car_park.recovery import award_record
from tests.models.at_work import Entry
from tests.models.award import BAY, CAR, CHEAP, KEY, PLACE, TASK, AwardPart
from tests.models.custody import CALL, HERE

#: What was said of the award of before: that it is void, that it was taken on, and who wants the car for it.
WORDS: tuple[Message, ...] = (
    Award(BAY, CALL.call, NOBODY, TASK, 1, CallResult.REJECTED, Reason.NODE_SILENT),
    TaskReport(CHEAP, TASK, TaskPhase.AWARDED, PLACE.number, Reason.NONE),
    TokenRequest(CHEAP, *KEY, 1, 1, NOBODY),
)


@dataclass
class LatePart(AwardPart):
    """The compartment and one robot, which knows the task or ``forgot`` it."""

    calls: int = 1
    nodes: tuple[int, ...] = (BAY, CHEAP)
    prelude: int = 0
    forgot: bool = False
    #: Whether the compartment has noted what it said last, or failed between the award and its note.
    noted: bool = True

    def journal(self, node: int) -> tuple[Entry, ...]:
        """The task was taken from who had won it, under its next version."""
        entries = super().journal(node)
        if node == BAY:
            # In the life in which it made that call.
            noted = (winner_record(CAR, NOBODY, TASK, 2).entry,) if self.noted else ()
            return (*entries, BootRecord(2).entry, *noted)
        knows = node == CHEAP and not self.forgot
        return (*entries, award_record(CALL, PLACE, HERE, 1).entry) if knows else entries
