"""Bytes of the messages in ``onboard.contract.calls``, and back.

Written by ``make docs`` from ``dbc/fleet.dbc``: change that file, never this one.
"""

import struct

from onboard.contract.base import FrameCode, OutOfRangeError, Reference, refusal
from onboard.contract.calls import Award, Bid, Call, CallForProposals, CallLoad, CallParent, CallTerms, LeftOut
from onboard.contract.codes import CallResult, Criterion, KindCode, Operation, Reason

_new = tuple.__new__
_CALL_RESULT = tuple(CallResult)
_CRITERION = tuple(Criterion)
_KIND_CODE = tuple(KindCode)
_OPERATION = tuple(Operation)
_REASON = tuple(Reason)
_FROM_0_TO_15_AT_8 = {value: value << 8 for value in range(16)}
_FROM_1_TO_15_AT_4 = {value: value << 4 for value in range(1, 16)}
_PACK_BHIB = struct.Struct("<BHIB").pack
_PACK_HBBBBBB = struct.Struct("<HBBBBBB").pack
_PACK_HBBHH = struct.Struct("<HBBHH").pack
_PACK_HBHBH = struct.Struct("<HBHBH").pack
_PACK_HHBHB = struct.Struct("<HHBHB").pack
_PACK_HIH = struct.Struct("<HIH").pack
_UNPACK_BHIB = struct.Struct("<BHIB").unpack_from
_UNPACK_HBBBBBB = struct.Struct("<HBBBBBB").unpack_from
_UNPACK_HBBHH = struct.Struct("<HBBHH").unpack_from
_UNPACK_HBHBBB = struct.Struct("<HBHBBB").unpack_from
_UNPACK_HHBHB = struct.Struct("<HHBHB").unpack_from
_UNPACK_HIH = struct.Struct("<HIH").unpack_from
_UNPACK_Q = struct.Struct("<Q").unpack_from


def pack_left_out(message: LeftOut) -> bytes:
    try:
        return _PACK_HBBBBBB(
            message.call, message.node_a, message.node_b, message.node_c, message.node_d, message.node_e, message.node_f
        )
    except struct.error as error:
        raise refusal(
            message,
            ("LeftOut.call", 0, 65535),
            ("LeftOut.node_a", 0, 255),
            ("LeftOut.node_b", 0, 255),
            ("LeftOut.node_c", 0, 255),
            ("LeftOut.node_d", 0, 255),
            ("LeftOut.node_e", 0, 255),
            ("LeftOut.node_f", 0, 255),
        ) from error


def unpack_left_out(sender: int, data: bytes) -> LeftOut | None:
    call, node_a, node_b, node_c, node_d, node_e, node_f = _UNPACK_HBBBBBB(data)
    return LeftOut(sender, call, node_a, node_b, node_c, node_d, node_e, node_f)


def pack_call(message: Call) -> bytes:
    task = message.task
    try:
        return _PACK_HBHBH(
            message.call,
            task[0],
            task[1],
            message.operation + message.kind * 0x10,
            message.criterion
            + _FROM_1_TO_15_AT_4[message.attempt]
            + _FROM_0_TO_15_AT_8[message.depth]
            + message.part * 0x1000,
        )
    except (KeyError, struct.error) as error:
        raise refusal(
            message,
            ("Call.call", 0, 65535),
            ("Call.task.origin", 0, 255),
            ("Call.task.number", 0, 65535),
            ("Call.attempt", 1, 15),
            ("Call.depth", 0, 15),
            ("Call.part", 0, 15),
        ) from error


def unpack_call(sender: int, data: bytes) -> Call | None:
    call, task_origin, task_number, word_5, word_6, word_7 = _UNPACK_HBHBBB(data)
    operation = word_5 & 0xF
    if operation > 7:
        return None
    kind = word_5 >> 4
    if kind > 9:
        return None
    criterion = word_6 & 0xF
    if criterion > 2:
        return None
    attempt = word_6 >> 4
    if attempt < 1:
        return None
    depth = word_7 & 0xF
    part = word_7 >> 4
    return Call(
        sender,
        call,
        _new(Reference, (task_origin, task_number)),
        _OPERATION[operation],
        _KIND_CODE[kind],
        _CRITERION[criterion],
        attempt,
        depth,
        part,
    )


def pack_call_terms(message: CallTerms) -> bytes:
    try:
        return _PACK_HIH(message.call, message.deadline_ms, message.from_station)
    except struct.error as error:
        raise refusal(
            message,
            ("CallTerms.call", 0, 65535),
            ("CallTerms.deadline_ms", 0, 4294967295),
            ("CallTerms.from_station", 0, 65535),
        ) from error


def unpack_call_terms(sender: int, data: bytes) -> CallTerms | None:
    call, deadline_ms, from_station = _UNPACK_HIH(data)
    return CallTerms(sender, call, deadline_ms, from_station)


