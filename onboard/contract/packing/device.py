"""Bytes of the messages in ``onboard.contract.device``, and back.

Written by ``make docs`` from ``dbc/device.dbc``: change that file, never this one.
"""

import struct

from onboard.contract.base import FrameCode, OutOfRangeError, Reference, refusal
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
    BatteryState,
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
    StateRequest,
    TicketPrint,
    TicketRead,
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
_FROM_0_TO_250_AT_12 = {value: value << 12 for value in range(251)}
_FROM_0_TO_255_AT_2 = {value: value << 2 for value in range(256)}
_FROM_0_TO_255_AT_4 = {value: value << 4 for value in range(256)}
_PACK_BBBIX = struct.Struct("<BBBIx").pack
_PACK_BBXXXXXX = struct.Struct("<BBxxxxxx").pack
_PACK_BHIX = struct.Struct("<BHIx").pack
_PACK_BIXXX = struct.Struct("<BIxxx").pack
_PACK_BSIHB = struct.Struct("<BiHB").pack
_PACK_BSISHB = struct.Struct("<BihB").pack
_PACK_IXXXX = struct.Struct("<Ixxxx").pack
_UNPACK_BBXXXXXX = struct.Struct("<BBxxxxxx").unpack_from
_UNPACK_BIXXX = struct.Struct("<BIxxx").unpack_from
_UNPACK_BSIHB = struct.Struct("<BiHB").unpack_from
_UNPACK_BSISHB = struct.Struct("<BihB").unpack_from
_UNPACK_BXXXXXXX = struct.Struct("<Bxxxxxxx").unpack_from
_UNPACK_HXXXXXX = struct.Struct("<Hxxxxxx").unpack_from
_UNPACK_Q = struct.Struct("<Q").unpack_from
_UNPACK_XXXXXXXX = struct.Struct("<xxxxxxxx").unpack_from


def pack_drive_order(message: DriveOrder) -> bytes:
    try:
        return _PACK_BSIHB(message.sequence, message.target_mm, message.speed_limit_mm_s, message.across)
    except struct.error as error:
        raise refusal(
            message,
            ("DriveOrder.sequence", 0, 255),
            ("DriveOrder.target_mm", -2147483648, 2147483647),
            ("DriveOrder.speed_limit_mm_s", 0, 65535),
        ) from error


def unpack_drive_order(sender: int, data: bytes) -> DriveOrder | None:
    sequence, target_mm, speed_limit_mm_s, across = _UNPACK_BSIHB(data)
    return DriveOrder(sender, sequence, target_mm, speed_limit_mm_s, across & 0x1 != 0)


def pack_shuttle_order(message: ShuttleOrder) -> bytes:
    wheelbase_mm = message.wheelbase_mm
    if wheelbase_mm > 8191:
        raise OutOfRangeError("ShuttleOrder.wheelbase_mm", wheelbase_mm, 0, 8191)
    try:
        return _PACK_BIXXX(message.sequence, message.action + message.side * 0x10 + wheelbase_mm * 0x20)
    except struct.error as error:
        raise refusal(message, ("ShuttleOrder.sequence", 0, 255), ("ShuttleOrder.wheelbase_mm", 0, 8191)) from error


def unpack_shuttle_order(sender: int, data: bytes) -> ShuttleOrder | None:
    sequence, word_1 = _UNPACK_BIXXX(data)
    action = word_1 & 0xF
    if action > 3:
        return None
    side = word_1 >> 4 & 0x1
    wheelbase_mm = word_1 >> 5 & 0x1FFF
    return ShuttleOrder(sender, sequence, _SHUTTLE_ACTION[action], _SIDE[side], wheelbase_mm)


def pack_door_order(message: DoorOrder) -> bytes:
    try:
        return _PACK_BBXXXXXX(message.sequence, message.door + message.action * 0x2)
    except struct.error as error:
        raise refusal(message, ("DoorOrder.sequence", 0, 255)) from error


