"""Bytes of the messages in ``onboard.contract.device``, and back.

Written by ``make docs`` from ``dbc/device.dbc``: change that file, never this one.
"""

from struct import Struct

from onboard.contract.base import FrameCode, OutOfRangeError, Reference
from onboard.contract.codes import (
    DeskInput,
    DeskText,
    DoorAction,
    DoorName,
    DoorPosition,
    DriveMode,
    LightColour,
    ShuttleAction,
    ShuttleMode,
    Side,
)
from onboard.contract.device import (
    BayState,
    DeskEvent,
    DeskOrder,
    DoorOrder,
    DoorState,
    DriveOrder,
    DriveState,
    LightOrder,
    PlatformState,
    ShuttleOrder,
    ShuttleState,
)

_new = tuple.__new__
_DESK_INPUT = tuple(DeskInput)
_DESK_TEXT = tuple(DeskText)
_DOOR_ACTION = tuple(DoorAction)
_DOOR_NAME = tuple(DoorName)
_DOOR_POSITION = tuple(DoorPosition)
_DRIVE_MODE = tuple(DriveMode)
_LIGHT_COLOUR = tuple(LightColour)
_SHUTTLE_ACTION = tuple(ShuttleAction)
_SHUTTLE_MODE = tuple(ShuttleMode)
_SIDE = tuple(Side)
_BBXXXXXX = Struct("<BBxxxxxx")
_BIXXX = Struct("<BIxxx")
_BSIHB = Struct("<BiHB")
_BSISHB = Struct("<BihB")
_BXXXXXXX = Struct("<Bxxxxxxx")
_HXXXXXX = Struct("<Hxxxxxx")
_Q = Struct("<Q")


def pack_drive_order(message: DriveOrder) -> bytes:
    sequence = message.sequence
    if not 0 <= sequence <= 255:
        raise OutOfRangeError("DriveOrder.sequence", sequence, 0, 255)
    target_mm = message.target_mm
    if not -2147483648 <= target_mm <= 2147483647:
        raise OutOfRangeError("DriveOrder.target_mm", target_mm, -2147483648, 2147483647)
    speed_limit_mm_s = message.speed_limit_mm_s
    if not 0 <= speed_limit_mm_s <= 65535:
        raise OutOfRangeError("DriveOrder.speed_limit_mm_s", speed_limit_mm_s, 0, 65535)
    return _BSIHB.pack(sequence, target_mm, speed_limit_mm_s, message.across)


def unpack_drive_order(sender: int, data: bytes) -> DriveOrder | None:
    sequence, target_mm, speed_limit_mm_s, across = _BSIHB.unpack_from(data)
    return DriveOrder(sender, sequence, target_mm, speed_limit_mm_s, across & 0x1 != 0)


def pack_shuttle_order(message: ShuttleOrder) -> bytes:
    sequence = message.sequence
    if not 0 <= sequence <= 255:
        raise OutOfRangeError("ShuttleOrder.sequence", sequence, 0, 255)
    wheelbase_mm = message.wheelbase_mm
    if not 0 <= wheelbase_mm <= 8191:
        raise OutOfRangeError("ShuttleOrder.wheelbase_mm", wheelbase_mm, 0, 8191)
    return _BIXXX.pack(sequence, message.action + message.side * 0x10 + wheelbase_mm * 0x20)


def unpack_shuttle_order(sender: int, data: bytes) -> ShuttleOrder | None:
    sequence, word_1 = _BIXXX.unpack_from(data)
    action = word_1 & 0xF
    if action > 3:
        return None
    side = word_1 >> 4 & 0x1
    wheelbase_mm = word_1 >> 5 & 0x1FFF
    return ShuttleOrder(sender, sequence, _SHUTTLE_ACTION[action], _SIDE[side], wheelbase_mm)


def pack_door_order(message: DoorOrder) -> bytes:
    sequence = message.sequence
    if not 0 <= sequence <= 255:
        raise OutOfRangeError("DoorOrder.sequence", sequence, 0, 255)
    return _BBXXXXXX.pack(sequence, message.door + message.action * 0x2)


def unpack_door_order(sender: int, data: bytes) -> DoorOrder | None:
    sequence, word_1 = _BBXXXXXX.unpack_from(data)
    door = word_1 & 0x1
    action = word_1 >> 1 & 0x1
    return DoorOrder(sender, sequence, _DOOR_NAME[door], _DOOR_ACTION[action])


def pack_light_order(message: LightOrder) -> bytes:
    return _BXXXXXXX.pack(message.colour)


def unpack_light_order(sender: int, data: bytes) -> LightOrder | None:
    (colour,) = _BXXXXXXX.unpack_from(data)
    colour = colour & 0x1
    return LightOrder(sender, _LIGHT_COLOUR[colour])


