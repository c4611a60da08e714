"""Bytes of the messages in ``onboard.contract.graph_device``, and back.

Written by ``make docs`` from ``dbc/graph.dbc``: change that file, never this one.
"""

import struct

from onboard.contract.base import FrameCode, OutOfRangeError, refusal
from onboard.contract.codes import OrderResult
from onboard.contract.graph import BodyPlace, RouteAction
from onboard.contract.graph_device import ApproachSensor, BodyState, RouteOrder, VisitAnswer, VisitKey

_BODY_PLACE = tuple(BodyPlace)
_ORDER_RESULT = tuple(OrderResult)
_ROUTE_ACTION = tuple(RouteAction)
_FROM_0_TO_250_AT_2 = {value: value << 2 for value in range(251)}
_FROM_0_TO_255_AT_1 = {value: value << 1 for value in range(256)}
_FROM_0_TO_255_AT_9 = {value: value << 9 for value in range(256)}
_PACK_BBBBXXXX = struct.Struct("<BBBBxxxx").pack
_PACK_BBXXXXXX = struct.Struct("<BBxxxxxx").pack
_PACK_BIXXX = struct.Struct("<BIxxx").pack
_PACK_HBBBBBB = struct.Struct("<HBBBBBB").pack
_PACK_HHXXXX = struct.Struct("<HHxxxx").pack
_UNPACK_BBBBXXXX = struct.Struct("<BBBBxxxx").unpack_from
_UNPACK_BBXXXXXX = struct.Struct("<BBxxxxxx").unpack_from
_UNPACK_BIXXX = struct.Struct("<BIxxx").unpack_from
_UNPACK_HBBBBBB = struct.Struct("<HBBBBBB").unpack_from
_UNPACK_HHXXXX = struct.Struct("<HHxxxx").unpack_from


def pack_route_order(message: RouteOrder) -> bytes:
    try:
        return _PACK_BIXXX(
            message.sequence,
            message.route_action + _FROM_0_TO_255_AT_1[message.start] + _FROM_0_TO_255_AT_9[message.end],
        )
    except (KeyError, struct.error) as error:
        raise refusal(
            message, ("RouteOrder.sequence", 0, 255), ("RouteOrder.start", 0, 255), ("RouteOrder.end", 0, 255)
        ) from error


def unpack_route_order(sender: int, data: bytes) -> RouteOrder | None:
    sequence, word_1 = _UNPACK_BIXXX(data)
    route_action = word_1 & 0x1
    start = word_1 >> 1 & 0xFF
    end = word_1 >> 9 & 0xFF
    return RouteOrder(sender, sequence, _ROUTE_ACTION[route_action], start, end)


def pack_visit_answer(message: VisitAnswer) -> bytes:
    try:
        return _PACK_HHXXXX(message.order, message.visit_result + _FROM_0_TO_250_AT_2[message.robot])
    except (KeyError, struct.error) as error:
        raise refusal(message, ("VisitAnswer.order", 0, 65535), ("VisitAnswer.robot", 0, 250)) from error


def unpack_visit_answer(sender: int, data: bytes) -> VisitAnswer | None:
    order, word_2 = _UNPACK_HHXXXX(data)
    visit_result = word_2 & 0x3
    robot = word_2 >> 2 & 0xFF
    if robot > 250:
        return None
    return VisitAnswer(sender, order, _ORDER_RESULT[visit_result], robot)


def pack_body_state(message: BodyState) -> bytes:
    try:
        return _PACK_BBBBXXXX(message.sequence, message.behind, message.node, message.body_place)
    except struct.error as error:
        raise refusal(
            message, ("BodyState.sequence", 0, 255), ("BodyState.behind", 0, 255), ("BodyState.node", 0, 255)
        ) from error


def unpack_body_state(sender: int, data: bytes) -> BodyState | None:
    sequence, behind, node, body_place = _UNPACK_BBBBXXXX(data)
    body_place = body_place & 0x3
    if body_place > 2:
        return None
    return BodyState(sender, sequence, behind, node, _BODY_PLACE[body_place])


def pack_approach_sensor(message: ApproachSensor) -> bytes:
    try:
        return _PACK_BBXXXXXX(message.behind, message.node)
    except struct.error as error:
        raise refusal(message, ("ApproachSensor.behind", 0, 255), ("ApproachSensor.node", 0, 255)) from error


def unpack_approach_sensor(sender: int, data: bytes) -> ApproachSensor | None:
    behind, node = _UNPACK_BBXXXXXX(data)
    return ApproachSensor(sender, behind, node)


def pack_visit_key(message: VisitKey) -> bytes:
    robot = message.robot
    if robot > 250:
        raise OutOfRangeError("VisitKey.robot", robot, 0, 250)
    try:
        return _PACK_HBBBBBB(
            message.order, robot, message.stop1, message.stop2, message.stop3, message.stop4, message.stop5
        )
    except struct.error as error:
        raise refusal(
            message,
            ("VisitKey.order", 0, 65535),
            ("VisitKey.robot", 0, 250),
            ("VisitKey.stop1", 0, 255),
            ("VisitKey.stop2", 0, 255),
            ("VisitKey.stop3", 0, 255),
            ("VisitKey.stop4", 0, 255),
            ("VisitKey.stop5", 0, 255),
        ) from error


def unpack_visit_key(sender: int, data: bytes) -> VisitKey | None:
    order, robot, stop1, stop2, stop3, stop4, stop5 = _UNPACK_HBBBBBB(data)
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
