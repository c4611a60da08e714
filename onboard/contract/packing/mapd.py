"""Bytes of the messages in ``onboard.contract.mapd``, and back.

Written by ``make docs`` from ``dbc/mapd.dbc``: change that file, never this one.
"""

import struct

from onboard.contract.base import FrameCode, OutOfRangeError, refusal
from onboard.contract.mapd import PathHead, PathMoves, StepRound, StepState, StepTurn, TurnRequest

_FROM_0_TO_1_AT_46 = {value: value << 46 for value in range(2)}
_FROM_0_TO_250_AT_38 = {value: value << 38 for value in range(251)}
_FROM_0_TO_255_AT_22 = {value: value << 22 for value in range(256)}
_FROM_0_TO_255_AT_30 = {value: value << 30 for value in range(256)}
_PACK_BBHI = struct.Struct("<BBHI").pack
_PACK_BHBHH = struct.Struct("<BHBHH").pack
_PACK_HBBI = struct.Struct("<HBBI").pack
_PACK_HHI = struct.Struct("<HHI").pack
_PACK_IXXXX = struct.Struct("<Ixxxx").pack
_UNPACK_HBBI = struct.Struct("<HBBI").unpack_from
_UNPACK_HHI = struct.Struct("<HHI").unpack_from
_UNPACK_IHH = struct.Struct("<IHH").unpack_from
_UNPACK_IXXXX = struct.Struct("<Ixxxx").unpack_from
_UNPACK_Q = struct.Struct("<Q").unpack_from


def pack_step_round(message: StepRound) -> bytes:
    step = message.step
    if step > 4194303:
        raise OutOfRangeError("StepRound.step", step, 0, 4194303)
    try:
        return _PACK_HBBI(message.open_tasks, message.attempt, message.bidding, step)
    except struct.error as error:
        raise refusal(
            message, ("StepRound.step", 0, 4194303), ("StepRound.open_tasks", 0, 65535), ("StepRound.attempt", 0, 255)
        ) from error


def unpack_step_round(sender: int, data: bytes) -> StepRound | None:
    open_tasks, attempt, bidding, step = _UNPACK_HBBI(data)
    step = step & 0x3FFFFF
    return StepRound(sender, step, open_tasks, attempt, bidding & 0x1 != 0)


def pack_step_turn(message: StepTurn) -> bytes:
    step = message.step
    if step < 0 or step > 4194303:
        raise OutOfRangeError("StepTurn.step", step, 0, 4194303)
    try:
        return (
            step
            + _FROM_0_TO_255_AT_22[message.index]
            + _FROM_0_TO_255_AT_30[message.changes]
            + _FROM_0_TO_250_AT_38[message.robot]
            + _FROM_0_TO_1_AT_46[message.won]
        ).to_bytes(8, "little")
    except KeyError as error:
        raise refusal(
            message,
            ("StepTurn.index", 0, 255),
            ("StepTurn.changes", 0, 255),
            ("StepTurn.robot", 0, 250),
            ("StepTurn.won", 0, 1),
        ) from error


def unpack_step_turn(sender: int, data: bytes) -> StepTurn | None:
    (word_0,) = _UNPACK_Q(data)
    step = word_0 & 0x3FFFFF
    index = word_0 >> 22 & 0xFF
    changes = word_0 >> 30 & 0xFF
    robot = word_0 >> 38 & 0xFF
    if robot > 250:
        return None
    won = word_0 >> 46 & 0x1
    return StepTurn(sender, step, index, changes, robot, won)


def pack_turn_request(message: TurnRequest) -> bytes:
    step = message.step
    if step < 0 or step > 4194303:
        raise OutOfRangeError("TurnRequest.step", step, 0, 4194303)
    try:
        return _PACK_IXXXX(step + _FROM_0_TO_255_AT_22[message.attempt])
    except (KeyError, struct.error) as error:
        raise refusal(message, ("TurnRequest.attempt", 0, 255)) from error


def unpack_turn_request(sender: int, data: bytes) -> TurnRequest | None:
    (word_0,) = _UNPACK_IXXXX(data)
    step = word_0 & 0x3FFFFF
    attempt = word_0 >> 22 & 0xFF
    return TurnRequest(sender, step, attempt)


