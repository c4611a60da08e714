"""Bytes of the messages in ``onboard.contract.terminal_device``, and back.

Written by ``make docs`` from ``dbc/terminal.dbc``: change that file, never this one.
"""

import struct

from onboard.contract.base import FrameCode, OutOfRangeError, refusal
from onboard.contract.codes import ManualMode
from onboard.contract.terminal import Action, HandlerMode, MoveMode, Verb
from onboard.contract.terminal_device import (
    HandlerOrder,
    HandlerState,
    LaneSensor,
    ManualKey,
    MissionAnswer,
    MissionKey,
    MoveOrder,
    MoveState,
)

_ACTION = tuple(Action)
_HANDLER_MODE = tuple(HandlerMode)
_MANUAL_MODE = tuple(ManualMode)
_MOVE_MODE = tuple(MoveMode)
_VERB = tuple(Verb)
_FROM_0_TO_255_AT_15 = {value: value << 15 for value in range(256)}
_FROM_0_TO_255_AT_23 = {value: value << 23 for value in range(256)}
_FROM_0_TO_31_AT_10 = {value: value << 10 for value in range(32)}
_PACK_BBBBXXXX = struct.Struct("<BBBBxxxx").pack
_PACK_BBHXXXX = struct.Struct("<BBHxxxx").pack
_PACK_BBIH = struct.Struct("<BBIH").pack
_PACK_BBXXXXXX = struct.Struct("<BBxxxxxx").pack
_PACK_BIXXX = struct.Struct("<BIxxx").pack
_UNPACK_BBBBXXXX = struct.Struct("<BBBBxxxx").unpack_from
_UNPACK_BBBXXXXX = struct.Struct("<BBBxxxxx").unpack_from
_UNPACK_BBXXXXXX = struct.Struct("<BBxxxxxx").unpack_from
_UNPACK_BIXXX = struct.Struct("<BIxxx").unpack_from
_UNPACK_Q = struct.Struct("<Q").unpack_from


def pack_move_order(message: MoveOrder) -> bytes:
    entity = message.entity
    if entity < 1:
        raise OutOfRangeError("MoveOrder.entity", entity, 1, 255)
    try:
        return _PACK_BBBBXXXX(message.sequence, entity, message.slot, message.towards)
    except struct.error as error:
        raise refusal(
            message,
            ("MoveOrder.sequence", 0, 255),
            ("MoveOrder.entity", 1, 255),
            ("MoveOrder.slot", 0, 255),
            ("MoveOrder.towards", 0, 255),
        ) from error


def unpack_move_order(sender: int, data: bytes) -> MoveOrder | None:
    sequence, entity, slot, towards = _UNPACK_BBBBXXXX(data)
    if entity < 1:
        return None
    return MoveOrder(sender, sequence, entity, slot, towards)


def pack_handler_order(message: HandlerOrder) -> bytes:
    box = message.box
    if box > 65535:
        raise OutOfRangeError("HandlerOrder.box", box, 0, 65535)
    try:
        return _PACK_BIXXX(message.sequence, message.action + box * 0x8)
    except struct.error as error:
        raise refusal(message, ("HandlerOrder.sequence", 0, 255), ("HandlerOrder.box", 0, 65535)) from error


def unpack_handler_order(sender: int, data: bytes) -> HandlerOrder | None:
    sequence, word_1 = _UNPACK_BIXXX(data)
    action = word_1 & 0x7
    if action > 4:
        return None
    box = word_1 >> 3 & 0xFFFF
    return HandlerOrder(sender, sequence, _ACTION[action], box)


def pack_mission_answer(message: MissionAnswer) -> bytes:
    try:
        return _PACK_BBXXXXXX(message.mission, message.is_taken)
    except struct.error as error:
        raise refusal(message, ("MissionAnswer.mission", 0, 255)) from error


def unpack_mission_answer(sender: int, data: bytes) -> MissionAnswer | None:
    mission, is_taken = _UNPACK_BBXXXXXX(data)
    return MissionAnswer(sender, mission, is_taken & 0x1 != 0)


def pack_move_state(message: MoveState) -> bytes:
    try:
        return _PACK_BBBBXXXX(
            message.sequence, message.entity, message.slot, message.mode + (0x4 if message.at_end else 0)
        )
    except struct.error as error:
        raise refusal(
            message, ("MoveState.sequence", 0, 255), ("MoveState.entity", 0, 255), ("MoveState.slot", 0, 255)
        ) from error


def unpack_move_state(sender: int, data: bytes) -> MoveState | None:
    sequence, entity, slot, word_3 = _UNPACK_BBBBXXXX(data)
    mode = word_3 & 0x3
    return MoveState(sender, sequence, entity, slot, _MOVE_MODE[mode], word_3 & 0x4 != 0)


def pack_handler_state(message: HandlerState) -> bytes:
    box = message.box
    if box > 65535:
        raise OutOfRangeError("HandlerState.box", box, 0, 65535)
    try:
        return _PACK_BIXXX(message.sequence, message.gear + box * 0x4)
    except struct.error as error:
        raise refusal(message, ("HandlerState.sequence", 0, 255), ("HandlerState.box", 0, 65535)) from error


