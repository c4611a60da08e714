"""Bytes of the messages in ``onboard.contract.cell_device``, and back.

Written by ``make docs`` from ``dbc/cell.dbc``: change that file, never this one.
"""

import struct

from onboard.contract.base import FrameCode, OutOfRangeError, Reference, refusal
from onboard.contract.cell import ArmMode, GripAction, GripMode, RefusedFor
from onboard.contract.cell_device import ArmOrder, ArmState, GripOrder, GripState, OrderAnswer, OrderFrom, OrderTo
from onboard.contract.codes import OrderResult

_new = tuple.__new__
_ARM_MODE = tuple(ArmMode)
_GRIP_ACTION = tuple(GripAction)
_GRIP_MODE = tuple(GripMode)
_ORDER_RESULT = tuple(OrderResult)
_REFUSED_FOR = tuple(RefusedFor)
_FROM_0_TO_255_AT_1 = {value: value << 1 for value in range(256)}
_FROM_0_TO_255_AT_2 = {value: value << 2 for value in range(256)}
_PACK_BBSIH = struct.Struct("<BBiH").pack
_PACK_BBSIXX = struct.Struct("<BBixx").pack
_PACK_BIXXX = struct.Struct("<BIxxx").pack
_PACK_HBIX = struct.Struct("<HBIx").pack
_PACK_HBSIB = struct.Struct("<HBiB").pack
_PACK_HBSIX = struct.Struct("<HBix").pack
_UNPACK_BIXXX = struct.Struct("<BIxxx").unpack_from
_UNPACK_Q = struct.Struct("<Q").unpack_from


def pack_arm_order(message: ArmOrder) -> bytes:
    x_mm = message.x_mm
    if x_mm < 0:
        if x_mm < -524288:
            raise OutOfRangeError("ArmOrder.x_mm", x_mm, -524288, 524287)
        x_mm += 0x100000
    elif x_mm > 524287:
        raise OutOfRangeError("ArmOrder.x_mm", x_mm, -524288, 524287)
    try:
        return _PACK_BBSIXX(message.sequence, x_mm & 0xFF, (x_mm >> 8) + message.y_mm * 0x1000)
    except struct.error as error:
        raise refusal(message, ("ArmOrder.sequence", 0, 255), ("ArmOrder.y_mm", -524288, 524287)) from error


def unpack_arm_order(sender: int, data: bytes) -> ArmOrder | None:
    (word_0,) = _UNPACK_Q(data)
    sequence = word_0 & 0xFF
    x_mm = ((word_0 >> 8 & 0xFFFFF) ^ 0x80000) - 0x80000
    y_mm = ((word_0 >> 28 & 0xFFFFF) ^ 0x80000) - 0x80000
    return ArmOrder(sender, sequence, x_mm, y_mm)


def pack_grip_order(message: GripOrder) -> bytes:
    part = message.part
    part_number = part[1]
    if part_number > 65535:
        raise OutOfRangeError("GripOrder.part_number", part_number, 0, 65535)
    try:
        return _PACK_BIXXX(message.sequence, message.grip_action + _FROM_0_TO_255_AT_1[part[0]] + part_number * 0x200)
    except (KeyError, struct.error) as error:
        raise refusal(
            message,
            ("GripOrder.sequence", 0, 255),
            ("GripOrder.part.origin", 0, 255),
            ("GripOrder.part.number", 0, 65535),
        ) from error


def unpack_grip_order(sender: int, data: bytes) -> GripOrder | None:
    sequence, word_1 = _UNPACK_BIXXX(data)
    grip_action = word_1 & 0x1
    part_origin = word_1 >> 1 & 0xFF
    part_number = word_1 >> 9 & 0xFFFF
    return GripOrder(sender, sequence, _GRIP_ACTION[grip_action], _new(Reference, (part_origin, part_number)))


