"""Bytes of the messages in ``onboard.contract.terminal_device``, and back.

Written by ``make docs`` from ``dbc/terminal.dbc``: change that file, never this one.
"""

from struct import Struct

from onboard.contract.base import FrameCode, OutOfRangeError
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
_BBBBXXXX = Struct("<BBBBxxxx")
_BBBXXXXX = Struct("<BBBxxxxx")
_BBXXXXXX = Struct("<BBxxxxxx")
_BIXXX = Struct("<BIxxx")
_Q = Struct("<Q")


def pack_move_order(message: MoveOrder) -> bytes:
    sequence = message.sequence
    if not 0 <= sequence <= 255:
        raise OutOfRangeError("MoveOrder.sequence", sequence, 0, 255)
    entity = message.entity
    if not 1 <= entity <= 255:
        raise OutOfRangeError("MoveOrder.entity", entity, 1, 255)
    slot = message.slot
    if not 0 <= slot <= 255:
        raise OutOfRangeError("MoveOrder.slot", slot, 0, 255)
    towards = message.towards
    if not 0 <= towards <= 255:
        raise OutOfRangeError("MoveOrder.towards", towards, 0, 255)
    return _BBBBXXXX.pack(sequence, entity, slot, towards)


def unpack_move_order(sender: int, data: bytes) -> MoveOrder | None:
    sequence, entity, slot, towards = _BBBBXXXX.unpack_from(data)
    if entity < 1:
        return None
    return MoveOrder(sender, sequence, entity, slot, towards)


def pack_handler_order(message: HandlerOrder) -> bytes:
    sequence = message.sequence
    if not 0 <= sequence <= 255:
        raise OutOfRangeError("HandlerOrder.sequence", sequence, 0, 255)
    box = message.box
    if not 0 <= box <= 65535:
        raise OutOfRangeError("HandlerOrder.box", box, 0, 65535)
    return _BIXXX.pack(sequence, message.action + box * 0x8)


def unpack_handler_order(sender: int, data: bytes) -> HandlerOrder | None:
    sequence, word_1 = _BIXXX.unpack_from(data)
    action = word_1 & 0x7
    if action > 4:
        return None
    box = word_1 >> 3 & 0xFFFF
    return HandlerOrder(sender, sequence, _ACTION[action], box)


def pack_mission_answer(message: MissionAnswer) -> bytes:
    mission = message.mission
    if not 0 <= mission <= 255:
        raise OutOfRangeError("MissionAnswer.mission", mission, 0, 255)
    return _BBXXXXXX.pack(mission, message.is_taken)


def unpack_mission_answer(sender: int, data: bytes) -> MissionAnswer | None:
    mission, is_taken = _BBXXXXXX.unpack_from(data)
    return MissionAnswer(sender, mission, is_taken & 0x1 != 0)


def pack_move_state(message: MoveState) -> bytes:
    sequence = message.sequence
    if not 0 <= sequence <= 255:
        raise OutOfRangeError("MoveState.sequence", sequence, 0, 255)
    entity = message.entity
    if not 0 <= entity <= 255:
        raise OutOfRangeError("MoveState.entity", entity, 0, 255)
    slot = message.slot
    if not 0 <= slot <= 255:
        raise OutOfRangeError("MoveState.slot", slot, 0, 255)
    return _BBBBXXXX.pack(sequence, entity, slot, message.mode + message.at_end * 0x4)


def unpack_move_state(sender: int, data: bytes) -> MoveState | None:
    sequence, entity, slot, word_3 = _BBBBXXXX.unpack_from(data)
    mode = word_3 & 0x3
    return MoveState(sender, sequence, entity, slot, _MOVE_MODE[mode], word_3 & 0x4 != 0)


def pack_handler_state(message: HandlerState) -> bytes:
    sequence = message.sequence
    if not 0 <= sequence <= 255:
        raise OutOfRangeError("HandlerState.sequence", sequence, 0, 255)
    box = message.box
    if not 0 <= box <= 65535:
        raise OutOfRangeError("HandlerState.box", box, 0, 65535)
    return _BIXXX.pack(sequence, message.gear + box * 0x4)


def unpack_handler_state(sender: int, data: bytes) -> HandlerState | None:
    sequence, word_1 = _BIXXX.unpack_from(data)
    gear = word_1 & 0x3
    box = word_1 >> 2 & 0xFFFF
    return HandlerState(sender, sequence, _HANDLER_MODE[gear], box)


def pack_lane_sensor(message: LaneSensor) -> bytes:
    lane = message.lane
    if not 1 <= lane <= 255:
        raise OutOfRangeError("LaneSensor.lane", lane, 1, 255)
    return _BBXXXXXX.pack(lane, message.blocked)


def unpack_lane_sensor(sender: int, data: bytes) -> LaneSensor | None:
    lane, blocked = _BBXXXXXX.unpack_from(data)
    if lane < 1:
        return None
    return LaneSensor(sender, lane, blocked & 0x1 != 0)


def pack_mission_key(message: MissionKey) -> bytes:
    mission = message.mission
    if not 0 <= mission <= 255:
        raise OutOfRangeError("MissionKey.mission", mission, 0, 255)
    what = message.what
    if not 0 <= what <= 65535:
        raise OutOfRangeError("MissionKey.what", what, 0, 65535)
    count = message.count
    if not 0 <= count <= 31:
        raise OutOfRangeError("MissionKey.count", count, 0, 31)
    source = message.source
    if not 0 <= source <= 255:
        raise OutOfRangeError("MissionKey.source", source, 0, 255)
    target = message.target
    if not 0 <= target <= 255:
        raise OutOfRangeError("MissionKey.target", target, 0, 255)
    before_s = message.before_s
    if not 0 <= before_s <= 32767:
        raise OutOfRangeError("MissionKey.before_s", before_s, 0, 32767)
    return _Q.pack(
        mission
        + message.verb * 0x100
        + what * 0x400
        + (count + source * 0x20 + target * 0x2000) * 0x4000000
        + (before_s + message.urgent * 0x8000) * 0x800000000000
    )


def unpack_mission_key(sender: int, data: bytes) -> MissionKey | None:
    (word_0,) = _Q.unpack_from(data)
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
    if not 1 <= number <= 255:
        raise OutOfRangeError("ManualKey.number", number, 1, 255)
    vehicle = message.vehicle
    if not 1 <= vehicle <= 250:
        raise OutOfRangeError("ManualKey.vehicle", vehicle, 1, 250)
    return _BBBXXXXX.pack(number, vehicle, message.manual_mode)


def unpack_manual_key(sender: int, data: bytes) -> ManualKey | None:
    number, vehicle, manual_mode = _BBBXXXXX.unpack_from(data)
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
