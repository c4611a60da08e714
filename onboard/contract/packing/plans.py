"""Bytes of the messages in ``onboard.contract.plans``, and back.

Written by ``make docs`` from ``dbc/fleet.dbc``: change that file, never this one.
"""

import struct

from onboard.contract.base import FrameCode, OutOfRangeError, Reference, Stamp, refusal
from onboard.contract.codes import Grade, LegAction, Reason, Side, TaskPhase
from onboard.contract.plans import (
    Blocked,
    CarAt,
    Clear,
    Itinerary,
    ItineraryHead,
    ItineraryLeg,
    Progress,
    TaskReport,
    Waiting,
)

_new = tuple.__new__
_GRADE = tuple(Grade)
_LEG_ACTION = tuple(LegAction)
_REASON = tuple(Reason)
_SIDE = tuple(Side)
_TASK_PHASE = tuple(TaskPhase)
_FROM_0_TO_30_AT_2 = {value: value << 2 for value in range(31)}
_PACK_BBBBBBH = struct.Struct("<BBBBBBH").pack
_PACK_BBBBSHSH = struct.Struct("<BBBBhh").pack
_PACK_BBBBXXXX = struct.Struct("<BBBBxxxx").pack
_PACK_BBHXXXX = struct.Struct("<BBHxxxx").pack
_PACK_BBIBB = struct.Struct("<BBIBB").pack
_PACK_BHHHB = struct.Struct("<BHHHB").pack
_PACK_BHIX = struct.Struct("<BHIx").pack
_UNPACK_BBBBI = struct.Struct("<BBBBI").unpack_from
_UNPACK_BBBBSHSH = struct.Struct("<BBBBhh").unpack_from
_UNPACK_BBBBXXXX = struct.Struct("<BBBBxxxx").unpack_from
_UNPACK_BBBXXXXX = struct.Struct("<BBBxxxxx").unpack_from
_UNPACK_BBIBB = struct.Struct("<BBIBB").unpack_from
_UNPACK_BHHHB = struct.Struct("<BHHHB").unpack_from
_UNPACK_BHIX = struct.Struct("<BHIx").unpack_from


def pack_itinerary_head(message: ItineraryHead) -> bytes:
    legs = message.legs
    if legs > 31:
        raise OutOfRangeError("ItineraryHead.legs", legs, 0, 31)
    stamp = message.stamp
    try:
        return _PACK_BBIBB(message.version, message.grade + legs * 0x4, stamp[0], stamp[1], stamp[2])
    except struct.error as error:
        raise refusal(
            message,
            ("ItineraryHead.version", 0, 255),
            ("ItineraryHead.legs", 0, 31),
            ("ItineraryHead.stamp.award_ms", 0, 4294967295),
            ("ItineraryHead.stamp.initiator", 0, 255),
            ("ItineraryHead.stamp.call", 0, 255),
        ) from error


def unpack_itinerary_head(sender: int, data: bytes) -> ItineraryHead | None:
    version, word_1, stamp_award_ms, stamp_initiator, stamp_call = _UNPACK_BBIBB(data)
    grade = word_1 & 0x3
    if grade > 2:
        return None
    legs = word_1 >> 2
    if legs > 31:
        return None
    return ItineraryHead(
        sender, version, _GRADE[grade], legs, _new(Stamp, (stamp_award_ms, stamp_initiator, stamp_call))
    )


def pack_itinerary_leg(message: ItineraryLeg) -> bytes:
    track = message.track
    if track < 1 or track > 254:
        raise OutOfRangeError("ItineraryLeg.track", track, 1, 254)
    end_ms = message.end_ms
    try:
        return _PACK_BBBBBBH(
            message.version,
            message.action + _FROM_0_TO_30_AT_2[message.leg] + message.side * 0x80,
            track,
            message.from_index,
            message.to_index,
            end_ms & 0xFF,
            end_ms >> 8,
        )
    except (KeyError, struct.error) as error:
        raise refusal(
            message,
            ("ItineraryLeg.version", 0, 255),
            ("ItineraryLeg.leg", 0, 30),
            ("ItineraryLeg.from_index", 0, 255),
            ("ItineraryLeg.to_index", 0, 255),
            ("ItineraryLeg.end_ms", 0, 16777215),
        ) from error


