"""Bytes of the messages in ``onboard.contract.graph``, and back.

Written by ``make docs`` from ``dbc/graph.dbc``: change that file, never this one.
"""

from struct import Struct

from onboard.contract.base import FrameCode, OutOfRangeError
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
_BBBXXXXX = Struct("<BBBxxxxx")
_BBHXXXX = Struct("<BBHxxxx")
_HBBBBBB = Struct("<HBBBBBB")
_Q = Struct("<Q")


def pack_node_answer(message: NodeAnswer) -> bytes:
    robot = message.robot
    if not 1 <= robot <= 250:
        raise OutOfRangeError("NodeAnswer.robot", robot, 1, 250)
    node = message.node
    if not 0 <= node <= 255:
        raise OutOfRangeError("NodeAnswer.node", node, 0, 255)
    after = message.after
    if not 0 <= after <= 255:
        raise OutOfRangeError("NodeAnswer.after", after, 0, 255)
    slot = message.slot
    if not 0 <= slot <= 15:
        raise OutOfRangeError("NodeAnswer.slot", slot, 0, 15)
    return _BBHXXXX.pack(robot, node, message.node_verdict + after * 0x4 + slot * 0x400)


def unpack_node_answer(sender: int, data: bytes) -> NodeAnswer | None:
    robot, node, word_2 = _BBHXXXX.unpack_from(data)
    if robot < 1 or robot > 250:
        return None
    node_verdict = word_2 & 0x3
    if node_verdict > 2:
        return None
    after = word_2 >> 2 & 0xFF
    slot = word_2 >> 10 & 0xF
    return NodeAnswer(sender, robot, node, _NODE_VERDICT[node_verdict], after, slot)


def pack_edge_notice(message: EdgeNotice) -> bytes:
    node = message.node
    if not 0 <= node <= 255:
        raise OutOfRangeError("EdgeNotice.node", node, 0, 255)
    other = message.other
    if not 0 <= other <= 255:
        raise OutOfRangeError("EdgeNotice.other", other, 0, 255)
    robot = message.robot
    if not 0 <= robot <= 250:
        raise OutOfRangeError("EdgeNotice.robot", robot, 0, 250)
    return _BBHXXXX.pack(node, other, message.edge_state + robot * 0x4)


def unpack_edge_notice(sender: int, data: bytes) -> EdgeNotice | None:
    node, other, word_2 = _BBHXXXX.unpack_from(data)
    edge_state = word_2 & 0x3
    if edge_state > 2:
        return None
    robot = word_2 >> 2 & 0xFF
    if robot > 250:
        return None
    return EdgeNotice(sender, node, other, _EDGE_STATE[edge_state], robot)


def pack_turn_signal(message: TurnSignal) -> bytes:
    node = message.node
    if not 0 <= node <= 255:
        raise OutOfRangeError("TurnSignal.node", node, 0, 255)
    behind = message.behind
    if not 0 <= behind <= 255:
        raise OutOfRangeError("TurnSignal.behind", behind, 0, 255)
    after = message.after
    if not 0 <= after <= 255:
        raise OutOfRangeError("TurnSignal.after", after, 0, 255)
    return _BBBXXXXX.pack(node, behind, after)


def unpack_turn_signal(sender: int, data: bytes) -> TurnSignal | None:
    node, behind, after = _BBBXXXXX.unpack_from(data)
    return TurnSignal(sender, node, behind, after)


def pack_visit_list(message: VisitList) -> bytes:
    order = message.order
    if not 0 <= order <= 65535:
        raise OutOfRangeError("VisitList.order", order, 0, 65535)
    robot = message.robot
    if not 1 <= robot <= 250:
        raise OutOfRangeError("VisitList.robot", robot, 1, 250)
    stop1 = message.stop1
    if not 0 <= stop1 <= 255:
        raise OutOfRangeError("VisitList.stop1", stop1, 0, 255)
    stop2 = message.stop2
    if not 0 <= stop2 <= 255:
        raise OutOfRangeError("VisitList.stop2", stop2, 0, 255)
    stop3 = message.stop3
    if not 0 <= stop3 <= 255:
        raise OutOfRangeError("VisitList.stop3", stop3, 0, 255)
    stop4 = message.stop4
    if not 0 <= stop4 <= 255:
        raise OutOfRangeError("VisitList.stop4", stop4, 0, 255)
    stop5 = message.stop5
    if not 0 <= stop5 <= 255:
        raise OutOfRangeError("VisitList.stop5", stop5, 0, 255)
    return _HBBBBBB.pack(order, robot, stop1, stop2, stop3, stop4, stop5)


def unpack_visit_list(sender: int, data: bytes) -> VisitList | None:
    order, robot, stop1, stop2, stop3, stop4, stop5 = _HBBBBBB.unpack_from(data)
    if robot < 1 or robot > 250:
        return None
    return VisitList(sender, order, robot, stop1, stop2, stop3, stop4, stop5)


def pack_robot_at(message: RobotAt) -> bytes:
    behind = message.behind
    if not 0 <= behind <= 255:
        raise OutOfRangeError("RobotAt.behind", behind, 0, 255)
    node = message.node
    if not 0 <= node <= 255:
        raise OutOfRangeError("RobotAt.node", node, 0, 255)
    ahead1 = message.ahead1
    if not 0 <= ahead1 <= 255:
        raise OutOfRangeError("RobotAt.ahead1", ahead1, 0, 255)
    ahead2 = message.ahead2
    if not 0 <= ahead2 <= 255:
        raise OutOfRangeError("RobotAt.ahead2", ahead2, 0, 255)
    ahead3 = message.ahead3
    if not 0 <= ahead3 <= 255:
        raise OutOfRangeError("RobotAt.ahead3", ahead3, 0, 255)
    goal = message.goal
    if not 0 <= goal <= 255:
        raise OutOfRangeError("RobotAt.goal", goal, 0, 255)
    return _Q.pack(
        behind
        + node * 0x100
        + message.on_edge * 0x10000
        + message.robot_mode * 0x20000
        + ahead1 * 0x80000
        + (ahead2 + ahead3 * 0x100 + goal * 0x10000) * 0x8000000
    )


def unpack_robot_at(sender: int, data: bytes) -> RobotAt | None:
    (word_0,) = _Q.unpack_from(data)
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
