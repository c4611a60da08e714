"""Bytes of the messages in ``onboard.contract.mapd_device``, and back.

Written by ``make docs`` from ``dbc/mapd.dbc``: change that file, never this one.
"""

import struct

from onboard.contract.base import FrameCode, OutOfRangeError, refusal
from onboard.contract.codes import OrderResult
from onboard.contract.mapd import CartAction
from onboard.contract.mapd_device import CartOrder, CartState, TransportAnswer, TransportKey

_CART_ACTION = tuple(CartAction)
_ORDER_RESULT = tuple(OrderResult)
_PACK_BHIX = struct.Struct("<BHIx").pack
_PACK_HHHH = struct.Struct("<HHHH").pack
_PACK_HHXXXX = struct.Struct("<HHxxxx").pack
_UNPACK_BHIX = struct.Struct("<BHIx").unpack_from
_UNPACK_HBXXXXX = struct.Struct("<HBxxxxx").unpack_from
_UNPACK_HHHH = struct.Struct("<HHHH").unpack_from
_UNPACK_Q = struct.Struct("<Q").unpack_from


def pack_cart_order(message: CartOrder) -> bytes:
    sequence = message.sequence
    if sequence < 0 or sequence > 255:
        raise OutOfRangeError("CartOrder.sequence", sequence, 0, 255)
    cell = message.cell
    if cell < 0 or cell > 63999:
        raise OutOfRangeError("CartOrder.cell", cell, 0, 63999)
    task = message.task
    if task < 0 or task > 65535:
        raise OutOfRangeError("CartOrder.task", task, 0, 65535)
    try:
        return (
            sequence + message.cart_action * 0x100 + cell * 0x400 + task * 0x4000000 + (message.step << 42)
        ).to_bytes(8, "little")
    except OverflowError as error:
        raise refusal(message, ("CartOrder.step", 0, 4194303)) from error


def unpack_cart_order(sender: int, data: bytes) -> CartOrder | None:
    (word_0,) = _UNPACK_Q(data)
    sequence = word_0 & 0xFF
    cart_action = word_0 >> 8 & 0x3
    if cart_action > 2:
        return None
    cell = word_0 >> 10 & 0xFFFF
    if cell > 63999:
        return None
    task = word_0 >> 26 & 0xFFFF
    step = word_0 >> 42
    return CartOrder(sender, sequence, _CART_ACTION[cart_action], cell, task, step)


def pack_transport_answer(message: TransportAnswer) -> bytes:
    task = message.task
    if task > 65534:
        raise OutOfRangeError("TransportAnswer.task", task, 0, 65534)
    try:
        return _PACK_HHXXXX(task, message.transport_result)
    except struct.error as error:
        raise refusal(message, ("TransportAnswer.task", 0, 65534)) from error


def unpack_transport_answer(sender: int, data: bytes) -> TransportAnswer | None:
    task, transport_result = _UNPACK_HBXXXXX(data)
    if task > 65534:
        return None
    transport_result = transport_result & 0x3
    return TransportAnswer(sender, task, _ORDER_RESULT[transport_result])


def pack_cart_state(message: CartState) -> bytes:
    cell = message.cell
    if cell > 63999:
        raise OutOfRangeError("CartState.cell", cell, 0, 63999)
    task = message.task
    if task > 65535:
        raise OutOfRangeError("CartState.task", task, 0, 65535)
    try:
        return _PACK_BHIX(message.sequence, cell, message.moving + task * 0x2)
    except struct.error as error:
        raise refusal(
            message, ("CartState.sequence", 0, 255), ("CartState.cell", 0, 63999), ("CartState.task", 0, 65535)
        ) from error


def unpack_cart_state(sender: int, data: bytes) -> CartState | None:
    sequence, cell, word_3 = _UNPACK_BHIX(data)
    if cell > 63999:
        return None
    task = word_3 >> 1 & 0xFFFF
    return CartState(sender, sequence, cell, word_3 & 0x1 != 0, task)


def pack_transport_key(message: TransportKey) -> bytes:
    task = message.task
    if task > 65534:
        raise OutOfRangeError("TransportKey.task", task, 0, 65534)
    pickup = message.pickup
    if pickup > 63999:
        raise OutOfRangeError("TransportKey.pickup", pickup, 0, 63999)
    delivery = message.delivery
    if delivery > 63999:
        raise OutOfRangeError("TransportKey.delivery", delivery, 0, 63999)
    try:
        return _PACK_HHHH(task, pickup, delivery, message.release)
    except struct.error as error:
        raise refusal(
            message,
            ("TransportKey.task", 0, 65534),
            ("TransportKey.pickup", 0, 63999),
            ("TransportKey.delivery", 0, 63999),
            ("TransportKey.release", 0, 65535),
        ) from error


def unpack_transport_key(sender: int, data: bytes) -> TransportKey | None:
    task, pickup, delivery, release = _UNPACK_HHHH(data)
    if task > 65534:
        return None
    if pickup > 63999:
        return None
    if delivery > 63999:
        return None
    return TransportKey(sender, task, pickup, delivery, release)


#: Every frame of this module.
FRAMES = (
    FrameCode(
        "CartOrder", 0x14E00000, 8, pack_cart_order, unpack_cart_order, CartOrder, CartOrder, ("Controller",), True
    ),
    FrameCode(
        "TransportAnswer",
        0x14E40000,
        8,
        pack_transport_answer,
        unpack_transport_answer,
        TransportAnswer,
        TransportAnswer,
        ("Controller",),
        True,
    ),
    FrameCode("CartState", 0x16E10000, 8, pack_cart_state, unpack_cart_state, CartState, CartState, ("Cart",), True),
    FrameCode(
        "TransportKey",
        0x16E30000,
        8,
        pack_transport_key,
        unpack_transport_key,
        TransportKey,
        TransportKey,
        ("Counter",),
        True,
    ),
)
