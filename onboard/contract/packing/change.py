"""Bytes of the messages in ``onboard.contract.change``, and back.

Written by ``make docs`` from ``dbc/change.dbc``: change that file, never this one.
"""

import struct

from onboard.contract.base import FrameCode, OutOfRangeError, refusal
from onboard.contract.change import ChangePhase, SiteNext

_CHANGE_PHASE = tuple(ChangePhase)
_PACK_HHI = struct.Struct("<HHI").pack
_UNPACK_HHBXXX = struct.Struct("<HHBxxx").unpack_from


def pack_site_next(message: SiteNext) -> bytes:
    site_digest = message.site_digest
    if site_digest < 1:
        raise OutOfRangeError("SiteNext.site_digest", site_digest, 1, 65535)
    next_digest = message.next_digest
    if next_digest < 1:
        raise OutOfRangeError("SiteNext.next_digest", next_digest, 1, 65535)
    try:
        return _PACK_HHI(site_digest, next_digest, message.change_phase)
    except struct.error as error:
        raise refusal(message, ("SiteNext.site_digest", 1, 65535), ("SiteNext.next_digest", 1, 65535)) from error


def unpack_site_next(sender: int, data: bytes) -> SiteNext | None:
    site_digest, next_digest, change_phase = _UNPACK_HHBXXX(data)
    if site_digest < 1:
        return None
    if next_digest < 1:
        return None
    change_phase = change_phase & 0xF
    if change_phase > 2:
        return None
    return SiteNext(sender, site_digest, next_digest, _CHANGE_PHASE[change_phase])


#: Every frame of this module.
FRAMES = (
    FrameCode(
        "SiteNext",
        0x10530000,
        8,
        pack_site_next,
        unpack_site_next,
        SiteNext,
        SiteNext,
        ("Robot", "Lift", "Compartment", "Machine", "Gateway"),
        False,
    ),
)