def pack_path_head(message: PathHead) -> bytes:
    step = message.step
    if step < 0 or step > 4194303:
        raise OutOfRangeError("PathHead.step", step, 0, 4194303)
    cell = message.cell
    if cell > 63999:
        raise OutOfRangeError("PathHead.cell", cell, 0, 63999)
    moves = message.moves
    if moves > 4095:
        raise OutOfRangeError("PathHead.moves", moves, 0, 4095)
    if message.kept:
        step += 0x400000
    try:
        return _PACK_BHBHH(step & 0xFF, (step >> 8), message.version, cell, moves)
    except struct.error as error:
        raise refusal(
            message, ("PathHead.cell", 0, 63999), ("PathHead.moves", 0, 4095), ("PathHead.version", 0, 255)
        ) from error


def unpack_path_head(sender: int, data: bytes) -> PathHead | None:
    word_0, cell, moves = _UNPACK_IHH(data)
    step = word_0 & 0x3FFFFF
    version = word_0 >> 24
    if cell > 63999:
        return None
    moves = moves & 0xFFF
    return PathHead(sender, step, cell, moves, version, word_0 & 0x400000 != 0)


def pack_path_moves(message: PathMoves) -> bytes:
    codes = message.codes
    try:
        return _PACK_BBHI(message.version, message.part, codes & 0xFFFF, codes >> 16)
    except struct.error as error:
        raise refusal(
            message, ("PathMoves.version", 0, 255), ("PathMoves.part", 0, 255), ("PathMoves.codes", 0, 281474976710655)
        ) from error


def unpack_path_moves(sender: int, data: bytes) -> PathMoves | None:
    (word_0,) = _UNPACK_Q(data)
    version = word_0 & 0xFF
    part = word_0 >> 8 & 0xFF
    codes = word_0 >> 16
    return PathMoves(sender, version, part, codes)


def pack_step_state(message: StepState) -> bytes:
    step = message.step
    if step < 0 or step > 4194303:
        raise OutOfRangeError("StepState.step", step, 0, 4194303)
    cell = message.cell
    if cell > 63999:
        raise OutOfRangeError("StepState.cell", cell, 0, 63999)
    if message.loaded:
        step += 0x400000
    if message.served:
        step += 0x800000
    try:
        return _PACK_HHI(cell, message.task, step)
    except struct.error as error:
        raise refusal(message, ("StepState.cell", 0, 63999), ("StepState.task", 0, 65535)) from error


def unpack_step_state(sender: int, data: bytes) -> StepState | None:
    cell, task, word_4 = _UNPACK_HHI(data)
    if cell > 63999:
        return None
    step = word_4 & 0x3FFFFF
    return StepState(sender, step, cell, task, word_4 & 0x400000 != 0, word_4 & 0x800000 != 0)


#: Every frame of this module.
FRAMES = (
    FrameCode("StepRound", 0x05B90000, 8, pack_step_round, unpack_step_round, StepRound, StepRound, ("Desk",), False),
    FrameCode("StepTurn", 0x05BB0000, 8, pack_step_turn, unpack_step_turn, StepTurn, StepTurn, ("Desk",), False),
    FrameCode(
        "TurnRequest",
        0x06BA0000,
        8,
        pack_turn_request,
        unpack_turn_request,
        TurnRequest,
        TurnRequest,
        ("Vehicle",),
        False,
    ),
    FrameCode("PathHead", 0x06BC0000, 8, pack_path_head, unpack_path_head, PathHead, PathHead, ("Vehicle",), False),
    FrameCode(
        "PathMoves", 0x06BD0000, 8, pack_path_moves, unpack_path_moves, PathMoves, PathMoves, ("Vehicle",), False
    ),
    FrameCode(
        "StepState", 0x06BE0000, 8, pack_step_state, unpack_step_state, StepState, StepState, ("Vehicle",), False
    ),
)
#: CRC-32 over this system's DBC: part of the digest of its sites (docs/site-file.md).
WORDS = 0xC515DC35
