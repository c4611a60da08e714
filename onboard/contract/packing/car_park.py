"""Bytes of the messages in ``onboard.contract.car_park``, and back.

Written by ``make docs`` from ``dbc/car_park.dbc``: change that file, never this one.
"""

import struct

from onboard.contract.base import FrameCode, OutOfRangeError, Reference, refusal
from onboard.contract.car_park import Promise

_new = tuple.__new__
_PACK_BHIB = struct.Struct("<BHIB").pack
_UNPACK_BHIB = struct.Struct("<BHIB").unpack_from


def pack_promise(message: Promise) -> bytes:
    car = message.car
    spread_ms = message.spread_ms
    if spread_ms < 0 or spread_ms > 127500:
        raise OutOfRangeError("Promise.spread_ms", spread_ms, 0, 127500)
    try:
        return _PACK_BHIB(car[0], car[1], message.ready_ms, spread_ms // 500)
    except struct.error as error:
        raise refusal(
            message,
            ("Promise.car.origin", 0, 255),
            ("Promise.car.number", 0, 65535),
            ("Promise.ready_ms", 0, 4294967295),
        ) from error


def unpack_promise(sender: int, data: bytes) -> Promise | None:
    car_origin, car_number, ready_ms, spread_ms = _UNPACK_BHIB(data)
    spread_ms = spread_ms * 500
    return Promise(sender, _new(Reference, (car_origin, car_number)), ready_ms, spread_ms)


#: Every frame of this module.
FRAMES = (FrameCode("Promise", 0x0E430000, 8, pack_promise, unpack_promise, Promise, Promise, ("Compartment",), False),)
#: CRC-32 over this system's DBC: part of the digest of its sites (docs/site-file.md).
WORDS = 0x678A87B2