def unpack_door_order(sender: int, data: bytes) -> DoorOrder | None:
    sequence, word_1 = _UNPACK_BBXXXXXX(data)
    door = word_1 & 0x1
    action = word_1 >> 1 & 0x1
    return DoorOrder(sender, sequence, _DOOR_NAME[door], _DOOR_ACTION[action])


def pack_light_order(message: LightOrder) -> bytes:
    return _PACK_IXXXX(message.colour)


def unpack_light_order(sender: int, data: bytes) -> LightOrder | None:
    (colour,) = _UNPACK_BXXXXXXX(data)
    colour = colour & 0x1
    return LightOrder(sender, _LIGHT_COLOUR[colour])


def pack_desk_order(message: DeskOrder) -> bytes:
    car = message.car
    car_number = car[1]
    if car_number < 0 or car_number > 65535:
        raise OutOfRangeError("DeskOrder.car_number", car_number, 0, 65535)
    try:
        return _PACK_BHIX(
            message.sequence,
            message.text + _FROM_0_TO_255_AT_4[car[0]] + (car_number & 0xF) * 0x1000,
            (car_number >> 4) + _FROM_0_TO_250_AT_12[message.compartment],
        )
    except (KeyError, struct.error) as error:
        raise refusal(
            message, ("DeskOrder.sequence", 0, 255), ("DeskOrder.car.origin", 0, 255), ("DeskOrder.compartment", 0, 250)
        ) from error


def unpack_desk_order(sender: int, data: bytes) -> DeskOrder | None:
    (word_0,) = _UNPACK_Q(data)
    sequence = word_0 & 0xFF
    text = word_0 >> 8 & 0xF
    if text > 12:
        return None
    car_origin = word_0 >> 12 & 0xFF
    car_number = word_0 >> 20 & 0xFFFF
    compartment = word_0 >> 36 & 0xFF
    if compartment > 250:
        return None
    return DeskOrder(sender, sequence, _DESK_TEXT[text], _new(Reference, (car_origin, car_number)), compartment)


def pack_state_request(message: StateRequest) -> bytes:
    return b"\0" * 8


def unpack_state_request(sender: int, data: bytes) -> StateRequest | None:
    return StateRequest(sender)


def pack_ticket_print(message: TicketPrint) -> bytes:
    half = message.half
    if half > 1:
        raise OutOfRangeError("TicketPrint.half", half, 0, 1)
    code = message.code
    try:
        return _PACK_BBBIX(message.sequence, half, code & 0xFF, code >> 8)
    except struct.error as error:
        raise refusal(
            message,
            ("TicketPrint.sequence", 0, 255),
            ("TicketPrint.half", 0, 1),
            ("TicketPrint.code", 0, 1099511627775),
        ) from error


def unpack_ticket_print(sender: int, data: bytes) -> TicketPrint | None:
    (word_0,) = _UNPACK_Q(data)
    sequence = word_0 & 0xFF
    half = word_0 >> 8 & 0x1
    code = word_0 >> 16 & 0xFFFFFFFFFF
    return TicketPrint(sender, sequence, half, code)


def pack_drive_state(message: DriveState) -> bytes:
    try:
        return _PACK_BSISHB(
            message.sequence,
            message.position_mm,
            message.speed_mm_s,
            message.mode + (0x8 if message.at_mark else 0) + (0x10 if message.across else 0),
        )
    except struct.error as error:
        raise refusal(
            message,
            ("DriveState.sequence", 0, 255),
            ("DriveState.position_mm", -2147483648, 2147483647),
            ("DriveState.speed_mm_s", -32768, 32767),
        ) from error


def unpack_drive_state(sender: int, data: bytes) -> DriveState | None:
    sequence, position_mm, speed_mm_s, word_7 = _UNPACK_BSISHB(data)
    mode = word_7 & 0x7
    if mode > 4:
        return None
    return DriveState(
        sender, sequence, position_mm, speed_mm_s, _DRIVE_MODE[mode], word_7 & 0x8 != 0, word_7 & 0x10 != 0
    )


