"""Straight-line functions from bytes to message objects as Python text.

A frame is cut into words of 1, 2, 4 or 8 bytes such that no signal crosses a cut, and ``struct`` does the rest.
"""

import re
from collections.abc import Iterator
from typing import NamedTuple

from onboard.contract.generate.model import TUPLES, DbcMessage
from onboard.wire.dbc_file import SignalLayout

#: Letters of ``struct`` by length in bytes.
_LETTERS = {1: "B", 2: "H", 4: "I", 8: "Q"}
#: Cost of one more word and of one more signal in a word, in ns on the machine of docs/figures.md, and of each signal
#: behind the first in a word that is longer than a digit.
_WORD_NS, _SIGNAL_NS, _LONG_NS = 12, 30, 20


class Word(NamedTuple):
    """Bytes ``start`` to ``start + length`` of a frame with the signals in them; without signals they are 0."""

    start: int
    length: int
    signals: tuple[SignalLayout, ...]

    @property
    def letter(self) -> str:
        """The word in a format of ``struct``."""
        if not self.signals:
            return "x" * self.length
        letter = _LETTERS[self.length]
        return letter.lower() if self.is_plain and self.signals[0].signed else letter

    @property
    def is_plain(self) -> bool:
        """Whether one signal fills the word."""
        return len(self.signals) == 1 and self.signals[0].bits == self.length * 8


def words(frame: DbcMessage) -> tuple[Word, ...]:
    """The cheapest cut of a frame into words."""
    length = frame.layout.length
    best: dict[int, tuple[int, tuple[Word, ...]]] = {0: (0, ())}
    for end in range(1, length + 1):
        found = []
        for size in (1, 2, 4, 8):
            if end - size not in best:
                continue
            cost, before = best[end - size]
            word = _word(frame, end - size, size)
            if word is not None:
                found.append((cost + _cost(word), (*before, word)))
        if found:
            best[end] = min(found, key=lambda one: one[0])
    return best[length][1]


def _word(frame: DbcMessage, start: int, size: int) -> Word | None:
    """The word there, None where a signal crosses one of its ends."""
    low, high = start * 8, (start + size) * 8
    inside = []
    for signal in frame.layout.signals:
        first, end = signal.shift, signal.shift + signal.bits
        if end <= low or first >= high:
            continue
        if first < low or end > high:
            return None
        inside.append(signal)
    return Word(start, size, tuple(inside))


def _cost(word: Word) -> int:
    if not word.signals:
        return 0
    more = _SIGNAL_NS + (_LONG_NS if word.length > 4 else 0)
    return _WORD_NS + (len(word.signals) - 1) * more


def struct_format(frame: DbcMessage) -> str:
    """The format of a frame, little-endian."""
    return "<" + "".join(word.letter for word in words(frame))


def function_name(frame: DbcMessage) -> str:
    """The message's name as functions have it: ``car_at`` of ``CarAt``."""
    return "".join(f"_{letter.lower()}" if letter.isupper() else letter for letter in frame.layout.name).lstrip("_")


def _mask(signal: SignalLayout) -> str:
    return f"0x{(1 << signal.bits) - 1:X}"


def shape(layout: str) -> str:
    """A name for a format of ``struct``: signed letters with an S before them."""
    return re.sub("[bhiq]", lambda found: f"S{found[0].upper()}", layout.lstrip("<")).replace("x", "X")


def reader(frame: DbcMessage) -> tuple[str, str]:
    """Name and value of what takes the words out of a frame."""
    layout = struct_format(frame)
    return f"_UNPACK_{shape(layout)}", f'struct.Struct("{layout}").unpack_from'


def unpack_function(frame: DbcMessage) -> str:
    """The function from a sender and bytes to a message, or None."""
    name, parts = function_name(frame), [word for word in words(frame) if word.signals]
    lines = [f"def unpack_{name}(sender: int, data: bytes) -> {frame.layout.name} | None:"]
    if parts:
        names = [word.signals[0].name if len(word.signals) == 1 else f"word_{word.start}" for word in parts]
        lines.append(f"    {', '.join(names)}{',' if len(names) == 1 else ''} = {reader(frame)[0]}(data)")
    tables = {field.signals[0].name: field.kind for field in frame.fields if field.kind not in ("int", "bool", *TUPLES)}
    booleans = {field.signals[0].name for field in frame.fields if field.kind == "bool"}
    for word in parts:
        for signal in word.signals:
            lines += _read(word, signal, is_bool=signal.name in booleans)
    arguments = ["sender"]
    for field in sorted(frame.fields, key=lambda field: bool(field.default)):
        if field.kind in TUPLES:
            arguments.append(f"_new({field.kind}, ({', '.join(signal.name for signal in field.signals)}))")
        elif field.kind == "bool":
            arguments.append(_bool(parts, field.signals[0]))
        elif field.name in tables:
            arguments.append(f"{table_name(field.kind)}[{field.name}]")
        else:
            arguments.append(field.name)
    lines.append(f"    return {frame.layout.name}({', '.join(arguments)})")
    return "\n".join(lines) + "\n"


def table_name(kind: str) -> str:
    """The tuple of an enumeration's members, by value."""
    return "_" + "".join(f"_{letter}" if letter.isupper() else letter.upper() for letter in kind).lstrip("_")


def _word_of(parts: list[Word], signal: SignalLayout) -> Word:
    return next(word for word in parts if signal in word.signals)


def _bool(parts: list[Word], signal: SignalLayout) -> str:
    word = _word_of(parts, signal)
    name = signal.name if len(word.signals) == 1 else f"word_{word.start}"
    return f"{name} & 0x{1 << signal.shift - word.start * 8:X} != 0"


def _read(word: Word, signal: SignalLayout, *, is_bool: bool) -> Iterator[str]:
    """The lines that take a signal out of its word and refuse what is out of its range."""
    if is_bool:
        return
    name, shift = signal.name, signal.shift - word.start * 8
    source = name if len(word.signals) == 1 else f"word_{word.start}"
    value = source
    if not word.is_plain:
        is_top = shift + signal.bits == word.length * 8
        value = f"{source} >> {shift}" if shift else source
        value = value if is_top and shift else f"{value} & {_mask(signal)}"
        if signal.signed:
            half = f"0x{1 << signal.bits - 1:X}"
            value = f"({value} ^ {half}) - {half}" if " " not in value else f"(({value}) ^ {half}) - {half}"
    if signal.is_scaled:
        value = f"({value})" if " " in value else value
        value = f"{value} * {signal.scale}" if signal.scale != 1 else value
        value = f"{value} + {signal.offset}" if signal.offset else value
    if value != name:
        yield f"    {name} = {value}"
    low = -(1 << signal.bits - 1) if signal.signed else 0
    high = low + (1 << signal.bits) - 1
    refused = []
    if signal.minimum > low * signal.scale + signal.offset:
        refused.append(f"{name} < {signal.minimum}")
    if signal.maximum < high * signal.scale + signal.offset:
        refused.append(f"{name} > {signal.maximum}")
    if refused:
        yield f"    if {' or '.join(refused)}:"
        yield "        return None"
