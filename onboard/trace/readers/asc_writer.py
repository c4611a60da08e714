"""Writes Vector ASC as CANalyzer, python-can and can-utils read it: hexadecimal, absolute times, dates in UTC.

The format knows buses by their numbers only; a comment tells the name of each before its first frame, and our reader
takes it from there. Of an error frame nothing but that it was there is kept, and who is not marked counts as received.
"""

import time
from typing import TextIO

from onboard.trace.raw import CANFD_BRS, CANFD_ESI, RawFrame

#: Flags behind the data of a CANFD line, after its duration and its length in bits: CAN FD, BRS, ESI.
_FLEXIBLE, _FASTER, _PASSIVE = 0x1000, 0x2000, 0x4000
#: Data length codes above 8 by length in bytes (ISO 11898-1).
_CODES = {12: 9, 16: 10, 20: 11, 24: 12, 32: 13, 48: 14, 64: 15}
#: The format's own, in every language.
_DAYS = ("Mon", "Tue", "Wed", "Thu", "Fri", "Sat", "Sun")
_MONTHS = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")
_MILLION = 1_000_000


class AscWriter:
    """Feed frames in the order of the log; ``close`` ends the log. The caller owns the file."""

    def __init__(self, file: TextIO) -> None:
        self._file = file
        self._buses: dict[str, int] = {}
        self._start_us: int | None = None

    def write(self, frame: RawFrame) -> None:
        """Add a frame; one from before the first counts as of its time, for the format has no time before it."""
        if self._start_us is None:
            self._start_us = frame.time_us // 1000 * 1000
            date = _date(self._start_us)
            self._file.write(f"date {date}\nbase hex  timestamps absolute\nno internal events logged\n")
            self._file.write(f"Begin Triggerblock {date}\n")
        bus = self._buses.get(frame.channel)
        if bus is None:
            bus = self._buses[frame.channel] = len(self._buses) + 1
            self._file.write(f"// bus {bus} is {frame.channel}\n")
        seconds, microseconds = divmod(max(0, frame.time_us - self._start_us), _MILLION)
        self._file.write(f"{seconds:4d}.{microseconds:06d} {_event(bus, frame)}\n")

    def close(self) -> None:
        """Write the line that ends the log; a log without frames stays empty."""
        if self._start_us is not None:
            self._file.write("End TriggerBlock\n")


def _event(bus: int, frame: RawFrame) -> str:
    if frame.is_error:
        return f"{bus}  ErrorFrame"
    identifier = f"{frame.can_id:X}{'x' if frame.is_extended else ''}"
    direction = "Tx" if frame.sent else "Rx"
    data = frame.data.hex(" ").upper()
    if frame.fd_flags is not None:
        faster, passive = bool(frame.fd_flags & CANFD_BRS), bool(frame.fd_flags & CANFD_ESI)
        flags = _FLEXIBLE | _FASTER * faster | _PASSIVE * passive
        size = len(frame.data)
        code = _CODES.get(size, size)
        return (
            f"CANFD {bus:3d} {direction:<4} {identifier:>8}  {'':>32} {faster:d} {passive:d} {code:x} {size:2d} {data} "
            f"{0:8d} {0:4d} {flags:8X} {0:8d} {0:8d} {0:8d} {0:8d} {0:8d}"
        )
    if frame.is_remote:
        return f"{bus}  {identifier:<15} {direction:<4} r {frame.remote_dlc:x}"
    return f"{bus}  {identifier:<15} {direction:<4} d {len(frame.data):x} {data}".rstrip()


def _date(time_us: int) -> str:
    at = time.gmtime(time_us // _MILLION)
    clock = f"{at.tm_hour:02d}:{at.tm_min:02d}:{at.tm_sec:02d}.{time_us // 1000 % 1000:03d}"
    return f"{_DAYS[at.tm_wday]} {_MONTHS[at.tm_mon - 1]} {at.tm_mday:02d} {clock} {at.tm_year}"