def pack_desk_order(message: DeskOrder) -> bytes:
    sequence = message.sequence
    if not 0 <= sequence <= 255:
        raise OutOfRangeError("DeskOrder.sequence", sequence, 0, 255)
    car_origin = message.car.origin
    if not 0 <= car_origin <= 255:
        raise OutOfRangeError("DeskOrder.car_origin", car_origin, 0, 255)
    car_number = message.car.number
    if not 0 <= car_number <= 65535:
        raise OutOfRangeError("DeskOrder.car_number", car_number, 0, 65535)
    return _BIXXX.pack(sequence, message.text + car_origin * 0x10 + car_number * 0x1000)


def unpack_desk_order(sender: int, data: bytes) -> DeskOrder | None:
    sequence, word_1 = _BIXXX.unpack_from(data)
    text = word_1 & 0xF
    if text > 8:
        return None
    car_origin = word_1 >> 4 & 0xFF
    car_number = word_1 >> 12 & 0xFFFF
    return DeskOrder(sender, sequence, _DESK_TEXT[text], _new(Reference, (car_origin, car_number)))


def pack_drive_state(message: DriveState) -> bytes:
    sequence = message.sequence
    if not 0 <= sequence <= 255:
        raise OutOfRangeError("DriveState.sequence", sequence, 0, 255)
    position_mm = message.position_mm
    if not -2147483648 <= position_mm <= 2147483647:
        raise OutOfRangeError("DriveState.position_mm", position_mm, -2147483648, 2147483647)
    speed_mm_s = message.speed_mm_s
    if not -32768 <= speed_mm_s <= 32767:
        raise OutOfRangeError("DriveState.speed_mm_s", speed_mm_s, -32768, 32767)
    return _BSISHB.pack(sequence, position_mm, speed_mm_s, message.mode + message.at_mark * 0x8 + message.across * 0x10)


def unpack_drive_state(sender: int, data: bytes) -> DriveState | None:
    sequence, position_mm, speed_mm_s, word_7 = _BSISHB.unpack_from(data)
    mode = word_7 & 0x7
    if mode > 4:
        return None
    return DriveState(
        sender, sequence, position_mm, speed_mm_s, _DRIVE_MODE[mode], word_7 & 0x8 != 0, word_7 & 0x10 != 0
    )


def pack_shuttle_state(message: ShuttleState) -> bytes:
    sequence = message.sequence
    if not 0 <= sequence <= 255:
        raise OutOfRangeError("ShuttleState.sequence", sequence, 0, 255)
    extension_mm = message.extension_mm
    if not 0 <= extension_mm <= 8191:
        raise OutOfRangeError("ShuttleState.extension_mm", extension_mm, 0, 8191)
    load_kg = message.load_kg
    if not 0 <= load_kg <= 4095:
        raise OutOfRangeError("ShuttleState.load_kg", load_kg, 0, 4095)
    wheelbase_mm = message.wheelbase_mm
    if not 0 <= wheelbase_mm <= 8191:
        raise OutOfRangeError("ShuttleState.wheelbase_mm", wheelbase_mm, 0, 8191)
    return _Q.pack(
        sequence
        + message.mode * 0x100
        + message.side * 0x1000
        + extension_mm * 0x2000
        + (load_kg + wheelbase_mm * 0x1000) * 0x4000000
    )


def unpack_shuttle_state(sender: int, data: bytes) -> ShuttleState | None:
    (word_0,) = _Q.unpack_from(data)
    sequence = word_0 & 0xFF
    mode = word_0 >> 8 & 0xF
    if mode > 5:
        return None
    side = word_0 >> 12 & 0x1
    extension_mm = word_0 >> 13 & 0x1FFF
    load_kg = word_0 >> 26 & 0xFFF
    wheelbase_mm = word_0 >> 38 & 0x1FFF
    return ShuttleState(sender, sequence, _SHUTTLE_MODE[mode], extension_mm, _SIDE[side], load_kg, wheelbase_mm)


def pack_door_state(message: DoorState) -> bytes:
    return _BXXXXXXX.pack(message.input_door + message.output_door * 0x8 + message.light * 0x40)


def unpack_door_state(sender: int, data: bytes) -> DoorState | None:
    (word_0,) = _BXXXXXXX.unpack_from(data)
    input_door = word_0 & 0x7
    if input_door > 5:
        return None
    output_door = word_0 >> 3 & 0x7
    if output_door > 5:
        return None
    light = word_0 >> 6 & 0x1
    return DoorState(sender, _DOOR_POSITION[input_door], _DOOR_POSITION[output_door], _LIGHT_COLOUR[light])


def pack_desk_event(message: DeskEvent) -> bytes:
    sequence = message.sequence
    if not 0 <= sequence <= 255:
        raise OutOfRangeError("DeskEvent.sequence", sequence, 0, 255)
    car_origin = message.car.origin
    if not 0 <= car_origin <= 255:
        raise OutOfRangeError("DeskEvent.car_origin", car_origin, 0, 255)
    car_number = message.car.number
    if not 0 <= car_number <= 65535:
        raise OutOfRangeError("DeskEvent.car_number", car_number, 0, 65535)
    return _BIXXX.pack(sequence, message.event + car_origin * 0x4 + car_number * 0x400)


