"""Bytes of the messages in ``onboard.contract.plans``, and back.

Written by ``make docs`` from ``dbc/fleet.dbc``: change that file, never this one.
"""

from struct import Struct

from onboard.contract.base import FrameCode, OutOfRangeError, Reference, Stamp
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
_BBBBI = Struct("<BBBBI")
_BBBBXXXX = Struct("<BBBBxxxx")
_BBBXXXXX = Struct("<BBBxxxxx")
_BBIBB = Struct("<BBIBB")
_BHHHB = Struct("<BHHHB")
_BHIX = Struct("<BHIx")
_Q = Struct("<Q")


def pack_itinerary_head(message: ItineraryHead) -> bytes:
    version = message.version
    if not 0 <= version <= 255:
        raise OutOfRangeError("ItineraryHead.version", version, 0, 255)
    legs = message.legs
    if not 0 <= legs <= 31:
        raise OutOfRangeError("ItineraryHead.legs", legs, 0, 31)
    stamp_award_ms = message.stamp.award_ms
    if not 0 <= stamp_award_ms <= 4294967295:
        raise OutOfRangeError("ItineraryHead.stamp_award_ms", stamp_award_ms, 0, 4294967295)
    stamp_initiator = message.stamp.initiator
    if not 0 <= stamp_initiator <= 255:
        raise OutOfRangeError("ItineraryHead.stamp_initiator", stamp_initiator, 0, 255)
    stamp_call = message.stamp.call
    if not 0 <= stamp_call <= 255:
        raise OutOfRangeError("ItineraryHead.stamp_call", stamp_call, 0, 255)
    return _BBIBB.pack(version, message.grade + legs * 0x4, stamp_award_ms, stamp_initiator, stamp_call)


def unpack_itinerary_head(sender: int, data: bytes) -> ItineraryHead | None:
    version, word_1, stamp_award_ms, stamp_initiator, stamp_call = _BBIBB.unpack_from(data)
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
    version = message.version
    if not 0 <= version <= 255:
        raise OutOfRangeError("ItineraryLeg.version", version, 0, 255)
    leg = message.leg
    if not 0 <= leg <= 30:
        raise OutOfRangeError("ItineraryLeg.leg", leg, 0, 30)
    track = message.track
    if not 1 <= track <= 254:
        raise OutOfRangeError("ItineraryLeg.track", track, 1, 254)
    from_index = message.from_index
    if not 0 <= from_index <= 255:
        raise OutOfRangeError("ItineraryLeg.from_index", from_index, 0, 255)
    to_index = message.to_index
    if not 0 <= to_index <= 255:
        raise OutOfRangeError("ItineraryLeg.to_index", to_index, 0, 255)
    end_ms = message.end_ms
    if not 0 <= end_ms <= 16777215:
        raise OutOfRangeError("ItineraryLeg.end_ms", end_ms, 0, 16777215)
    return _BBBBI.pack(
        version, message.action + leg * 0x4 + message.side * 0x80, track, from_index, to_index + end_ms * 0x100
    )


def unpack_itinerary_leg(sender: int, data: bytes) -> ItineraryLeg | None:
    version, word_1, track, from_index, word_4 = _BBBBI.unpack_from(data)
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
    itinerary_version = message.itinerary_version
    if not 0 <= itinerary_version <= 255:
        raise OutOfRangeError("Progress.itinerary_version", itinerary_version, 0, 255)
    leg = message.leg
    if not 0 <= leg <= 31:
        raise OutOfRangeError("Progress.leg", leg, 0, 31)
    track = message.track
    if not 1 <= track <= 254:
        raise OutOfRangeError("Progress.track", track, 1, 254)
    index = message.index
    if not 0 <= index <= 255:
        raise OutOfRangeError("Progress.index", index, 0, 255)
    offset_mm = message.offset_mm
    if not -32768 <= offset_mm <= 32767:
        raise OutOfRangeError("Progress.offset_mm", offset_mm, -32768, 32767)
    speed_mm_s = message.speed_mm_s
    if not -32768 <= speed_mm_s <= 32767:
        raise OutOfRangeError("Progress.speed_mm_s", speed_mm_s, -32768, 32767)
    return _Q.pack(
        itinerary_version
        + leg * 0x100
        + track * 0x2000
        + index * 0x200000
        + (offset_mm & 0xFFFF) * 0x20000000
        + (speed_mm_s & 0xFFFF) * 0x200000000000
    )


