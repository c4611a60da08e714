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
_FROM_0_TO_250_AT_12 = {value: value << 12 for value in range(251)}
_FROM_0_TO_250_AT_20 = {value: value << 20 for value in range(251)}
_FROM_0_TO_255_AT_4 = {value: value << 4 for value in range(256)}
_FROM_1_TO_255_AT_4 = {value: value << 4 for value in range(1, 256)}
_FROM_1_TO_255_AT_56 = {value: value << 56 for value in range(1, 256)}
_LOW_4_AT_28 = tuple(value << 28 for value in range(16))
_PACK_IHBB = struct.Struct("<IHBB").pack
_PACK_II = struct.Struct("<II").pack
_UNPACK_Q = struct.Struct("<Q").unpack_from


def pack_token_grant(message: TokenGrant) -> bytes:
    token = message.token
    if token < 0 or token > 16777215:
        raise OutOfRangeError("TokenGrant.token", token, 0, 16777215)
    version = message.version
    if version < 0 or version > 268435455:
        raise OutOfRangeError("TokenGrant.version", version, 0, 268435455)
    try:
        return (
            message.token_kind + token * 0x10 + version * 0x10000000 + _FROM_1_TO_255_AT_56[message.holder]
        ).to_bytes(8, "little")
    except (KeyError, OverflowError) as error:
        raise refusal(message, ("TokenGrant.holder", 1, 255)) from error


def unpack_token_grant(sender: int, data: bytes) -> TokenGrant | None:
    (word_0,) = _UNPACK_Q(data)
    token_kind = word_0 & 0xF
    if token_kind > 4:
        return None
    token = word_0 >> 4 & 0xFFFFFF
    version = word_0 >> 28 & 0xFFFFFFF
    holder = word_0 >> 56
    if holder < 1:
        return None
    return TokenGrant(sender, _TOKEN_KIND[token_kind], token, version, holder)


def pack_token_held(message: TokenHeld) -> bytes:
    token = message.token
    if token < 0 or token > 16777215:
        raise OutOfRangeError("TokenHeld.token", token, 0, 16777215)
    version = message.version
    if version > 268435455:
        raise OutOfRangeError("TokenHeld.version", version, 0, 268435455)
    try:
        return (message.token_kind + token * 0x10 + version * 0x10000000).to_bytes(8, "little")
    except OverflowError as error:
        raise refusal(message, ("TokenHeld.version", 0, 268435455)) from error


def unpack_token_held(sender: int, data: bytes) -> TokenHeld | None:
    (word_0,) = _UNPACK_Q(data)
    token_kind = word_0 & 0xF
    if token_kind > 4:
        return None
    token = word_0 >> 4 & 0xFFFFFF
    version = word_0 >> 28 & 0xFFFFFFF
    return TokenHeld(sender, _TOKEN_KIND[token_kind], token, version)


def pack_token_refusal(message: TokenRefusal) -> bytes:
    token = message.token
    if token < 0 or token > 16777215:
        raise OutOfRangeError("TokenRefusal.token", token, 0, 16777215)
    version = message.version
    requester = message.requester
    if requester < 1:
        raise OutOfRangeError("TokenRefusal.requester", requester, 1, 255)
    try:
        return _PACK_IHBB(
            message.token_kind + token * 0x10 + _LOW_4_AT_28[version & 0xF], version >> 4, requester, message.reason
        )
    except struct.error as error:
        raise refusal(message, ("TokenRefusal.version", 0, 1048575), ("TokenRefusal.requester", 1, 255)) from error


def unpack_token_refusal(sender: int, data: bytes) -> TokenRefusal | None:
    (word_0,) = _UNPACK_Q(data)
    token_kind = word_0 & 0xF
    if token_kind > 4:
        return None
    token = word_0 >> 4 & 0xFFFFFF
    version = word_0 >> 28 & 0xFFFFF
    requester = word_0 >> 48 & 0xFF
    if requester < 1:
        return None
    reason = word_0 >> 56
    if reason > 47:
        return None
    return TokenRefusal(sender, _TOKEN_KIND[token_kind], token, version, requester, _REASON[reason])


