"""What the machines of the system graph say beyond the messages of all.

Written by ``make docs`` from ``dbc/graph.dbc``: change that file, never this one.
"""

from enum import IntEnum

from onboard.contract.base import Message, message


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
    """What a drive is ordered to do about the end of its edge."""

    GO = 0
    ENTER = 1


class BodyPlace(IntEnum):
    """Where a body is; AT_LINE is on the edge still, at its end before the node."""

    IN_NODE = 0
    ON_EDGE = 1
    AT_LINE = 2


@message(frozen=True, slots=True)
class NodeAnswer(Message):
    """A node agent answers a robot's signal: go, stop, or take another edge.

    GO and ANOTHER permit nothing by themselves: the robot asks for the tokens of the edge, and of the slot where
    one is named.
    """

    #: Node-ID of the robot. 1 to 250.
    robot: int
    #: The node that answers. 0 to 255.
    node: int
    #: What the robot is to do.
    node_verdict: NodeVerdict
    #: Node at the other end of the edge that is granted, or was wanted. 0 to 255.
    after: int
    #: Slot in that node which goes with the edge; 0 where the rules grant none. 0 to 15.
    slot: int


@message(frozen=True, slots=True)
class EdgeNotice(Message):
    """A node agent tells the agent at the other end of an edge what becomes of it."""

    #: The node whose agent speaks. 0 to 255.
    node: int
    #: The node at the other end, to whose agent it speaks. 0 to 255.
    other: int
    #: FREE: it may be granted; RESERVED: granted to a robot; KEPT: kept for the node's own needs.
    edge_state: EdgeState
    #: Node-ID of the robot that has it, 0 for none. 0 to 250.
    robot: int


@message(frozen=True, slots=True)
class TurnSignal(Message):
    """A robot that comes near a node, or stands in it, tells by which edge it will leave.

    As a direction indicator does. Repeated until it is answered, and slowly while it waits.
    """

    #: The node it comes to. 0 to 255.
    node: int
    #: Node from which it comes and to which it does not go back, 255 for none. 0 to 255.
    behind: int
    #: Node to which it wants to go. 0 to 255.
    after: int


@message(frozen=True, slots=True)
class VisitList(Message):
    """An order for one robot by name: nodes to be visited in turn.

    Repeated until the robot's TaskReport is heard; the task is the sender's, with this number. Without any node it
    takes the order back: the robot ends its edge, does nothing more for it and answers REFUSED, CANCELLED. To a
    desk, with two nodes: a transport from the first to the second for whichever robot does it best, under the same
    name; the desk answers with its TaskReport.
    """

    #: Serial number of the order at the desk. 0 to 65535.
    order: int
    #: Node-ID of the robot, or of a desk. 1 to 250.
    robot: int
    #: Node 1 to be visited, 255 behind the last; 255 here takes the order back. 0 to 255.
    stop1: int
    #: Node 2 to be visited, 255 behind the last. 0 to 255.
    stop2: int
    #: Node 3 to be visited, 255 behind the last. 0 to 255.
    stop3: int
    #: Node 4 to be visited, 255 behind the last. 0 to 255.
    stop4: int
    #: Node 5 to be visited, 255 behind the last. 0 to 255.
    stop5: int


@message(frozen=True, slots=True)
class RobotAt(Message):
    """Where a robot is and where it goes.

    Sent on change and every 2 s while it drives.
    """

    #: Node behind it, 255 for none. 0 to 255.
    behind: int
    #: Node it is in or comes to. 0 to 255.
    node: int
    #: Whether it is between the two.
    on_edge: bool
    #: What it does.
    robot_mode: RobotMode
    #: Next node of its way, 255 for none. 0 to 255.
    ahead1: int
    #: The node after, 255 for none. 0 to 255.
    ahead2: int
    #: The node after, 255 for none. 0 to 255.
    ahead3: int
    #: Where its way ends, 255 for none. 0 to 255.
    goal: int
