"""Bytes of the messages in ``onboard.contract.presence``, and back.

Written by ``make docs`` from ``dbc/fleet.dbc``: change that file, never this one.
"""

import struct

from onboard.contract.base import FrameCode, OutOfRangeError, Reference, refusal
from onboard.contract.codes import KindCode, MachineState, ManualMode, OperatorAction, Reason
from onboard.contract.presence import (
    BusTime,
    Diagnostic,
    EmergencyStop,
    Go,
    Halted,
    Heartbeat,
    ManualOrder,
    ManualState,
    OperatorOrder,
    SyncDone,
    SyncRequest,
)

_new = tuple.__new__
_KIND_CODE = tuple(KindCode)
_MACHINE_STATE = tuple(MachineState)
_MANUAL_MODE = tuple(ManualMode)
_OPERATOR_ACTION = tuple(OperatorAction)
_REASON = tuple(Reason)
_FROM_0_TO_255_AT_4 = {value: value << 4 for value in range(256)}
_PACK_BBBBBXXX = struct.Struct("<BBBBBxxx").pack
_PACK_BBHI = struct.Struct("<BBHI").pack
_PACK_BBHXXXX = struct.Struct("<BBHxxxx").pack
_PACK_BBXXXXXX = struct.Struct("<BBxxxxxx").pack
_PACK_BHHBBB = struct.Struct("<BHHBBB").pack
_PACK_BIXXX = struct.Struct("<BIxxx").pack
_PACK_BXXXXXXX = struct.Struct("<Bxxxxxxx").pack
_PACK_IXXXX = struct.Struct("<Ixxxx").pack
_UNPACK_BBBBBXXX = struct.Struct("<BBBBBxxx").unpack_from
_UNPACK_BBBXXXXX = struct.Struct("<BBBxxxxx").unpack_from
_UNPACK_BBXXXXXX = struct.Struct("<BBxxxxxx").unpack_from
_UNPACK_BHHBBB = struct.Struct("<BHHBBB").unpack_from
_UNPACK_BIXXX = struct.Struct("<BIxxx").unpack_from
_UNPACK_BXXXXXXX = struct.Struct("<Bxxxxxxx").unpack_from
_UNPACK_Q = struct.Struct("<Q").unpack_from


def pack_emergency_stop(message: EmergencyStop) -> bytes:
    return _PACK_IXXXX(message.reason)


def unpack_emergency_stop(sender: int, data: bytes) -> EmergencyStop | None:
    (reason,) = _UNPACK_BXXXXXXX(data)
    if reason > 47:
        return None
    return EmergencyStop(sender, _REASON[reason])


def pack_go(message: Go) -> bytes:
    try:
        return _PACK_BXXXXXXX(message.stopper)
    except struct.error as error:
        raise refusal(message, ("Go.stopper", 0, 255)) from error


def unpack_go(sender: int, data: bytes) -> Go | None:
    (stopper,) = _UNPACK_BXXXXXXX(data)
    return Go(sender, stopper)


def pack_bus_time(message: BusTime) -> bytes:
    bus_time_us = message.bus_time_us
    if bus_time_us > 281474976710655:
        raise OutOfRangeError("BusTime.bus_time_us", bus_time_us, 0, 281474976710655)
    try:
        return (bus_time_us).to_bytes(8, "little")
    except OverflowError as error:
        raise refusal(message, ("BusTime.bus_time_us", 0, 281474976710655)) from error


def unpack_bus_time(sender: int, data: bytes) -> BusTime | None:
    (bus_time_us,) = _UNPACK_Q(data)
    bus_time_us = bus_time_us & 0xFFFFFFFFFFFF
    return BusTime(sender, bus_time_us)


def pack_manual_order(message: ManualOrder) -> bytes:
    machine = message.machine
    if machine < 1 or machine > 250:
        raise OutOfRangeError("ManualOrder.machine", machine, 1, 250)
    number = message.number
    if number < 1:
        raise OutOfRangeError("ManualOrder.number", number, 1, 255)
    try:
        return _PACK_BBHXXXX(machine, number, message.manual_mode)
    except struct.error as error:
        raise refusal(message, ("ManualOrder.number", 1, 255)) from error