def pack_order_answer(message: OrderAnswer) -> bytes:
    cost_mm = message.cost_mm
    if cost_mm < 0 or cost_mm > 4294967295:
        raise OutOfRangeError("OrderAnswer.cost_mm", cost_mm, 0, 4294967295)
    try:
        return _PACK_HBIX(
            message.order,
            message.order_result + (cost_mm & 0x1F) * 0x8,
            (cost_mm >> 5) + message.refused_for * 0x8000000,
        )
    except struct.error as error:
        raise refusal(message, ("OrderAnswer.order", 0, 65535)) from error


def unpack_order_answer(sender: int, data: bytes) -> OrderAnswer | None:
    (word_0,) = _UNPACK_Q(data)
    order = word_0 & 0xFFFF
    order_result = word_0 >> 16 & 0x7
    if order_result > 3:
        return None
    cost_mm = word_0 >> 19 & 0xFFFFFFFF
    refused_for = word_0 >> 51 & 0x3
    if refused_for > 2:
        return None
    return OrderAnswer(sender, order, _ORDER_RESULT[order_result], cost_mm, _REFUSED_FOR[refused_for])


def pack_arm_state(message: ArmState) -> bytes:
    x_mm = message.x_mm
    if x_mm < 0:
        if x_mm < -262144:
            raise OutOfRangeError("ArmState.x_mm", x_mm, -262144, 262143)
        x_mm += 0x100000
    elif x_mm > 262143:
        raise OutOfRangeError("ArmState.x_mm", x_mm, -262144, 262143)
    y_mm = message.y_mm
    if y_mm < -262144 or y_mm > 262143:
        raise OutOfRangeError("ArmState.y_mm", y_mm, -262144, 262143)
    try:
        return _PACK_BBSIH(message.sequence, x_mm & 0xFF, (x_mm >> 8) + y_mm * 0x1000, message.arm_mode)
    except struct.error as error:
        raise refusal(message, ("ArmState.sequence", 0, 255)) from error


def unpack_arm_state(sender: int, data: bytes) -> ArmState | None:
    (word_0,) = _UNPACK_Q(data)
    sequence = word_0 & 0xFF
    x_mm = ((word_0 >> 8 & 0xFFFFF) ^ 0x80000) - 0x80000
    if x_mm < -262144 or x_mm > 262143:
        return None
    y_mm = ((word_0 >> 28 & 0xFFFFF) ^ 0x80000) - 0x80000
    if y_mm < -262144 or y_mm > 262143:
        return None
    arm_mode = word_0 >> 48 & 0x3
    if arm_mode > 1:
        return None
    return ArmState(sender, sequence, x_mm, y_mm, _ARM_MODE[arm_mode])


def pack_grip_state(message: GripState) -> bytes:
    part = message.part
    part_number = part[1]
    if part_number > 65535:
        raise OutOfRangeError("GripState.part_number", part_number, 0, 65535)
    try:
        return _PACK_BIXXX(message.sequence, message.grip_mode + _FROM_0_TO_255_AT_2[part[0]] + part_number * 0x400)
    except (KeyError, struct.error) as error:
        raise refusal(
            message,
            ("GripState.sequence", 0, 255),
            ("GripState.part.origin", 0, 255),
            ("GripState.part.number", 0, 65535),
        ) from error


def unpack_grip_state(sender: int, data: bytes) -> GripState | None:
    sequence, word_1 = _UNPACK_BIXXX(data)
    grip_mode = word_1 & 0x3
    part_origin = word_1 >> 2 & 0xFF
    part_number = word_1 >> 10 & 0xFFFF
    return GripState(sender, sequence, _GRIP_MODE[grip_mode], _new(Reference, (part_origin, part_number)))