def unpack_progress(sender: int, data: bytes) -> Progress | None:
    (word_0,) = _Q.unpack_from(data)
    itinerary_version = word_0 & 0xFF
    leg = word_0 >> 8 & 0x1F
    track = word_0 >> 13 & 0xFF
    if track < 1 or track > 254:
        return None
    index = word_0 >> 21 & 0xFF
    offset_mm = ((word_0 >> 29 & 0xFFFF) ^ 0x8000) - 0x8000
    speed_mm_s = ((word_0 >> 45 & 0xFFFF) ^ 0x8000) - 0x8000
    return Progress(sender, itinerary_version, leg, track, index, offset_mm, speed_mm_s)


def pack_waiting(message: Waiting) -> bytes:
    track = message.track
    if not 1 <= track <= 254:
        raise OutOfRangeError("Waiting.track", track, 1, 254)
    index = message.index
    if not 0 <= index <= 255:
        raise OutOfRangeError("Waiting.index", index, 0, 255)
    blocker = message.blocker
    if not 0 <= blocker <= 255:
        raise OutOfRangeError("Waiting.blocker", blocker, 0, 255)
    return _BBBBXXXX.pack(track, index, blocker, message.reason)


def unpack_waiting(sender: int, data: bytes) -> Waiting | None:
    track, index, blocker, reason = _BBBBXXXX.unpack_from(data)
    if track < 1 or track > 254:
        return None
    if reason > 47:
        return None
    return Waiting(sender, track, index, blocker, _REASON[reason])


def pack_task_report(message: TaskReport) -> bytes:
    task_origin = message.task.origin
    if not 0 <= task_origin <= 255:
        raise OutOfRangeError("TaskReport.task_origin", task_origin, 0, 255)
    task_number = message.task.number
    if not 0 <= task_number <= 65535:
        raise OutOfRangeError("TaskReport.task_number", task_number, 0, 65535)
    station = message.station
    if not 0 <= station <= 65535:
        raise OutOfRangeError("TaskReport.station", station, 0, 65535)
    return _BHIX.pack(task_origin, task_number, message.phase + station * 0x10 + message.reason * 0x100000)


def unpack_task_report(sender: int, data: bytes) -> TaskReport | None:
    task_origin, task_number, word_3 = _BHIX.unpack_from(data)
    phase = word_3 & 0xF
    if phase > 6:
        return None
    station = word_3 >> 4 & 0xFFFF
    reason = word_3 >> 20 & 0xFF
    if reason > 47:
        return None
    return TaskReport(sender, _new(Reference, (task_origin, task_number)), _TASK_PHASE[phase], station, _REASON[reason])


def pack_car_at(message: CarAt) -> bytes:
    car_origin = message.car.origin
    if not 0 <= car_origin <= 255:
        raise OutOfRangeError("CarAt.car_origin", car_origin, 0, 255)
    car_number = message.car.number
    if not 0 <= car_number <= 65535:
        raise OutOfRangeError("CarAt.car_number", car_number, 0, 65535)
    station = message.station
    if not 0 <= station <= 65535:
        raise OutOfRangeError("CarAt.station", station, 0, 65535)
    version = message.version
    if not 0 <= version <= 65535:
        raise OutOfRangeError("CarAt.version", version, 0, 65535)
    wheelbase_mm = message.wheelbase_mm
    if not 1500 <= wheelbase_mm <= 4050:
        raise OutOfRangeError("CarAt.wheelbase_mm", wheelbase_mm, 1500, 4050)
    return _BHHHB.pack(car_origin, car_number, station, version, (wheelbase_mm - 1500) // 10)


def unpack_car_at(sender: int, data: bytes) -> CarAt | None:
    car_origin, car_number, station, version, wheelbase_mm = _BHHHB.unpack_from(data)
    wheelbase_mm = wheelbase_mm * 10 + 1500
    return CarAt(sender, _new(Reference, (car_origin, car_number)), station, version, wheelbase_mm)


def pack_blocked(message: Blocked) -> bytes:
    track = message.track
    if not 1 <= track <= 254:
        raise OutOfRangeError("Blocked.track", track, 1, 254)
    index = message.index
    if not 0 <= index <= 255:
        raise OutOfRangeError("Blocked.index", index, 0, 255)
    return _BBBXXXXX.pack(track, index, message.reason)


def unpack_blocked(sender: int, data: bytes) -> Blocked | None:
    track, index, reason = _BBBXXXXX.unpack_from(data)
    if track < 1 or track > 254:
        return None
    if reason > 47:
        return None
    return Blocked(sender, track, index, _REASON[reason])


def pack_clear(message: Clear) -> bytes:
    track = message.track
    if not 1 <= track <= 254:
        raise OutOfRangeError("Clear.track", track, 1, 254)
    index = message.index
    if not 0 <= index <= 255:
        raise OutOfRangeError("Clear.index", index, 0, 255)
    return _BBBXXXXX.pack(track, index, message.reason)


def unpack_clear(sender: int, data: bytes) -> Clear | None:
    track, index, reason = _BBBXXXXX.unpack_from(data)
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
