"""Bytes of the messages in ``onboard.contract.cell``, and back.

Written by ``make docs`` from ``dbc/cell.dbc``: change that file, never this one.
"""

from struct import Struct

from onboard.contract.base import FrameCode, OutOfRangeError, Reference
from onboard.contract.cell import (
    ArmPhase,
    ArmProgress,
    GoalEnd,
    GoalPath,
    GoalStart,
    GoalTerms,
    MoveCostHigh,
    MoveCostLow,
    MoveFrom,
    MoveTo,
    OfferHigh,
    OfferLow,
    OfferNodes,
    PartAt,
)

_new = tuple.__new__
_ARM_PHASE = tuple(ArmPhase)
_BHBBBBB = Struct("<BHBBBBB")
_BHIX = Struct("<BHIx")
_HBBBBBX = Struct("<HBBBBBx")
_HIBX = Struct("<HIBx")
_Q = Struct("<Q")


def pack_goal_start(message: GoalStart) -> bytes:
    goal = message.goal
    if not 0 <= goal <= 65535:
        raise OutOfRangeError("GoalStart.goal", goal, 0, 65535)
    x_mm = message.x_mm
    if not -8388608 <= x_mm <= 8388607:
        raise OutOfRangeError("GoalStart.x_mm", x_mm, -8388608, 8388607)
    y_mm = message.y_mm
    if not -8388608 <= y_mm <= 8388607:
        raise OutOfRangeError("GoalStart.y_mm", y_mm, -8388608, 8388607)
    return _Q.pack(goal + (x_mm & 0xFFFFFF) * 0x10000 + (y_mm & 0xFFFFFF) * 0x10000000000)


def unpack_goal_start(sender: int, data: bytes) -> GoalStart | None:
    (word_0,) = _Q.unpack_from(data)
    goal = word_0 & 0xFFFF
    x_mm = ((word_0 >> 16 & 0xFFFFFF) ^ 0x800000) - 0x800000
    y_mm = ((word_0 >> 40) ^ 0x800000) - 0x800000
    return GoalStart(sender, goal, x_mm, y_mm)


def pack_goal_end(message: GoalEnd) -> bytes:
    goal = message.goal
    if not 0 <= goal <= 65535:
        raise OutOfRangeError("GoalEnd.goal", goal, 0, 65535)
    x_mm = message.x_mm
    if not -8388608 <= x_mm <= 8388607:
        raise OutOfRangeError("GoalEnd.x_mm", x_mm, -8388608, 8388607)
    y_mm = message.y_mm
    if not -8388608 <= y_mm <= 8388607:
        raise OutOfRangeError("GoalEnd.y_mm", y_mm, -8388608, 8388607)
    return _Q.pack(goal + (x_mm & 0xFFFFFF) * 0x10000 + (y_mm & 0xFFFFFF) * 0x10000000000)


def unpack_goal_end(sender: int, data: bytes) -> GoalEnd | None:
    (word_0,) = _Q.unpack_from(data)
    goal = word_0 & 0xFFFF
    x_mm = ((word_0 >> 16 & 0xFFFFFF) ^ 0x800000) - 0x800000
    y_mm = ((word_0 >> 40) ^ 0x800000) - 0x800000
    return GoalEnd(sender, goal, x_mm, y_mm)


def pack_goal_terms(message: GoalTerms) -> bytes:
    goal = message.goal
    if not 0 <= goal <= 65535:
        raise OutOfRangeError("GoalTerms.goal", goal, 0, 65535)
    time_limit_ms = message.time_limit_ms
    if not 0 <= time_limit_ms <= 4294967295:
        raise OutOfRangeError("GoalTerms.time_limit_ms", time_limit_ms, 0, 4294967295)
    level = message.level
    if not 0 <= level <= 5:
        raise OutOfRangeError("GoalTerms.level", level, 0, 5)
    return _HIBX.pack(goal, time_limit_ms, level)


def unpack_goal_terms(sender: int, data: bytes) -> GoalTerms | None:
    goal, time_limit_ms, level = _HIBX.unpack_from(data)
    level = level & 0xF
    if level > 5:
        return None
    return GoalTerms(sender, goal, time_limit_ms, level)