def pack_order_from(message: OrderFrom) -> bytes:
    x_mm = message.x_mm
    if x_mm < 0:
        if x_mm < -262144:
            raise OutOfRangeError("OrderFrom.x_mm", x_mm, -262144, 262143)
        x_mm += 0x100000
    elif x_mm > 262143:
        raise OutOfRangeError("OrderFrom.x_mm", x_mm, -262144, 262143)
    y_mm = message.y_mm
    if y_mm < -262144 or y_mm > 262143:
        raise OutOfRangeError("OrderFrom.y_mm", y_mm, -262144, 262143)
    try:
        return _PACK_HBSIX(message.order, x_mm & 0xFF, (x_mm >> 8) + y_mm * 0x1000)
    except struct.error as error:
        raise refusal(message, ("OrderFrom.order", 0, 65535)) from error


def unpack_order_from(sender: int, data: bytes) -> OrderFrom | None:
    (word_0,) = _UNPACK_Q(data)
    order = word_0 & 0xFFFF
    x_mm = ((word_0 >> 16 & 0xFFFFF) ^ 0x80000) - 0x80000
    if x_mm < -262144 or x_mm > 262143:
        return None
    y_mm = ((word_0 >> 36 & 0xFFFFF) ^ 0x80000) - 0x80000
    if y_mm < -262144 or y_mm > 262143:
        return None
    return OrderFrom(sender, order, x_mm, y_mm)


def pack_order_to(message: OrderTo) -> bytes:
    x_mm = message.x_mm
    if x_mm < 0:
        if x_mm < -262144:
            raise OutOfRangeError("OrderTo.x_mm", x_mm, -262144, 262143)
        x_mm += 0x100000
    elif x_mm > 262143:
        raise OutOfRangeError("OrderTo.x_mm", x_mm, -262144, 262143)
    y_mm = message.y_mm
    if y_mm < -262144 or y_mm > 262143:
        raise OutOfRangeError("OrderTo.y_mm", y_mm, -262144, 262143)
    within_ms = message.within_ms
    if within_ms < 0 or within_ms > 2550000:
        raise OutOfRangeError("OrderTo.within_ms", within_ms, 0, 2550000)
    try:
        return _PACK_HBSIB(message.order, x_mm & 0xFF, (x_mm >> 8) + y_mm * 0x1000, within_ms // 10000)
    except struct.error as error:
        raise refusal(message, ("OrderTo.order", 0, 65535)) from error


def unpack_order_to(sender: int, data: bytes) -> OrderTo | None:
    (word_0,) = _UNPACK_Q(data)
    order = word_0 & 0xFFFF
    x_mm = ((word_0 >> 16 & 0xFFFFF) ^ 0x80000) - 0x80000
    if x_mm < -262144 or x_mm > 262143:
        return None
    y_mm = ((word_0 >> 36 & 0xFFFFF) ^ 0x80000) - 0x80000
    if y_mm < -262144 or y_mm > 262143:
        return None
    within_ms = (word_0 >> 56) * 10000
    return OrderTo(sender, order, x_mm, y_mm, within_ms)


#: Every frame of this module.
FRAMES = (
    FrameCode("ArmOrder", 0x14D00000, 8, pack_arm_order, unpack_arm_order, ArmOrder, ArmOrder, ("Controller",), True),
    FrameCode(
        "GripOrder", 0x14D20000, 8, pack_grip_order, unpack_grip_order, GripOrder, GripOrder, ("Controller",), True
    ),
    FrameCode(
        "OrderAnswer",
        0x14D60000,
        8,
        pack_order_answer,
        unpack_order_answer,
        OrderAnswer,
        OrderAnswer,
        ("Controller",),
        True,
    ),
    FrameCode("ArmState", 0x16D10000, 8, pack_arm_state, unpack_arm_state, ArmState, ArmState, ("Drive",), True),
    FrameCode("GripState", 0x16D30000, 8, pack_grip_state, unpack_grip_state, GripState, GripState, ("Gripper",), True),
    FrameCode("OrderFrom", 0x16D40000, 8, pack_order_from, unpack_order_from, OrderFrom, OrderFrom, ("Counter",), True),
    FrameCode("OrderTo", 0x16D50000, 8, pack_order_to, unpack_order_to, OrderTo, OrderTo, ("Counter",), True),
)
