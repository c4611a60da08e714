"""Bytes of the messages in ``onboard.contract.announce``, and back.

Written by ``make docs`` from ``dbc/announce.dbc``: change that file, never this one.
"""

import struct

from onboard.contract.announce import FetchTime, FetchWord
from onboard.contract.base import FrameCode, Reference, refusal

_new = tuple.__new__
_FETCH_WORD = tuple(FetchWord)
_PACK_BHIB = struct.Struct("<BHIB").pack
_UNPACK_BHIB = struct.Struct("<BHIB").unpack_from


def pack_fetch_time(message: FetchTime) -> bytes:
    car = message.car
    try:
        return _PACK_BHIB(car[0], car[1], message.fetch_ms, message.fetch_word)
    except struct.error as error:
        raise refusal(
            message,
            ("FetchTime.car.origin", 0, 255),
            ("FetchTime.car.number", 0, 65535),
            ("FetchTime.fetch_ms", 0, 4294967295),
        ) from error


def unpack_fetch_time(sender: int, data: bytes) -> FetchTime | None:
    car_origin, car_number, fetch_ms, fetch_word = _UNPACK_BHIB(data)
    fetch_word = fetch_word & 0xF
    if fetch_word > 5:
        return None
    return FetchTime(sender, _new(Reference, (car_origin, car_number)), fetch_ms, _FETCH_WORD[fetch_word])


#: Every frame of this module.
FRAMES = (
    FrameCode(
        "FetchTime",
        0x0E440000,
        8,
        pack_fetch_time,
        unpack_fetch_time,
        FetchTime,
        FetchTime,
        ("Compartment", "Gateway"),
        False,
    ),
)
