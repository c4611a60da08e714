"""What the machines of a terminal say beyond the messages of all: field names are the signals of ``dbc/terminal.dbc``.

Times on the wire are bus time in ms modulo 2**32; a plan's step ends so many ms after the plan's begin.
"""

from dataclasses import dataclass
from enum import IntEnum

from onboard.core.codes import ManualMode
from onboard.core.messages import Message, Reference


class Action(IntEnum):
    """Elementary actions (row M09)."""

    GOTO = 0
    DOCK = 1
    PICK_UP = 2
    PUT_DOWN = 3
    UNDOCK = 4


class StepResult(IntEnum):
    """What a report of an elementary action says."""

    DONE = 0
    FAILED = 1
    BLOCKED = 2


class MoveMode(IntEnum):
    """What the drive does: stands at the end of its slot, moves, stands before an obstacle, or is out of order."""

    STANDING = 0
    MOVING = 1
    BLOCKED = 2
    FAULT = 3


class HandlerMode(IntEnum):
    """What docking gear and spreader do."""

    FREE = 0
    WORKING = 1
    DOCKED = 2
    FAILED = 3


class Verb(IntEnum):
    """What an operator orders."""

    LOAD = 0
    TRANSHIP = 1
    END = 2


# --- fleet bus -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class PlanHead(Message):
    """A plan under ``version``: so many ``PlanStep`` and ``PlanTask`` follow; incomplete, it is inert.

    ``begin_ms`` is when its first step began, or begins.
    """

    version: int
    steps: int
    tasks: int
    begin_ms: int


@dataclass(frozen=True, slots=True)
class PlanStep(Message):
    """One elementary action on ``entity``, to end ``end_ms`` after the plan's begin.

    It comes right after step ``after_step`` of machine ``after`` on that entity; 0: after nobody that is not there yet.
    """

    version: int
    step: int
    action: Action
    entity: int
    end_ms: int
    after: int
    after_step: int


@dataclass(frozen=True, slots=True)
class PlanTask(Message):
    """One load of a plan: picked up in step ``pick``, put down in step ``put`` (31: done already)."""

    version: int
    part: int
    pick: int
    put: int
    box: int
    task: Reference


@dataclass(frozen=True, slots=True)
class StepReport(Message):
    """A robot reports on an elementary action (row M30); DONE: it ended at ``at_ms`` and the next one began."""

    version: int
    step: int
    result: StepResult
    entity: int
    at_ms: int


@dataclass(frozen=True, slots=True)
class LaneState(Message):
    """A lane is blocked since, or free since, ``since_ms`` (rows M03, M36): told on change and again slowly."""

    lane: int
    blocked: bool
    since_ms: int


@dataclass(frozen=True, slots=True)
class TaskTerms(Message):
    """What a call for a transport does not say: ``before_ms`` is the date (row M06), 0 for none, of ``task``."""

    task: Reference
    before_ms: int


@dataclass(frozen=True, slots=True)
class Assignment(Message):
    """Only from a central planner, for comparison (row M39): ``vehicle`` is to carry ``box`` for ``task``."""

    vehicle: int
    task: Reference
    box: int
    target: int


@dataclass(frozen=True, slots=True)
class BoxOrder(Message):
    """A box is wanted at a station, as a mission of ``desk``; ``within_s`` from now, 0 for any time."""

    desk: int
    number: int
    box: int
    target: int
    within_s: int
    urgent: bool


# --- device buses --------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class MoveOrder(Message):
    """Go on into ``slot`` of ``entity``, to be left ``towards`` another. A new ``sequence`` starts it."""

    sequence: int
    entity: int
    slot: int
    towards: int


@dataclass(frozen=True, slots=True)
class MoveState(Message):
    """Where the body is and what the drive does; ``sequence`` is that of the last order carried out.

    ``at_end``: the slot is crossed, the body stands at its end.
    """

    sequence: int
    entity: int
    slot: int
    mode: MoveMode
    at_end: bool


@dataclass(frozen=True, slots=True)
class HandlerOrder(Message):
    """Dock, pick up, put down or undock at the station in hand; a new ``sequence`` starts it."""

    sequence: int
    action: Action
    box: int


@dataclass(frozen=True, slots=True)
class HandlerState(Message):
    """``gear`` after order ``sequence``; ``box`` is the number of the one aboard as its label reads, 0 for none."""

    sequence: int
    gear: HandlerMode
    box: int


@dataclass(frozen=True, slots=True)
class LaneSensor(Message):
    """What a desk's cameras see of a lane."""

    lane: int
    blocked: bool


@dataclass(frozen=True, slots=True)
class MissionKey(Message):
    """What an operator types: LOAD is one frame, TRANSHIP one for each box and END.

    ``what`` is a type for LOAD and a box for TRANSHIP; ``before_s`` the date in s of bus time, 0 for none.
    """

    mission: int
    verb: Verb
    what: int
    count: int
    source: int
    target: int
    before_s: int
    urgent: bool


@dataclass(frozen=True, slots=True)
class MissionAnswer(Message):
    """A mission that came whole is in the desk's journal, or is nothing that can be carried out."""

    mission: int
    is_taken: bool


@dataclass(frozen=True, slots=True)
class ManualKey(Message):
    """What a person presses for ``vehicle``; ``number`` grows by one with each press at a desk."""

    number: int
    vehicle: int
    manual_mode: ManualMode


MESSAGES = (
    PlanHead, PlanStep, PlanTask, StepReport, LaneState, TaskTerms, Assignment, BoxOrder,
    MoveOrder, MoveState, HandlerOrder, HandlerState, LaneSensor, MissionKey,
    MissionAnswer, ManualKey,
)  # fmt: skip