def unpack_desk_event(sender: int, data: bytes) -> DeskEvent | None:
    sequence, word_1 = _BIXXX.unpack_from(data)
    event = word_1 & 0x3
    if event > 2:
        return None
    car_origin = word_1 >> 2 & 0xFF
    car_number = word_1 >> 10 & 0xFFFF
    return DeskEvent(sender, sequence, _DESK_INPUT[event], _new(Reference, (car_origin, car_number)))


def pack_bay_state(message: BayState) -> bytes:
    load_kg = message.load_kg
    if not 0 <= load_kg <= 4095:
        raise OutOfRangeError("BayState.load_kg", load_kg, 0, 4095)
    length_mm = message.length_mm
    if not 0 <= length_mm <= 8191:
        raise OutOfRangeError("BayState.length_mm", length_mm, 0, 8191)
    height_mm = message.height_mm
    if not 0 <= height_mm <= 4095:
        raise OutOfRangeError("BayState.height_mm", height_mm, 0, 4095)
    wheelbase_mm = message.wheelbase_mm
    if not 0 <= wheelbase_mm <= 8191:
        raise OutOfRangeError("BayState.wheelbase_mm", wheelbase_mm, 0, 8191)
    return _Q.pack(
        load_kg
        + length_mm * 0x1000
        + (height_mm + wheelbase_mm * 0x1000 + message.person_inside * 0x2000000 + message.carrier_in_front * 0x4000000)
        * 0x2000000
    )


def unpack_bay_state(sender: int, data: bytes) -> BayState | None:
    (word_0,) = _Q.unpack_from(data)
    load_kg = word_0 & 0xFFF
    length_mm = word_0 >> 12 & 0x1FFF
    height_mm = word_0 >> 25 & 0xFFF
    wheelbase_mm = word_0 >> 37 & 0x1FFF
    return BayState(
        sender,
        load_kg,
        length_mm,
        height_mm,
        wheelbase_mm,
        word_0 & 0x4000000000000 != 0,
        word_0 & 0x8000000000000 != 0,
    )


def pack_platform_state(message: PlatformState) -> bytes:
    load_kg = message.load_kg
    if not 0 <= load_kg <= 4095:
        raise OutOfRangeError("PlatformState.load_kg", load_kg, 0, 4095)
    return _HXXXXXX.pack(message.carrier_aboard + message.crossing * 0x2 + load_kg * 0x4)


def unpack_platform_state(sender: int, data: bytes) -> PlatformState | None:
    (word_0,) = _HXXXXXX.unpack_from(data)
    load_kg = word_0 >> 2 & 0xFFF
    return PlatformState(sender, word_0 & 0x1 != 0, word_0 & 0x2 != 0, load_kg)


#: Every frame of this module.
FRAMES = (
    FrameCode(
        "DriveOrder", 0x14800000, 8, pack_drive_order, unpack_drive_order, DriveOrder, DriveOrder, ("Controller",), True
    ),
    FrameCode(
        "ShuttleOrder",
        0x14810000,
        8,
        pack_shuttle_order,
        unpack_shuttle_order,
        ShuttleOrder,
        ShuttleOrder,
        ("Controller",),
        True,
    ),
    FrameCode(
        "DoorOrder", 0x14820000, 8, pack_door_order, unpack_door_order, DoorOrder, DoorOrder, ("Controller",), True
    ),
    FrameCode(
        "LightOrder", 0x14830000, 8, pack_light_order, unpack_light_order, LightOrder, LightOrder, ("Controller",), True
    ),
    FrameCode(
        "DeskOrder", 0x14840000, 8, pack_desk_order, unpack_desk_order, DeskOrder, DeskOrder, ("Controller",), True
    ),
    FrameCode(
        "DriveState", 0x16900000, 8, pack_drive_state, unpack_drive_state, DriveState, DriveState, ("Drive",), True
    ),
    FrameCode(
        "ShuttleState",
        0x16910000,
        8,
        pack_shuttle_state,
        unpack_shuttle_state,
        ShuttleState,
        ShuttleState,
        ("Shuttle",),
        True,
    ),
    FrameCode("DoorState", 0x16920000, 8, pack_door_state, unpack_door_state, DoorState, DoorState, ("Doors",), True),
    FrameCode("DeskEvent", 0x16930000, 8, pack_desk_event, unpack_desk_event, DeskEvent, DeskEvent, ("Desk",), True),
    FrameCode("BayState", 0x16940000, 8, pack_bay_state, unpack_bay_state, BayState, BayState, ("Bay",), True),
    FrameCode(
        "PlatformState",
        0x16950000,
        8,
        pack_platform_state,
        unpack_platform_state,
        PlatformState,
        PlatformState,
        ("Platform",),
        True,
    ),
)