def unpack_itinerary_leg(sender: int, data: bytes) -> ItineraryLeg | None:
    version, word_1, track, from_index, word_4 = _UNPACK_BBBBI(data)
    action = word_1 & 0x3
    leg = word_1 >> 2 & 0x1F
    if leg > 30:
        return None
    side = word_1 >> 7
    if track < 1 or track > 254:
        return None
    to_index = word_4 & 0xFF
    end_ms = word_4 >> 8
    return ItineraryLeg(sender, version, _LEG_ACTION[action], leg, _SIDE[side], track, from_index, to_index, end_ms)


def pack_progress(message: Progress) -> bytes:
    leg = message.leg
    if leg > 31:
        raise OutOfRangeError("Progress.leg", leg, 0, 31)
    track = message.track
    if track < 1 or track > 254:
        raise OutOfRangeError("Progress.track", track, 1, 254)
    try:
        return _PACK_BBBBSHSH(
            message.itinerary_version, track, message.index, leg, message.offset_mm, message.speed_mm_s
        )
    except struct.error as error:
        raise refusal(
            message,
            ("Progress.itinerary_version", 0, 255),
            ("Progress.leg", 0, 31),
            ("Progress.index", 0, 255),
            ("Progress.offset_mm", -32768, 32767),
            ("Progress.speed_mm_s", -32768, 32767),
        ) from error


def unpack_progress(sender: int, data: bytes) -> Progress | None:
    itinerary_version, track, index, leg, offset_mm, speed_mm_s = _UNPACK_BBBBSHSH(data)
    if track < 1 or track > 254:
        return None
    leg = leg & 0x1F
    return Progress(sender, itinerary_version, leg, track, index, offset_mm, speed_mm_s)


def pack_waiting(message: Waiting) -> bytes:
    track = message.track
    if track < 1 or track > 254:
        raise OutOfRangeError("Waiting.track", track, 1, 254)
    try:
        return _PACK_BBBBXXXX(track, message.index, message.blocker, message.reason)
    except struct.error as error:
        raise refusal(message, ("Waiting.index", 0, 255), ("Waiting.blocker", 0, 255)) from error


def unpack_waiting(sender: int, data: bytes) -> Waiting | None:
    track, index, blocker, reason = _UNPACK_BBBBXXXX(data)
    if track < 1 or track > 254:
        return None
    if reason > 47:
        return None
    return Waiting(sender, track, index, blocker, _REASON[reason])


def pack_task_report(message: TaskReport) -> bytes:
    task = message.task
    station = message.station
    if station < 0 or station > 65535:
        raise OutOfRangeError("TaskReport.station", station, 0, 65535)
    try:
        return _PACK_BHIX(task[0], task[1], message.phase + station * 0x10 + message.reason * 0x100000)
    except struct.error as error:
        raise refusal(message, ("TaskReport.task.origin", 0, 255), ("TaskReport.task.number", 0, 65535)) from error


def unpack_task_report(sender: int, data: bytes) -> TaskReport | None:
    task_origin, task_number, word_3 = _UNPACK_BHIX(data)
    phase = word_3 & 0xF
    if phase > 6:
        return None
    station = word_3 >> 4 & 0xFFFF
    reason = word_3 >> 20 & 0xFF
    if reason > 47:
        return None
    return TaskReport(sender, _new(Reference, (task_origin, task_number)), _TASK_PHASE[phase], station, _REASON[reason])


