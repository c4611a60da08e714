"""Bytes of the messages in ``onboard.contract.graph_device``, and back.

Written by ``make docs`` from ``dbc/graph.dbc``: change that file, never this one.
"""

from struct import Struct

from onboard.contract.base import FrameCode, OutOfRangeError
from onboard.contract.codes import OrderResult
from onboard.contract.graph import BodyPlace, RouteAction
from onboard.contract.graph_device import ApproachSensor, BodyState, RouteOrder, VisitAnswer, VisitKey

_BODY_PLACE = tuple(BodyPlace)
_ORDER_RESULT = tuple(OrderResult)
_ROUTE_ACTION = tuple(RouteAction)
_BBBBXXXX = Struct("<BBBBxxxx")
_BBXXXXXX = Struct("<BBxxxxxx")
_BIXXX = Struct("<BIxxx")
_HBBBBBB = Struct("<HBBBBBB")
_HHXXXX = Struct("<HHxxxx")


def pack_route_order(message: RouteOrder) -> bytes:
    sequence = message.sequence
    if not 0 <= sequence <= 255:
        raise OutOfRangeError("RouteOrder.sequence", sequence, 0, 255)
    start = message.start
    if not 0 <= start <= 255:
        raise OutOfRangeError("RouteOrder.start", start, 0, 255)
    end = message.end
    if not 0 <= end <= 255:
        raise OutOfRangeError("RouteOrder.end", end, 0, 255)
    return _BIXXX.pack(sequence, message.route_action + start * 0x2 + end * 0x200)


def unpack_route_order(sender: int, data: bytes) -> RouteOrder | None:
    sequence, word_1 = _BIXXX.unpack_from(data)
    route_action = word_1 & 0x1
    start = word_1 >> 1 & 0xFF
    end = word_1 >> 9 & 0xFF
    return RouteOrder(sender, sequence, _ROUTE_ACTION[route_action], start, end)


def pack_visit_answer(message: VisitAnswer) -> bytes:
    order = message.order
    if not 0 <= order <= 65535:
        raise OutOfRangeError("VisitAnswer.order", order, 0, 65535)
    robot = message.robot
    if not 0 <= robot <= 250:
        raise OutOfRangeError("VisitAnswer.robot", robot, 0, 250)
    return _HHXXXX.pack(order, message.visit_result + robot * 0x4)


def unpack_visit_answer(sender: int, data: bytes) -> VisitAnswer | None:
    order, word_2 = _HHXXXX.unpack_from(data)
    visit_result = word_2 & 0x3
    robot = word_2 >> 2 & 0xFF
    if robot > 250:
        return None
    return VisitAnswer(sender, order, _ORDER_RESULT[visit_result], robot)


def pack_body_state(message: BodyState) -> bytes:
    sequence = message.sequence
    if not 0 <= sequence <= 255:
        raise OutOfRangeError("BodyState.sequence", sequence, 0, 255)
    behind = message.behind
    if not 0 <= behind <= 255:
        raise OutOfRangeError("BodyState.behind", behind, 0, 255)
    node = message.node
    if not 0 <= node <= 255:
        raise OutOfRangeError("BodyState.node", node, 0, 255)
    return _BBBBXXXX.pack(sequence, behind, node, message.body_place)


def unpack_body_state(sender: int, data: bytes) -> BodyState | None:
    sequence, behind, node, body_place = _BBBBXXXX.unpack_from(data)
    body_place = body_place & 0x3
    if body_place > 2:
        return None
    return BodyState(sender, sequence, behind, node, _BODY_PLACE[body_place])


def pack_approach_sensor(message: ApproachSensor) -> bytes:
    behind = message.behind
    if not 0 <= behind <= 255:
        raise OutOfRangeError("ApproachSensor.behind", behind, 0, 255)
    node = message.node
    if not 0 <= node <= 255:
        raise OutOfRangeError("ApproachSensor.node", node, 0, 255)
    return _BBXXXXXX.pack(behind, node)


def unpack_approach_sensor(sender: int, data: bytes) -> ApproachSensor | None:
    behind, node = _BBXXXXXX.unpack_from(data)
    return ApproachSensor(sender, behind, node)


def pack_visit_key(message: VisitKey) -> bytes:
    order = message.order
    if not 0 <= order <= 65535:
        raise OutOfRangeError("VisitKey.order", order, 0, 65535)
    robot = message.robot
    if not 0 <= robot <= 250:
        raise OutOfRangeError("VisitKey.robot", robot, 0, 250)
    stop1 = message.stop1
    if not 0 <= stop1 <= 255:
        raise OutOfRangeError("VisitKey.stop1", stop1, 0, 255)
    stop2 = message.stop2
    if not 0 <= stop2 <= 255:
        raise OutOfRangeError("VisitKey.stop2", stop2, 0, 255)
    stop3 = message.stop3
    if not 0 <= stop3 <= 255:
        raise OutOfRangeError("VisitKey.stop3", stop3, 0, 255)
    stop4 = message.stop4
    if not 0 <= stop4 <= 255:
        raise OutOfRangeError("VisitKey.stop4", stop4, 0, 255)
    stop5 = message.stop5
    if not 0 <= stop5 <= 255:
        raise OutOfRangeError("VisitKey.stop5", stop5, 0, 255)
    return _HBBBBBB.pack(order, robot, stop1, stop2, stop3, stop4, stop5)


def unpack_visit_key(sender: int, data: bytes) -> VisitKey | None:
    order, robot, stop1, stop2, stop3, stop4, stop5 = _HBBBBBB.unpack_from(data)
    if robot > 250:
        return None
    return VisitKey(sender, order, robot, stop1, stop2, stop3, stop4, stop5)


#: Every frame of this module.
FRAMES = (
    FrameCode(
        "RouteOrder", 0x14C80000, 8, pack_route_order, unpack_route_order, RouteOrder, RouteOrder, ("Controller",), True
    ),
    FrameCode(
        "VisitAnswer",
        0x14CC0000,
        8,
        pack_visit_answer,
        unpack_visit_answer,
        VisitAnswer,
        VisitAnswer,
        ("Controller",),
        True,
    ),
    FrameCode("BodyState", 0x16C90000, 8, pack_body_state, unpack_body_state, BodyState, BodyState, ("Drive",), True),
    FrameCode(
        "ApproachSensor",
        0x16CA0000,
        8,
        pack_approach_sensor,
        unpack_approach_sensor,
        ApproachSensor,
        ApproachSensor,
        ("Sensor",),
        True,
    ),
    FrameCode("VisitKey", 0x16CB0000, 8, pack_visit_key, unpack_visit_key, VisitKey, VisitKey, ("Counter",), True),
)
