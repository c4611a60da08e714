"""Logs in exactly the format of ``candump -L`` (can-utils): the black box of a run.

``(SECONDS.MICROSECONDS) CHANNEL ID#DATA``: three hex digits for an 11-bit identifier, eight for a 29-bit one, upper
case, no suffix; ``#R`` and the length asked for, where it is not 0, for a remote frame; bit 29 in the identifier for an
error frame (``CAN_ERR_FLAG``, linux/can.h). python-can's writer appends `` R`` or `` T``: Wireshark cannot read that.
"""

from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Self

from onboard.core.frame import CAN_EFF_MASK, Frame

ERROR_FLAG = 0x2000_0000
#: Bytes that wait in memory before they go to the file; some 1,400 frames.
BUFFER_BYTES = 1 << 16
_MILLION = 1_000_000


def format_line(time_us: int, channel: str, frame: Frame) -> str:
    """One line without its end; ``time_us`` since the epoch, not negative."""
    seconds, microseconds = divmod(time_us, _MILLION)
    return f"({seconds:010d}.{microseconds:06d}) {channel} {format_frame(frame)}"


def format_frame(frame: Frame) -> str:
    """The part of a line that is the frame: ``18FF0201#08C3``, also what can-utils' ``cansend`` takes."""
    if frame.is_error:
        return f"{ERROR_FLAG | frame.arbitration_id & CAN_EFF_MASK:08X}#{frame.data.hex().upper()}"
    identifier = f"{frame.arbitration_id:08X}" if frame.is_extended else f"{frame.arbitration_id:03X}"
    if frame.is_remote:
        return f"{identifier}#R{frame.remote_dlc or ''}"
    return f"{identifier}#{frame.data.hex().upper()}"


class CandumpWriter:
    """Writes frames to a log as they come. A context manager; leaving it closes the file.

    ``frames`` counts what was written. Raises ``OSError`` where the file cannot be written.
    """

    def __init__(self, file: Path | BinaryIO) -> None:
        """A path is created or overwritten; an open binary file is taken over."""
        self.frames = 0
        self._file = file.open("wb") if isinstance(file, Path) else file
        self._lines: list[str] = []
        self._waiting = 0

    def write(self, time_us: int, channel: str, frame: Frame) -> None:
        """Add a frame at ``time_us`` since the epoch; ``channel`` is one word."""
        line = format_line(time_us, channel, frame)
        self._lines.append(line)
        self._waiting += len(line) + 1
        self.frames += 1
        if self._waiting >= BUFFER_BYTES:
            self._spill()

    def flush(self) -> None:
        """Let readers of the file see everything."""
        self._spill()
        self._file.flush()

    def close(self) -> None:
        """Write what waits and close the file."""
        if not self._file.closed:
            self.flush()
            self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _spill(self) -> None:
        if self._lines:
            self._lines.append("")
            text, self._lines, self._waiting = "\n".join(self._lines), [], 0
            self._file.write(text.encode("ascii", "replace"))
