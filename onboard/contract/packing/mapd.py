"""Bytes of the messages in ``onboard.contract.mapd``, and back.

Written by ``make docs`` from ``dbc/mapd.dbc``: change that file, never this one.
"""

from struct import Struct

from onboard.contract.base import FrameCode, OutOfRangeError
from onboard.contract.mapd import PathHead, PathMoves, StepRound, StepState, StepTurn, TurnRequest

_IXXXX = Struct("<Ixxxx")
_Q = Struct("<Q")


def pack_step_round(message: StepRound) -> bytes:
    step = message.step
    if not 0 <= step <= 4194303:
        raise OutOfRangeError("StepRound.step", step, 0, 4194303)
    open_tasks = message.open_tasks
    if not 0 <= open_tasks <= 65535:
        raise OutOfRangeError("StepRound.open_tasks", open_tasks, 0, 65535)
    attempt = message.attempt
    if not 0 <= attempt <= 255:
        raise OutOfRangeError("StepRound.attempt", attempt, 0, 255)
    return _Q.pack(step + (open_tasks + attempt * 0x10000 + message.bidding * 0x1000000) * 0x400000)


def unpack_step_round(sender: int, data: bytes) -> StepRound | None:
    (word_0,) = _Q.unpack_from(data)
    step = word_0 & 0x3FFFFF
    open_tasks = word_0 >> 22 & 0xFFFF
    attempt = word_0 >> 38 & 0xFF
    return StepRound(sender, step, open_tasks, attempt, word_0 & 0x400000000000 != 0)


def pack_step_turn(message: StepTurn) -> bytes:
    step = message.step
    if not 0 <= step <= 4194303:
        raise OutOfRangeError("StepTurn.step", step, 0, 4194303)
    index = message.index
    if not 0 <= index <= 255:
        raise OutOfRangeError("StepTurn.index", index, 0, 255)
    changes = message.changes
    if not 0 <= changes <= 255:
        raise OutOfRangeError("StepTurn.changes", changes, 0, 255)
    robot = message.robot
    if not 0 <= robot <= 250:
        raise OutOfRangeError("StepTurn.robot", robot, 0, 250)
    won = message.won
    if not 0 <= won <= 1:
        raise OutOfRangeError("StepTurn.won", won, 0, 1)
    return _Q.pack(step + index * 0x400000 + (changes + robot * 0x100 + won * 0x10000) * 0x40000000)


def unpack_step_turn(sender: int, data: bytes) -> StepTurn | None:
    (word_0,) = _Q.unpack_from(data)
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
    if not 0 <= step <= 4194303:
        raise OutOfRangeError("TurnRequest.step", step, 0, 4194303)
    attempt = message.attempt
    if not 0 <= attempt <= 255:
        raise OutOfRangeError("TurnRequest.attempt", attempt, 0, 255)
    return _IXXXX.pack(step + attempt * 0x400000)


def unpack_turn_request(sender: int, data: bytes) -> TurnRequest | None:
    (word_0,) = _IXXXX.unpack_from(data)
    step = word_0 & 0x3FFFFF
    attempt = word_0 >> 22 & 0xFF
    return TurnRequest(sender, step, attempt)


def pack_path_head(message: PathHead) -> bytes:
    step = message.step
    if not 0 <= step <= 4194303:
        raise OutOfRangeError("PathHead.step", step, 0, 4194303)
    cell = message.cell
    if not 0 <= cell <= 63999:
        raise OutOfRangeError("PathHead.cell", cell, 0, 63999)
    moves = message.moves
    if not 0 <= moves <= 4095:
        raise OutOfRangeError("PathHead.moves", moves, 0, 4095)
    version = message.version
    if not 0 <= version <= 255:
        raise OutOfRangeError("PathHead.version", version, 0, 255)
    return _Q.pack(step + (cell + moves * 0x10000) * 0x400000 + (version + message.kept * 0x100) * 0x4000000000000)


def unpack_path_head(sender: int, data: bytes) -> PathHead | None:
    (word_0,) = _Q.unpack_from(data)
    step = word_0 & 0x3FFFFF
    cell = word_0 >> 22 & 0xFFFF
    if cell > 63999:
        return None
    moves = word_0 >> 38 & 0xFFF
    version = word_0 >> 50 & 0xFF
    return PathHead(sender, step, cell, moves, version, word_0 & 0x400000000000000 != 0)


def pack_path_moves(message: PathMoves) -> bytes:
    version = message.version
    if not 0 <= version <= 255:
        raise OutOfRangeError("PathMoves.version", version, 0, 255)
    part = message.part
    if not 0 <= part <= 255:
        raise OutOfRangeError("PathMoves.part", part, 0, 255)
    codes = message.codes
    if not 0 <= codes <= 281474976710655:
        raise OutOfRangeError("PathMoves.codes", codes, 0, 281474976710655)
    return _Q.pack(version + part * 0x100 + codes * 0x10000)


def unpack_path_moves(sender: int, data: bytes) -> PathMoves | None:
    (word_0,) = _Q.unpack_from(data)
    version = word_0 & 0xFF
    part = word_0 >> 8 & 0xFF
    codes = word_0 >> 16
    return PathMoves(sender, version, part, codes)


def pack_step_state(message: StepState) -> bytes:
    step = message.step
    if not 0 <= step <= 4194303:
        raise OutOfRangeError("StepState.step", step, 0, 4194303)
    cell = message.cell
    if not 0 <= cell <= 63999:
        raise OutOfRangeError("StepState.cell", cell, 0, 63999)
    task = message.task
    if not 0 <= task <= 65535:
        raise OutOfRangeError("StepState.task", task, 0, 65535)
    return _Q.pack(step + cell * 0x400000 + (task + message.loaded * 0x10000 + message.served * 0x20000) * 0x4000000000)


def unpack_step_state(sender: int, data: bytes) -> StepState | None:
    (word_0,) = _Q.unpack_from(data)
    step = word_0 & 0x3FFFFF
    cell = word_0 >> 22 & 0xFFFF
    if cell > 63999:
        return None
    task = word_0 >> 38 & 0xFFFF
    return StepState(sender, step, cell, task, word_0 & 0x40000000000000 != 0, word_0 & 0x80000000000000 != 0)


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
