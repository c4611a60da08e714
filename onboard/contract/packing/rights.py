"""Bytes of the messages in ``onboard.contract.rights``, and back.

Written by ``make docs`` from ``dbc/fleet.dbc``: change that file, never this one.
"""

import struct

from onboard.contract.base import FrameCode, OutOfRangeError, refusal
from onboard.contract.codes import Reason, RegenerationPhase, TokenKind
from onboard.contract.rights import (
    Regeneration,
    RegenerationState,
    TokenAssigned,
    TokenDispute,
    TokenGiven,
    TokenGrant,
    TokenHeld,
    TokenRefusal,
    TokenRequest,
    TokenSeen,
)

_REASON = tuple(Reason)
_REGENERATION_PHASE = tuple(RegenerationPhase)
_TOKEN_KIND = tuple(TokenKind)
_PACK_BHBBHB = struct.Struct("<BHBBHB").pack
_PACK_HHBBBB = struct.Struct("<HHBBBB").pack
_PACK_HHBBH = struct.Struct("<HHBBH").pack
_PACK_IBHB = struct.Struct("<IBHB").pack
_PACK_II = struct.Struct("<II").pack
_UNPACK_HHBBBB = struct.Struct("<HHBBBB").unpack_from
_UNPACK_HHBBBX = struct.Struct("<HHBBBx").unpack_from
_UNPACK_II = struct.Struct("<II").unpack_from


def pack_token_grant(message: TokenGrant) -> bytes:
    token = message.token
    holder = message.holder
    if holder < 1:
        raise OutOfRangeError("TokenGrant.holder", holder, 1, 255)
    try:
        return _PACK_IBHB(message.token_kind + message.version * 0x10, token & 0xFF, token >> 8, holder)
    except struct.error as error:
        raise refusal(
            message,
            ("TokenGrant.token", 0, 16777215),
            ("TokenGrant.version", 0, 268435455),
            ("TokenGrant.holder", 1, 255),
        ) from error


def unpack_token_grant(sender: int, data: bytes) -> TokenGrant | None:
    word_0, word_4 = _UNPACK_II(data)
    token_kind = word_0 & 0xF
    if token_kind > 4:
        return None
    version = word_0 >> 4
    token = word_4 & 0xFFFFFF
    holder = word_4 >> 24
    if holder < 1:
        return None
    return TokenGrant(sender, _TOKEN_KIND[token_kind], token, version, holder)


def pack_token_held(message: TokenHeld) -> bytes:
    token = message.token
    if token > 16777215:
        raise OutOfRangeError("TokenHeld.token", token, 0, 16777215)
    try:
        return _PACK_II(message.token_kind + message.version * 0x10, token)
    except struct.error as error:
        raise refusal(message, ("TokenHeld.token", 0, 16777215), ("TokenHeld.version", 0, 268435455)) from error


def unpack_token_held(sender: int, data: bytes) -> TokenHeld | None:
    word_0, token = _UNPACK_II(data)
    token_kind = word_0 & 0xF
    if token_kind > 4:
        return None
    version = word_0 >> 4
    token = token & 0xFFFFFF
    return TokenHeld(sender, _TOKEN_KIND[token_kind], token, version)


def pack_token_refusal(message: TokenRefusal) -> bytes:
    token = message.token
    version = message.version
    requester = message.requester
    if requester < 1:
        raise OutOfRangeError("TokenRefusal.requester", requester, 1, 255)
    try:
        return _PACK_BHBBHB(
            message.token_kind + (version & 0xF) * 0x10,
            version >> 4,
            requester,
            token & 0xFF,
            token >> 8,
            message.reason,
        )
    except struct.error as error:
        raise refusal(
            message,
            ("TokenRefusal.token", 0, 16777215),
            ("TokenRefusal.version", 0, 1048575),
            ("TokenRefusal.requester", 1, 255),
        ) from error


def unpack_token_refusal(sender: int, data: bytes) -> TokenRefusal | None:
    word_0, word_4 = _UNPACK_II(data)
    token_kind = word_0 & 0xF
    if token_kind > 4:
        return None
    version = word_0 >> 4 & 0xFFFFF
    requester = word_0 >> 24
    if requester < 1:
        return None
    token = word_4 & 0xFFFFFF
    reason = word_4 >> 24
    if reason > 47:
        return None
    return TokenRefusal(sender, _TOKEN_KIND[token_kind], token, version, requester, _REASON[reason])


def pack_token_request(message: TokenRequest) -> bytes:
    token = message.token
    version_seen = message.version_seen
    try:
        return _PACK_BHBBHB(
            message.token_kind + (version_seen & 0xF) * 0x10,
            version_seen >> 4,
            message.itinerary_version,
            token & 0xFF,
            token >> 8,
            message.predecessor,
        )
    except struct.error as error:
        raise refusal(
            message,
            ("TokenRequest.token", 0, 16777215),
            ("TokenRequest.version_seen", 0, 1048575),
            ("TokenRequest.itinerary_version", 0, 255),
            ("TokenRequest.predecessor", 0, 255),
        ) from error


