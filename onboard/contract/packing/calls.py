"""Bytes of the messages in ``onboard.contract.calls``, and back.

Written by ``make docs`` from ``dbc/fleet.dbc``: change that file, never this one.
"""

from struct import Struct

from onboard.contract.base import FrameCode, OutOfRangeError, Reference
from onboard.contract.calls import Award, Bid, Call, CallForProposals, CallLoad, CallParent, CallTerms, LeftOut
from onboard.contract.codes import CallResult, Criterion, KindCode, Operation, Reason

_new = tuple.__new__
_CALL_RESULT = tuple(CallResult)
_CRITERION = tuple(Criterion)
_KIND_CODE = tuple(KindCode)
_OPERATION = tuple(Operation)
_REASON = tuple(Reason)
_BHIB = Struct("<BHIB")
_HBBBBBB = Struct("<HBBBBBB")
_HBBHH = Struct("<HBBHH")
_HBHBBB = Struct("<HBHBBB")
_HHBHB = Struct("<HHBHB")
_HIH = Struct("<HIH")
_Q = Struct("<Q")


def pack_left_out(message: LeftOut) -> bytes:
    call = message.call
    if not 0 <= call <= 65535:
        raise OutOfRangeError("LeftOut.call", call, 0, 65535)
    node_a = message.node_a
    if not 0 <= node_a <= 255:
        raise OutOfRangeError("LeftOut.node_a", node_a, 0, 255)
    node_b = message.node_b
    if not 0 <= node_b <= 255:
        raise OutOfRangeError("LeftOut.node_b", node_b, 0, 255)
    node_c = message.node_c
    if not 0 <= node_c <= 255:
        raise OutOfRangeError("LeftOut.node_c", node_c, 0, 255)
    node_d = message.node_d
    if not 0 <= node_d <= 255:
        raise OutOfRangeError("LeftOut.node_d", node_d, 0, 255)
    node_e = message.node_e
    if not 0 <= node_e <= 255:
        raise OutOfRangeError("LeftOut.node_e", node_e, 0, 255)
    node_f = message.node_f
    if not 0 <= node_f <= 255:
        raise OutOfRangeError("LeftOut.node_f", node_f, 0, 255)
    return _HBBBBBB.pack(call, node_a, node_b, node_c, node_d, node_e, node_f)


def unpack_left_out(sender: int, data: bytes) -> LeftOut | None:
    call, node_a, node_b, node_c, node_d, node_e, node_f = _HBBBBBB.unpack_from(data)
    return LeftOut(sender, call, node_a, node_b, node_c, node_d, node_e, node_f)


def pack_call(message: Call) -> bytes:
    call = message.call
    if not 0 <= call <= 65535:
        raise OutOfRangeError("Call.call", call, 0, 65535)
    task_origin = message.task.origin
    if not 0 <= task_origin <= 255:
        raise OutOfRangeError("Call.task_origin", task_origin, 0, 255)
    task_number = message.task.number
    if not 0 <= task_number <= 65535:
        raise OutOfRangeError("Call.task_number", task_number, 0, 65535)
    attempt = message.attempt
    if not 1 <= attempt <= 15:
        raise OutOfRangeError("Call.attempt", attempt, 1, 15)
    depth = message.depth
    if not 0 <= depth <= 15:
        raise OutOfRangeError("Call.depth", depth, 0, 15)
    part = message.part
    if not 0 <= part <= 15:
        raise OutOfRangeError("Call.part", part, 0, 15)
    return _HBHBBB.pack(
        call,
        task_origin,
        task_number,
        message.operation + message.kind * 0x10,
        message.criterion + attempt * 0x10,
        depth + part * 0x10,
    )


def unpack_call(sender: int, data: bytes) -> Call | None:
    call, task_origin, task_number, word_5, word_6, word_7 = _HBHBBB.unpack_from(data)
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
    call = message.call
    if not 0 <= call <= 65535:
        raise OutOfRangeError("CallTerms.call", call, 0, 65535)
    deadline_ms = message.deadline_ms
    if not 0 <= deadline_ms <= 4294967295:
        raise OutOfRangeError("CallTerms.deadline_ms", deadline_ms, 0, 4294967295)
    from_station = message.from_station
    if not 0 <= from_station <= 65535:
        raise OutOfRangeError("CallTerms.from_station", from_station, 0, 65535)
    return _HIH.pack(call, deadline_ms, from_station)


def unpack_call_terms(sender: int, data: bytes) -> CallTerms | None:
    call, deadline_ms, from_station = _HIH.unpack_from(data)
    return CallTerms(sender, call, deadline_ms, from_station)


