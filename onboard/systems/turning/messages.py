"""What the turning cell's machines say beyond the messages of all systems; bits and units: ``dbc/turning.dbc``."""

from dataclasses import dataclass
from enum import IntEnum

from onboard.core.messages import Message


class LathePhase(IntEnum):
    """How far an order is, as LatheProgress says it."""

    QUEUED = 0
    SETTING_UP = 1
    TURNING = 2
    FINISHED = 3


class LatheAction(IntEnum):
    """Orders to a lathe's numerical control."""

    SET_UP = 0
    MAKE = 1


class NcMode(IntEnum):
    """What a numerical control does; ALARM needs a person."""

    READY = 0
    SETTING = 1
    RUNNING = 2
    ALARM = 3


class JobResult(IntEnum):
    """What became of an order at the desk."""

    RECEIVED = 0
    IN_HAND = 1
    DONE = 2
    REFUSED = 3


# --- fleet bus -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class TurningOrder(Message):
    """What the sender's order ``task`` is: drawing and material by number, batch, bar and face allowance."""

    task: int
    drawing: int
    material: int
    batch: int
    bar_mm: int
    face_um: int


@dataclass(frozen=True, slots=True)
class BillCutting(Message):
    """Two terms of a bid for order ``task`` of ``manager``, cents for one part (row P26)."""

    manager: int
    task: int
    machining_ct: int
    tools_ct: int


@dataclass(frozen=True, slots=True)
class BillWaiting(Message):
    """Two more."""

    manager: int
    task: int
    setup_ct: int
    latency_ct: int


@dataclass(frozen=True, slots=True)
class BillBar(Message):
    """The fifth, and the sum."""

    manager: int
    task: int
    material_ct: int
    total_ct: int


@dataclass(frozen=True, slots=True)
class LatheProgress(Message):
    """How far order ``task`` of ``manager`` is on the sender."""

    manager: int
    task: int
    made: int
    batch: int
    lathe_phase: LathePhase


# --- device bus ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class ProgramText(Message):
    """Five characters of a program, the first in the lowest byte."""

    program: int
    index: int
    text: int


@dataclass(frozen=True, slots=True)
class ProgramEnd(Message):
    """The program is whole."""

    program: int
    length: int
    crc: int


@dataclass(frozen=True, slots=True)
class LatheOrder(Message):
    """One action; a new ``sequence`` starts it, a repeated one does nothing."""

    sequence: int
    lathe_action: LatheAction
    chuck: int
    edges: int


@dataclass(frozen=True, slots=True)
class NcState(Message):
    """The control: what it does, which program is loaded, parts made since it was set up."""

    sequence: int
    nc_mode: NcMode
    program: int
    parts: int


@dataclass(frozen=True, slots=True)
class ToolState(Message):
    """How long the edge of one tool has cut."""

    tool: int
    used_ms: int


@dataclass(frozen=True, slots=True)
class JobEntry(Message):
    """A person orders turned parts."""

    number: int
    drawing: int
    material: int
    batch: int
    bar_mm: int
    face_um: int


@dataclass(frozen=True, slots=True)
class JobAnswer(Message):
    """What becomes of an order; ``total_ct`` is the price of one part, 0 before it is known."""

    number: int
    job_result: JobResult
    winner: int
    total_ct: int


MESSAGES: tuple[type[Message], ...] = (
    TurningOrder,
    BillCutting,
    BillWaiting,
    BillBar,
    LatheProgress,
    ProgramText,
    ProgramEnd,
    LatheOrder,
    NcState,
    ToolState,
    JobEntry,
    JobAnswer,
)

#: Characters in one ProgramText.
CHUNK = 5


def text_frames(sender: int, program: int, text: str) -> tuple[Message, ...]:
    """A program as its frames, ProgramEnd last. Raises ``UnicodeEncodeError`` for what is not ASCII."""
    data = text.encode("ascii")
    chunks = [data[at : at + CHUNK] for at in range(0, len(data), CHUNK)]
    words = [int.from_bytes(chunk, "little") for chunk in chunks]
    frames: list[Message] = [ProgramText(sender, program, index, word) for index, word in enumerate(words)]
    return (*frames, ProgramEnd(sender, program, len(data), crc16(data)))


def crc16(data: bytes) -> int:
    """CRC-16/CCITT-FALSE, as the mirror's digest has it."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc
