"""Every signal of every frame of a block at once: the same values, and the same refusals, as the codec has one by one.

A signal's column has the DBC's name and number (``value = raw * scale + offset``, dbc/*.dbc); what the codec makes one
field of, such as a reference, is a column for each of its parts.
"""

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from onboard.contract.codes import Reason
from onboard.trace.columns.block import FrameBlock
from onboard.wire.dbc_file import MessageLayout, SignalLayout, device_layouts, fleet_layouts

_NODE_MASK = 0xFF
_WORD_BITS = 64
#: Types of columns, narrowest first; the first that holds a signal's whole range is taken.
_TYPES = (np.uint8, np.int8, np.uint16, np.int16, np.uint32, np.int32, np.int64)


@dataclass(frozen=True, slots=True)
class MessageColumns:
    """All frames of one message in a block: their rows there, in the order of the log, senders, signals by name."""

    layout: MessageLayout
    rows: npt.NDArray[np.int64]
    sender: npt.NDArray[np.uint8]
    values: dict[str, npt.NDArray[Any]]


class SignalDecoder:
    """The contract of a system on both buses. ``drops`` counts frames that are no message, by the codec's reasons."""

    def __init__(self, system: str = "") -> None:
        """``system`` "" is the contract that all systems share."""
        self.drops: Counter[Reason] = Counter()
        # What is of both is the fleet's, as a listener has it.
        self.layouts = {one.frame_id: one for one in (*device_layouts(system), *fleet_layouts(system))}

    def decode(self, block: FrameBlock) -> Iterator[MessageColumns]:
        """The messages of a block, in the order of their identifiers."""
        rows = np.flatnonzero(block.is_data)
        can_id = block.can_id[rows]
        is_known = block.is_extended[rows] & (can_id & _NODE_MASK != 0)
        identifier = np.where(is_known, can_id & ~np.uint32(_NODE_MASK), _NODE_MASK)
        words = block.words
        for number in np.unique(identifier).tolist():
            layout = self.layouts.get(number)
            mine = rows[identifier == number]
            if layout is None:
                self._drop(Reason.UNKNOWN_IDENTIFIER, len(mine))
                continue
            whole = mine[block.length[mine] >= layout.length]
            self._drop(Reason.SHORT_FRAME, len(mine) - len(whole))
            values, is_right = _values(words[whole], layout.signals)
            if not is_right.all():
                self._drop(Reason.VALUE_OUT_OF_RANGE, int(np.count_nonzero(~is_right)))
                whole = whole[is_right]
                values = {name: column[is_right] for name, column in values.items()}
            if len(whole):
                yield MessageColumns(layout, whole, (block.can_id[whole] & _NODE_MASK).astype(np.uint8), values)

    def _drop(self, reason: Reason, count: int) -> None:
        if count:
            self.drops[reason] += count


def type_of(signal: SignalLayout) -> Any:
    """The narrowest type that holds the range of a signal."""
    return next(one for one in _TYPES if np.iinfo(one).min <= signal.minimum and signal.maximum <= np.iinfo(one).max)


def _values(
    words: npt.NDArray[np.uint64], signals: Iterable[SignalLayout]
) -> tuple[dict[str, npt.NDArray[Any]], npt.NDArray[np.bool_]]:
    """Columns by name, and which rows have no value out of its range."""
    is_right = np.ones(len(words), np.bool_)
    values = {}
    for signal in signals:
        raw = words >> np.uint64(signal.shift) if signal.shift else words
        if signal.shift + signal.bits < _WORD_BITS:
            raw = raw & np.uint64((1 << signal.bits) - 1)
        value = raw.view(np.int64)
        low, high = 0, (1 << signal.bits) - 1
        if signal.signed:
            half = 1 << signal.bits - 1
            value, low, high = (value ^ half) - half, -half, half - 1
        if signal.is_scaled:
            value = value * signal.scale + signal.offset
        if signal.minimum > low * signal.scale + signal.offset:
            is_right &= value >= signal.minimum
        if signal.maximum < high * signal.scale + signal.offset:
            is_right &= value <= signal.maximum
        values[signal.name] = value.astype(type_of(signal))
    return values, is_right