def pack_goal_path(message: GoalPath) -> bytes:
    goal = message.goal
    if not 0 <= goal <= 65535:
        raise OutOfRangeError("GoalPath.goal", goal, 0, 65535)
    node1 = message.node1
    if not 0 <= node1 <= 255:
        raise OutOfRangeError("GoalPath.node1", node1, 0, 255)
    node2 = message.node2
    if not 0 <= node2 <= 255:
        raise OutOfRangeError("GoalPath.node2", node2, 0, 255)
    node3 = message.node3
    if not 0 <= node3 <= 255:
        raise OutOfRangeError("GoalPath.node3", node3, 0, 255)
    node4 = message.node4
    if not 0 <= node4 <= 255:
        raise OutOfRangeError("GoalPath.node4", node4, 0, 255)
    node5 = message.node5
    if not 0 <= node5 <= 255:
        raise OutOfRangeError("GoalPath.node5", node5, 0, 255)
    return _HBBBBBX.pack(goal, node1, node2, node3, node4, node5)


def unpack_goal_path(sender: int, data: bytes) -> GoalPath | None:
    goal, node1, node2, node3, node4, node5 = _HBBBBBX.unpack_from(data)
    return GoalPath(sender, goal, node1, node2, node3, node4, node5)


def pack_offer_high(message: OfferHigh) -> bytes:
    manager = message.manager
    if not 1 <= manager <= 255:
        raise OutOfRangeError("OfferHigh.manager", manager, 1, 255)
    goal = message.goal
    if not 0 <= goal <= 65535:
        raise OutOfRangeError("OfferHigh.goal", goal, 0, 65535)
    bits = message.bits
    if not 0 <= bits <= 4294967295:
        raise OutOfRangeError("OfferHigh.bits", bits, 0, 4294967295)
    return _BHIX.pack(manager, goal, bits)


def unpack_offer_high(sender: int, data: bytes) -> OfferHigh | None:
    manager, goal, bits = _BHIX.unpack_from(data)
    if manager < 1:
        return None
    return OfferHigh(sender, manager, goal, bits)


def pack_offer_low(message: OfferLow) -> bytes:
    manager = message.manager
    if not 1 <= manager <= 255:
        raise OutOfRangeError("OfferLow.manager", manager, 1, 255)
    goal = message.goal
    if not 0 <= goal <= 65535:
        raise OutOfRangeError("OfferLow.goal", goal, 0, 65535)
    bits = message.bits
    if not 0 <= bits <= 4294967295:
        raise OutOfRangeError("OfferLow.bits", bits, 0, 4294967295)
    return _BHIX.pack(manager, goal, bits)


def unpack_offer_low(sender: int, data: bytes) -> OfferLow | None:
    manager, goal, bits = _BHIX.unpack_from(data)
    if manager < 1:
        return None
    return OfferLow(sender, manager, goal, bits)


def pack_offer_nodes(message: OfferNodes) -> bytes:
    manager = message.manager
    if not 1 <= manager <= 255:
        raise OutOfRangeError("OfferNodes.manager", manager, 1, 255)
    goal = message.goal
    if not 0 <= goal <= 65535:
        raise OutOfRangeError("OfferNodes.goal", goal, 0, 65535)
    node1 = message.node1
    if not 0 <= node1 <= 255:
        raise OutOfRangeError("OfferNodes.node1", node1, 0, 255)
    node2 = message.node2
    if not 0 <= node2 <= 255:
        raise OutOfRangeError("OfferNodes.node2", node2, 0, 255)
    node3 = message.node3
    if not 0 <= node3 <= 255:
        raise OutOfRangeError("OfferNodes.node3", node3, 0, 255)
    node4 = message.node4
    if not 0 <= node4 <= 255:
        raise OutOfRangeError("OfferNodes.node4", node4, 0, 255)
    node5 = message.node5
    if not 0 <= node5 <= 255:
        raise OutOfRangeError("OfferNodes.node5", node5, 0, 255)
    return _BHBBBBB.pack(manager, goal, node1, node2, node3, node4, node5)


def unpack_offer_nodes(sender: int, data: bytes) -> OfferNodes | None:
    manager, goal, node1, node2, node3, node4, node5 = _BHBBBBB.unpack_from(data)
    if manager < 1:
        return None
    return OfferNodes(sender, manager, goal, node1, node2, node3, node4, node5)


def pack_move_from(message: MoveFrom) -> bytes:
    manager = message.manager
    if not 1 <= manager <= 255:
        raise OutOfRangeError("MoveFrom.manager", manager, 1, 255)
    goal = message.goal
    if not 0 <= goal <= 65535:
        raise OutOfRangeError("MoveFrom.goal", goal, 0, 65535)
    x_mm = message.x_mm
    if not -524288 <= x_mm <= 524287:
        raise OutOfRangeError("MoveFrom.x_mm", x_mm, -524288, 524287)
    y_mm = message.y_mm
    if not -524288 <= y_mm <= 524287:
        raise OutOfRangeError("MoveFrom.y_mm", y_mm, -524288, 524287)
    return _Q.pack(manager + goal * 0x100 + (x_mm & 0xFFFFF) * 0x1000000 + (y_mm & 0xFFFFF) * 0x100000000000)


