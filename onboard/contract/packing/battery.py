"""Bytes of the messages in ``onboard.contract.battery``, and back.

Written by ``make docs`` from ``dbc/battery.dbc``: change that file, never this one.
"""

import struct

from onboard.contract.base import FrameCode, OutOfRangeError
from onboard.contract.battery import BatteryLevel

_PACK_IXXXX = struct.Struct("<Ixxxx").pack
_UNPACK_HXXXXXX = struct.Struct("<Hxxxxxx").unpack_from


def pack_battery_level(message: BatteryLevel) -> bytes:
    charge_permille = message.charge_permille
    if charge_permille < 0 or charge_permille > 1000:
        raise OutOfRangeError("BatteryLevel.charge_permille", charge_permille, 0, 1000)
    if message.charging:
        charge_permille += 0x400
    if message.bids:
        charge_permille += 0x800
    return _PACK_IXXXX(charge_permille)


def unpack_battery_level(sender: int, data: bytes) -> BatteryLevel | None:
    (word_0,) = _UNPACK_HXXXXXX(data)
    charge_permille = word_0 & 0x3FF
    if charge_permille > 1000:
        return None
    return BatteryLevel(sender, charge_permille, word_0 & 0x400 != 0, word_0 & 0x800 != 0)


#: Every frame of this module.
FRAMES = (
    FrameCode(
        "BatteryLevel",
        0x1EF20000,
        8,
        pack_battery_level,
        unpack_battery_level,
        BatteryLevel,
        BatteryLevel,
        ("Robot",),
        False,
    ),
)
