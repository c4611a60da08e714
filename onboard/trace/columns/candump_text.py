"""Whole stretches of ``candump -L`` text to columns at once; lines of another form go to the reader of single lines.

The plain form is what candump and every writer after it print for a classic data frame: ``(`` ten digits ``.`` six
digits ``) CHANNEL ID#DATA``, with `` R`` or `` T`` behind it or nothing. Everything else, faults among it, is left to
``onboard.trace.readers.candump``, so both read a log in the same way.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from onboard.core.frame import CAN_EFF_MASK, CAN_MAX_DLC, CAN_SFF_MASK
from onboard.trace.columns.block import UNMARKED, FrameBlock
from onboard.trace.raw import RawFrame
from onboard.trace.readers.candump import parse_line
from onboard.trace.readers.faults import LogFault, LogFaults

_Bytes = npt.NDArray[np.uint8]
_Ints = npt.NDArray[np.int64]
_Flags = npt.NDArray[np.bool_]
#: ``(SSSSSSSSSS.UUUUUU) ``: where digits stand, what they weigh, and what stands between them.
_HEAD = 20
_DIGITS = np.array([*range(1, 11), *range(12, 18)])
_WEIGHTS = 10 ** np.arange(15, -1, -1, dtype=np.int64)
_BETWEEN = ((0, ord("(")), (11, ord(".")), (18, ord(")")), (19, ord(" ")))
#: A space and eight digits before the ``#``, of which an 11-bit identifier takes the last three.
_ID_WIDTH, _SHORT, _LONG = 9, 3, 8
_NO_DIGIT = 0xFF
_NIBBLES = np.full(256, _NO_DIGIT, np.uint8)
for _value, _digit in enumerate("0123456789ABCDEF"):
    _NIBBLES[[ord(_digit), ord(_digit.lower())]] = _value
#: Longest name of a channel that is read here: two machine words.
_NAME_WIDTH = 16
#: Spare bytes around the text, so that every window lies inside.
_MARGIN = 64


class _Lines(NamedTuple):
    """Where each line begins, where its ``#`` is and where it ends, without a mark of direction."""

    start: _Ints
    hash: _Ints
    stop: _Ints


def read_block(text: bytes, first: int, faults: LogFaults) -> FrameBlock:
    """The frames of whole lines, the first of which has the number ``first``; what gives none is counted."""
    buffer = np.frombuffer(b" " * _MARGIN + text + b" " * _MARGIN, np.uint8)
    ends = np.flatnonzero(buffer == ord("\n"))
    starts = np.concatenate(([_MARGIN], ends[:-1] + 1))
    hashes, is_plain = _hashes(buffer, starts, ends)
    sent, stops = _marks(buffer, ends)
    lines = _Lines(starts, hashes, stops)
    time_us = _times(buffer, lines, is_plain)
    can_id, is_extended = _identifiers(buffer, lines, is_plain)
    length, data = _data(buffer, lines, is_plain)
    channel, channels = _channels(buffer, lines, is_extended, is_plain)
    block = FrameBlock(
        np.arange(first, first + len(ends), dtype=np.int64),
        time_us,
        channel,
        can_id,
        is_extended,
        length,
        data,
        sent,
        channels,
        {},
    )
    if not is_plain.all():
        block = _with_others(block, is_plain, text, starts - _MARGIN, ends - _MARGIN, faults)
    block.count(faults)
    return block


def _windows(buffer: _Bytes, at: _Ints, width: int) -> _Bytes:
    """``width`` bytes from each place on, a row each."""
    return np.lib.stride_tricks.sliding_window_view(buffer, width)[at]


def _hashes(buffer: _Bytes, starts: _Ints, ends: _Ints) -> tuple[_Ints, _Flags]:
    """The first ``#`` of each line; plain is who has exactly one, and room before it."""
    found = np.flatnonzero(buffer == ord("#"))
    if len(found) == len(ends) and bool(np.all((found > starts) & (found < ends))):
        first, is_plain = found, np.ones(len(ends), np.bool_)
    else:
        padded = np.concatenate((found, [len(buffer), len(buffer)]))
        at = np.searchsorted(found, starts)
        first = np.minimum(padded[at], ends)
        is_plain = (padded[at] < ends) & (padded[at + 1] > ends)
    return first, is_plain & (first >= starts + _HEAD + 1 + _SHORT)


def _marks(buffer: _Bytes, ends: _Ints) -> tuple[npt.NDArray[np.int8], _Ints]:
    """Who sent the frame, where that is marked, and where the data end."""
    ends = ends - (buffer[ends - 1] == ord("\r"))
    last, is_marked = buffer[ends - 1], buffer[ends - 2] == ord(" ")
    is_sent, is_received = (is_marked & (last == ord(mark)) for mark in "TR")
    sent = np.full(len(ends), UNMARKED, np.int8)
    sent[is_sent], sent[is_received] = 1, 0
    return sent, ends - 2 * (is_sent | is_received)


