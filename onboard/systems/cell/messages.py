"""What the cell's machines say beyond the messages of all systems; bits, units and ranges are in ``dbc/cell.dbc``."""

import struct
from dataclasses import dataclass
from enum import IntEnum

from onboard.core.messages import Message, Reference

#: Robots that one frame can name: the deepest sub-goal has as many predecessors at most.
MAX_PATH = 5


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
    """Orders to a gripper."""

    TAKE = 0
    PUT = 1


class GripMode(IntEnum):
    """What a gripper does; NOTHING_THERE ends a TAKE that found no such part."""

    OPEN = 0
    BUSY = 1
    HOLDING = 2
    NOTHING_THERE = 3


class OrderResult(IntEnum):
    """What became of an order at the goal manager's counter."""

    RECEIVED = 0
    IN_HAND = 1
    DONE = 2
    REFUSED = 3


# --- fleet bus -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class GoalStart(Message):
    """Where the part of the sender's goal is, or will be handed over."""

    goal: int
    x_mm: int
    y_mm: int


@dataclass(frozen=True, slots=True)
class GoalEnd(Message):
    """Where the part is to be brought."""

    goal: int
    x_mm: int
    y_mm: int


@dataclass(frozen=True, slots=True)
class GoalTerms(Message):
    """``time_limit_ms`` is bus time, 0 for none; ``level`` is the goal's depth in the tree of contracts."""

    goal: int
    time_limit_ms: int
    level: int


@dataclass(frozen=True, slots=True)
class GoalPath(Message):
    """Robots that work on the goal already, the main contractor first; zeros behind the last."""

    goal: int
    node1: int
    node2: int
    node3: int
    node4: int
    node5: int


@dataclass(frozen=True, slots=True)
class OfferHigh(Message):
    """Upper half of an offer's exact cost, for goal ``goal`` of ``manager``."""

    manager: int
    goal: int
    bits: int


@dataclass(frozen=True, slots=True)
class OfferLow(Message):
    """Lower half of it."""

    manager: int
    goal: int
    bits: int


@dataclass(frozen=True, slots=True)
class OfferNodes(Message):
    """Everybody involved in an offer, the bidder first (row C14)."""

    manager: int
    goal: int
    node1: int
    node2: int
    node3: int
    node4: int
    node5: int


@dataclass(frozen=True, slots=True)
class MoveFrom(Message):
    """A contract that the sender has won: where it stands when it begins."""

    manager: int
    goal: int
    x_mm: int
    y_mm: int


@dataclass(frozen=True, slots=True)
class MoveTo(Message):
    """Where it puts the part down."""

    manager: int
    goal: int
    x_mm: int
    y_mm: int


@dataclass(frozen=True, slots=True)
class MoveCostHigh(Message):
    """Upper half of the exact cost of its own moves."""

    manager: int
    goal: int
    bits: int


@dataclass(frozen=True, slots=True)
class MoveCostLow(Message):
    """Lower half of it."""

    manager: int
    goal: int
    bits: int


@dataclass(frozen=True, slots=True)
class ArmProgress(Message):
    """Where a robot is and what it does, for which goal's part."""

    x_mm: int
    y_mm: int
    arm_phase: ArmPhase
    goal: int


@dataclass(frozen=True, slots=True)
class PartAt(Message):
    """The custodian states where a part is; aboard, the place is where it was taken up."""

    part: Reference
    x_mm: int
    y_mm: int
    aboard: bool


# --- device bus ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class ArmOrder(Message):
    """Go straight to a point; to be repeated, see the DBC."""

    sequence: int
    x_mm: int
    y_mm: int


@dataclass(frozen=True, slots=True)
class ArmState(Message):
    """Where the robot is and what its drive does."""

    sequence: int
    x_mm: int
    y_mm: int
    arm_mode: ArmMode


@dataclass(frozen=True, slots=True)
class GripOrder(Message):
    """One action of the gripper; a new ``sequence`` starts it, a repeated one does nothing."""

    sequence: int
    grip_action: GripAction
    part: Reference


@dataclass(frozen=True, slots=True)
class GripState(Message):
    """The gripper's mode for order ``sequence``, and the part in it."""

    sequence: int
    grip_mode: GripMode
    part: Reference


@dataclass(frozen=True, slots=True)
class OrderFrom(Message):
    """A part is to be carried: where it lies. Order and part have one number."""

    order: int
    x_mm: int
    y_mm: int


@dataclass(frozen=True, slots=True)
class OrderTo(Message):
    """Where the part is wanted, and within what time (steps of 10 s, 0 for no limit)."""

    order: int
    x_mm: int
    y_mm: int
    within_ms: int


@dataclass(frozen=True, slots=True)
class OrderAnswer(Message):
    """What becomes of an order; ``cost_mm`` in thousandths of the paper's unit, 0 before it is known."""

    order: int
    order_result: OrderResult
    cost_mm: int


MESSAGES: tuple[type[Message], ...] = (
    GoalStart,
    GoalEnd,
    GoalTerms,
    GoalPath,
    OfferHigh,
    OfferLow,
    OfferNodes,
    MoveFrom,
    MoveTo,
    MoveCostHigh,
    MoveCostLow,
    ArmProgress,
    PartAt,
    ArmOrder,
    ArmState,
    GripOrder,
    GripState,
    OrderFrom,
    OrderTo,
    OrderAnswer,
)


def halves(value: float) -> tuple[int, int]:
    """A double as two words of 32 bits, the upper one first (IEEE 754)."""
    high, low = struct.unpack(">II", struct.pack(">d", value))
    return high, low


def from_halves(high: int, low: int) -> float:
    """Inverse of ``halves``. What is no finite number comes back as it is: the caller judges."""
    (value,) = struct.unpack(">d", struct.pack(">II", high, low))
    return float(value)


def five(nodes: tuple[int, ...]) -> tuple[int, int, int, int, int]:
    """Up to five node-IDs, zeros behind the last. Raises ``ValueError`` for more."""
    if len(nodes) > MAX_PATH:
        raise ValueError(f"{len(nodes)} robots do not fit into one frame")
    one, two, three, four, fifth = (*nodes, *(0,) * (MAX_PATH - len(nodes)))
    return one, two, three, four, fifth


def nodes_of(message: GoalPath | OfferNodes) -> tuple[int, ...]:
    """Inverse of ``five``."""
    every = (message.node1, message.node2, message.node3, message.node4, message.node5)
    return tuple(node for node in every if node)
