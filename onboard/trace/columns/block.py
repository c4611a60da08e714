"""Frames of a log as columns of numbers: what is looked at a million at a time. Off board only: it needs numpy."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import chain, repeat
from typing import Any

import numpy as np
import numpy.typing as npt

from onboard.core.frame import CAN_EFF_MASK, CAN_MAX_DLC
from onboard.trace.raw import KEY_BYTES, KEY_IS_LONG, KEY_MARK, RawFrame
from onboard.trace.readers.faults import LogFault, LogFaults

#: What a column says of a log that does not tell who sent a frame.
UNMARKED = -1
#: ``RawFrame`` from a tuple of all its fields: a third of the time of calling the class.
_raw_of: Callable[[Any], RawFrame] = partial(tuple.__new__, RawFrame)


@dataclass(frozen=True, slots=True)
class FrameBlock:
    """A stretch of a log, a row a frame, in the order of the log; ``where`` is the frame's line or place there.

    ``time_us`` since the epoch. ``channel`` counts in ``channels``. ``data`` has eight bytes a row, 0 behind
    ``length``; ``sent`` is 1, 0 or ``UNMARKED``. Rows in ``others`` are no classic data frames: error, remote and CAN
    FD frames, which stand there whole; of their columns only time, channel, identifier and place count.
    """

    where: npt.NDArray[np.int64]
    time_us: npt.NDArray[np.int64]
    channel: npt.NDArray[np.int32]
    can_id: npt.NDArray[np.uint32]
    is_extended: npt.NDArray[np.bool_]
    length: npt.NDArray[np.uint8]
    data: npt.NDArray[np.uint8]
    sent: npt.NDArray[np.int8]
    channels: tuple[str, ...]
    others: dict[int, RawFrame]

    def __len__(self) -> int:
        return len(self.time_us)

    @property
    def is_data(self) -> npt.NDArray[np.bool_]:
        """Which rows are classic data frames."""
        found = np.ones(len(self), np.bool_)
        found[list(self.others)] = False
        return found

    @property
    def words(self) -> npt.NDArray[np.uint64]:
        """The eight bytes of each row as one little-endian number."""
        return self.data.view("<u8")[:, 0]

    @property
    def keys(self) -> list[bytes]:
        """What each classic data frame says, all but time, channel and direction: equal where frames say the same."""
        keys: list[bytes] = _keys(self.data, self.can_id, self.length, self.is_extended).tolist()
        return keys

    def apart(self, identifier: int, ignored: int) -> tuple[list[bytes | None], Iterator[tuple[int, bytes, bool]]]:
        """Frames of one message by their keys, and the others: identifier, data, whether that is a long one.

        The first has None for each of the others. ``identifier`` has 0 in its lowest byte, where that of a frame may
        have any; ``ignored`` are bits of the data, as a little-endian number, that count as 0. No row is in ``others``.
        """
        is_mine = self.is_extended & (self.can_id & np.uint32(CAN_EFF_MASK ^ 0xFF) == identifier)
        mine, left = np.flatnonzero(is_mine), np.flatnonzero(~is_mine)
        data = (self.words[mine] & ~np.uint64(ignored)).astype("<u8").view(np.uint8).reshape(-1, CAN_MAX_DLC)
        keys = np.full(len(self), None, object)
        keys[mine] = _keys(data, self.can_id[mine], self.length[mine], self.is_extended[mine])
        found: list[bytes | None] = keys.tolist()
        others = zip(
            self.can_id[left].tolist(),
            _cut(self.data[left], self.length[left]),
            self.is_extended[left].tolist(),
            strict=True,
        )
        return found, others

    @property
    def names(self) -> list[str]:
        """The channel of each row."""
        return list(map(self.channels.__getitem__, self.channel.tolist()))

    def only(self, rows: list[int]) -> "FrameBlock":
        """These rows alone; none of them in ``others``."""
        return FrameBlock(
            self.where[rows],
            self.time_us[rows],
            self.channel[rows],
            self.can_id[rows],
            self.is_extended[rows],
            self.length[rows],
            self.data[rows],
            self.sent[rows],
            self.channels,
            {},
        )

    def frames(self) -> Iterator[RawFrame]:
        """One frame a row, in the order of the log, extended identifiers marked as such."""
        marks = {UNMARKED: None, 0: False, 1: True}
        rows: Iterator[RawFrame] = map(
            _raw_of,
            zip(
                self.time_us.tolist(),
                self.names,
                self.can_id.tolist(),
                _cut(self.data, self.length),
                self.is_extended.tolist(),
                repeat(False),
                repeat(False),
                repeat(0),
                repeat(None),
                map(marks.__getitem__, self.sent.tolist()),
                strict=False,
            ),
        )
        if not self.others:
            return rows
        return (self.others.get(row, frame) for row, frame in enumerate(rows))

    def count(self, faults: LogFaults) -> None:
        """Count the frames, and times that go back on their own channel, as ``LogFaults.watch`` does."""
        latest = faults.latest_us
        faults.frames += len(self)
        for number, name in enumerate(self.channels):
            rows = np.flatnonzero(self.channel == number)
            if not len(rows):
                continue
            times = self.time_us[rows]
            back = np.diff(times, prepend=latest.get(name, times[0])) < 0
            for row in rows[back].tolist():
                faults.add(LogFault.BACKWARDS, int(self.where[row]))
            latest[name] = int(times[-1])


def _cut(data: npt.NDArray[np.uint8], length: npt.NDArray[np.uint8]) -> list[bytes]:
    """The data of each row, as long as they are."""
    blob = data.tobytes()
    return [blob[at : at + size] for at, size in zip(range(0, len(blob), CAN_MAX_DLC), length.tolist(), strict=True)]


def _keys(
    data: npt.NDArray[np.uint8],
    can_id: npt.NDArray[np.uint32],
    length: npt.NDArray[np.uint8],
    is_extended: npt.NDArray[np.bool_],
) -> npt.NDArray[np.bytes_]:
    parts = np.empty((len(data), KEY_BYTES), np.uint8)
    parts[:, :CAN_MAX_DLC] = data
    parts[:, CAN_MAX_DLC:-1] = can_id.astype("<u4").view(np.uint8).reshape(-1, 4)
    # Never 0, so nothing of a key is taken for the end of a text.
    parts[:, -1] = length + KEY_MARK + KEY_IS_LONG * is_extended
    return parts.view(f"S{KEY_BYTES}")[:, 0]


def block_of(placed: list[tuple[int, RawFrame]]) -> FrameBlock:
    """Frames of any reader, with their places, as columns."""
    frames = [frame for _, frame in placed]
    channels = tuple(dict.fromkeys(frame.channel for frame in frames))
    numbers = {name: number for number, name in enumerate(channels)}
    data = b"".join(frame.data[:CAN_MAX_DLC].ljust(CAN_MAX_DLC, b"\0") for frame in frames)
    return FrameBlock(
        np.array([where for where, _ in placed], np.int64),
        np.array([frame.time_us for frame in frames], np.int64),
        np.array([numbers[frame.channel] for frame in frames], np.int32),
        np.array([frame.can_id for frame in frames], np.uint32),
        np.array([frame.is_extended for frame in frames], np.bool_),
        np.array([min(frame.length, CAN_MAX_DLC) for frame in frames], np.uint8),
        np.frombuffer(data, np.uint8).reshape(-1, CAN_MAX_DLC),
        np.array([UNMARKED if frame.sent is None else frame.sent for frame in frames], np.int8),
        channels,
        {row: frame for row, frame in enumerate(frames) if not frame.is_data},
    )


def joined(blocks: list[FrameBlock]) -> FrameBlock:
    """Blocks of one log behind one another as one."""
    channels = tuple(dict.fromkeys(chain.from_iterable(one.channels for one in blocks)))
    numbers = {name: number for number, name in enumerate(channels)}
    others: dict[int, RawFrame] = {}
    mapped, before = [], 0
    for one in blocks:
        table = np.array([numbers[name] for name in one.channels], np.int32)
        mapped.append(table[one.channel] if len(one) else one.channel)
        others |= {before + row: frame for row, frame in one.others.items()}
        before += len(one)
    return FrameBlock(
        np.concatenate([one.where for one in blocks]),
        np.concatenate([one.time_us for one in blocks]),
        np.concatenate(mapped),
        np.concatenate([one.can_id for one in blocks]),
        np.concatenate([one.is_extended for one in blocks]),
        np.concatenate([one.length for one in blocks]),
        np.concatenate([one.data for one in blocks]),
        np.concatenate([one.sent for one in blocks]),
        channels,
        others,
    )
