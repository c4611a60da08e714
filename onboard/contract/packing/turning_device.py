"""Bytes of the messages in ``onboard.contract.turning_device``, and back.

Written by ``make docs`` from ``dbc/turning.dbc``: change that file, never this one.
"""

from struct import Struct

from onboard.contract.base import FrameCode, OutOfRangeError
from onboard.contract.codes import OrderResult
from onboard.contract.turning import LatheAction, NcMode
from onboard.contract.turning_device import JobAnswer, JobEntry, LatheOrder, NcState, ProgramEnd, ProgramText, ToolState

_LATHE_ACTION = tuple(LatheAction)
_NC_MODE = tuple(NcMode)
_ORDER_RESULT = tuple(OrderResult)
_BIXXX = Struct("<BIxxx")
_HBIB = Struct("<HBIB")
_HIXX = Struct("<HIxx")
_IHXX = Struct("<IHxx")
_Q = Struct("<Q")


def pack_program_text(message: ProgramText) -> bytes:
    program = message.program
    if not 0 <= program <= 255:
        raise OutOfRangeError("ProgramText.program", program, 0, 255)
    index = message.index
    if not 0 <= index <= 65535:
        raise OutOfRangeError("ProgramText.index", index, 0, 65535)
    text = message.text
    if not 0 <= text <= 1099511627775:
        raise OutOfRangeError("ProgramText.text", text, 0, 1099511627775)
    return _Q.pack(program + index * 0x100 + text * 0x1000000)


def unpack_program_text(sender: int, data: bytes) -> ProgramText | None:
    (word_0,) = _Q.unpack_from(data)
    program = word_0 & 0xFF
    index = word_0 >> 8 & 0xFFFF
    text = word_0 >> 24
    return ProgramText(sender, program, index, text)


def pack_program_end(message: ProgramEnd) -> bytes:
    program = message.program
    if not 0 <= program <= 255:
        raise OutOfRangeError("ProgramEnd.program", program, 0, 255)
    length = message.length
    if not 0 <= length <= 16777215:
        raise OutOfRangeError("ProgramEnd.length", length, 0, 16777215)
    crc = message.crc
    if not 0 <= crc <= 65535:
        raise OutOfRangeError("ProgramEnd.crc", crc, 0, 65535)
    return _IHXX.pack(program + length * 0x100, crc)


def unpack_program_end(sender: int, data: bytes) -> ProgramEnd | None:
    word_0, crc = _IHXX.unpack_from(data)
    program = word_0 & 0xFF
    length = word_0 >> 8
    return ProgramEnd(sender, program, length, crc)


def pack_lathe_order(message: LatheOrder) -> bytes:
    sequence = message.sequence
    if not 0 <= sequence <= 255:
        raise OutOfRangeError("LatheOrder.sequence", sequence, 0, 255)
    chuck = message.chuck
    if not 0 <= chuck <= 15:
        raise OutOfRangeError("LatheOrder.chuck", chuck, 0, 15)
    edges = message.edges
    if not 0 <= edges <= 65535:
        raise OutOfRangeError("LatheOrder.edges", edges, 0, 65535)
    return _BIXXX.pack(sequence, message.lathe_action + chuck * 0x4 + edges * 0x40)


def unpack_lathe_order(sender: int, data: bytes) -> LatheOrder | None:
    sequence, word_1 = _BIXXX.unpack_from(data)
    lathe_action = word_1 & 0x3
    if lathe_action > 1:
        return None
    chuck = word_1 >> 2 & 0xF
    edges = word_1 >> 6 & 0xFFFF
    return LatheOrder(sender, sequence, _LATHE_ACTION[lathe_action], chuck, edges)


def pack_job_answer(message: JobAnswer) -> bytes:
    number = message.number
    if not 0 <= number <= 65535:
        raise OutOfRangeError("JobAnswer.number", number, 0, 65535)
    winner = message.winner
    if not 0 <= winner <= 255:
        raise OutOfRangeError("JobAnswer.winner", winner, 0, 255)
    total_ct = message.total_ct
    if not 0 <= total_ct <= 1048575:
        raise OutOfRangeError("JobAnswer.total_ct", total_ct, 0, 1048575)
    return _HIXX.pack(number, message.job_result + winner * 0x8 + total_ct * 0x800)


def unpack_job_answer(sender: int, data: bytes) -> JobAnswer | None:
    number, word_2 = _HIXX.unpack_from(data)
    job_result = word_2 & 0x7
    if job_result > 3:
        return None
    winner = word_2 >> 3 & 0xFF
    total_ct = word_2 >> 11 & 0xFFFFF
    return JobAnswer(sender, number, _ORDER_RESULT[job_result], winner, total_ct)


def pack_nc_state(message: NcState) -> bytes:
    sequence = message.sequence
    if not 0 <= sequence <= 255:
        raise OutOfRangeError("NcState.sequence", sequence, 0, 255)
    program = message.program
    if not 0 <= program <= 255:
        raise OutOfRangeError("NcState.program", program, 0, 255)
    parts = message.parts
    if not 0 <= parts <= 65535:
        raise OutOfRangeError("NcState.parts", parts, 0, 65535)
    return _BIXXX.pack(sequence, message.nc_mode + program * 0x8 + parts * 0x800)


def unpack_nc_state(sender: int, data: bytes) -> NcState | None:
    sequence, word_1 = _BIXXX.unpack_from(data)
    nc_mode = word_1 & 0x7
    if nc_mode > 3:
        return None
    program = word_1 >> 3 & 0xFF
    parts = word_1 >> 11 & 0xFFFF
    return NcState(sender, sequence, _NC_MODE[nc_mode], program, parts)


def pack_tool_state(message: ToolState) -> bytes:
    tool = message.tool
    if not 1 <= tool <= 255:
        raise OutOfRangeError("ToolState.tool", tool, 1, 255)
    used_ms = message.used_ms
    if not 0 <= used_ms <= 4294967295:
        raise OutOfRangeError("ToolState.used_ms", used_ms, 0, 4294967295)
    return _BIXXX.pack(tool, used_ms)


def unpack_tool_state(sender: int, data: bytes) -> ToolState | None:
    tool, used_ms = _BIXXX.unpack_from(data)
    if tool < 1:
        return None
    return ToolState(sender, tool, used_ms)


def pack_job_entry(message: JobEntry) -> bytes:
    number = message.number
    if not 0 <= number <= 65535:
        raise OutOfRangeError("JobEntry.number", number, 0, 65535)
    drawing = message.drawing
    if not 0 <= drawing <= 255:
        raise OutOfRangeError("JobEntry.drawing", drawing, 0, 255)
    material = message.material
    if not 0 <= material <= 255:
        raise OutOfRangeError("JobEntry.material", material, 0, 255)
    batch = message.batch
    if not 1 <= batch <= 4095:
        raise OutOfRangeError("JobEntry.batch", batch, 1, 4095)
    bar_mm = message.bar_mm
    if not 1 <= bar_mm <= 4095:
        raise OutOfRangeError("JobEntry.bar_mm", bar_mm, 1, 4095)
    face_um = message.face_um
    if not 0 <= face_um <= 25500:
        raise OutOfRangeError("JobEntry.face_um", face_um, 0, 25500)
    return _HBIB.pack(number, drawing, material + batch * 0x100 + bar_mm * 0x100000, face_um // 100)


def unpack_job_entry(sender: int, data: bytes) -> JobEntry | None:
    number, drawing, word_3, face_um = _HBIB.unpack_from(data)
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
