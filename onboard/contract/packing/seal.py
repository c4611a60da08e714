"""Bytes of the messages in ``onboard.contract.seal``, and back.

Written by ``make docs`` from ``dbc/seal.dbc``: change that file, never this one.
"""

import struct

from onboard.contract.base import FrameCode, OutOfRangeError, refusal
from onboard.contract.seal import Seal, SealAnswer, SealChallenge, SealFault, SealTo, SealWord

_SEAL_WORD = tuple(SealWord)
_PACK_BHIX = struct.Struct("<BHIx").pack
_PACK_BIXXX = struct.Struct("<BIxxx").pack
_PACK_HHI = struct.Struct("<HHI").pack
_PACK_II = struct.Struct("<II").pack
_UNPACK_BIXXX = struct.Struct("<BIxxx").unpack_from
_UNPACK_II = struct.Struct("<II").unpack_from
_UNPACK_Q = struct.Struct("<Q").unpack_from


def pack_seal(message: Seal) -> bytes:
    tag = message.tag
    try:
        return _PACK_HHI(message.counter, tag & 0xFFFF, tag >> 16)
    except struct.error as error:
        raise refusal(message, ("Seal.counter", 0, 65535), ("Seal.tag", 0, 281474976710655)) from error


def unpack_seal(sender: int, data: bytes) -> Seal | None:
    (word_0,) = _UNPACK_Q(data)
    counter = word_0 & 0xFFFF
    tag = word_0 >> 16
    return Seal(sender, counter, tag)


def pack_seal_to(message: SealTo) -> bytes:
    tag = message.tag
    try:
        return _PACK_HHI(message.counter, tag & 0xFFFF, tag >> 16)
    except struct.error as error:
        raise refusal(message, ("SealTo.counter", 0, 65535), ("SealTo.tag", 0, 281474976710655)) from error


def unpack_seal_to(sender: int, data: bytes) -> SealTo | None:
    (word_0,) = _UNPACK_Q(data)
    counter = word_0 & 0xFFFF
    tag = word_0 >> 16
    return SealTo(sender, counter, tag)


def pack_seal_challenge(message: SealChallenge) -> bytes:
    nonce = message.nonce
    try:
        return _PACK_BHIX(message.whom, nonce & 0xFFFF, nonce >> 16)
    except struct.error as error:
        raise refusal(message, ("SealChallenge.whom", 0, 255), ("SealChallenge.nonce", 0, 281474976710655)) from error


def unpack_seal_challenge(sender: int, data: bytes) -> SealChallenge | None:
    (word_0,) = _UNPACK_Q(data)
    whom = word_0 & 0xFF
    nonce = word_0 >> 8 & 0xFFFFFFFFFFFF
    return SealChallenge(sender, whom, nonce)


def pack_seal_answer(message: SealAnswer) -> bytes:
    life = message.life
    if life < 1:
        raise OutOfRangeError("SealAnswer.life", life, 1, 4294967295)
    try:
        return _PACK_II(message.number, life)
    except struct.error as error:
        raise refusal(message, ("SealAnswer.number", 0, 4294967295), ("SealAnswer.life", 1, 4294967295)) from error


def unpack_seal_answer(sender: int, data: bytes) -> SealAnswer | None:
    number, life = _UNPACK_II(data)
    if life < 1:
        return None
    return SealAnswer(sender, number, life)


def pack_seal_fault(message: SealFault) -> bytes:
    about = message.about
    if about < 1:
        raise OutOfRangeError("SealFault.about", about, 1, 255)
    count = message.count
    if count < 1 or count > 65535:
        raise OutOfRangeError("SealFault.count", count, 1, 65535)
    try:
        return _PACK_BIXXX(about, message.fault + count * 0x10)
    except struct.error as error:
        raise refusal(message, ("SealFault.about", 1, 255)) from error


def unpack_seal_fault(sender: int, data: bytes) -> SealFault | None:
    about, word_1 = _UNPACK_BIXXX(data)
    if about < 1:
        return None
    fault = word_1 & 0xF
    if fault > 4:
        return None
    count = word_1 >> 4 & 0xFFFF
    if count < 1:
        return None
    return SealFault(sender, about, _SEAL_WORD[fault], count)


#: Every frame of this module.
FRAMES = (
    FrameCode(
        "Seal",
        0x01030000,
        8,
        pack_seal,
        unpack_seal,
        Seal,
        Seal,
        ("Robot", "Lift", "Compartment", "Machine", "Gateway"),
        False,
    ),
    FrameCode(
        "SealTo",
        0x01040000,
        8,
        pack_seal_to,
        unpack_seal_to,
        SealTo,
        SealTo,
        ("Robot", "Lift", "Compartment", "Machine", "Gateway"),
        False,
    ),
    FrameCode(
        "SealChallenge",
        0x10540000,
        8,
        pack_seal_challenge,
        unpack_seal_challenge,
        SealChallenge,
        SealChallenge,
        ("Robot", "Lift", "Compartment", "Machine", "Gateway"),
        False,
    ),
    FrameCode(
        "SealAnswer",
        0x10550000,
        8,
        pack_seal_answer,
        unpack_seal_answer,
        SealAnswer,
        SealAnswer,
        ("Robot", "Lift", "Compartment", "Machine", "Gateway"),
        False,
    ),
    FrameCode(
        "SealFault",
        0x1EF10000,
        8,
        pack_seal_fault,
        unpack_seal_fault,
        SealFault,
        SealFault,
        ("Robot", "Lift", "Compartment", "Machine", "Gateway"),
        False,
    ),
)
