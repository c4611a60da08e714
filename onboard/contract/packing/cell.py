"""Bytes of the messages in ``onboard.contract.cell``, and back.

Written by ``make docs`` from ``dbc/cell.dbc``: change that file, never this one.
"""

import struct

from onboard.contract.base import FrameCode, OutOfRangeError, Reference, refusal
from onboard.contract.cell import (
    ArmPhase,
    ArmProgress,
    GoalEnd,
    GoalPath,
    GoalStart,
    GoalTerms,
    GoalTooDeep,
    MoveCostHigh,
    MoveCostLow,
    MoveFrom,
    MoveTo,
    OfferHigh,
    OfferLow,
    OfferNodes,
    OfferNodesMore,
    PartAt,
)

_new = tuple.__new__
_ARM_PHASE = tuple(ArmPhase)
_FROM_0_TO_7_AT_4 = {value: value << 4 for value in range(8)}
_PACK_BHBBBBB = struct.Struct("<BHBBBBB").pack
_PACK_BHBBBXX = struct.Struct("<BHBBBxx").pack
_PACK_BHBSI = struct.Struct("<BHBi").pack
_PACK_BHIX = struct.Struct("<BHIx").pack
_PACK_BHXXXXX = struct.Struct("<BHxxxxx").pack
_PACK_BSIBH = struct.Struct("<BiBH").pack
_PACK_HBBBBBB = struct.Struct("<HBBBBBB").pack
_PACK_HBSHBSH = struct.Struct("<HBhBh").pack
_PACK_HIH = struct.Struct("<HIH").pack
_UNPACK_BHBBBBB = struct.Struct("<BHBBBBB").unpack_from
_UNPACK_BHBBBXX = struct.Struct("<BHBBBxx").unpack_from
_UNPACK_BHIX = struct.Struct("<BHIx").unpack_from
_UNPACK_BHXXXXX = struct.Struct("<BHxxxxx").unpack_from
_UNPACK_HBBBBBB = struct.Struct("<HBBBBBB").unpack_from
_UNPACK_HIBX = struct.Struct("<HIBx").unpack_from
_UNPACK_Q = struct.Struct("<Q").unpack_from


def pack_goal_start(message: GoalStart) -> bytes:
    x_mm = message.x_mm
    y_mm = message.y_mm
    try:
        return _PACK_HBSHBSH(message.goal, x_mm & 0xFF, x_mm >> 8, y_mm & 0xFF, y_mm >> 8)
    except struct.error as error:
        raise refusal(
            message,
            ("GoalStart.goal", 0, 65535),
            ("GoalStart.x_mm", -8388608, 8388607),
            ("GoalStart.y_mm", -8388608, 8388607),
        ) from error


def unpack_goal_start(sender: int, data: bytes) -> GoalStart | None:
    (word_0,) = _UNPACK_Q(data)
    goal = word_0 & 0xFFFF
    x_mm = ((word_0 >> 16 & 0xFFFFFF) ^ 0x800000) - 0x800000
    y_mm = ((word_0 >> 40) ^ 0x800000) - 0x800000
    return GoalStart(sender, goal, x_mm, y_mm)


def pack_goal_end(message: GoalEnd) -> bytes:
    x_mm = message.x_mm
    y_mm = message.y_mm
    try:
        return _PACK_HBSHBSH(message.goal, x_mm & 0xFF, x_mm >> 8, y_mm & 0xFF, y_mm >> 8)
    except struct.error as error:
        raise refusal(
            message,
            ("GoalEnd.goal", 0, 65535),
            ("GoalEnd.x_mm", -8388608, 8388607),
            ("GoalEnd.y_mm", -8388608, 8388607),
        ) from error


def unpack_goal_end(sender: int, data: bytes) -> GoalEnd | None:
    (word_0,) = _UNPACK_Q(data)
    goal = word_0 & 0xFFFF
    x_mm = ((word_0 >> 16 & 0xFFFFFF) ^ 0x800000) - 0x800000
    y_mm = ((word_0 >> 40) ^ 0x800000) - 0x800000
    return GoalEnd(sender, goal, x_mm, y_mm)


def pack_goal_terms(message: GoalTerms) -> bytes:
    level = message.level
    if level < 0 or level > 7:
        raise OutOfRangeError("GoalTerms.level", level, 0, 7)
    try:
        return _PACK_HIH(message.goal, message.time_limit_ms, level + _FROM_0_TO_7_AT_4[message.deepest])
    except (KeyError, struct.error) as error:
        raise refusal(
            message,
            ("GoalTerms.goal", 0, 65535),
            ("GoalTerms.time_limit_ms", 0, 4294967295),
            ("GoalTerms.deepest", 0, 7),
        ) from error