def unpack_manual_order(sender: int, data: bytes) -> ManualOrder | None:
    machine, number, manual_mode = _UNPACK_BBBXXXXX(data)
    if machine < 1 or machine > 250:
        return None
    if number < 1:
        return None
    manual_mode = manual_mode & 0x3
    if manual_mode > 2:
        return None
    return ManualOrder(sender, machine, number, _MANUAL_MODE[manual_mode])


def pack_manual_state(message: ManualState) -> bytes:
    try:
        return _PACK_BBXXXXXX(message.number, message.manual_mode + (0x4 if message.at_rest else 0))
    except struct.error as error:
        raise refusal(message, ("ManualState.number", 0, 255)) from error


def unpack_manual_state(sender: int, data: bytes) -> ManualState | None:
    number, word_1 = _UNPACK_BBXXXXXX(data)
    manual_mode = word_1 & 0x3
    if manual_mode > 2:
        return None
    return ManualState(sender, number, _MANUAL_MODE[manual_mode], word_1 & 0x4 != 0)


def pack_halted(message: Halted) -> bytes:
    machine = message.machine
    if machine < 1 or machine > 250:
        raise OutOfRangeError("Halted.machine", machine, 1, 250)
    try:
        return _PACK_BBBBBXXX(machine, message.reason, message.cause, message.needs_person, message.boot)
    except struct.error as error:
        raise refusal(message, ("Halted.cause", 0, 255), ("Halted.boot", 0, 255)) from error


def unpack_halted(sender: int, data: bytes) -> Halted | None:
    machine, reason, cause, needs_person, boot = _UNPACK_BBBBBXXX(data)
    if machine < 1 or machine > 250:
        return None
    if reason > 47:
        return None
    return Halted(sender, machine, _REASON[reason], cause, needs_person & 0x1 != 0, boot)


def pack_sync_request(message: SyncRequest) -> bytes:
    try:
        return _PACK_BBXXXXXX(message.whom, message.boot_before)
    except struct.error as error:
        raise refusal(message, ("SyncRequest.whom", 0, 255), ("SyncRequest.boot_before", 0, 255)) from error


def unpack_sync_request(sender: int, data: bytes) -> SyncRequest | None:
    whom, boot_before = _UNPACK_BBXXXXXX(data)
    return SyncRequest(sender, whom, boot_before)


def pack_operator_order(message: OperatorOrder) -> bytes:
    compartment = message.compartment
    if compartment < 1:
        raise OutOfRangeError("OperatorOrder.compartment", compartment, 1, 255)
    car = message.car
    car_number = car[1]
    if car_number > 65535:
        raise OutOfRangeError("OperatorOrder.car_number", car_number, 0, 65535)
    try:
        return _PACK_BIXXX(compartment, message.action + _FROM_0_TO_255_AT_4[car[0]] + car_number * 0x1000)
    except (KeyError, struct.error) as error:
        raise refusal(
            message,
            ("OperatorOrder.compartment", 1, 255),
            ("OperatorOrder.car.origin", 0, 255),
            ("OperatorOrder.car.number", 0, 65535),
        ) from error


def unpack_operator_order(sender: int, data: bytes) -> OperatorOrder | None:
    compartment, word_1 = _UNPACK_BIXXX(data)
    if compartment < 1:
        return None
    action = word_1 & 0xF
    if action > 4:
        return None
    car_origin = word_1 >> 4 & 0xFF
    car_number = word_1 >> 12 & 0xFFFF
    return OperatorOrder(sender, compartment, _OPERATOR_ACTION[action], _new(Reference, (car_origin, car_number)))


def pack_sync_done(message: SyncDone) -> bytes:
    askers = message.askers
    try:
        return _PACK_BBHI(message.whom, message.boot, askers & 0xFFFF, askers >> 16)
    except struct.error as error:
        raise refusal(
            message, ("SyncDone.whom", 0, 255), ("SyncDone.boot", 0, 255), ("SyncDone.askers", 0, 281474976710655)
        ) from error


def unpack_sync_done(sender: int, data: bytes) -> SyncDone | None:
    (word_0,) = _UNPACK_Q(data)
    whom = word_0 & 0xFF
    boot = word_0 >> 8 & 0xFF
    askers = word_0 >> 16
    return SyncDone(sender, whom, boot, askers)