def unpack_move_from(sender: int, data: bytes) -> MoveFrom | None:
    (word_0,) = _Q.unpack_from(data)
    manager = word_0 & 0xFF
    if manager < 1:
        return None
    goal = word_0 >> 8 & 0xFFFF
    x_mm = ((word_0 >> 24 & 0xFFFFF) ^ 0x80000) - 0x80000
    y_mm = ((word_0 >> 44) ^ 0x80000) - 0x80000
    return MoveFrom(sender, manager, goal, x_mm, y_mm)


def pack_move_to(message: MoveTo) -> bytes:
    manager = message.manager
    if not 1 <= manager <= 255:
        raise OutOfRangeError("MoveTo.manager", manager, 1, 255)
    goal = message.goal
    if not 0 <= goal <= 65535:
        raise OutOfRangeError("MoveTo.goal", goal, 0, 65535)
    x_mm = message.x_mm
    if not -524288 <= x_mm <= 524287:
        raise OutOfRangeError("MoveTo.x_mm", x_mm, -524288, 524287)
    y_mm = message.y_mm
    if not -524288 <= y_mm <= 524287:
        raise OutOfRangeError("MoveTo.y_mm", y_mm, -524288, 524287)
    return _Q.pack(manager + goal * 0x100 + (x_mm & 0xFFFFF) * 0x1000000 + (y_mm & 0xFFFFF) * 0x100000000000)


def unpack_move_to(sender: int, data: bytes) -> MoveTo | None:
    (word_0,) = _Q.unpack_from(data)
    manager = word_0 & 0xFF
    if manager < 1:
        return None
    goal = word_0 >> 8 & 0xFFFF
    x_mm = ((word_0 >> 24 & 0xFFFFF) ^ 0x80000) - 0x80000
    y_mm = ((word_0 >> 44) ^ 0x80000) - 0x80000
    return MoveTo(sender, manager, goal, x_mm, y_mm)


def pack_move_cost_high(message: MoveCostHigh) -> bytes:
    manager = message.manager
    if not 1 <= manager <= 255:
        raise OutOfRangeError("MoveCostHigh.manager", manager, 1, 255)
    goal = message.goal
    if not 0 <= goal <= 65535:
        raise OutOfRangeError("MoveCostHigh.goal", goal, 0, 65535)
    bits = message.bits
    if not 0 <= bits <= 4294967295:
        raise OutOfRangeError("MoveCostHigh.bits", bits, 0, 4294967295)
    return _BHIX.pack(manager, goal, bits)


def unpack_move_cost_high(sender: int, data: bytes) -> MoveCostHigh | None:
    manager, goal, bits = _BHIX.unpack_from(data)
    if manager < 1:
        return None
    return MoveCostHigh(sender, manager, goal, bits)


def pack_move_cost_low(message: MoveCostLow) -> bytes:
    manager = message.manager
    if not 1 <= manager <= 255:
        raise OutOfRangeError("MoveCostLow.manager", manager, 1, 255)
    goal = message.goal
    if not 0 <= goal <= 65535:
        raise OutOfRangeError("MoveCostLow.goal", goal, 0, 65535)
    bits = message.bits
    if not 0 <= bits <= 4294967295:
        raise OutOfRangeError("MoveCostLow.bits", bits, 0, 4294967295)
    return _BHIX.pack(manager, goal, bits)


def unpack_move_cost_low(sender: int, data: bytes) -> MoveCostLow | None:
    manager, goal, bits = _BHIX.unpack_from(data)
    if manager < 1:
        return None
    return MoveCostLow(sender, manager, goal, bits)


def pack_arm_progress(message: ArmProgress) -> bytes:
    x_mm = message.x_mm
    if not -524288 <= x_mm <= 524287:
        raise OutOfRangeError("ArmProgress.x_mm", x_mm, -524288, 524287)
    y_mm = message.y_mm
    if not -524288 <= y_mm <= 524287:
        raise OutOfRangeError("ArmProgress.y_mm", y_mm, -524288, 524287)
    goal = message.goal
    if not 0 <= goal <= 65535:
        raise OutOfRangeError("ArmProgress.goal", goal, 0, 65535)
    return _Q.pack(
        (x_mm & 0xFFFFF) + ((y_mm & 0xFFFFF) + message.arm_phase * 0x100000) * 0x100000 + goal * 0x100000000000
    )