def unpack_goal_terms(sender: int, data: bytes) -> GoalTerms | None:
    goal, time_limit_ms, word_6 = _UNPACK_HIBX(data)
    level = word_6 & 0xF
    if level > 7:
        return None
    deepest = word_6 >> 4
    if deepest > 7:
        return None
    return GoalTerms(sender, goal, time_limit_ms, level, deepest)


def pack_goal_path(message: GoalPath) -> bytes:
    try:
        return _PACK_HBBBBBB(
            message.goal, message.node1, message.node2, message.node3, message.node4, message.node5, message.node6
        )
    except struct.error as error:
        raise refusal(
            message,
            ("GoalPath.goal", 0, 65535),
            ("GoalPath.node1", 0, 255),
            ("GoalPath.node2", 0, 255),
            ("GoalPath.node3", 0, 255),
            ("GoalPath.node4", 0, 255),
            ("GoalPath.node5", 0, 255),
            ("GoalPath.node6", 0, 255),
        ) from error


def unpack_goal_path(sender: int, data: bytes) -> GoalPath | None:
    goal, node1, node2, node3, node4, node5, node6 = _UNPACK_HBBBBBB(data)
    return GoalPath(sender, goal, node1, node2, node3, node4, node5, node6)


def pack_offer_high(message: OfferHigh) -> bytes:
    manager = message.manager
    if manager < 1:
        raise OutOfRangeError("OfferHigh.manager", manager, 1, 255)
    try:
        return _PACK_BHIX(manager, message.goal, message.bits)
    except struct.error as error:
        raise refusal(
            message, ("OfferHigh.manager", 1, 255), ("OfferHigh.goal", 0, 65535), ("OfferHigh.bits", 0, 4294967295)
        ) from error


def unpack_offer_high(sender: int, data: bytes) -> OfferHigh | None:
    manager, goal, bits = _UNPACK_BHIX(data)
    if manager < 1:
        return None
    return OfferHigh(sender, manager, goal, bits)


def pack_offer_low(message: OfferLow) -> bytes:
    manager = message.manager
    if manager < 1:
        raise OutOfRangeError("OfferLow.manager", manager, 1, 255)
    try:
        return _PACK_BHIX(manager, message.goal, message.bits)
    except struct.error as error:
        raise refusal(
            message, ("OfferLow.manager", 1, 255), ("OfferLow.goal", 0, 65535), ("OfferLow.bits", 0, 4294967295)
        ) from error


def unpack_offer_low(sender: int, data: bytes) -> OfferLow | None:
    manager, goal, bits = _UNPACK_BHIX(data)
    if manager < 1:
        return None
    return OfferLow(sender, manager, goal, bits)


def pack_offer_nodes(message: OfferNodes) -> bytes:
    manager = message.manager
    if manager < 1:
        raise OutOfRangeError("OfferNodes.manager", manager, 1, 255)
    try:
        return _PACK_BHBBBBB(
            manager, message.goal, message.node1, message.node2, message.node3, message.node4, message.node5
        )
    except struct.error as error:
        raise refusal(
            message,
            ("OfferNodes.manager", 1, 255),
            ("OfferNodes.goal", 0, 65535),
            ("OfferNodes.node1", 0, 255),
            ("OfferNodes.node2", 0, 255),
            ("OfferNodes.node3", 0, 255),
            ("OfferNodes.node4", 0, 255),
            ("OfferNodes.node5", 0, 255),
        ) from error


def unpack_offer_nodes(sender: int, data: bytes) -> OfferNodes | None:
    manager, goal, node1, node2, node3, node4, node5 = _UNPACK_BHBBBBB(data)
    if manager < 1:
        return None
    return OfferNodes(sender, manager, goal, node1, node2, node3, node4, node5)


def pack_offer_nodes_more(message: OfferNodesMore) -> bytes:
    manager = message.manager
    if manager < 1:
        raise OutOfRangeError("OfferNodesMore.manager", manager, 1, 255)
    try:
        return _PACK_BHBBBXX(manager, message.goal, message.node6, message.node7, message.node8)
    except struct.error as error:
        raise refusal(
            message,
            ("OfferNodesMore.manager", 1, 255),
            ("OfferNodesMore.goal", 0, 65535),
            ("OfferNodesMore.node6", 0, 255),
            ("OfferNodesMore.node7", 0, 255),
            ("OfferNodesMore.node8", 0, 255),
        ) from error


