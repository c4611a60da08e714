"""What the machines of the system cell say beyond the messages of all.

Written by ``make docs`` from ``dbc/cell.dbc``: change that file, never this one.
"""

from enum import IntEnum

from onboard.contract.base import Message, Reference, message


class ArmPhase(IntEnum):
    """What a robot does, as ArmProgress says it."""

    IDLE = 0
    TO_PART = 1
    TAKING = 2
    CARRYING = 3
    PUTTING = 4
    WAITING = 5


class ArmMode(IntEnum):
    """What a robot's drive does."""

    RESTING = 0
    GOING = 1


class GripAction(IntEnum):
    """What a gripper is ordered to do with a part."""

    TAKE = 0
    PUT = 1


class GripMode(IntEnum):
    """What a gripper does; NOTHING_THERE ends a TAKE that found no such part."""

    OPEN = 0
    BUSY = 1
    HOLDING = 2
    NOTHING_THERE = 3


class RefusedFor(IntEnum):
    """Why a goal was refused: nobody can carry it out, or it would take a chain of more than eight robots."""

    NOTHING = 0
    NOBODY = 1
    TOO_DEEP = 2


@message(frozen=True, slots=True)
class GoalStart(Message):
    """Where the part of a goal is, or will be handed over.

    Sent with GoalEnd, GoalTerms and GoalPath before each call for the goal.
    """

    #: Serial number of the goal at its manager; with the manager's node-ID it is the task of the calls for it. 0 to
    #: 65535.
    goal: int
    #: x of the start. -8388608 to 8388607 mm.
    x_mm: int
    #: y of the start. -8388608 to 8388607 mm.
    y_mm: int


@message(frozen=True, slots=True)
class GoalEnd(Message):
    """Where the part of a goal is to be brought."""

    #: Serial number of the goal at its manager; with the manager's node-ID it is the task of the calls for it. 0 to
    #: 65535.
    goal: int
    #: x of the end. -8388608 to 8388607 mm.
    x_mm: int
    #: y of the end. -8388608 to 8388607 mm.
    y_mm: int


@message(frozen=True, slots=True)
class GoalTerms(Message):
    """Time limit of a goal, and how deep it is in the tree of contracts."""

    #: Serial number of the goal at its manager; with the manager's node-ID it is the task of the calls for it. 0 to
    #: 65535.
    goal: int
    #: Bus time until which the part must be at the end; 0 for no limit. 0 to 4294967295 ms.
    time_limit_ms: int
    #: 0 for a goal of the goal manager, one more for each sub-goal; as many nodes are in GoalPath, but of seven the
    #: last: that is the sender. 0 to 7.
    level: int
    #: Level of the deepest sub-goal that may be called for. 0 to 7.
    deepest: int


@message(frozen=True, slots=True)
class GoalPath(Message):
    """Robots that work on the goal already: they are not asked again."""

    #: Serial number of the goal at its manager; with the manager's node-ID it is the task of the calls for it. 0 to
    #: 65535.
    goal: int
    #: Node-ID 1 of the robots, the main contractor first, 0 for none. 0 to 255.
    node1: int
    #: Node-ID 2 of the robots, the main contractor first, 0 for none. 0 to 255.
    node2: int
    #: Node-ID 3 of the robots, the main contractor first, 0 for none. 0 to 255.
    node3: int
    #: Node-ID 4 of the robots, the main contractor first, 0 for none. 0 to 255.
    node4: int
    #: Node-ID 5 of the robots, the main contractor first, 0 for none. 0 to 255.
    node5: int
    #: Node-ID 6 of the robots, 0 for none. 0 to 255.
    node6: int


@message(frozen=True, slots=True)
class OfferHigh(Message):
    """Upper half of the exact cost of an offer.

    Sent with OfferLow and OfferNodes before the bid.
    """

    #: Node-ID of whoever made the goal. 1 to 255.
    manager: int
    #: Serial number of the goal at its manager; with the manager's node-ID it is the task of the calls for it. 0 to
    #: 65535.
    goal: int
    #: Upper 32 bits of the double. 0 to 4294967295.
    bits: int


@message(frozen=True, slots=True)
class OfferLow(Message):
    """Lower half of the exact cost of an offer."""

    #: Node-ID of whoever made the goal. 1 to 255.
    manager: int
    #: Serial number of the goal at its manager; with the manager's node-ID it is the task of the calls for it. 0 to
    #: 65535.
    goal: int
    #: Lower 32 bits of the double. 0 to 4294967295.
    bits: int


