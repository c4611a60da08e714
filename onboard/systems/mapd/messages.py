"""What the machines of a pick-up and delivery site say beyond the messages of all; bits are in ``dbc/mapd.dbc``.

A *step* is counted from 0 and the same for all: a robot tells that it has come to step k + 1 when its k-th move is
done, and nobody begins step k + 1 before all have told that.
"""

from dataclasses import dataclass
from enum import IntEnum

from onboard.core.messages import Message

#: No task.
NO_TASK = 0xFFFF
#: Moves in one frame of a path, and bits of each.
MOVES_A_FRAME, MOVE_BITS = 12, 4
#: Most ways that lead from one cell: a move names one of them, 0 is a wait.
MOST_WAYS = (1 << MOVE_BITS) - 1
#: Most moves of a path, and the last step that can be told.
MOST_MOVES, LAST_STEP = 0xFFF, 0x3FFFFF


class CartAction(IntEnum):
    """Orders to a robot's body."""

    MOVE = 0
    LOAD = 1
    UNLOAD = 2


class TransportResult(IntEnum):
    """What became of a transport."""

    RECEIVED = 0
    DONE = 1
    REFUSED = 2


# --- fleet bus -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class StepRound(Message):
    """Step ``step`` begins, with ``open_tasks`` calls standing; bids are asked for where ``bidding``.

    ``attempt`` differs where the round of a step is opened again.
    """

    step: int
    open_tasks: int
    attempt: int
    bidding: bool


@dataclass(frozen=True, slots=True)
class TurnRequest(Message):
    """A robot without a task asks for a turn to plan: others need the place where it rests."""

    step: int
    attempt: int


@dataclass(frozen=True, slots=True)
class StepTurn(Message):
    """One change that a round has brought, ``index`` of ``changes``: ``robot`` has ``won`` a task, or has none now.

    Those named plan anew, in this order. A round without changes is closed by one with ``changes`` 0 and robot 0. Which
    task was won is in its award.
    """

    step: int
    index: int
    changes: int
    robot: int
    won: bool


@dataclass(frozen=True, slots=True)
class PathHead(Message):
    """The sender's path from ``step`` on, from ``cell``, as ``PathMoves`` with this ``version`` tell it.

    ``kept``: no better one was found, and the sender has no task.
    """

    step: int
    cell: int
    moves: int
    version: int
    kept: bool


@dataclass(frozen=True, slots=True)
class PathMoves(Message):
    """Moves ``12 part`` to ``12 part + 11`` of a path, the first in the lowest bits of ``codes``."""

    version: int
    part: int
    codes: int


@dataclass(frozen=True, slots=True)
class StepState(Message):
    """The sender has come to ``step`` and is in ``cell``, with its ``task`` aboard where ``loaded``.

    ``served``: the task was delivered on the way to this step, and the sender has none now.
    """

    step: int
    cell: int
    task: int
    loaded: bool
    served: bool


# --- device bus ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class CartOrder(Message):
    """Move to the next ``cell``, or load or unload ``task`` there; a repeated ``sequence`` does nothing again."""

    sequence: int
    cart_action: CartAction
    cell: int
    task: int
    step: int


@dataclass(frozen=True, slots=True)
class CartState(Message):
    """Where the body is, or, while ``moving``, is going to be; the ``task`` aboard; the last order taken up."""

    sequence: int
    cell: int
    moving: bool
    task: int


@dataclass(frozen=True, slots=True)
class TransportKey(Message):
    """Somebody orders a transport, to be called for from the step on whose lowest 16 bits are ``release``."""

    task: int
    pickup: int
    delivery: int
    release: int


@dataclass(frozen=True, slots=True)
class TransportAnswer(Message):
    """What becomes of an order."""

    task: int
    transport_result: TransportResult


MESSAGES: tuple[type[Message], ...] = (
    StepRound,
    TurnRequest,
    StepTurn,
    PathHead,
    PathMoves,
    StepState,
    CartOrder,
    CartState,
    TransportKey,
    TransportAnswer,
)