def pack_heartbeat(message: Heartbeat) -> bytes:
    site_digest = message.site_digest
    if site_digest < 1:
        raise OutOfRangeError("Heartbeat.site_digest", site_digest, 1, 65535)
    boot = message.boot
    if boot < 1:
        raise OutOfRangeError("Heartbeat.boot", boot, 1, 255)
    try:
        return _PACK_BHHBBB(
            message.contract,
            site_digest,
            message.mirror_digest,
            boot,
            message.kind + message.state * 0x10,
            message.epoch,
        )
    except struct.error as error:
        raise refusal(
            message,
            ("Heartbeat.contract", 0, 255),
            ("Heartbeat.site_digest", 1, 65535),
            ("Heartbeat.mirror_digest", 0, 65535),
            ("Heartbeat.boot", 1, 255),
            ("Heartbeat.epoch", 0, 255),
        ) from error


def unpack_heartbeat(sender: int, data: bytes) -> Heartbeat | None:
    contract, site_digest, mirror_digest, boot, word_6, epoch = _UNPACK_BHHBBB(data)
    if site_digest < 1:
        return None
    if boot < 1:
        return None
    kind = word_6 & 0xF
    if kind > 9:
        return None
    state = word_6 >> 4
    if state > 5:
        return None
    return Heartbeat(sender, contract, site_digest, mirror_digest, boot, _KIND_CODE[kind], _MACHINE_STATE[state], epoch)


def pack_diagnostic(message: Diagnostic) -> bytes:
    try:
        return _PACK_BIXXX(message.reason, message.count)
    except struct.error as error:
        raise refusal(message, ("Diagnostic.count", 0, 4294967295)) from error


def unpack_diagnostic(sender: int, data: bytes) -> Diagnostic | None:
    reason, count = _UNPACK_BIXXX(data)
    if reason > 47:
        return None
    return Diagnostic(sender, _REASON[reason], count)


#: Every frame of this module.
FRAMES = (
    FrameCode(
        "EmergencyStop",
        0x00010000,
        8,
        pack_emergency_stop,
        unpack_emergency_stop,
        EmergencyStop,
        EmergencyStop,
        ("Robot", "Lift", "Compartment", "Machine", "Gateway"),
        False,
    ),
    FrameCode("Go", 0x00020000, 8, pack_go, unpack_go, Go, Go, ("Gateway",), False),
    FrameCode(
        "BusTime",
        0x04200000,
        8,
        pack_bus_time,
        unpack_bus_time,
        BusTime,
        BusTime,
        ("Lift", "Compartment", "Machine"),
        False,
    ),
    FrameCode(
        "ManualOrder",
        0x08670000,
        8,
        pack_manual_order,
        unpack_manual_order,
        ManualOrder,
        ManualOrder,
        ("Gateway", "Machine"),
        False,
    ),
    FrameCode(
        "ManualState",
        0x08680000,
        8,
        pack_manual_state,
        unpack_manual_state,
        ManualState,
        ManualState,
        ("Robot", "Machine"),
        False,
    ),
    FrameCode(
        "Halted",
        0x086C0000,
        8,
        pack_halted,
        unpack_halted,
        Halted,
        Halted,
        ("Robot", "Lift", "Compartment", "Machine"),
        False,
    ),
    FrameCode(
        "SyncRequest",
        0x0E4C0000,
        8,
        pack_sync_request,
        unpack_sync_request,
        SyncRequest,
        SyncRequest,
        ("Robot", "Lift", "Compartment", "Machine", "Gateway"),
        False,
    ),
    FrameCode(
        "OperatorOrder",
        0x0E4D0000,
        8,
        pack_operator_order,
        unpack_operator_order,
        OperatorOrder,
        OperatorOrder,
        ("Gateway",),
        False,
    ),
    FrameCode(
        "SyncDone",
        0x10510000,
        8,
        pack_sync_done,
        unpack_sync_done,
        SyncDone,
        SyncDone,
        ("Robot", "Lift", "Compartment", "Machine"),
        False,
    ),
    FrameCode(
        "Heartbeat",
        0x12500000,
        8,
        pack_heartbeat,
        unpack_heartbeat,
        Heartbeat,
        Heartbeat,
        ("Robot", "Lift", "Compartment", "Machine", "Gateway"),
        False,
    ),
    FrameCode(
        "Diagnostic",
        0x1EF00000,
        8,
        pack_diagnostic,
        unpack_diagnostic,
        Diagnostic,
        Diagnostic,
        ("Robot", "Lift", "Compartment", "Machine", "Gateway"),
        False,
    ),
)