def pack_call_load(message: CallLoad) -> bytes:
    car = message.car
    wheelbase_mm = message.wheelbase_mm
    if wheelbase_mm < 1500 or wheelbase_mm > 4050:
        raise OutOfRangeError("CallLoad.wheelbase_mm", wheelbase_mm, 1500, 4050)
    try:
        return _PACK_HHBHB(message.call, message.to_station, car[0], car[1], (wheelbase_mm - 1500) // 10)
    except struct.error as error:
        raise refusal(
            message,
            ("CallLoad.call", 0, 65535),
            ("CallLoad.to_station", 0, 65535),
            ("CallLoad.car.origin", 0, 255),
            ("CallLoad.car.number", 0, 65535),
        ) from error


def unpack_call_load(sender: int, data: bytes) -> CallLoad | None:
    call, to_station, car_origin, car_number, wheelbase_mm = _UNPACK_HHBHB(data)
    wheelbase_mm = wheelbase_mm * 10 + 1500
    return CallLoad(sender, call, to_station, _new(Reference, (car_origin, car_number)), wheelbase_mm)


def pack_call_parent(message: CallParent) -> bytes:
    parent = message.parent
    ready_ms = message.ready_ms
    if ready_ms < 0 or ready_ms > 1638300:
        raise OutOfRangeError("CallParent.ready_ms", ready_ms, 0, 1638300)
    ready_ms = ready_ms // 100
    hold_ms = message.hold_ms
    if hold_ms < 0 or hold_ms > 255750:
        raise OutOfRangeError("CallParent.hold_ms", hold_ms, 0, 255750)
    try:
        return _PACK_HBHBH(
            message.call, parent[0], parent[1], ready_ms & 0xFF, (ready_ms >> 8) + (hold_ms // 250) * 0x40
        )
    except struct.error as error:
        raise refusal(
            message,
            ("CallParent.call", 0, 65535),
            ("CallParent.parent.origin", 0, 255),
            ("CallParent.parent.number", 0, 65535),
        ) from error


def unpack_call_parent(sender: int, data: bytes) -> CallParent | None:
    (word_0,) = _UNPACK_Q(data)
    call = word_0 & 0xFFFF
    parent_origin = word_0 >> 16 & 0xFF
    parent_number = word_0 >> 24 & 0xFFFF
    ready_ms = (word_0 >> 40 & 0x3FFF) * 100
    hold_ms = (word_0 >> 54) * 250
    return CallParent(sender, call, _new(Reference, (parent_origin, parent_number)), ready_ms, hold_ms)


def pack_award(message: Award) -> bytes:
    task = message.task
    task_version = message.task_version
    if task_version < 0 or task_version > 127:
        raise OutOfRangeError("Award.task_version", task_version, 0, 127)
    try:
        return _PACK_HBBHH(
            message.call,
            message.winner,
            task[0],
            task[1],
            task_version + message.result * 0x80 + message.reason * 0x400,
        )
    except struct.error as error:
        raise refusal(
            message,
            ("Award.call", 0, 65535),
            ("Award.winner", 0, 255),
            ("Award.task.origin", 0, 255),
            ("Award.task.number", 0, 65535),
        ) from error


def unpack_award(sender: int, data: bytes) -> Award | None:
    call, winner, task_origin, task_number, word_6 = _UNPACK_HBBHH(data)
    task_version = word_6 & 0x7F
    result = word_6 >> 7 & 0x7
    if result > 5:
        return None
    reason = word_6 >> 10
    if reason > 47:
        return None
    return Award(
        sender,
        call,
        winner,
        _new(Reference, (task_origin, task_number)),
        task_version,
        _CALL_RESULT[result],
        _REASON[reason],
    )


def pack_bid(message: Bid) -> bytes:
    initiator = message.initiator
    if initiator < 1:
        raise OutOfRangeError("Bid.initiator", initiator, 1, 255)
    try:
        return _PACK_BHIB(initiator, message.call, message.cost, message.itinerary_version)
    except struct.error as error:
        raise refusal(
            message,
            ("Bid.initiator", 1, 255),
            ("Bid.call", 0, 65535),
            ("Bid.cost", 0, 4294967295),
            ("Bid.itinerary_version", 0, 255),
        ) from error


def unpack_bid(sender: int, data: bytes) -> Bid | None:
    initiator, call, cost, itinerary_version = _UNPACK_BHIB(data)
    if initiator < 1:
        return None
    return Bid(sender, initiator, call, cost, itinerary_version)


#: Every frame of this module.
FRAMES = (
    FrameCode(
        "LeftOut",
        0x062F0000,
        8,
        pack_left_out,
        unpack_left_out,
        LeftOut,
        LeftOut,
        ("Robot", "Lift", "Compartment", "Machine", "Gateway"),
        False,
    ),
    FrameCode(
        "Call",
        0x06300000,
        8,
        pack_call,
        unpack_call,
        Call,
        CallForProposals,
        ("Robot", "Lift", "Compartment", "Machine", "Gateway"),
        False,
    ),
    FrameCode(
        "CallTerms",
        0x06310000,
        8,
        pack_call_terms,
        unpack_call_terms,
        CallTerms,
        None,
        ("Robot", "Lift", "Compartment", "Machine", "Gateway"),
        False,
    ),
    FrameCode(
        "CallLoad",
        0x06320000,
        8,
        pack_call_load,
        unpack_call_load,
        CallLoad,
        None,
        ("Robot", "Lift", "Compartment", "Machine", "Gateway"),
        False,
    ),
    FrameCode(
        "CallParent",
        0x06330000,
        8,
        pack_call_parent,
        unpack_call_parent,
        CallParent,
        None,
        ("Robot", "Lift", "Compartment", "Machine", "Gateway"),
        False,
    ),
    FrameCode(
        "Award",
        0x08380000,
        8,
        pack_award,
        unpack_award,
        Award,
        Award,
        ("Robot", "Lift", "Compartment", "Machine", "Gateway"),
        False,
    ),
    FrameCode("Bid", 0x09390000, 8, pack_bid, unpack_bid, Bid, Bid, ("Robot", "Lift", "Compartment", "Machine"), False),
)
