"""What the machines of the system graph say beyond the messages of all, on their device buses.

Written by ``make docs`` from ``dbc/graph.dbc``: change that file, never this one.
"""

from onboard.contract.base import Message, message
from onboard.contract.codes import OrderResult
from onboard.contract.graph import BodyPlace, RouteAction


@message(frozen=True, slots=True)
class RouteOrder(Message):
    """Go along an edge, or into the node ahead.

    Repeated every drive_refresh of the site while the robot moves; a moving drive that hears none for
    DriveTimeOutMs stops by itself.
    """

    #: Grows by one with every new order; a repeat has the same. 0 to 255.
    sequence: int
    #: GO: from start to end, on from the edge before; ENTER: into start and stay.
    route_action: RouteAction
    #: Node where the edge begins. 0 to 255.
    start: int
    #: Node where it ends, 255 with ENTER. 0 to 255.
    end: int


@message(frozen=True, slots=True)
class VisitAnswer(Message):
    """What becomes of an order: sent on change and every 2 s until it is over."""

    #: Serial number of the order. 0 to 65535.
    order: int
    #: What became of it.
    visit_result: OrderResult
    #: Node-ID of the robot that has it, 0 for none. 0 to 250.
    robot: int


@message(frozen=True, slots=True)
class BodyState(Message):
    """Where the body is: sent on change and every 10 s."""

    #: Sequence of the last order taken up. 0 to 255.
    sequence: int
    #: Node behind it, 255 where it has not moved yet. 0 to 255.
    behind: int
    #: Node it is in or comes to. 0 to 255.
    node: int
    #: IN_NODE; ON_EDGE between the two; AT_LINE: at the end of the edge, before the node.
    body_place: BodyPlace


@message(frozen=True, slots=True)
class ApproachSensor(Message):
    """The robot passes the sensor before a node."""

    #: Node from which it comes. 0 to 255.
    behind: int
    #: Node to which it comes. 0 to 255.
    node: int


@message(frozen=True, slots=True)
class VisitKey(Message):
    """A person orders visits at the desk.

    Said again every second until VisitAnswer names the order.
    """

    #: Serial number of the order. 0 to 65535.
    order: int
    #: Node-ID of the robot, 0 for the nearest free one: then from stop1 to stop2. 0 to 250.
    robot: int
    #: Node 1 to be visited, 255 behind the last. 0 to 255.
    stop1: int
    #: Node 2 to be visited, 255 behind the last. 0 to 255.
    stop2: int
    #: Node 3 to be visited, 255 behind the last. 0 to 255.
    stop3: int
    #: Node 4 to be visited, 255 behind the last. 0 to 255.
    stop4: int
    #: Node 5 to be visited, 255 behind the last. 0 to 255.
    stop5: int
