"""Bytes of the messages in ``onboard.contract.turning_device``, and back.

Written by ``make docs`` from ``dbc/turning.dbc``: change that file, never this one.
"""

import struct

from onboard.contract.base import FrameCode, OutOfRangeError, refusal
from onboard.contract.codes import OrderResult
from onboard.contract.turning import LatheAction, NcMode
from onboard.contract.turning_device import JobAnswer, JobEntry, LatheOrder, NcState, ProgramEnd, ProgramText, ToolState

_LATHE_ACTION = tuple(LatheAction)
_NC_MODE = tuple(NcMode)
_ORDER_RESULT = tuple(OrderResult)
_FROM_0_TO_15_AT_2 = {value: value << 2 for value in range(16)}
_FROM_0_TO_255_AT_3 = {value: value << 3 for value in range(256)}
_PACK_BBHHXX = struct.Struct("<BBHHxx").pack
_PACK_BHBI = struct.Struct("<BHBI").pack
_PACK_BIXXX = struct.Struct("<BIxxx").pack
_PACK_HBBBHB = struct.Struct("<HBBBHB").pack
_PACK_HIXX = struct.Struct("<HIxx").pack
_UNPACK_BIXXX = struct.Struct("<BIxxx").unpack_from
_UNPACK_HBIB = struct.Struct("<HBIB").unpack_from
_UNPACK_HIXX = struct.Struct("<HIxx").unpack_from
_UNPACK_IHXX = struct.Struct("<IHxx").unpack_from
_UNPACK_Q = struct.Struct("<Q").unpack_from


def pack_program_text(message: ProgramText) -> bytes:
    text = message.text
    try:
        return _PACK_BHBI(message.program, message.index, text & 0xFF, text >> 8)
    except struct.error as error:
        raise refusal(
            message,
            ("ProgramText.program", 0, 255),
            ("ProgramText.index", 0, 65535),
            ("ProgramText.text", 0, 1099511627775),
        ) from error


def unpack_program_text(sender: int, data: bytes) -> ProgramText | None:
    (word_0,) = _UNPACK_Q(data)
    program = word_0 & 0xFF
    index = word_0 >> 8 & 0xFFFF
    text = word_0 >> 24
    return ProgramText(sender, program, index, text)


def pack_program_end(message: ProgramEnd) -> bytes:
    length = message.length
    try:
        return _PACK_BBHHXX(message.program, length & 0xFF, length >> 8, message.crc)
    except struct.error as error:
        raise refusal(
            message, ("ProgramEnd.program", 0, 255), ("ProgramEnd.length", 0, 16777215), ("ProgramEnd.crc", 0, 65535)
        ) from error


def unpack_program_end(sender: int, data: bytes) -> ProgramEnd | None:
    word_0, crc = _UNPACK_IHXX(data)
    program = word_0 & 0xFF
    length = word_0 >> 8
    return ProgramEnd(sender, program, length, crc)


def pack_lathe_order(message: LatheOrder) -> bytes:
    edges = message.edges
    if edges > 65535:
        raise OutOfRangeError("LatheOrder.edges", edges, 0, 65535)
    try:
        return _PACK_BIXXX(message.sequence, message.lathe_action + _FROM_0_TO_15_AT_2[message.chuck] + edges * 0x40)
    except (KeyError, struct.error) as error:
        raise refusal(
            message, ("LatheOrder.sequence", 0, 255), ("LatheOrder.chuck", 0, 15), ("LatheOrder.edges", 0, 65535)
        ) from error


def unpack_lathe_order(sender: int, data: bytes) -> LatheOrder | None:
    sequence, word_1 = _UNPACK_BIXXX(data)
    lathe_action = word_1 & 0x3
    if lathe_action > 1:
        return None
    chuck = word_1 >> 2 & 0xF
    edges = word_1 >> 6 & 0xFFFF
    return LatheOrder(sender, sequence, _LATHE_ACTION[lathe_action], chuck, edges)


def pack_job_answer(message: JobAnswer) -> bytes:
    total_ct = message.total_ct
    if total_ct > 1048575:
        raise OutOfRangeError("JobAnswer.total_ct", total_ct, 0, 1048575)
    try:
        return _PACK_HIXX(message.number, message.job_result + _FROM_0_TO_255_AT_3[message.winner] + total_ct * 0x800)
    except (KeyError, struct.error) as error:
        raise refusal(
            message, ("JobAnswer.number", 0, 65535), ("JobAnswer.winner", 0, 255), ("JobAnswer.total_ct", 0, 1048575)
        ) from error