def pack_call_load(message: CallLoad) -> bytes:
    call = message.call
    if not 0 <= call <= 65535:
        raise OutOfRangeError("CallLoad.call", call, 0, 65535)
    to_station = message.to_station
    if not 0 <= to_station <= 65535:
        raise OutOfRangeError("CallLoad.to_station", to_station, 0, 65535)
    car_origin = message.car.origin
    if not 0 <= car_origin <= 255:
        raise OutOfRangeError("CallLoad.car_origin", car_origin, 0, 255)
    car_number = message.car.number
    if not 0 <= car_number <= 65535:
        raise OutOfRangeError("CallLoad.car_number", car_number, 0, 65535)
    wheelbase_mm = message.wheelbase_mm
    if not 1500 <= wheelbase_mm <= 4050:
        raise OutOfRangeError("CallLoad.wheelbase_mm", wheelbase_mm, 1500, 4050)
    return _HHBHB.pack(call, to_station, car_origin, car_number, (wheelbase_mm - 1500) // 10)


def unpack_call_load(sender: int, data: bytes) -> CallLoad | None:
    call, to_station, car_origin, car_number, wheelbase_mm = _HHBHB.unpack_from(data)
    wheelbase_mm = wheelbase_mm * 10 + 1500
    return CallLoad(sender, call, to_station, _new(Reference, (car_origin, car_number)), wheelbase_mm)


def pack_call_parent(message: CallParent) -> bytes:
    call = message.call
    if not 0 <= call <= 65535:
        raise OutOfRangeError("CallParent.call", call, 0, 65535)
    parent_origin = message.parent.origin
    if not 0 <= parent_origin <= 255:
        raise OutOfRangeError("CallParent.parent_origin", parent_origin, 0, 255)
    parent_number = message.parent.number
    if not 0 <= parent_number <= 65535:
        raise OutOfRangeError("CallParent.parent_number", parent_number, 0, 65535)
    ready_ms = message.ready_ms
    if not 0 <= ready_ms <= 1638300:
        raise OutOfRangeError("CallParent.ready_ms", ready_ms, 0, 1638300)
    hold_ms = message.hold_ms
    if not 0 <= hold_ms <= 255750:
        raise OutOfRangeError("CallParent.hold_ms", hold_ms, 0, 255750)
    return _Q.pack(
        call
        + parent_origin * 0x10000
        + (parent_number + (ready_ms // 100) * 0x10000) * 0x1000000
        + (hold_ms // 250) * 0x40000000000000
    )


def unpack_call_parent(sender: int, data: bytes) -> CallParent | None:
    (word_0,) = _Q.unpack_from(data)
    call = word_0 & 0xFFFF
    parent_origin = word_0 >> 16 & 0xFF
    parent_number = word_0 >> 24 & 0xFFFF
    ready_ms = (word_0 >> 40 & 0x3FFF) * 100
    hold_ms = (word_0 >> 54) * 250
    return CallParent(sender, call, _new(Reference, (parent_origin, parent_number)), ready_ms, hold_ms)


def pack_award(message: Award) -> bytes:
    call = message.call
    if not 0 <= call <= 65535:
        raise OutOfRangeError("Award.call", call, 0, 65535)
    winner = message.winner
    if not 0 <= winner <= 255:
        raise OutOfRangeError("Award.winner", winner, 0, 255)
    task_origin = message.task.origin
    if not 0 <= task_origin <= 255:
        raise OutOfRangeError("Award.task_origin", task_origin, 0, 255)
    task_number = message.task.number
    if not 0 <= task_number <= 65535:
        raise OutOfRangeError("Award.task_number", task_number, 0, 65535)
    task_version = message.task_version
    if not 0 <= task_version <= 127:
        raise OutOfRangeError("Award.task_version", task_version, 0, 127)
    return _HBBHH.pack(
        call, winner, task_origin, task_number, task_version + message.result * 0x80 + message.reason * 0x400
    )


def unpack_award(sender: int, data: bytes) -> Award | None:
    call, winner, task_origin, task_number, word_6 = _HBBHH.unpack_from(data)
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
    if not 1 <= initiator <= 255:
        raise OutOfRangeError("Bid.initiator", initiator, 1, 255)
    call = message.call
    if not 0 <= call <= 65535:
        raise OutOfRangeError("Bid.call", call, 0, 65535)
    cost = message.cost
    if not 0 <= cost <= 4294967295:
        raise OutOfRangeError("Bid.cost", cost, 0, 4294967295)
    itinerary_version = message.itinerary_version
    if not 0 <= itinerary_version <= 255:
        raise OutOfRangeError("Bid.itinerary_version", itinerary_version, 0, 255)
    return _BHIB.pack(initiator, call, cost, itinerary_version)


def unpack_bid(sender: int, data: bytes) -> Bid | None:
    initiator, call, cost, itinerary_version = _BHIB.unpack_from(data)
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