def pack_token_request(message: TokenRequest) -> bytes:
    token = message.token
    if token < 0 or token > 16777215:
        raise OutOfRangeError("TokenRequest.token", token, 0, 16777215)
    version_seen = message.version_seen
    try:
        return _PACK_IHBB(
            message.token_kind + token * 0x10 + _LOW_4_AT_28[version_seen & 0xF],
            version_seen >> 4,
            message.itinerary_version,
            message.predecessor,
        )
    except struct.error as error:
        raise refusal(
            message,
            ("TokenRequest.version_seen", 0, 1048575),
            ("TokenRequest.itinerary_version", 0, 255),
            ("TokenRequest.predecessor", 0, 255),
        ) from error


def unpack_token_request(sender: int, data: bytes) -> TokenRequest | None:
    (word_0,) = _UNPACK_Q(data)
    token_kind = word_0 & 0xF
    if token_kind > 4:
        return None
    token = word_0 >> 4 & 0xFFFFFF
    version_seen = word_0 >> 28 & 0xFFFFF
    itinerary_version = word_0 >> 48 & 0xFF
    predecessor = word_0 >> 56
    return TokenRequest(sender, _TOKEN_KIND[token_kind], token, version_seen, itinerary_version, predecessor)


def pack_token_dispute(message: TokenDispute) -> bytes:
    token = message.token
    if token < 0 or token > 16777215:
        raise OutOfRangeError("TokenDispute.token", token, 0, 16777215)
    version = message.version
    if version < 0 or version > 268435455:
        raise OutOfRangeError("TokenDispute.version", version, 0, 268435455)
    try:
        return (
            message.token_kind + token * 0x10 + version * 0x10000000 + _FROM_1_TO_255_AT_56[message.believed]
        ).to_bytes(8, "little")
    except (KeyError, OverflowError) as error:
        raise refusal(message, ("TokenDispute.believed", 1, 255)) from error


def unpack_token_dispute(sender: int, data: bytes) -> TokenDispute | None:
    (word_0,) = _UNPACK_Q(data)
    token_kind = word_0 & 0xF
    if token_kind > 4:
        return None
    token = word_0 >> 4 & 0xFFFFFF
    version = word_0 >> 28 & 0xFFFFFFF
    believed = word_0 >> 56
    if believed < 1:
        return None
    return TokenDispute(sender, _TOKEN_KIND[token_kind], token, version, believed)


def pack_token_given(message: TokenGiven) -> bytes:
    token = message.token
    if token < 0 or token > 16777215:
        raise OutOfRangeError("TokenGiven.token", token, 0, 16777215)
    version = message.version
    if version < 0 or version > 268435455:
        raise OutOfRangeError("TokenGiven.version", version, 0, 268435455)
    try:
        return (
            message.token_kind + token * 0x10 + version * 0x10000000 + _FROM_1_TO_255_AT_56[message.holder]
        ).to_bytes(8, "little")
    except (KeyError, OverflowError) as error:
        raise refusal(message, ("TokenGiven.holder", 1, 255)) from error


def unpack_token_given(sender: int, data: bytes) -> TokenGiven | None:
    (word_0,) = _UNPACK_Q(data)
    token_kind = word_0 & 0xF
    if token_kind > 4:
        return None
    token = word_0 >> 4 & 0xFFFFFF
    version = word_0 >> 28 & 0xFFFFFFF
    holder = word_0 >> 56
    if holder < 1:
        return None
    return TokenGiven(sender, _TOKEN_KIND[token_kind], token, version, holder)


def pack_token_seen(message: TokenSeen) -> bytes:
    token = message.token
    if token < 0 or token > 16777215:
        raise OutOfRangeError("TokenSeen.token", token, 0, 16777215)
    version = message.version
    if version < 0 or version > 268435455:
        raise OutOfRangeError("TokenSeen.version", version, 0, 268435455)
    try:
        return (
            message.token_kind + token * 0x10 + version * 0x10000000 + _FROM_1_TO_255_AT_56[message.holder]
        ).to_bytes(8, "little")
    except (KeyError, OverflowError) as error:
        raise refusal(message, ("TokenSeen.holder", 1, 255)) from error


def unpack_token_seen(sender: int, data: bytes) -> TokenSeen | None:
    (word_0,) = _UNPACK_Q(data)
    token_kind = word_0 & 0xF
    if token_kind > 4:
        return None
    token = word_0 >> 4 & 0xFFFFFF
    version = word_0 >> 28 & 0xFFFFFFF
    holder = word_0 >> 56
    if holder < 1:
        return None
    return TokenSeen(sender, _TOKEN_KIND[token_kind], token, version, holder)