def unpack_job_answer(sender: int, data: bytes) -> JobAnswer | None:
    number, word_2 = _UNPACK_HIXX(data)
    job_result = word_2 & 0x7
    if job_result > 3:
        return None
    winner = word_2 >> 3 & 0xFF
    total_ct = word_2 >> 11 & 0xFFFFF
    return JobAnswer(sender, number, _ORDER_RESULT[job_result], winner, total_ct)


def pack_nc_state(message: NcState) -> bytes:
    parts = message.parts
    if parts > 65535:
        raise OutOfRangeError("NcState.parts", parts, 0, 65535)
    try:
        return _PACK_BIXXX(message.sequence, message.nc_mode + _FROM_0_TO_255_AT_3[message.program] + parts * 0x800)
    except (KeyError, struct.error) as error:
        raise refusal(
            message, ("NcState.sequence", 0, 255), ("NcState.program", 0, 255), ("NcState.parts", 0, 65535)
        ) from error


def unpack_nc_state(sender: int, data: bytes) -> NcState | None:
    sequence, word_1 = _UNPACK_BIXXX(data)
    nc_mode = word_1 & 0x7
    if nc_mode > 4:
        return None
    program = word_1 >> 3 & 0xFF
    parts = word_1 >> 11 & 0xFFFF
    return NcState(sender, sequence, _NC_MODE[nc_mode], program, parts)


def pack_tool_state(message: ToolState) -> bytes:
    tool = message.tool
    if tool < 1:
        raise OutOfRangeError("ToolState.tool", tool, 1, 255)
    try:
        return _PACK_BIXXX(tool, message.used_ms)
    except struct.error as error:
        raise refusal(message, ("ToolState.tool", 1, 255), ("ToolState.used_ms", 0, 4294967295)) from error


def unpack_tool_state(sender: int, data: bytes) -> ToolState | None:
    tool, used_ms = _UNPACK_BIXXX(data)
    if tool < 1:
        return None
    return ToolState(sender, tool, used_ms)


def pack_job_entry(message: JobEntry) -> bytes:
    batch = message.batch
    if batch < 1 or batch > 4095:
        raise OutOfRangeError("JobEntry.batch", batch, 1, 4095)
    bar_mm = message.bar_mm
    if bar_mm < 1:
        raise OutOfRangeError("JobEntry.bar_mm", bar_mm, 1, 4095)
    face_um = message.face_um
    if face_um < 0 or face_um > 25500:
        raise OutOfRangeError("JobEntry.face_um", face_um, 0, 25500)
    try:
        return _PACK_HBBBHB(
            message.number,
            message.drawing,
            message.material,
            batch & 0xFF,
            (batch >> 8) + bar_mm * 0x10,
            face_um // 100,
        )
    except struct.error as error:
        raise refusal(
            message,
            ("JobEntry.number", 0, 65535),
            ("JobEntry.drawing", 0, 255),
            ("JobEntry.material", 0, 255),
            ("JobEntry.bar_mm", 1, 4095),
        ) from error


def unpack_job_entry(sender: int, data: bytes) -> JobEntry | None:
    number, drawing, word_3, face_um = _UNPACK_HBIB(data)
    material = word_3 & 0xFF
    batch = word_3 >> 8 & 0xFFF
    if batch < 1:
        return None
    bar_mm = word_3 >> 20
    if bar_mm < 1:
        return None
    face_um = face_um * 100
    return JobEntry(sender, number, drawing, material, batch, bar_mm, face_um)


#: Every frame of this module.
FRAMES = (
    FrameCode(
        "ProgramText",
        0x14D80000,
        8,
        pack_program_text,
        unpack_program_text,
        ProgramText,
        ProgramText,
        ("Controller",),
        True,
    ),
    FrameCode(
        "ProgramEnd", 0x14D90000, 8, pack_program_end, unpack_program_end, ProgramEnd, ProgramEnd, ("Controller",), True
    ),
    FrameCode(
        "LatheOrder", 0x14DA0000, 8, pack_lathe_order, unpack_lathe_order, LatheOrder, LatheOrder, ("Controller",), True
    ),
    FrameCode(
        "JobAnswer", 0x14DE0000, 8, pack_job_answer, unpack_job_answer, JobAnswer, JobAnswer, ("Controller",), True
    ),
    FrameCode("NcState", 0x16DB0000, 8, pack_nc_state, unpack_nc_state, NcState, NcState, ("Nc",), True),
    FrameCode("ToolState", 0x16DC0000, 8, pack_tool_state, unpack_tool_state, ToolState, ToolState, ("Nc",), True),
    FrameCode("JobEntry", 0x16DD0000, 8, pack_job_entry, unpack_job_entry, JobEntry, JobEntry, ("Counter",), True),
)