def _times(buffer: _Bytes, lines: _Lines, is_plain: _Flags) -> _Ints:
    head = _windows(buffer, lines.start, _HEAD)
    for column, sign in _BETWEEN:
        is_plain &= head[:, column] == sign
    digits = head[:, _DIGITS] - ord("0")
    is_plain &= (digits < 10).all(axis=1)
    time_us: _Ints = digits.astype(np.int64) @ _WEIGHTS
    return time_us


def _identifiers(buffer: _Bytes, lines: _Lines, is_plain: _Flags) -> tuple[npt.NDArray[np.uint32], _Flags]:
    window = _windows(buffer, lines.hash - _ID_WIDTH, _ID_WIDTH)
    nibbles = _NIBBLES[window]
    is_short = window[:, _ID_WIDTH - _SHORT - 1] == ord(" ")
    nibbles[is_short, : _ID_WIDTH - _SHORT] = 0
    is_digit = nibbles != _NO_DIGIT
    is_extended = ~is_short
    is_plain &= is_digit[:, 1:].all(axis=1) & (is_short | (window[:, 0] == ord(" ")))
    # Where there are eight digits, a line's head comes before them, and the space in between is not the head's.
    is_plain &= lines.hash - np.where(is_short, _SHORT, _LONG) > lines.start + _HEAD + 1
    can_id = np.zeros(len(nibbles), np.uint32)
    for column in range(1, _ID_WIDTH):
        can_id = can_id << np.uint32(4) | nibbles[:, column]
    is_plain &= can_id <= np.where(is_extended, CAN_EFF_MASK, CAN_SFF_MASK)
    return can_id, is_extended


def _data(buffer: _Bytes, lines: _Lines, is_plain: _Flags) -> tuple[npt.NDArray[np.uint8], _Bytes]:
    digits = lines.stop - lines.hash - 1
    is_plain &= (digits >= 0) & (digits <= 2 * CAN_MAX_DLC) & (digits % 2 == 0)
    nibbles = _NIBBLES[_windows(buffer, lines.hash + 1, 2 * CAN_MAX_DLC)]
    nibbles[np.arange(2 * CAN_MAX_DLC) >= digits[:, None]] = 0
    is_plain &= (nibbles != _NO_DIGIT).all(axis=1)
    data = nibbles[:, ::2] << np.uint8(4) | nibbles[:, 1::2]
    return np.clip(digits // 2, 0, CAN_MAX_DLC).astype(np.uint8), np.ascontiguousarray(data)


def _channels(
    buffer: _Bytes, lines: _Lines, is_extended: _Flags, is_plain: _Flags
) -> tuple[npt.NDArray[np.int32], tuple[str, ...]]:
    """The number of each line's channel, and their names in the order in which they first come."""
    size = lines.hash - np.where(is_extended, _LONG, _SHORT) - 1 - (lines.start + _HEAD)
    is_plain &= (size > 0) & (size <= _NAME_WIDTH)
    window = _windows(buffer, lines.start + _HEAD, _NAME_WIDTH)
    keys = np.where(np.arange(_NAME_WIDTH) < size[:, None], window, 0).astype(np.uint8).view("<u8")
    channel = np.zeros(len(size), np.int32)
    names: dict[str, int] = {}
    left = np.flatnonzero(is_plain)
    while len(left):
        length = int(size[left[0]])
        name = keys[left[0]].tobytes()[:length]
        is_same = (keys[left] == keys[left[0]]).all(axis=1) & (size[left] == length)
        if name.split() == [name]:
            channel[left[is_same]] = names.setdefault(name.decode("utf-8", "replace"), len(names))
        else:
            is_plain[left[is_same]] = False
        left = left[~is_same]
    return channel, tuple(names)


def _with_others(
    block: FrameBlock, is_plain: _Flags, text: bytes, starts: _Ints, ends: _Ints, faults: LogFaults
) -> FrameBlock:
    """The block without the lines that are none, and with the frames of those that the line reader knows."""
    keep = is_plain.copy()
    names = {name: number for number, name in enumerate(block.channels)}
    read: dict[int, RawFrame] = {}
    for row in np.flatnonzero(~is_plain).tolist():
        line = text[starts[row] : ends[row] + 1]
        if line.isspace():
            continue
        found = parse_line(line)
        if isinstance(found, LogFault):
            faults.add(found, int(block.where[row]))
            continue
        keep[row], read[row] = True, found
        block.time_us[row], block.can_id[row] = found.time_us, found.can_id
        block.channel[row] = names.setdefault(found.channel, len(names))
        block.is_extended[row], block.length[row] = found.is_extended, min(found.length, CAN_MAX_DLC)
        block.data[row] = np.frombuffer(found.data[:CAN_MAX_DLC].ljust(CAN_MAX_DLC, b"\0"), np.uint8)
        block.sent[row] = UNMARKED if found.sent is None else found.sent
    rows = np.cumsum(keep) - 1
    return FrameBlock(
        block.where[keep],
        block.time_us[keep],
        block.channel[keep],
        block.can_id[keep],
        block.is_extended[keep],
        block.length[keep],
        block.data[keep],
        block.sent[keep],
        tuple(names),
        {int(rows[row]): frame for row, frame in read.items() if not frame.is_data},
    )