def pack_token_assigned(message: TokenAssigned) -> bytes:
    token = message.token
    if token < 0 or token > 16777215:
        raise OutOfRangeError("TokenAssigned.token", token, 0, 16777215)
    version = message.version
    if version < 0 or version > 268435455:
        raise OutOfRangeError("TokenAssigned.version", version, 0, 268435455)
    try:
        return (
            message.token_kind + token * 0x10 + version * 0x10000000 + _FROM_1_TO_255_AT_56[message.holder]
        ).to_bytes(8, "little")
    except (KeyError, OverflowError) as error:
        raise refusal(message, ("TokenAssigned.holder", 1, 255)) from error


def unpack_token_assigned(sender: int, data: bytes) -> TokenAssigned | None:
    (word_0,) = _UNPACK_Q(data)
    token_kind = word_0 & 0xF
    if token_kind > 4:
        return None
    token = word_0 >> 4 & 0xFFFFFF
    version = word_0 >> 28 & 0xFFFFFFF
    holder = word_0 >> 56
    if holder < 1:
        return None
    return TokenAssigned(sender, _TOKEN_KIND[token_kind], token, version, holder)


def pack_regeneration(message: Regeneration) -> bytes:
    tokens = message.tokens
    if tokens < 0 or tokens > 65535:
        raise OutOfRangeError("Regeneration.tokens", tokens, 0, 65535)
    digest = message.digest
    if digest > 65535:
        raise OutOfRangeError("Regeneration.digest", digest, 0, 65535)
    try:
        return _PACK_II(
            message.regeneration_phase
            + _FROM_1_TO_255_AT_4[message.epoch]
            + _FROM_0_TO_250_AT_12[message.lost]
            + _FROM_0_TO_250_AT_20[message.absent]
            + _LOW_4_AT_28[tokens & 0xF],
            (tokens >> 4) + digest * 0x1000,
        )
    except (KeyError, struct.error) as error:
        raise refusal(
            message,
            ("Regeneration.epoch", 1, 255),
            ("Regeneration.lost", 0, 250),
            ("Regeneration.absent", 0, 250),
            ("Regeneration.digest", 0, 65535),
        ) from error


def unpack_regeneration(sender: int, data: bytes) -> Regeneration | None:
    (word_0,) = _UNPACK_Q(data)
    regeneration_phase = word_0 & 0xF
    if regeneration_phase > 5:
        return None
    epoch = word_0 >> 4 & 0xFF
    if epoch < 1:
        return None
    lost = word_0 >> 12 & 0xFF
    if lost > 250:
        return None
    absent = word_0 >> 20 & 0xFF
    if absent > 250:
        return None
    tokens = word_0 >> 28 & 0xFFFF
    digest = word_0 >> 44 & 0xFFFF
    return Regeneration(sender, _REGENERATION_PHASE[regeneration_phase], epoch, lost, absent, tokens, digest)


def pack_regeneration_state(message: RegenerationState) -> bytes:
    tokens = message.tokens
    if tokens < 0 or tokens > 65535:
        raise OutOfRangeError("RegenerationState.tokens", tokens, 0, 65535)
    digest = message.digest
    if digest < 0 or digest > 65535:
        raise OutOfRangeError("RegenerationState.digest", digest, 0, 65535)
    try:
        return (
            message.regeneration_phase
            + _FROM_0_TO_255_AT_4[message.epoch]
            + tokens * 0x1000
            + (digest + message.reason * 0x10000) * 0x10000000
        ).to_bytes(8, "little")
    except KeyError as error:
        raise refusal(message, ("RegenerationState.epoch", 0, 255)) from error


def unpack_regeneration_state(sender: int, data: bytes) -> RegenerationState | None:
    (word_0,) = _UNPACK_Q(data)
    regeneration_phase = word_0 & 0xF
    if regeneration_phase > 5:
        return None
    epoch = word_0 >> 4 & 0xFF
    tokens = word_0 >> 12 & 0xFFFF
    digest = word_0 >> 28 & 0xFFFF
    reason = word_0 >> 44 & 0xFF
    if reason > 47:
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
