"""Logs as ``candump -L`` writes them: classic, CAN FD, remote and error frames, with or without marks of direction.

The format is can-utils' (``lib.c``, ``parse_canframe``); marks of direction come from ``candump -L -x`` and python-can.
"""

import re
from collections.abc import Iterable, Iterator

from onboard.core.frame import CAN_EFF_MASK, CAN_MAX_DLC, CAN_SFF_MASK
from onboard.trace.candump import ERROR_FLAG
from onboard.trace.raw import CANFD_MAX_LEN, RawFrame
from onboard.trace.readers.faults import LogFault, LogFaults

#: A classic frame of a length above 8 may end in ``_`` and its raw length code, 9 to F: it still has eight bytes.
_LINE = re.compile(
    rb"\((\d{1,12})\.(\d{6})(?:\d{3})?\)\s+(\S{1,64})\s+([0-9A-Fa-f]+)#(#[0-9A-Fa-f])?([0-9A-Za-z.]*)(?:_[9A-Fa-f])?"
    rb"(?:\s+([RT]))?\s*"
)
_REMOTE = re.compile(r"R[0-8]?")
_SHORT, _LONG = 3, 8
_MILLION = 1_000_000


def read_candump(lines: Iterable[bytes], faults: LogFaults, first: int = 1) -> Iterator[tuple[int, RawFrame]]:
    """Frames with their line numbers from ``first`` on; what gives none is counted. ``lines`` come with their ends.

    A last line without its end is not believed, whole as it may look: half of its data may be missing.
    """
    for number, line in enumerate(lines, first):
        if line.isspace():
            continue
        found = parse_line(line) if line.endswith(b"\n") else LogFault.CUT
        if isinstance(found, LogFault):
            faults.add(found, number)
        else:
            yield number, found


def parse_line(line: bytes) -> RawFrame | LogFault:
    """The frame of one line."""
    match = _LINE.fullmatch(line)
    if match is None:
        return LogFault.NOT_A_LINE
    seconds, fraction, channel, digits, flexible, body, mark = match.groups()
    extended = len(digits) == _LONG
    identifier = int(digits, 16)
    if len(digits) not in (_SHORT, _LONG) or identifier > (CAN_EFF_MASK | ERROR_FLAG if extended else CAN_SFF_MASK):
        return LogFault.IDENTIFIER
    text = body.decode()
    time_us = int(seconds) * _MILLION + int(fraction)
    name = channel.decode("utf-8", "replace")
    sent = None if mark is None else mark == b"T"
    if text[:1] == "R":
        if flexible or not _REMOTE.fullmatch(text):
            return LogFault.DATA
        return RawFrame(time_us, name, identifier, b"", extended, True, False, int(text[1:] or 0), None, sent)
    try:
        data = bytes.fromhex(text.replace(".", ""))
    except ValueError:
        return LogFault.DATA
    if len(data) > (CANFD_MAX_LEN if flexible else CAN_MAX_DLC):
        return LogFault.DATA
    flags = int(flexible[1:], 16) if flexible else None
    is_error = bool(identifier & ERROR_FLAG)
    return RawFrame(
        time_us, name, identifier & CAN_EFF_MASK, data, extended and not is_error, False, is_error, 0, flags, sent
    )
