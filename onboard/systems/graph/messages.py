"""What the machines of a factory graph say beyond the messages of all; bits and ranges are in ``dbc/graph.dbc``."""

from dataclasses import dataclass
from enum import IntEnum

from onboard.core.messages import Message

#: No node.
NO_NODE = 255


class NodeVerdict(IntEnum):
    """A node agent's three answers (row G15)."""

    GO = 0
    STOP = 1
    ANOTHER = 2


class EdgeState(IntEnum):
    """What a node agent tells its neighbour of their edge (rows G20 to G22)."""

    FREE = 0
    RESERVED = 1
    KEPT = 2


class RobotMode(IntEnum):
    """The paper's modes of a robot (row G13)."""

    FREE = 0
    DRIVING = 1
    LOADING = 2


class RouteAction(IntEnum):
    """Orders to a drive."""

    GO = 0
    ENTER = 1


class BodyPlace(IntEnum):
    """Where a body is; AT_LINE is on the edge still, at its end before the node."""

    IN_NODE = 0
    ON_EDGE = 1
    AT_LINE = 2


class VisitResult(IntEnum):
    """What became of an order."""

    RECEIVED = 0
    IN_HAND = 1
    DONE = 2
    REFUSED = 3


# --- fleet bus -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class NodeAnswer(Message):
    """A node agent's answer to ``robot``; ``slot`` in ``after`` goes with the edge, 0 for none."""

    robot: int
    node: int
    node_verdict: NodeVerdict
    after: int
    slot: int


@dataclass(frozen=True, slots=True)
class EdgeNotice(Message):
    """The agent of ``node`` tells that of ``other`` what becomes of their edge."""

    node: int
    other: int
    edge_state: EdgeState
    robot: int


@dataclass(frozen=True, slots=True)
class TurnSignal(Message):
    """By which edge the sender will leave ``node`` (row G14)."""

    node: int
    behind: int
    after: int


@dataclass(frozen=True, slots=True)
class RobotAt(Message):
    """Where the sender is, what it does, and where it goes."""

    behind: int
    node: int
    on_edge: bool
    robot_mode: RobotMode
    ahead1: int
    ahead2: int
    ahead3: int
    goal: int


@dataclass(frozen=True, slots=True)
class VisitList(Message):
    """An order for one robot by name (row G11)."""

    order: int
    robot: int
    stop1: int
    stop2: int
    stop3: int
    stop4: int
    stop5: int


# --- device bus ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class RouteOrder(Message):
    """GO from ``start`` to ``end``, or ENTER ``start``; a new ``sequence`` starts it, a repeated one keeps it fresh."""

    sequence: int
    route_action: RouteAction
    start: int
    end: int


@dataclass(frozen=True, slots=True)
class BodyState(Message):
    """Where the body is."""

    sequence: int
    behind: int
    node: int
    body_place: BodyPlace


@dataclass(frozen=True, slots=True)
class ApproachSensor(Message):
    """The body passes the sensor before ``node`` (row G10)."""

    behind: int
    node: int


@dataclass(frozen=True, slots=True)
class VisitKey(Message):
    """A person orders visits; ``robot`` 0 is the nearest free one, from ``stop1`` to ``stop2``."""

    order: int
    robot: int
    stop1: int
    stop2: int
    stop3: int
    stop4: int
    stop5: int


@dataclass(frozen=True, slots=True)
class VisitAnswer(Message):
    """What becomes of an order, and who has it."""

    order: int
    visit_result: VisitResult
    robot: int


MESSAGES: tuple[type[Message], ...] = (
    NodeAnswer,
    EdgeNotice,
    TurnSignal,
    RobotAt,
    VisitList,
    RouteOrder,
    BodyState,
    ApproachSensor,
    VisitKey,
    VisitAnswer,
)


def stops_of(message: VisitList | VisitKey) -> tuple[int, ...]:
    """The nodes to visit, in turn."""
    every = (message.stop1, message.stop2, message.stop3, message.stop4, message.stop5)
    return tuple(node for node in every if node != NO_NODE)


def five(stops: tuple[int, ...]) -> tuple[int, int, int, int, int]:
    """Inverse of ``stops_of``. Raises ``ValueError`` for more than five stops."""
    if len(stops) > 5:
        raise ValueError(f"{len(stops)} stops do not fit into one frame")
    one, two, three, four, fifth = (*stops, *(NO_NODE,) * (5 - len(stops)))
    return one, two, three, four, fifth
