"""What the fields of the turning system's messages hold, and how they are filled and read."""

from onboard.contract.base import Message
from onboard.contract.turning_device import ProgramEnd, ProgramText

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