@message(frozen=True, slots=True)
class OfferNodes(Message):
    """Everybody who is involved in an offer."""

    #: Node-ID of whoever made the goal. 1 to 255.
    manager: int
    #: Serial number of the goal at its manager; with the manager's node-ID it is the task of the calls for it. 0 to
    #: 65535.
    goal: int
    #: Node-ID 1 of the robots involved, the bidder first, 0 for none. 0 to 255.
    node1: int
    #: Node-ID 2 of the robots involved, the bidder first, 0 for none. 0 to 255.
    node2: int
    #: Node-ID 3 of the robots involved, the bidder first, 0 for none. 0 to 255.
    node3: int
    #: Node-ID 4 of the robots involved, the bidder first, 0 for none. 0 to 255.
    node4: int
    #: Node-ID 5 of the robots involved, the bidder first, 0 for none. 0 to 255.
    node5: int


@message(frozen=True, slots=True)
class OfferNodesMore(Message):
    """Who else is involved in an offer that names five robots or more.

    Sent right after its OfferNodes.
    """

    #: Node-ID of whoever made the goal. 1 to 255.
    manager: int
    #: Serial number of the goal at its manager; with the manager's node-ID it is the task of the calls for it. 0 to
    #: 65535.
    goal: int
    #: Node-ID 6 of the robots involved, 0 for none. 0 to 255.
    node6: int
    #: Node-ID 7 of the robots involved, 0 for none. 0 to 255.
    node7: int
    #: Node-ID 8 of the robots involved, 0 for none. 0 to 255.
    node8: int


@message(frozen=True, slots=True)
class GoalTooDeep(Message):
    """A robot could bring this part on.

    But its goal would need a sub-goal that is deeper than its manager lets robots call for. Sent in place of a bid.
    """

    #: ``origin``: Node-ID of the goal manager that named the part. 0 to 255.
    #: ``number``: Serial number of the part at its origin. 0 to 65535.
    part: Reference


@message(frozen=True, slots=True)
class MoveFrom(Message):
    """A contract that was won: where the robot stands when it begins.

    Sent with MoveTo, MoveCostHigh and MoveCostLow.
    """

    #: Node-ID of whoever made the goal. 1 to 255.
    manager: int
    #: Serial number of the goal at its manager; with the manager's node-ID it is the task of the calls for it. 0 to
    #: 65535.
    goal: int
    #: x of where it stands. -524288 to 524287 mm.
    x_mm: int
    #: y of where it stands. -524288 to 524287 mm.
    y_mm: int


@message(frozen=True, slots=True)
class MoveTo(Message):
    """A contract that was won: where the robot puts the part down."""

    #: Node-ID of whoever made the goal. 1 to 255.
    manager: int
    #: Serial number of the goal at its manager; with the manager's node-ID it is the task of the calls for it. 0 to
    #: 65535.
    goal: int
    #: x of where it puts the part down. -524288 to 524287 mm.
    x_mm: int
    #: y of where it puts the part down. -524288 to 524287 mm.
    y_mm: int


@message(frozen=True, slots=True)
class MoveCostHigh(Message):
    """Upper half of the exact cost of the robot's own moves."""

    #: Node-ID of whoever made the goal. 1 to 255.
    manager: int
    #: Serial number of the goal at its manager; with the manager's node-ID it is the task of the calls for it. 0 to
    #: 65535.
    goal: int
    #: Upper 32 bits of the double. 0 to 4294967295.
    bits: int


@message(frozen=True, slots=True)
class MoveCostLow(Message):
    """Lower half of the exact cost of the robot's own moves."""

    #: Node-ID of whoever made the goal. 1 to 255.
    manager: int
    #: Serial number of the goal at its manager; with the manager's node-ID it is the task of the calls for it. 0 to
    #: 65535.
    goal: int
    #: Lower 32 bits of the double. 0 to 4294967295.
    bits: int


@message(frozen=True, slots=True)
class ArmProgress(Message):
    """Where a robot is and what it does: sent when that changes and every 2 s while it moves."""

    #: x of where it is. -524288 to 524287 mm.
    x_mm: int
    #: y of where it is. -524288 to 524287 mm.
    y_mm: int
    #: What it does.
    arm_phase: ArmPhase
    #: Serial number of the goal at its manager; with the manager's node-ID it is the task of the calls for it. 0 to
    #: 65535.
    goal: int


@message(frozen=True, slots=True)
class PartAt(Message):
    """The custodian of a part states where it is; aboard, the place is where it was taken up."""

    #: ``origin``: Node-ID of the goal manager that named the part. 0 to 255.
    #: ``number``: Serial number of the part at its origin. 0 to 65535.
    part: Reference
    #: x of the part. -262144 to 262143 mm.
    x_mm: int
    #: 1: a robot carries it.
    aboard: bool
    #: y of the part. -262144 to 262143 mm.
    y_mm: int