def unpack_offer_nodes_more(sender: int, data: bytes) -> OfferNodesMore | None:
    manager, goal, node6, node7, node8 = _UNPACK_BHBBBXX(data)
    if manager < 1:
        return None
    return OfferNodesMore(sender, manager, goal, node6, node7, node8)


def pack_goal_too_deep(message: GoalTooDeep) -> bytes:
    part = message.part
    try:
        return _PACK_BHXXXXX(part[0], part[1])
    except struct.error as error:
        raise refusal(message, ("GoalTooDeep.part.origin", 0, 255), ("GoalTooDeep.part.number", 0, 65535)) from error


def unpack_goal_too_deep(sender: int, data: bytes) -> GoalTooDeep | None:
    part_origin, part_number = _UNPACK_BHXXXXX(data)
    return GoalTooDeep(sender, _new(Reference, (part_origin, part_number)))


def pack_move_from(message: MoveFrom) -> bytes:
    manager = message.manager
    if manager < 1:
        raise OutOfRangeError("MoveFrom.manager", manager, 1, 255)
    x_mm = message.x_mm
    if x_mm < 0:
        if x_mm < -524288:
            raise OutOfRangeError("MoveFrom.x_mm", x_mm, -524288, 524287)
        x_mm += 0x100000
    elif x_mm > 524287:
        raise OutOfRangeError("MoveFrom.x_mm", x_mm, -524288, 524287)
    try:
        return _PACK_BHBSI(manager, message.goal, x_mm & 0xFF, (x_mm >> 8) + message.y_mm * 0x1000)
    except struct.error as error:
        raise refusal(
            message, ("MoveFrom.manager", 1, 255), ("MoveFrom.goal", 0, 65535), ("MoveFrom.y_mm", -524288, 524287)
        ) from error


def unpack_move_from(sender: int, data: bytes) -> MoveFrom | None:
    (word_0,) = _UNPACK_Q(data)
    manager = word_0 & 0xFF
    if manager < 1:
        return None
    goal = word_0 >> 8 & 0xFFFF
    x_mm = ((word_0 >> 24 & 0xFFFFF) ^ 0x80000) - 0x80000
    y_mm = ((word_0 >> 44) ^ 0x80000) - 0x80000
    return MoveFrom(sender, manager, goal, x_mm, y_mm)


def pack_move_to(message: MoveTo) -> bytes:
    manager = message.manager
    if manager < 1:
        raise OutOfRangeError("MoveTo.manager", manager, 1, 255)
    x_mm = message.x_mm
    if x_mm < 0:
        if x_mm < -524288:
            raise OutOfRangeError("MoveTo.x_mm", x_mm, -524288, 524287)
        x_mm += 0x100000
    elif x_mm > 524287:
        raise OutOfRangeError("MoveTo.x_mm", x_mm, -524288, 524287)
    try:
        return _PACK_BHBSI(manager, message.goal, x_mm & 0xFF, (x_mm >> 8) + message.y_mm * 0x1000)
    except struct.error as error:
        raise refusal(
            message, ("MoveTo.manager", 1, 255), ("MoveTo.goal", 0, 65535), ("MoveTo.y_mm", -524288, 524287)
        ) from error


def unpack_move_to(sender: int, data: bytes) -> MoveTo | None:
    (word_0,) = _UNPACK_Q(data)
    manager = word_0 & 0xFF
    if manager < 1:
        return None
    goal = word_0 >> 8 & 0xFFFF
    x_mm = ((word_0 >> 24 & 0xFFFFF) ^ 0x80000) - 0x80000
    y_mm = ((word_0 >> 44) ^ 0x80000) - 0x80000
    return MoveTo(sender, manager, goal, x_mm, y_mm)


def pack_move_cost_high(message: MoveCostHigh) -> bytes:
    manager = message.manager
    if manager < 1:
        raise OutOfRangeError("MoveCostHigh.manager", manager, 1, 255)
    try:
        return _PACK_BHIX(manager, message.goal, message.bits)
    except struct.error as error:
        raise refusal(
            message,
            ("MoveCostHigh.manager", 1, 255),
            ("MoveCostHigh.goal", 0, 65535),
            ("MoveCostHigh.bits", 0, 4294967295),
        ) from error


