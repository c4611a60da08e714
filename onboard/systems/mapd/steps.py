"""What a robot does within a step of everybody: one table of (phase, finding).

A line is followed by the next at once until there is nothing to do but to wait.
"""

from enum import Enum


class GridStepPhase(Enum):
    """Where a robot stands within a step."""

    GATHER = "waits for all robots to come to this step, and for its round"
    BID = "the round is open"
    TURNS = "those who have won or lost plan, one after the other"
    MOVE = "goes to where its path is in the next step"


class StepFinding(Enum):
    """What was heard, and where the cart is, come to in a phase; of several the first that holds."""

    UNTOLD = "the robot has come to this step, and has not said so"
    EARLY = "the round was not told, and it is not late yet"
    MISSING = "somebody, a path or the round is missing"
    OTHER_TASKS = "all are there, and the round counts other open tasks than are known"
    ROUND_TO_BID = "all are there, and the round is for bids"
    ROUND_TO_GO = "all are there, and nobody bids in this step"
    NOT_BEGUN = "the round is new"
    OPEN = "the round goes on"
    CLOSED = "all turns and awards of the round are known"
    MY_TURN = "those before this robot have planned"
    ALL_PLANNED = "all who are to plan have"
    ON_PATH = "its path is known, and it has not come to its next cell"
    ARRIVED = "it has"


class StepDeed(Enum):
    """What the robot does then."""

    WAIT = "nothing"
    ASK = "ask whoever is missing, where that is due"
    ASK_TASKS = "ask the desk for its open tasks, where that is due, and forget those that are known"
    TELL = "say that it has come, and where it is"
    BEGIN_BIDS = "work out what each open task would cost"
    LOOK = "take part in the call that suits it best; ask the desk, where that is due"
    PLAN = "plan, journal and tell its path"
    DRIVE = "go on, load or unload"
    PASS = "what this phase is for is done"
    NEXT_STEP = "begin the next step"


#: Nothing follows these before something is heard or due.
LAST = (StepDeed.WAIT, StepDeed.ASK, StepDeed.ASK_TASKS, StepDeed.LOOK)

_GATHER, _BID, _TURNS, _MOVE = GridStepPhase
#: (phase, finding) -> (phase that follows, deed).
STEP_TABLE: dict[tuple[GridStepPhase, StepFinding], tuple[GridStepPhase, StepDeed]] = {
    (_GATHER, StepFinding.UNTOLD): (_GATHER, StepDeed.TELL),
    (_GATHER, StepFinding.EARLY): (_GATHER, StepDeed.WAIT),
    (_GATHER, StepFinding.MISSING): (_GATHER, StepDeed.ASK),
    (_GATHER, StepFinding.OTHER_TASKS): (_GATHER, StepDeed.ASK_TASKS),
    (_GATHER, StepFinding.ROUND_TO_BID): (_BID, StepDeed.PASS),
    (_GATHER, StepFinding.ROUND_TO_GO): (_MOVE, StepDeed.PASS),
    (_BID, StepFinding.NOT_BEGUN): (_BID, StepDeed.BEGIN_BIDS),
    (_BID, StepFinding.OPEN): (_BID, StepDeed.LOOK),
    (_BID, StepFinding.CLOSED): (_TURNS, StepDeed.PASS),
    (_TURNS, StepFinding.MISSING): (_TURNS, StepDeed.ASK),
    (_TURNS, StepFinding.MY_TURN): (_TURNS, StepDeed.PLAN),
    (_TURNS, StepFinding.ALL_PLANNED): (_MOVE, StepDeed.PASS),
    (_MOVE, StepFinding.MISSING): (_MOVE, StepDeed.ASK),
    (_MOVE, StepFinding.ON_PATH): (_MOVE, StepDeed.DRIVE),
    (_MOVE, StepFinding.ARRIVED): (_GATHER, StepDeed.NEXT_STEP),
}