def unpack_arm_progress(sender: int, data: bytes) -> ArmProgress | None:
    (word_0,) = _Q.unpack_from(data)
    x_mm = ((word_0 & 0xFFFFF) ^ 0x80000) - 0x80000
    y_mm = ((word_0 >> 20 & 0xFFFFF) ^ 0x80000) - 0x80000
    arm_phase = word_0 >> 40 & 0xF
    if arm_phase > 5:
        return None
    goal = word_0 >> 44 & 0xFFFF
    return ArmProgress(sender, x_mm, y_mm, _ARM_PHASE[arm_phase], goal)


def pack_part_at(message: PartAt) -> bytes:
    part_origin = message.part.origin
    if not 0 <= part_origin <= 255:
        raise OutOfRangeError("PartAt.part_origin", part_origin, 0, 255)
    part_number = message.part.number
    if not 0 <= part_number <= 65535:
        raise OutOfRangeError("PartAt.part_number", part_number, 0, 65535)
    x_mm = message.x_mm
    if not -262144 <= x_mm <= 262143:
        raise OutOfRangeError("PartAt.x_mm", x_mm, -262144, 262143)
    y_mm = message.y_mm
    if not -262144 <= y_mm <= 262143:
        raise OutOfRangeError("PartAt.y_mm", y_mm, -262144, 262143)
    return _Q.pack(
        part_origin
        + part_number * 0x100
        + (x_mm & 0x7FFFF) * 0x1000000
        + ((y_mm & 0x7FFFF) + message.aboard * 0x80000) * 0x80000000000
    )


def unpack_part_at(sender: int, data: bytes) -> PartAt | None:
    (word_0,) = _Q.unpack_from(data)
    part_origin = word_0 & 0xFF
    part_number = word_0 >> 8 & 0xFFFF
    x_mm = ((word_0 >> 24 & 0x7FFFF) ^ 0x40000) - 0x40000
    y_mm = ((word_0 >> 43 & 0x7FFFF) ^ 0x40000) - 0x40000
    return PartAt(sender, _new(Reference, (part_origin, part_number)), x_mm, y_mm, word_0 & 0x4000000000000000 != 0)


#: Every frame of this module.
FRAMES = (
    FrameCode(
        "GoalStart", 0x05A00000, 8, pack_goal_start, unpack_goal_start, GoalStart, GoalStart, ("Arm", "Desk"), False
    ),
    FrameCode("GoalEnd", 0x05A10000, 8, pack_goal_end, unpack_goal_end, GoalEnd, GoalEnd, ("Arm", "Desk"), False),
    FrameCode(
        "GoalTerms", 0x05A20000, 8, pack_goal_terms, unpack_goal_terms, GoalTerms, GoalTerms, ("Arm", "Desk"), False
    ),
    FrameCode("GoalPath", 0x05A30000, 8, pack_goal_path, unpack_goal_path, GoalPath, GoalPath, ("Arm", "Desk"), False),
    FrameCode("OfferHigh", 0x08A40000, 8, pack_offer_high, unpack_offer_high, OfferHigh, OfferHigh, ("Arm",), False),
    FrameCode("OfferLow", 0x08A50000, 8, pack_offer_low, unpack_offer_low, OfferLow, OfferLow, ("Arm",), False),
    FrameCode(
        "OfferNodes", 0x08A60000, 8, pack_offer_nodes, unpack_offer_nodes, OfferNodes, OfferNodes, ("Arm",), False
    ),
    FrameCode("MoveFrom", 0x0EA80000, 8, pack_move_from, unpack_move_from, MoveFrom, MoveFrom, ("Arm",), False),
    FrameCode("MoveTo", 0x0EA90000, 8, pack_move_to, unpack_move_to, MoveTo, MoveTo, ("Arm",), False),
    FrameCode(
        "MoveCostHigh",
        0x0EAA0000,
        8,
        pack_move_cost_high,
        unpack_move_cost_high,
        MoveCostHigh,
        MoveCostHigh,
        ("Arm",),
        False,
    ),
    FrameCode(
        "MoveCostLow",
        0x0EAB0000,
        8,
        pack_move_cost_low,
        unpack_move_cost_low,
        MoveCostLow,
        MoveCostLow,
        ("Arm",),
        False,
    ),
    FrameCode(
        "ArmProgress", 0x0EAC0000, 8, pack_arm_progress, unpack_arm_progress, ArmProgress, ArmProgress, ("Arm",), False
    ),
    FrameCode("PartAt", 0x0EAD0000, 8, pack_part_at, unpack_part_at, PartAt, PartAt, ("Arm", "Desk"), False),
)