def unpack_handler_state(sender: int, data: bytes) -> HandlerState | None:
    sequence, word_1 = _UNPACK_BIXXX(data)
    gear = word_1 & 0x3
    box = word_1 >> 2 & 0xFFFF
    return HandlerState(sender, sequence, _HANDLER_MODE[gear], box)


def pack_lane_sensor(message: LaneSensor) -> bytes:
    lane = message.lane
    if lane < 1:
        raise OutOfRangeError("LaneSensor.lane", lane, 1, 255)
    try:
        return _PACK_BBXXXXXX(lane, message.blocked)
    except struct.error as error:
        raise refusal(message, ("LaneSensor.lane", 1, 255)) from error


def unpack_lane_sensor(sender: int, data: bytes) -> LaneSensor | None:
    lane, blocked = _UNPACK_BBXXXXXX(data)
    if lane < 1:
        return None
    return LaneSensor(sender, lane, blocked & 0x1 != 0)


def pack_mission_key(message: MissionKey) -> bytes:
    what = message.what
    if what < 0 or what > 65535:
        raise OutOfRangeError("MissionKey.what", what, 0, 65535)
    before_s = message.before_s
    if before_s < 0 or before_s > 32767:
        raise OutOfRangeError("MissionKey.before_s", before_s, 0, 32767)
    if message.urgent:
        before_s += 0x8000
    try:
        return _PACK_BBIH(
            message.mission,
            message.verb + (what & 0x3F) * 0x4,
            (what >> 6)
            + _FROM_0_TO_31_AT_10[message.count]
            + _FROM_0_TO_255_AT_15[message.source]
            + _FROM_0_TO_255_AT_23[message.target]
            + ((before_s & 0x1) << 31),
            (before_s >> 1),
        )
    except (KeyError, struct.error) as error:
        raise refusal(
            message,
            ("MissionKey.mission", 0, 255),
            ("MissionKey.count", 0, 31),
            ("MissionKey.source", 0, 255),
            ("MissionKey.target", 0, 255),
        ) from error


def unpack_mission_key(sender: int, data: bytes) -> MissionKey | None:
    (word_0,) = _UNPACK_Q(data)
    mission = word_0 & 0xFF
    verb = word_0 >> 8 & 0x3
    if verb > 2:
        return None
    what = word_0 >> 10 & 0xFFFF
    count = word_0 >> 26 & 0x1F
    source = word_0 >> 31 & 0xFF
    target = word_0 >> 39 & 0xFF
    before_s = word_0 >> 47 & 0x7FFF
    return MissionKey(
        sender, mission, _VERB[verb], what, count, source, target, before_s, word_0 & 0x4000000000000000 != 0
    )


def pack_manual_key(message: ManualKey) -> bytes:
    number = message.number
    if number < 1:
        raise OutOfRangeError("ManualKey.number", number, 1, 255)
    vehicle = message.vehicle
    if vehicle < 1 or vehicle > 250:
        raise OutOfRangeError("ManualKey.vehicle", vehicle, 1, 250)
    try:
        return _PACK_BBHXXXX(number, vehicle, message.manual_mode)
    except struct.error as error:
        raise refusal(message, ("ManualKey.number", 1, 255)) from error


def unpack_manual_key(sender: int, data: bytes) -> ManualKey | None:
    number, vehicle, manual_mode = _UNPACK_BBBXXXXX(data)
    if number < 1:
        return None
    if vehicle < 1 or vehicle > 250:
        return None
    manual_mode = manual_mode & 0x3
    if manual_mode > 2:
        return None
    return ManualKey(sender, number, vehicle, _MANUAL_MODE[manual_mode])


#: Every frame of this module.
FRAMES = (
    FrameCode(
        "MoveOrder", 0x14C00000, 8, pack_move_order, unpack_move_order, MoveOrder, MoveOrder, ("Controller",), True
    ),
    FrameCode(
        "HandlerOrder",
        0x14C20000,
        8,
        pack_handler_order,
        unpack_handler_order,
        HandlerOrder,
        HandlerOrder,
        ("Controller",),
        True,
    ),
    FrameCode(
        "MissionAnswer",
        0x14C30000,
        8,
        pack_mission_answer,
        unpack_mission_answer,
        MissionAnswer,
        MissionAnswer,
        ("Controller",),
        True,
    ),
    FrameCode("MoveState", 0x16C10000, 8, pack_move_state, unpack_move_state, MoveState, MoveState, ("Drive",), True),
    FrameCode(
        "HandlerState",
        0x16C30000,
        8,
        pack_handler_state,
        unpack_handler_state,
        HandlerState,
        HandlerState,
        ("Handler",),
        True,
    ),
    FrameCode(
        "LaneSensor", 0x16C40000, 8, pack_lane_sensor, unpack_lane_sensor, LaneSensor, LaneSensor, ("Cameras",), True
    ),
    FrameCode(
        "MissionKey", 0x16C50000, 8, pack_mission_key, unpack_mission_key, MissionKey, MissionKey, ("Keyboard",), True
    ),
    FrameCode(
        "ManualKey", 0x16C60000, 8, pack_manual_key, unpack_manual_key, ManualKey, ManualKey, ("Keyboard",), True
    ),
)