def unpack_token_request(sender: int, data: bytes) -> TokenRequest | None:
    word_0, word_4 = _UNPACK_II(data)
    token_kind = word_0 & 0xF
    if token_kind > 4:
        return None
    version_seen = word_0 >> 4 & 0xFFFFF
    itinerary_version = word_0 >> 24
    token = word_4 & 0xFFFFFF
    predecessor = word_4 >> 24
    return TokenRequest(sender, _TOKEN_KIND[token_kind], token, version_seen, itinerary_version, predecessor)


def pack_token_dispute(message: TokenDispute) -> bytes:
    token = message.token
    believed = message.believed
    if believed < 1:
        raise OutOfRangeError("TokenDispute.believed", believed, 1, 255)
    try:
        return _PACK_IBHB(message.token_kind + message.version * 0x10, token & 0xFF, token >> 8, believed)
    except struct.error as error:
        raise refusal(
            message,
            ("TokenDispute.token", 0, 16777215),
            ("TokenDispute.version", 0, 268435455),
            ("TokenDispute.believed", 1, 255),
        ) from error


def unpack_token_dispute(sender: int, data: bytes) -> TokenDispute | None:
    word_0, word_4 = _UNPACK_II(data)
    token_kind = word_0 & 0xF
    if token_kind > 4:
        return None
    version = word_0 >> 4
    token = word_4 & 0xFFFFFF
    believed = word_4 >> 24
    if believed < 1:
        return None
    return TokenDispute(sender, _TOKEN_KIND[token_kind], token, version, believed)


def pack_token_given(message: TokenGiven) -> bytes:
    token = message.token
    holder = message.holder
    if holder < 1:
        raise OutOfRangeError("TokenGiven.holder", holder, 1, 255)
    try:
        return _PACK_IBHB(message.token_kind + message.version * 0x10, token & 0xFF, token >> 8, holder)
    except struct.error as error:
        raise refusal(
            message,
            ("TokenGiven.token", 0, 16777215),
            ("TokenGiven.version", 0, 268435455),
            ("TokenGiven.holder", 1, 255),
        ) from error


def unpack_token_given(sender: int, data: bytes) -> TokenGiven | None:
    word_0, word_4 = _UNPACK_II(data)
    token_kind = word_0 & 0xF
    if token_kind > 4:
        return None
    version = word_0 >> 4
    token = word_4 & 0xFFFFFF
    holder = word_4 >> 24
    if holder < 1:
        return None
    return TokenGiven(sender, _TOKEN_KIND[token_kind], token, version, holder)


def pack_token_seen(message: TokenSeen) -> bytes:
    token = message.token
    holder = message.holder
    if holder < 1:
        raise OutOfRangeError("TokenSeen.holder", holder, 1, 255)
    try:
        return _PACK_IBHB(message.token_kind + message.version * 0x10, token & 0xFF, token >> 8, holder)
    except struct.error as error:
        raise refusal(
            message, ("TokenSeen.token", 0, 16777215), ("TokenSeen.version", 0, 268435455), ("TokenSeen.holder", 1, 255)
        ) from error


def unpack_token_seen(sender: int, data: bytes) -> TokenSeen | None:
    word_0, word_4 = _UNPACK_II(data)
    token_kind = word_0 & 0xF
    if token_kind > 4:
        return None
    version = word_0 >> 4
    token = word_4 & 0xFFFFFF
    holder = word_4 >> 24
    if holder < 1:
        return None
    return TokenSeen(sender, _TOKEN_KIND[token_kind], token, version, holder)


def pack_token_assigned(message: TokenAssigned) -> bytes:
    token = message.token
    holder = message.holder
    if holder < 1:
        raise OutOfRangeError("TokenAssigned.holder", holder, 1, 255)
    try:
        return _PACK_IBHB(message.token_kind + message.version * 0x10, token & 0xFF, token >> 8, holder)
    except struct.error as error:
        raise refusal(
            message,
            ("TokenAssigned.token", 0, 16777215),
            ("TokenAssigned.version", 0, 268435455),
            ("TokenAssigned.holder", 1, 255),
        ) from error


def unpack_token_assigned(sender: int, data: bytes) -> TokenAssigned | None:
    word_0, word_4 = _UNPACK_II(data)
    token_kind = word_0 & 0xF
    if token_kind > 4:
        return None
    version = word_0 >> 4
    token = word_4 & 0xFFFFFF
    holder = word_4 >> 24
    if holder < 1:
        return None
    return TokenAssigned(sender, _TOKEN_KIND[token_kind], token, version, holder)