def pack_car_at(message: CarAt) -> bytes:
    car = message.car
    wheelbase_mm = message.wheelbase_mm
    if wheelbase_mm < 1500 or wheelbase_mm > 4050:
        raise OutOfRangeError("CarAt.wheelbase_mm", wheelbase_mm, 1500, 4050)
    try:
        return _PACK_BHHHB(car[0], car[1], message.station, message.version, (wheelbase_mm - 1500) // 10)
    except struct.error as error:
        raise refusal(
            message,
            ("CarAt.car.origin", 0, 255),
            ("CarAt.car.number", 0, 65535),
            ("CarAt.station", 0, 65535),
            ("CarAt.version", 0, 65535),
        ) from error


def unpack_car_at(sender: int, data: bytes) -> CarAt | None:
    car_origin, car_number, station, version, wheelbase_mm = _UNPACK_BHHHB(data)
    wheelbase_mm = wheelbase_mm * 10 + 1500
    return CarAt(sender, _new(Reference, (car_origin, car_number)), station, version, wheelbase_mm)


def pack_blocked(message: Blocked) -> bytes:
    track = message.track
    if track < 1 or track > 254:
        raise OutOfRangeError("Blocked.track", track, 1, 254)
    try:
        return _PACK_BBHXXXX(track, message.index, message.reason)
    except struct.error as error:
        raise refusal(message, ("Blocked.index", 0, 255)) from error


def unpack_blocked(sender: int, data: bytes) -> Blocked | None:
    track, index, reason = _UNPACK_BBBXXXXX(data)
    if track < 1 or track > 254:
        return None
    if reason > 47:
        return None
    return Blocked(sender, track, index, _REASON[reason])


def pack_clear(message: Clear) -> bytes:
    track = message.track
    if track < 1 or track > 254:
        raise OutOfRangeError("Clear.track", track, 1, 254)
    try:
        return _PACK_BBHXXXX(track, message.index, message.reason)
    except struct.error as error:
        raise refusal(message, ("Clear.index", 0, 255)) from error


def unpack_clear(sender: int, data: bytes) -> Clear | None:
    track, index, reason = _UNPACK_BBBXXXXX(data)
    if track < 1 or track > 254:
        return None
    if reason > 47:
        return None
    return Clear(sender, track, index, _REASON[reason])


#: Every frame of this module.
FRAMES = (
    FrameCode(
        "ItineraryHead",
        0x0C400000,
        8,
        pack_itinerary_head,
        unpack_itinerary_head,
        ItineraryHead,
        Itinerary,
        ("Robot", "Lift", "Machine"),
        False,
    ),
    FrameCode(
        "ItineraryLeg",
        0x0C410000,
        8,
        pack_itinerary_leg,
        unpack_itinerary_leg,
        ItineraryLeg,
        None,
        ("Robot", "Lift", "Machine"),
        False,
    ),
    FrameCode(
        "Progress",
        0x0E480000,
        8,
        pack_progress,
        unpack_progress,
        Progress,
        Progress,
        ("Robot", "Lift", "Machine"),
        False,
    ),
    FrameCode(
        "Waiting", 0x0E490000, 8, pack_waiting, unpack_waiting, Waiting, Waiting, ("Robot", "Lift", "Machine"), False
    ),
    FrameCode(
        "TaskReport",
        0x0E4A0000,
        8,
        pack_task_report,
        unpack_task_report,
        TaskReport,
        TaskReport,
        ("Robot", "Lift", "Compartment", "Machine"),
        False,
    ),
    FrameCode(
        "CarAt",
        0x0E4B0000,
        8,
        pack_car_at,
        unpack_car_at,
        CarAt,
        CarAt,
        ("Robot", "Lift", "Compartment", "Machine"),
        False,
    ),
    FrameCode(
        "Blocked",
        0x0E4E0000,
        8,
        pack_blocked,
        unpack_blocked,
        Blocked,
        Blocked,
        ("Gateway", "Lift", "Compartment"),
        False,
    ),
    FrameCode(
        "Clear", 0x0E4F0000, 8, pack_clear, unpack_clear, Clear, Clear, ("Gateway", "Lift", "Compartment"), False
    ),
)
