"""The disk that people flash: an MBR with four primary partitions, put together without loop devices or root.

MBR rather than GPT, for the boot ROM of the Raspberry Pi 3 reads no other. One FAT partition that every laptop shows,
two root slots, one journal.
"""

import os
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from deploy.update.board import SIGNATURE
from deploy.wheels import DeployError

SECTOR_BYTES = 512
#: Partitions begin on whole megabytes, as erase blocks of cards do.
_ALIGN = (1 << 20) // SECTOR_BYTES
_ENTRY = struct.Struct("<B3sB3sII")
#: "Use the LBA": cylinders, heads and sectors beyond what they can say (UEFI 2.10, section 5.2.1).
_NO_CHS = b"\xfe\xff\xff"
FAT32_LBA, LINUX = 0x0C, 0x83


@dataclass(frozen=True, slots=True)
class DiskPartition:
    """One partition: its type, its size, and a file with its content, which may be smaller."""

    kind: int
    size_mb: int
    content: Path | None = None


def starts(parts: Sequence[DiskPartition]) -> list[int]:
    """The first sector of each partition."""
    first, found = _ALIGN, []
    for part in parts:
        found.append(first)
        first += part.size_mb * _ALIGN
    return found


def boot_record(parts: Sequence[DiskPartition]) -> bytes:
    """The disk's first sector (UEFI 2.10, table 5-1). Raises ``ValueError`` for more than four partitions."""
    if len(parts) > 4:
        raise ValueError(f"an MBR holds four partitions, not {len(parts)}")
    entries = b"".join(
        _ENTRY.pack(0, _NO_CHS, part.kind, _NO_CHS, first, part.size_mb * _ALIGN)
        for part, first in zip(parts, starts(parts), strict=True)
    )
    return bytes(440) + SIGNATURE + bytes(2) + entries.ljust(64, b"\0") + b"\x55\xaa"


def write_disk(parts: Sequence[DiskPartition], to: Path) -> None:
    """Write the image; what is empty stays a hole in the file. Raises ``DeployError`` where a content is too large."""
    places = starts(parts)
    with to.open("wb") as disk:
        disk.write(boot_record(parts))
        disk.truncate((places[-1] + parts[-1].size_mb * _ALIGN) * SECTOR_BYTES)
        for part, first in zip(parts, places, strict=True):
            if part.content is not None:
                _copy(part, first * SECTOR_BYTES, disk.fileno())


def copy_disk(image: Path, to: Path) -> Path:
    """Copy an image, holes as holes: it holds less than half of what its size says. Raises ``OSError``."""
    with to.open("wb") as disk:
        disk.truncate(image.stat().st_size)
        _write(image, 0, disk.fileno())
    return to


def _copy(part: DiskPartition, offset: int, disk: int) -> None:
    assert part.content is not None
    size = part.content.stat().st_size
    if size > part.size_mb << 20:
        raise DeployError(f"{part.content.name} has {size} bytes; its partition takes {part.size_mb} MiB")
    _write(part.content, offset, disk)


def _write(content: Path, offset: int, disk: int) -> None:
    with content.open("rb") as file:
        while block := file.read(1 << 20):
            # A hole reads as zeros; an image of holes is written and packed faster.
            if block.count(0) != len(block):
                os.pwrite(disk, block, offset)
            offset += len(block)