def pack_regeneration(message: Regeneration) -> bytes:
    epoch = message.epoch
    if epoch < 1:
        raise OutOfRangeError("Regeneration.epoch", epoch, 1, 255)
    lost = message.lost
    if lost > 250:
        raise OutOfRangeError("Regeneration.lost", lost, 0, 250)
    absent = message.absent
    if absent > 250:
        raise OutOfRangeError("Regeneration.absent", absent, 0, 250)
    try:
        return _PACK_HHBBBB(message.tokens, message.digest, epoch, lost, absent, message.regeneration_phase)
    except struct.error as error:
        raise refusal(
            message,
            ("Regeneration.epoch", 1, 255),
            ("Regeneration.lost", 0, 250),
            ("Regeneration.absent", 0, 250),
            ("Regeneration.tokens", 0, 65535),
            ("Regeneration.digest", 0, 65535),
        ) from error


def unpack_regeneration(sender: int, data: bytes) -> Regeneration | None:
    tokens, digest, epoch, lost, absent, regeneration_phase = _UNPACK_HHBBBB(data)
    if epoch < 1:
        return None
    if lost > 250:
        return None
    if absent > 250:
        return None
    regeneration_phase = regeneration_phase & 0xF
    if regeneration_phase > 5:
        return None
    return Regeneration(sender, _REGENERATION_PHASE[regeneration_phase], epoch, lost, absent, tokens, digest)


def pack_regeneration_state(message: RegenerationState) -> bytes:
    try:
        return _PACK_HHBBH(message.tokens, message.digest, message.epoch, message.reason, message.regeneration_phase)
    except struct.error as error:
        raise refusal(
            message,
            ("RegenerationState.epoch", 0, 255),
            ("RegenerationState.tokens", 0, 65535),
            ("RegenerationState.digest", 0, 65535),
        ) from error


def unpack_regeneration_state(sender: int, data: bytes) -> RegenerationState | None:
    tokens, digest, epoch, reason, regeneration_phase = _UNPACK_HHBBBX(data)
    if reason > 47:
        return None
    regeneration_phase = regeneration_phase & 0xF
    if regeneration_phase > 5:
        return None
    return RegenerationState(sender, _REGENERATION_PHASE[regeneration_phase], epoch, tokens, digest, _REASON[reason])


#: Every frame of this module.
FRAMES = (
    FrameCode(
        "TokenGrant",
        0x01100000,
        8,
        pack_token_grant,
        unpack_token_grant,
        TokenGrant,
        TokenGrant,
        ("Robot", "Lift", "Compartment", "Machine"),
        False,
    ),
    FrameCode(
        "TokenHeld",
        0x01110000,
        8,
        pack_token_held,
        unpack_token_held,
        TokenHeld,
        TokenHeld,
        ("Robot", "Lift", "Compartment", "Machine"),
        False,
    ),
    FrameCode(
        "TokenRefusal",
        0x02120000,
        8,
        pack_token_refusal,
        unpack_token_refusal,
        TokenRefusal,
        TokenRefusal,
        ("Robot", "Lift", "Compartment", "Machine"),
        False,
    ),
    FrameCode(
        "TokenRequest",
        0x02130000,
        8,
        pack_token_request,
        unpack_token_request,
        TokenRequest,
        TokenRequest,
        ("Robot", "Lift", "Compartment", "Machine"),
        False,
    ),
    FrameCode(
        "TokenDispute",
        0x02140000,
        8,
        pack_token_dispute,
        unpack_token_dispute,
        TokenDispute,
        TokenDispute,
        ("Robot", "Lift", "Compartment", "Machine"),
        False,
    ),
    FrameCode(
        "TokenGiven",
        0x02150000,
        8,
        pack_token_given,
        unpack_token_given,
        TokenGiven,
        TokenGiven,
        ("Robot", "Lift", "Compartment", "Machine"),
        False,
    ),
    FrameCode(
        "TokenSeen",
        0x02160000,
        8,
        pack_token_seen,
        unpack_token_seen,
        TokenSeen,
        TokenSeen,
        ("Robot", "Lift", "Compartment", "Machine"),
        False,
    ),
    FrameCode(
        "TokenAssigned",
        0x02170000,
        8,
        pack_token_assigned,
        unpack_token_assigned,
        TokenAssigned,
        TokenAssigned,
        ("Gateway",),
        False,
    ),
    FrameCode(
        "Regeneration",
        0x086A0000,
        8,
        pack_regeneration,
        unpack_regeneration,
        Regeneration,
        Regeneration,
        ("Gateway",),
        False,
    ),
    FrameCode(
        "RegenerationState",
        0x086B0000,
        8,
        pack_regeneration_state,
        unpack_regeneration_state,
        RegenerationState,
        RegenerationState,
        ("Robot", "Lift", "Compartment", "Machine"),
        False,
    ),
)
