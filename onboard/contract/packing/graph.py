"""Bytes of the messages in ``onboard.contract.graph``, and back.

Written by ``make docs`` from ``dbc/graph.dbc``: change that file, never this one.
"""

import struct

from onboard.contract.base import FrameCode, OutOfRangeError, refusal
from onboard.contract.graph import (
    EdgeNotice,
    EdgeState,
    NodeAnswer,
    NodeVerdict,
    RobotAt,
    RobotMode,
    TurnSignal,
    VisitList,
)

_EDGE_STATE = tuple(EdgeState)
_NODE_VERDICT = tuple(NodeVerdict)
_ROBOT_MODE = tuple(RobotMode)
_FROM_0_TO_15_AT_10 = {value: value << 10 for value in range(16)}
_FROM_0_TO_250_AT_2 = {value: value << 2 for value in range(251)}
_FROM_0_TO_255_AT_11 = {value: value << 11 for value in range(256)}
_FROM_0_TO_255_AT_2 = {value: value << 2 for value in range(256)}
_FROM_0_TO_255_AT_3 = {value: value << 3 for value in range(256)}
_PACK_BBBXXXXX = struct.Struct("<BBBxxxxx").pack
_PACK_BBHI = struct.Struct("<BBHI").pack
_PACK_BBHXXXX = struct.Struct("<BBHxxxx").pack
_PACK_HBBBBBB = struct.Struct("<HBBBBBB").pack
_UNPACK_BBBXXXXX = struct.Struct("<BBBxxxxx").unpack_from
_UNPACK_BBHXXXX = struct.Struct("<BBHxxxx").unpack_from
_UNPACK_HBBBBBB = struct.Struct("<HBBBBBB").unpack_from
_UNPACK_Q = struct.Struct("<Q").unpack_from


def pack_node_answer(message: NodeAnswer) -> bytes:
    robot = message.robot
    if robot < 1 or robot > 250:
        raise OutOfRangeError("NodeAnswer.robot", robot, 1, 250)
    try:
        return _PACK_BBHXXXX(
            robot,
            message.node,
            message.node_verdict + _FROM_0_TO_255_AT_2[message.after] + _FROM_0_TO_15_AT_10[message.slot],
        )
    except (KeyError, struct.error) as error:
        raise refusal(
            message, ("NodeAnswer.node", 0, 255), ("NodeAnswer.after", 0, 255), ("NodeAnswer.slot", 0, 15)
        ) from error


def unpack_node_answer(sender: int, data: bytes) -> NodeAnswer | None:
    robot, node, word_2 = _UNPACK_BBHXXXX(data)
    if robot < 1 or robot > 250:
        return None
    node_verdict = word_2 & 0x3
    if node_verdict > 2:
        return None
    after = word_2 >> 2 & 0xFF
    slot = word_2 >> 10 & 0xF
    return NodeAnswer(sender, robot, node, _NODE_VERDICT[node_verdict], after, slot)


def pack_edge_notice(message: EdgeNotice) -> bytes:
    try:
        return _PACK_BBHXXXX(message.node, message.other, message.edge_state + _FROM_0_TO_250_AT_2[message.robot])
    except (KeyError, struct.error) as error:
        raise refusal(
            message, ("EdgeNotice.node", 0, 255), ("EdgeNotice.other", 0, 255), ("EdgeNotice.robot", 0, 250)
        ) from error


def unpack_edge_notice(sender: int, data: bytes) -> EdgeNotice | None:
    node, other, word_2 = _UNPACK_BBHXXXX(data)
    edge_state = word_2 & 0x3
    if edge_state > 2:
        return None
    robot = word_2 >> 2 & 0xFF
    if robot > 250:
        return None
    return EdgeNotice(sender, node, other, _EDGE_STATE[edge_state], robot)


def pack_turn_signal(message: TurnSignal) -> bytes:
    try:
        return _PACK_BBBXXXXX(message.node, message.behind, message.after)
    except struct.error as error:
        raise refusal(
            message, ("TurnSignal.node", 0, 255), ("TurnSignal.behind", 0, 255), ("TurnSignal.after", 0, 255)
        ) from error


