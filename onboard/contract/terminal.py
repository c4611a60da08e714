"""What the machines of the system terminal say beyond the messages of all.

Written by ``make docs`` from ``dbc/terminal.dbc``: change that file, never this one.
"""

from enum import IntEnum

from onboard.contract.base import Message, Reference, message


class Action(IntEnum):
    """Elementary actions of which a plan is made (row M09)."""

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
    """What the drive does.

    Stands (in the middle of its slot where at_end is 0), moves, stands before an obstacle, or is out of order.
    """

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
    """What an operator orders with a mission."""

    LOAD = 0
    TRANSHIP = 1
    END = 2


@message(frozen=True, slots=True)
class TaskTerms(Message):
    """What a call for a transport says beyond its fields; said right before the call."""

    #: ``origin``: Node-ID of the desk that named the task. 0 to 255.
    #: ``number``: Number of the task there. 0 to 65535.
    task: Reference
    #: Bus time by which the box is to be put down; 0: no date. 0 to 4294967295 ms.
    before_ms: int


@message(frozen=True, slots=True)
class BoxOrder(Message):
    """Whoever orders for a person wants one box brought to a station.

    A mission of that desk under the sender's own name for the task. Repeated until the desk answers with its
    TaskReport, OPEN where it is new.
    """

    #: Node-ID of the desk. 1 to 250.
    desk: int
    #: Serial number at the sender; with its node-ID the task's name. 0 to 65535.
    number: int
    #: Number of the box, in the order of the site file, from 1. 1 to 65535.
    box: int
    #: Station, by the number of its entity. 1 to 255.
    target: int
    #: Time from now in which it shall be put down, 0 for any. 0 to 32767 s.
    within_s: int
    #: Goes before all that are not urgent, and interrupts calls that are open (row M29).
    urgent: bool


@message(frozen=True, slots=True)
class Assignment(Message):
    """Only from a central planner, for comparison: the vehicle is to carry the box.

    Repeated until the vehicle's TaskReport is heard.
    """

    #: Node-ID of the vehicle. 1 to 250.
    vehicle: int
    #: ``origin``: Node-ID of the desk that named the task. 0 to 255.
    #: ``number``: Number of the task there. 0 to 65535.
    task: Reference
    #: Number of the box. 1 to 65535.
    box: int
    #: Entity number of the station to which it goes. 1 to 255.
    target: int


@message(frozen=True, slots=True)
class PlanHead(Message):
    """First frame of a plan.

    This, PlanTask 0 to tasks-1 and PlanStep 0 to steps-1 with one sender and version are one plan; an incomplete
    set is inert. It replaces the sender's plan; no steps: the sender has none.
    """

    #: Version of the sender's plan (serial, RFC 1982; never 0): that of its itinerary. 1 to 255.
    version: int
    #: Number of PlanStep frames that belong to it. 0 to 31.
    steps: int
    #: Number of PlanTask frames that belong to it. 0 to 7.
    tasks: int
    #: Bus time at which its first step begins or began. 0 to 4294967295 ms.
    begin_ms: int


@message(frozen=True, slots=True)
class PlanStep(Message):
    """One elementary action of a plan; it begins when the one before it ends."""

    #: Version of the sender's plan (serial, RFC 1982; never 0): that of its itinerary. 1 to 255.
    version: int
    #: Number of the step, from 0. 0 to 30.
    step: int
    #: What is done.
    action: Action
    #: Entity in which it is done: lane, crossing, area or station, by its number in the site's order. 1 to 255.
    entity: int
    #: End of the step, counted from the plan's begin_ms. 0 to 16777215 ms.
    end_ms: int
    #: Node-ID of the machine right after which the sender comes to this entity; 0: after nobody that is not there yet.
    #: 0 to 255.
    after: int
    #: First step of that machine's stay there, in its plan. 0 to 31.
    after_step: int


@message(frozen=True, slots=True)
class PlanTask(Message):
    """One load of a plan."""

    #: Version of the sender's plan (serial, RFC 1982; never 0): that of its itinerary. 1 to 255.
    version: int
    #: Number of the load, from 0. 0 to 6.
    part: int
    #: Step that picks it up; 31: it is aboard. 0 to 31.
    pick: int
    #: Step that puts it down. 0 to 30.
    put: int
    #: Number of the box in the books of the first desk. 1 to 65535.
    box: int
    #: ``origin``: Node-ID of the desk that named the task. 0 to 255.
    #: ``number``: Number of the task there. 0 to 65535.
    task: Reference


@message(frozen=True, slots=True)
class StepReport(Message):
    """A robot has achieved an elementary action, or cannot: DONE.

    The step is over since at_ms, and the next one began; the last one is said again slowly.
    """

    #: Version of the sender's plan (serial, RFC 1982; never 0): that of its itinerary. 1 to 255.
    version: int
    #: Step of the plan. 0 to 30.
    step: int
    #: What came of it.
    result: StepResult
    #: Entity of the step. 1 to 255.
    entity: int
    #: Bus time of it. 0 to 4294967295 ms.
    at_ms: int


@message(frozen=True, slots=True)
class LaneState(Message):
    """A lane is blocked by an obstacle, or free again.

    Said on change, and again while it is blocked. The newest since_ms counts.
    """

    #: Entity number of the lane. 1 to 255.
    lane: int
    #: Whether robots must not enter it.
    blocked: bool
    #: Bus time of the change. 0 to 4294967295 ms.
    since_ms: int
