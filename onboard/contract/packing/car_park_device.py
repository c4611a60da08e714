"""Bytes of the messages in ``onboard.contract.car_park_device``, and back.

Written by ``make docs`` from ``dbc/car_park.dbc``: change that file, never this one.
"""

import struct

from onboard.contract.base import FrameCode, OutOfRangeError, Reference, refusal
from onboard.contract.car_park_device import DeskPromise

_new = tuple.__new__
_PACK_BHBHH = struct.Struct("<BHBHH").pack
_UNPACK_BHIX = struct.Struct("<BHIx").unpack_from


def pack_desk_promise(message: DeskPromise) -> bytes:
    car = message.car
    in_ms = message.in_ms
    spread_ms = message.spread_ms
    if spread_ms < 0 or spread_ms > 127500:
        raise OutOfRangeError("DeskPromise.spread_ms", spread_ms, 0, 127500)
    try:
        return _PACK_BHBHH(car[0], car[1], in_ms & 0xFF, in_ms >> 8, spread_ms // 500)
    except struct.error as error:
        raise refusal(
            message,
            ("DeskPromise.car.origin", 0, 255),
            ("DeskPromise.car.number", 0, 65535),
            ("DeskPromise.in_ms", 0, 16777215),
        ) from error


def unpack_desk_promise(sender: int, data: bytes) -> DeskPromise | None:
    car_origin, car_number, word_3 = _UNPACK_BHIX(data)
    in_ms = word_3 & 0xFFFFFF
    spread_ms = (word_3 >> 24) * 500
    return DeskPromise(sender, _new(Reference, (car_origin, car_number)), in_ms, spread_ms)


#: Every frame of this module.
FRAMES = (
    FrameCode(
        "DeskPromise",
        0x14870000,
        8,
        pack_desk_promise,
        unpack_desk_promise,
        DeskPromise,
        DeskPromise,
        ("Controller",),
        True,
    ),
)
