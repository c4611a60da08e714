"""Bytes of the messages in ``onboard.contract.presence``, and back.

Written by ``make docs`` from ``dbc/fleet.dbc``: change that file, never this one.
"""

from struct import Struct

from onboard.contract.base import FrameCode, OutOfRangeError, Reference
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
_BBBBBXXX = Struct("<BBBBBxxx")
_BBBXXXXX = Struct("<BBBxxxxx")
_BBXXXXXX = Struct("<BBxxxxxx")
_BHHBBB = Struct("<BHHBBB")
_BIXXX = Struct("<BIxxx")
_BXXXXXXX = Struct("<Bxxxxxxx")
_Q = Struct("<Q")


def pack_emergency_stop(message: EmergencyStop) -> bytes:
    return _BXXXXXXX.pack(message.reason)


def unpack_emergency_stop(sender: int, data: bytes) -> EmergencyStop | None:
    (reason,) = _BXXXXXXX.unpack_from(data)
    if reason > 47:
        return None
    return EmergencyStop(sender, _REASON[reason])


def pack_go(message: Go) -> bytes:
    stopper = message.stopper
    if not 0 <= stopper <= 255:
        raise OutOfRangeError("Go.stopper", stopper, 0, 255)
    return _BXXXXXXX.pack(stopper)


def unpack_go(sender: int, data: bytes) -> Go | None:
    (stopper,) = _BXXXXXXX.unpack_from(data)
    return Go(sender, stopper)


def pack_bus_time(message: BusTime) -> bytes:
    bus_time_us = message.bus_time_us
    if not 0 <= bus_time_us <= 281474976710655:
        raise OutOfRangeError("BusTime.bus_time_us", bus_time_us, 0, 281474976710655)
    return _Q.pack(bus_time_us)


def unpack_bus_time(sender: int, data: bytes) -> BusTime | None:
    (bus_time_us,) = _Q.unpack_from(data)
    bus_time_us = bus_time_us & 0xFFFFFFFFFFFF
    return BusTime(sender, bus_time_us)


def pack_manual_order(message: ManualOrder) -> bytes:
    machine = message.machine
    if not 1 <= machine <= 250:
        raise OutOfRangeError("ManualOrder.machine", machine, 1, 250)
    number = message.number
    if not 1 <= number <= 255:
        raise OutOfRangeError("ManualOrder.number", number, 1, 255)
    return _BBBXXXXX.pack(machine, number, message.manual_mode)


def unpack_manual_order(sender: int, data: bytes) -> ManualOrder | None:
    machine, number, manual_mode = _BBBXXXXX.unpack_from(data)
    if machine < 1 or machine > 250:
        return None
    if number < 1:
        return None
    manual_mode = manual_mode & 0x3
    if manual_mode > 2:
        return None
    return ManualOrder(sender, machine, number, _MANUAL_MODE[manual_mode])


def pack_manual_state(message: ManualState) -> bytes:
    number = message.number
    if not 0 <= number <= 255:
        raise OutOfRangeError("ManualState.number", number, 0, 255)
    return _BBXXXXXX.pack(number, message.manual_mode + message.at_rest * 0x4)


def unpack_manual_state(sender: int, data: bytes) -> ManualState | None:
    number, word_1 = _BBXXXXXX.unpack_from(data)
    manual_mode = word_1 & 0x3
    if manual_mode > 2:
        return None
    return ManualState(sender, number, _MANUAL_MODE[manual_mode], word_1 & 0x4 != 0)


def pack_halted(message: Halted) -> bytes:
    machine = message.machine
    if not 1 <= machine <= 250:
        raise OutOfRangeError("Halted.machine", machine, 1, 250)
    cause = message.cause
    if not 0 <= cause <= 255:
        raise OutOfRangeError("Halted.cause", cause, 0, 255)
    boot = message.boot
    if not 0 <= boot <= 255:
        raise OutOfRangeError("Halted.boot", boot, 0, 255)
    return _BBBBBXXX.pack(machine, message.reason, cause, message.needs_person, boot)