def unpack_move_cost_high(sender: int, data: bytes) -> MoveCostHigh | None:
    manager, goal, bits = _UNPACK_BHIX(data)
    if manager < 1:
        return None
    return MoveCostHigh(sender, manager, goal, bits)


def pack_move_cost_low(message: MoveCostLow) -> bytes:
    manager = message.manager
    if manager < 1:
        raise OutOfRangeError("MoveCostLow.manager", manager, 1, 255)
    try:
        return _PACK_BHIX(manager, message.goal, message.bits)
    except struct.error as error:
        raise refusal(
            message,
            ("MoveCostLow.manager", 1, 255),
            ("MoveCostLow.goal", 0, 65535),
            ("MoveCostLow.bits", 0, 4294967295),
        ) from error


def unpack_move_cost_low(sender: int, data: bytes) -> MoveCostLow | None:
    manager, goal, bits = _UNPACK_BHIX(data)
    if manager < 1:
        return None
    return MoveCostLow(sender, manager, goal, bits)


def pack_arm_progress(message: ArmProgress) -> bytes:
    x_mm = message.x_mm
    if x_mm < 0:
        if x_mm < -524288:
            raise OutOfRangeError("ArmProgress.x_mm", x_mm, -524288, 524287)
        x_mm += 0x100000
    elif x_mm > 524287:
        raise OutOfRangeError("ArmProgress.x_mm", x_mm, -524288, 524287)
    try:
        return _PACK_BSIBH(x_mm & 0xFF, (x_mm >> 8) + message.y_mm * 0x1000, message.arm_phase, message.goal)
    except struct.error as error:
        raise refusal(message, ("ArmProgress.y_mm", -524288, 524287), ("ArmProgress.goal", 0, 65535)) from error


def unpack_arm_progress(sender: int, data: bytes) -> ArmProgress | None:
    (word_0,) = _UNPACK_Q(data)
    x_mm = ((word_0 & 0xFFFFF) ^ 0x80000) - 0x80000
    y_mm = ((word_0 >> 20 & 0xFFFFF) ^ 0x80000) - 0x80000
    arm_phase = word_0 >> 40 & 0xF
    if arm_phase > 5:
        return None
    goal = word_0 >> 48
    return ArmProgress(sender, x_mm, y_mm, _ARM_PHASE[arm_phase], goal)


def pack_part_at(message: PartAt) -> bytes:
    part = message.part
    x_mm = message.x_mm
    if x_mm < 0:
        if x_mm < -262144:
            raise OutOfRangeError("PartAt.x_mm", x_mm, -262144, 262143)
        x_mm += 0x80000
    elif x_mm > 262143:
        raise OutOfRangeError("PartAt.x_mm", x_mm, -262144, 262143)
    try:
        return _PACK_BHBSI(
            part[0], part[1], x_mm & 0xFF, (x_mm >> 8) + (0x800 if message.aboard else 0) + message.y_mm * 0x2000
        )
    except struct.error as error:
        raise refusal(
            message, ("PartAt.part.origin", 0, 255), ("PartAt.part.number", 0, 65535), ("PartAt.y_mm", -262144, 262143)
        ) from error


def unpack_part_at(sender: int, data: bytes) -> PartAt | None:
    (word_0,) = _UNPACK_Q(data)
    part_origin = word_0 & 0xFF
    part_number = word_0 >> 8 & 0xFFFF
    x_mm = ((word_0 >> 24 & 0x7FFFF) ^ 0x40000) - 0x40000
    y_mm = ((word_0 >> 45) ^ 0x40000) - 0x40000
    return PartAt(sender, _new(Reference, (part_origin, part_number)), x_mm, word_0 & 0x80000000000 != 0, y_mm)


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
    FrameCode(
        "OfferNodesMore",
        0x08A70000,
        8,
        pack_offer_nodes_more,
        unpack_offer_nodes_more,
        OfferNodesMore,
        OfferNodesMore,
        ("Arm",),
        False,
    ),
    FrameCode(
        "GoalTooDeep",
        0x08A80000,
        8,
        pack_goal_too_deep,
        unpack_goal_too_deep,
        GoalTooDeep,
        GoalTooDeep,
        ("Arm",),
        False,
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
#: CRC-32 over this system's DBC: part of the digest of its sites (docs/site-file.md).
WORDS = 0xBE6B7570
