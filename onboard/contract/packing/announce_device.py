"""Bytes of the messages in ``onboard.contract.announce_device``, and back.

Written by ``make docs`` from ``dbc/announce.dbc``: change that file, never this one.
"""

import struct

from onboard.contract.announce import FetchWord
from onboard.contract.announce_device import DeskFetch, DeskFetchAnswer
from onboard.contract.base import FrameCode, OutOfRangeError, Reference, refusal

_new = tuple.__new__
_FETCH_WORD = tuple(FetchWord)
_PACK_BBHI = struct.Struct("<BBHI").pack
_PACK_BHIX = struct.Struct("<BHIx").pack
_UNPACK_BBHI = struct.Struct("<BBHI").unpack_from
_UNPACK_BHIX = struct.Struct("<BHIx").unpack_from


def pack_desk_fetch_answer(message: DeskFetchAnswer) -> bytes:
    car = message.car
    in_s = message.in_s
    if in_s < 0 or in_s > 1048575:
        raise OutOfRangeError("DeskFetchAnswer.in_s", in_s, 0, 1048575)
    try:
        return _PACK_BHIX(car[0], car[1], in_s + message.fetch_word * 0x100000)
    except struct.error as error:
        raise refusal(
            message, ("DeskFetchAnswer.car.origin", 0, 255), ("DeskFetchAnswer.car.number", 0, 65535)
        ) from error


def unpack_desk_fetch_answer(sender: int, data: bytes) -> DeskFetchAnswer | None:
    car_origin, car_number, word_3 = _UNPACK_BHIX(data)
    in_s = word_3 & 0xFFFFF
    fetch_word = word_3 >> 20 & 0xF
    if fetch_word > 5:
        return None
    return DeskFetchAnswer(sender, _new(Reference, (car_origin, car_number)), in_s, _FETCH_WORD[fetch_word])


def pack_desk_fetch(message: DeskFetch) -> bytes:
    car = message.car
    in_s = message.in_s
    if in_s > 1048575:
        raise OutOfRangeError("DeskFetch.in_s", in_s, 0, 1048575)
    try:
        return _PACK_BBHI(message.sequence, car[0], car[1], in_s)
    except struct.error as error:
        raise refusal(
            message,
            ("DeskFetch.sequence", 0, 255),
            ("DeskFetch.car.origin", 0, 255),
            ("DeskFetch.car.number", 0, 65535),
            ("DeskFetch.in_s", 0, 1048575),
        ) from error


def unpack_desk_fetch(sender: int, data: bytes) -> DeskFetch | None:
    sequence, car_origin, car_number, in_s = _UNPACK_BBHI(data)
    in_s = in_s & 0xFFFFF
    return DeskFetch(sender, sequence, _new(Reference, (car_origin, car_number)), in_s)


#: Every frame of this module.
FRAMES = (
    FrameCode(
        "DeskFetchAnswer",
        0x14880000,
        8,
        pack_desk_fetch_answer,
        unpack_desk_fetch_answer,
        DeskFetchAnswer,
        DeskFetchAnswer,
        ("Controller",),
        True,
    ),
    FrameCode("DeskFetch", 0x16980000, 8, pack_desk_fetch, unpack_desk_fetch, DeskFetch, DeskFetch, ("Desk",), True),
)