def pack_shuttle_state(message: ShuttleState) -> bytes:
    extension_mm = message.extension_mm
    if extension_mm < 0 or extension_mm > 8191:
        raise OutOfRangeError("ShuttleState.extension_mm", extension_mm, 0, 8191)
    load_kg = message.load_kg
    if load_kg < 0 or load_kg > 4095:
        raise OutOfRangeError("ShuttleState.load_kg", load_kg, 0, 4095)
    wheelbase_mm = message.wheelbase_mm
    if wheelbase_mm > 8191:
        raise OutOfRangeError("ShuttleState.wheelbase_mm", wheelbase_mm, 0, 8191)
    try:
        return _PACK_BHIX(
            message.sequence,
            message.mode + message.side * 0x10 + (extension_mm & 0x7FF) * 0x20,
            (extension_mm >> 11) + load_kg * 0x4 + wheelbase_mm * 0x4000,
        )
    except struct.error as error:
        raise refusal(message, ("ShuttleState.sequence", 0, 255), ("ShuttleState.wheelbase_mm", 0, 8191)) from error


def unpack_shuttle_state(sender: int, data: bytes) -> ShuttleState | None:
    (word_0,) = _UNPACK_Q(data)
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
    return _PACK_IXXXX(message.input_door + message.output_door * 0x8 + message.light * 0x40)


def unpack_door_state(sender: int, data: bytes) -> DoorState | None:
    (word_0,) = _UNPACK_BXXXXXXX(data)
    input_door = word_0 & 0x7
    if input_door > 5:
        return None
    output_door = word_0 >> 3 & 0x7
    if output_door > 5:
        return None
    light = word_0 >> 6 & 0x1
    return DoorState(sender, _DOOR_POSITION[input_door], _DOOR_POSITION[output_door], _LIGHT_COLOUR[light])


def pack_desk_event(message: DeskEvent) -> bytes:
    car = message.car
    car_number = car[1]
    if car_number > 65535:
        raise OutOfRangeError("DeskEvent.car_number", car_number, 0, 65535)
    try:
        return _PACK_BIXXX(message.sequence, message.event + _FROM_0_TO_255_AT_2[car[0]] + car_number * 0x400)
    except (KeyError, struct.error) as error:
        raise refusal(
            message,
            ("DeskEvent.sequence", 0, 255),
            ("DeskEvent.car.origin", 0, 255),
            ("DeskEvent.car.number", 0, 65535),
        ) from error


def unpack_desk_event(sender: int, data: bytes) -> DeskEvent | None:
    sequence, word_1 = _UNPACK_BIXXX(data)
    event = word_1 & 0x3
    car_origin = word_1 >> 2 & 0xFF
    car_number = word_1 >> 10 & 0xFFFF
    return DeskEvent(sender, sequence, _DESK_INPUT[event], _new(Reference, (car_origin, car_number)))


def pack_bay_state(message: BayState) -> bytes:
    load_kg = message.load_kg
    if load_kg < 0 or load_kg > 4095:
        raise OutOfRangeError("BayState.load_kg", load_kg, 0, 4095)
    length_mm = message.length_mm
    if length_mm < 0 or length_mm > 8191:
        raise OutOfRangeError("BayState.length_mm", length_mm, 0, 8191)
    height_mm = message.height_mm
    if height_mm < 0 or height_mm > 4095:
        raise OutOfRangeError("BayState.height_mm", height_mm, 0, 4095)
    wheelbase_mm = message.wheelbase_mm
    if wheelbase_mm < 0 or wheelbase_mm > 8191:
        raise OutOfRangeError("BayState.wheelbase_mm", wheelbase_mm, 0, 8191)
    if message.person_inside:
        wheelbase_mm += 0x2000
    if message.carrier_in_front:
        wheelbase_mm += 0x4000
    try:
        return (
            load_kg + length_mm * 0x1000 + (height_mm + wheelbase_mm * 0x1000) * 0x2000000 + (message.width_mm << 52)
        ).to_bytes(8, "little")
    except OverflowError as error:
        raise refusal(message, ("BayState.width_mm", 0, 4095)) from error