def unpack_turn_signal(sender: int, data: bytes) -> TurnSignal | None:
    node, behind, after = _UNPACK_BBBXXXXX(data)
    return TurnSignal(sender, node, behind, after)


def pack_visit_list(message: VisitList) -> bytes:
    robot = message.robot
    if robot < 1 or robot > 250:
        raise OutOfRangeError("VisitList.robot", robot, 1, 250)
    try:
        return _PACK_HBBBBBB(
            message.order, robot, message.stop1, message.stop2, message.stop3, message.stop4, message.stop5
        )
    except struct.error as error:
        raise refusal(
            message,
            ("VisitList.order", 0, 65535),
            ("VisitList.stop1", 0, 255),
            ("VisitList.stop2", 0, 255),
            ("VisitList.stop3", 0, 255),
            ("VisitList.stop4", 0, 255),
            ("VisitList.stop5", 0, 255),
        ) from error


def unpack_visit_list(sender: int, data: bytes) -> VisitList | None:
    order, robot, stop1, stop2, stop3, stop4, stop5 = _UNPACK_HBBBBBB(data)
    if robot < 1 or robot > 250:
        return None
    return VisitList(sender, order, robot, stop1, stop2, stop3, stop4, stop5)


def pack_robot_at(message: RobotAt) -> bytes:
    ahead2 = message.ahead2
    if ahead2 < 0 or ahead2 > 255:
        raise OutOfRangeError("RobotAt.ahead2", ahead2, 0, 255)
    try:
        return _PACK_BBHI(
            message.behind,
            message.node,
            message.on_edge + message.robot_mode * 0x2 + _FROM_0_TO_255_AT_3[message.ahead1] + (ahead2 & 0x1F) * 0x800,
            (ahead2 >> 5) + _FROM_0_TO_255_AT_3[message.ahead3] + _FROM_0_TO_255_AT_11[message.goal],
        )
    except (KeyError, struct.error) as error:
        raise refusal(
            message,
            ("RobotAt.behind", 0, 255),
            ("RobotAt.node", 0, 255),
            ("RobotAt.ahead1", 0, 255),
            ("RobotAt.ahead3", 0, 255),
            ("RobotAt.goal", 0, 255),
        ) from error


def unpack_robot_at(sender: int, data: bytes) -> RobotAt | None:
    (word_0,) = _UNPACK_Q(data)
    behind = word_0 & 0xFF
    node = word_0 >> 8 & 0xFF
    robot_mode = word_0 >> 17 & 0x3
    if robot_mode > 2:
        return None
    ahead1 = word_0 >> 19 & 0xFF
    ahead2 = word_0 >> 27 & 0xFF
    ahead3 = word_0 >> 35 & 0xFF
    goal = word_0 >> 43 & 0xFF
    return RobotAt(sender, behind, node, word_0 & 0x10000 != 0, _ROBOT_MODE[robot_mode], ahead1, ahead2, ahead3, goal)


#: Every frame of this module.
FRAMES = (
    FrameCode(
        "NodeAnswer", 0x05700000, 8, pack_node_answer, unpack_node_answer, NodeAnswer, NodeAnswer, ("Node",), False
    ),
    FrameCode(
        "EdgeNotice", 0x05710000, 8, pack_edge_notice, unpack_edge_notice, EdgeNotice, EdgeNotice, ("Node",), False
    ),
    FrameCode(
        "TurnSignal", 0x06720000, 8, pack_turn_signal, unpack_turn_signal, TurnSignal, TurnSignal, ("Vehicle",), False
    ),
    FrameCode(
        "VisitList", 0x06740000, 8, pack_visit_list, unpack_visit_list, VisitList, VisitList, ("Desk", "Gateway"), False
    ),
    FrameCode("RobotAt", 0x0E730000, 8, pack_robot_at, unpack_robot_at, RobotAt, RobotAt, ("Vehicle",), False),
)
#: CRC-32 over this system's DBC: part of the digest of its sites (docs/site-file.md).
WORDS = 0x8C94A3CB