def unpack_halted(sender: int, data: bytes) -> Halted | None:
    machine, reason, cause, needs_person, boot = _BBBBBXXX.unpack_from(data)
    if machine < 1 or machine > 250:
        return None
    if reason > 47:
        return None
    return Halted(sender, machine, _REASON[reason], cause, needs_person & 0x1 != 0, boot)


def pack_sync_request(message: SyncRequest) -> bytes:
    whom = message.whom
    if not 0 <= whom <= 255:
        raise OutOfRangeError("SyncRequest.whom", whom, 0, 255)
    boot_before = message.boot_before
    if not 0 <= boot_before <= 255:
        raise OutOfRangeError("SyncRequest.boot_before", boot_before, 0, 255)
    return _BBXXXXXX.pack(whom, boot_before)


def unpack_sync_request(sender: int, data: bytes) -> SyncRequest | None:
    whom, boot_before = _BBXXXXXX.unpack_from(data)
    return SyncRequest(sender, whom, boot_before)


def pack_operator_order(message: OperatorOrder) -> bytes:
    compartment = message.compartment
    if not 1 <= compartment <= 255:
        raise OutOfRangeError("OperatorOrder.compartment", compartment, 1, 255)
    car_origin = message.car.origin
    if not 0 <= car_origin <= 255:
        raise OutOfRangeError("OperatorOrder.car_origin", car_origin, 0, 255)
    car_number = message.car.number
    if not 0 <= car_number <= 65535:
        raise OutOfRangeError("OperatorOrder.car_number", car_number, 0, 65535)
    return _BIXXX.pack(compartment, message.action + car_origin * 0x10 + car_number * 0x1000)


def unpack_operator_order(sender: int, data: bytes) -> OperatorOrder | None:
    compartment, word_1 = _BIXXX.unpack_from(data)
    if compartment < 1:
        return None
    action = word_1 & 0xF
    if action > 3:
        return None
    car_origin = word_1 >> 4 & 0xFF
    car_number = word_1 >> 12 & 0xFFFF
    return OperatorOrder(sender, compartment, _OPERATOR_ACTION[action], _new(Reference, (car_origin, car_number)))


def pack_sync_done(message: SyncDone) -> bytes:
    whom = message.whom
    if not 0 <= whom <= 255:
        raise OutOfRangeError("SyncDone.whom", whom, 0, 255)
    boot = message.boot
    if not 0 <= boot <= 255:
        raise OutOfRangeError("SyncDone.boot", boot, 0, 255)
    return _BBXXXXXX.pack(whom, boot)


def unpack_sync_done(sender: int, data: bytes) -> SyncDone | None:
    whom, boot = _BBXXXXXX.unpack_from(data)
    return SyncDone(sender, whom, boot)


def pack_heartbeat(message: Heartbeat) -> bytes:
    contract = message.contract
    if not 0 <= contract <= 255:
        raise OutOfRangeError("Heartbeat.contract", contract, 0, 255)
    site_digest = message.site_digest
    if not 1 <= site_digest <= 65535:
        raise OutOfRangeError("Heartbeat.site_digest", site_digest, 1, 65535)
    mirror_digest = message.mirror_digest
    if not 0 <= mirror_digest <= 65535:
        raise OutOfRangeError("Heartbeat.mirror_digest", mirror_digest, 0, 65535)
    boot = message.boot
    if not 1 <= boot <= 255:
        raise OutOfRangeError("Heartbeat.boot", boot, 1, 255)
    epoch = message.epoch
    if not 0 <= epoch <= 255:
        raise OutOfRangeError("Heartbeat.epoch", epoch, 0, 255)
    return _BHHBBB.pack(contract, site_digest, mirror_digest, boot, message.kind + message.state * 0x10, epoch)


def unpack_heartbeat(sender: int, data: bytes) -> Heartbeat | None:
    contract, site_digest, mirror_digest, boot, word_6, epoch = _BHHBBB.unpack_from(data)
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
    count = message.count
    if not 0 <= count <= 4294967295:
        raise OutOfRangeError("Diagnostic.count", count, 0, 4294967295)
    return _BIXXX.pack(message.reason, count)


def unpack_diagnostic(sender: int, data: bytes) -> Diagnostic | None:
    reason, count = _BIXXX.unpack_from(data)
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