def unpack_bay_state(sender: int, data: bytes) -> BayState | None:
    (word_0,) = _UNPACK_Q(data)
    load_kg = word_0 & 0xFFF
    length_mm = word_0 >> 12 & 0x1FFF
    height_mm = word_0 >> 25 & 0xFFF
    wheelbase_mm = word_0 >> 37 & 0x1FFF
    width_mm = word_0 >> 52
    return BayState(
        sender,
        load_kg,
        length_mm,
        height_mm,
        wheelbase_mm,
        word_0 & 0x4000000000000 != 0,
        word_0 & 0x8000000000000 != 0,
        width_mm,
    )


def pack_platform_state(message: PlatformState) -> bytes:
    load_kg = message.load_kg
    if load_kg > 4095:
        raise OutOfRangeError("PlatformState.load_kg", load_kg, 0, 4095)
    try:
        return _PACK_IXXXX(message.carrier_aboard + (0x2 if message.crossing else 0) + load_kg * 0x4)
    except struct.error as error:
        raise refusal(message, ("PlatformState.load_kg", 0, 4095)) from error


def unpack_platform_state(sender: int, data: bytes) -> PlatformState | None:
    (word_0,) = _UNPACK_HXXXXXX(data)
    load_kg = word_0 >> 2 & 0xFFF
    return PlatformState(sender, word_0 & 0x1 != 0, word_0 & 0x2 != 0, load_kg)


def pack_ticket_read(message: TicketRead) -> bytes:
    half = message.half
    if half > 1:
        raise OutOfRangeError("TicketRead.half", half, 0, 1)
    code = message.code
    try:
        return _PACK_BBBIX(message.sequence, half, code & 0xFF, code >> 8)
    except struct.error as error:
        raise refusal(
            message, ("TicketRead.sequence", 0, 255), ("TicketRead.half", 0, 1), ("TicketRead.code", 0, 1099511627775)
        ) from error


def unpack_ticket_read(sender: int, data: bytes) -> TicketRead | None:
    (word_0,) = _UNPACK_Q(data)
    sequence = word_0 & 0xFF
    half = word_0 >> 8 & 0x1
    code = word_0 >> 16 & 0xFFFFFFFFFF
    return TicketRead(sender, sequence, half, code)


def pack_battery_state(message: BatteryState) -> bytes:
    charge_permille = message.charge_permille
    if charge_permille < 0 or charge_permille > 1000:
        raise OutOfRangeError("BatteryState.charge_permille", charge_permille, 0, 1000)
    if message.charging:
        charge_permille += 0x400
    return _PACK_IXXXX(charge_permille)


def unpack_battery_state(sender: int, data: bytes) -> BatteryState | None:
    (word_0,) = _UNPACK_HXXXXXX(data)
    charge_permille = word_0 & 0x3FF
    if charge_permille > 1000:
        return None
    return BatteryState(sender, charge_permille, word_0 & 0x400 != 0)


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
        "StateRequest",
        0x14850000,
        8,
        pack_state_request,
        unpack_state_request,
        StateRequest,
        StateRequest,
        ("Controller",),
        True,
    ),
    FrameCode(
        "TicketPrint",
        0x14860000,
        8,
        pack_ticket_print,
        unpack_ticket_print,
        TicketPrint,
        TicketPrint,
        ("Controller",),
        True,
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
    FrameCode(
        "TicketRead", 0x16960000, 8, pack_ticket_read, unpack_ticket_read, TicketRead, TicketRead, ("Desk",), True
    ),
    FrameCode(
        "BatteryState",
        0x16970000,
        8,
        pack_battery_state,
        unpack_battery_state,
        BatteryState,
        BatteryState,
        ("Battery",),
        True,
    ),
)
