"""Straight-line functions from message objects to bytes as Python text.

A frame is cut into words of 1, 2, 4 or 8 bytes, and ``struct`` packs them; a signal that crosses a cut is taken in
parts. Of all cuts the cheapest is taken, by the nanoseconds that CPython 3.11 needs for each step on the machine of
docs/figures.md (bench/codec.py). Its whole numbers have digits of 30 bits and fast ways for sums and products of one
digit. Where a signal ends where its word ends, ``struct`` checks its range, for nothing. Where it is the last of its
word but ends before it, one that is too low makes the word negative, as all below are none, and ``struct`` refuses it.
"""

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

from onboard.contract.generate.decoding import function_name, shape
from onboard.contract.generate.model import TUPLES, YES_NO, DbcMessage, Field
from onboard.wire.dbc_file import SignalLayout

#: Letters of ``struct`` by length in bytes.
_LETTERS = {1: "B", 2: "H", 4: "I", 8: "Q"}
_DIGIT_BITS = 30
#: Signals as short have a dictionary for what they add to a word: 18 kB at most.
_TABLE_BITS = 8
_FRAME_BYTES = 8
#: What steps cost, in ns: least squares over the twelve likeliest cuts of every message. A word more, one of more than
#: a digit put together, the whole frame as one number; ``&`` and ``>>``; ``*`` within a digit, to more than one and by
#: more than one; ``+`` within a digit and beyond; a table instead, less the check; to make a negative number a
#: positive one, half of all being so; to check a range, and one of more than a digit.
_WORD_NS, _BIG_WORD_NS, _FRAME_NS, _AND_NS, _SHIFT_NS = 1, 10, 14, 7, 11
_TIMES_NS, _CROSS_TIMES_NS, _LONG_TIMES_NS, _PLUS_NS, _LONG_PLUS_NS = 5, 8, 9, 9, 10
_TABLE_NS, _SIGN_NS, _CHECK_NS, _LONG_CHECK_NS = -8, 10, 11, 20
#: To carry yes or no in the number below it, half of all being no.
_CARRY_NS = 8
#: Lengths of words where another cut than the cheapest by these is 7 to 13 % faster, as measured.
_MEASURED = {
    "MissionKey": (1, 1, 4, 2),
    "OrderAnswer": (2, 1, 4, 1),
}


class Piece(NamedTuple):
    """Bits ``first`` to ``first + bits`` of a signal, at the bit ``at`` of a word."""

    signal: SignalLayout
    first: int
    bits: int
    at: int

    @property
    def has_sign(self) -> bool:
        """Whether it is the upper end of a signal, or all of it."""
        return self.first + self.bits == self.signal.bits

    @property
    def is_whole(self) -> bool:
        """Whether it is all of its signal."""
        return self.bits == self.signal.bits


class Word(NamedTuple):
    """Bytes ``start`` to ``start + length`` of a frame; without pieces they are 0."""

    start: int
    length: int
    pieces: tuple[Piece, ...]

    @property
    def closing(self) -> SignalLayout | None:
        """The signal that ends with the word, None where none does: ``struct`` refuses what it cannot hold."""
        last = self.pieces[-1]
        return last.signal if last.has_sign and last.at + last.bits == self.length * 8 else None

    @property
    def guarded(self) -> SignalLayout | None:
        """The signal whose low end ``struct`` checks, as nothing above it makes up for what is below 0."""
        last = self.pieces[-1]
        is_free = last.has_sign and not last.signal.signed and _is_free(last.signal, is_low=True)
        return last.signal if is_free and not last.signal.choices else None

    @property
    def letter(self) -> str:
        """The word in a format of ``struct``."""
        if not self.pieces:
            return "x" * self.length
        letter = _LETTERS[self.length]
        return letter.lower() if self.closing is not None and self.closing.signed else letter

    @property
    def is_number(self) -> bool:
        """Whether it is a whole frame that ``int.to_bytes`` writes."""
        return bool(self.pieces) and self.letter == "Q"


def words(frame: DbcMessage) -> tuple[Word, ...]:
    """The cheapest cut of a frame into words."""
    if frame.layout.name in _MEASURED:
        lengths = _MEASURED[frame.layout.name]
        return tuple(_word(frame, sum(lengths[:number]), size) for number, size in enumerate(lengths))
    best: dict[int, tuple[int, tuple[Word, ...]]] = {0: (0, ())}
    for end in range(1, frame.layout.length + 1):
        found = []
        for size in reversed(_LETTERS):
            if end - size in best:
                cost, before = best[end - size]
                word = _word(frame, end - size, size)
                found.append((cost + _cost(word), (*before, word)))
        best[end] = min(found, key=lambda one: one[0])
    return best[frame.layout.length][1]


def _word(frame: DbcMessage, start: int, length: int) -> Word:
    return Word(start, length, tuple(_pieces(frame, start * 8, (start + length) * 8)))


def _carried(word: Word) -> dict[str, Piece]:
    """Yes and no right above a number that has a name: by signal, the piece of the number, which takes them along.

    One that says no costs a jump then, and one that says yes a sum of small numbers.
    """
    found: dict[str, Piece] = {}
    for below, piece in pairwise(word.pieces):
        carrier = found.get(below.signal.name, below)
        signal = carrier.signal
        can_carry = not (signal.signed or signal.choices or signal.is_scaled or _is_from_table(word, carrier))
        is_next = piece.at == below.at + below.bits and carrier.has_sign
        if is_next and can_carry and piece.signal.choices == YES_NO:
            found[piece.signal.name] = carrier
    return found


def _pieces(frame: DbcMessage, low: int, high: int) -> Iterator[Piece]:
    for signal in sorted(frame.layout.signals, key=lambda one: one.shift):
        first, end = max(signal.shift, low), min(signal.shift + signal.bits, high)
        if first < end:
            yield Piece(signal, first - signal.shift, end - first, first - low)


def _cost(word: Word) -> int:
    """Nanoseconds of a word, less those of the checks that it spares."""
    if not word.pieces:
        return 0
    last, closing = word.pieces[-1], word.closing
    cost = _FRAME_NS if word.length == _FRAME_BYTES else _WORD_NS
    if word.letter == "I" and len(word.pieces) > 1 and last.at + last.bits > _DIGIT_BITS:
        cost += _BIG_WORD_NS
    carried = _carried(word)
    cost += sum(_CARRY_NS if piece.signal.name in carried else _piece_cost(word, piece) for piece in word.pieces)
    if closing is not None and not closing.choices:
        check = _LONG_CHECK_NS if closing.maximum >= 1 << _DIGIT_BITS else _CHECK_NS
        cost -= check * (_is_free(closing, is_low=True) + _is_free(closing, is_low=False)) // 2
    elif word.guarded is not None and not _is_from_table(word, last):
        cost -= (_LONG_CHECK_NS if word.guarded.maximum >= 1 << _DIGIT_BITS else _CHECK_NS) // 2
    return cost


def _piece_cost(word: Word, piece: Piece) -> int:
    signal, is_long = piece.signal, piece.at + piece.bits > _DIGIT_BITS
    cost = (0 if piece.has_sign else _AND_NS) + (_SHIFT_NS if piece.first else 0)
    cost += 0 if piece.is_whole or signal.bits <= _DIGIT_BITS else _BIG_WORD_NS
    if signal.signed and piece.has_sign and word.closing is not signal:
        cost += _SIGN_NS
    if not piece.at:
        return cost
    cost += _LONG_PLUS_NS if is_long else _PLUS_NS
    if _is_fixed(word, piece):
        return cost + (_TIMES_NS if signal.choices else _TABLE_NS)
    if piece.at >= _DIGIT_BITS:
        return cost + _LONG_TIMES_NS
    return cost + (_CROSS_TIMES_NS if is_long else _TIMES_NS)


def _is_free(signal: SignalLayout, *, is_low: bool) -> bool:
    """Whether one end of a signal's range is that of its bits."""
    low = -(1 << signal.bits - 1) if signal.signed else 0
    if signal.is_scaled:
        return False
    return signal.minimum == low if is_low else signal.maximum == low + (1 << signal.bits) - 1


def _is_from_table(word: Word, piece: Piece) -> bool:
    """Whether a dictionary has what a piece adds to its word: it takes the place of a product and of a check."""
    signal = piece.signal
    is_small = piece.is_whole and piece.bits <= _TABLE_BITS and not signal.signed and not signal.is_scaled
    return is_small and piece.at > 0 and not signal.choices and (word.is_number or word.closing is not signal)


def _table(piece: Piece) -> tuple[str, str]:
    """Name and value of that dictionary."""
    signal = piece.signal
    name = f"_FROM_{signal.minimum}_TO_{signal.maximum}_AT_{piece.at}"
    ends = f"{signal.minimum}, {signal.maximum + 1}" if signal.minimum else f"{signal.maximum + 1}"
    return name, f"{{value: value << {piece.at} for value in range({ends})}}"


def _is_fixed(word: Word, piece: Piece) -> bool:
    """Whether a piece needs no product: it comes out of a table, or is yes or no above the lowest bit."""
    is_yes_no = piece.signal.choices == YES_NO and piece.at > 0
    return is_yes_no or _is_from_table(word, piece)


class _Lines:
    """A function in the making: its statements, and the names that its expressions use for signals."""

    def __init__(self, frame: DbcMessage) -> None:
        self.frame = frame
        self.words = tuple(word for word in words(frame))
        self.body: list[str] = []
        self.names: dict[str, str] = {}
        #: Signals whose range, or one end of it, is not checked before they are packed.
        self.late: list[str] = []
        #: Signals whose name has the raw number already.
        self.scaled: set[str] = set()
        self.carried = {name: one for word in self.words for name, one in _carried(word).items()}
        for field in frame.fields:
            self._take(field)
        for name, carrier in self.carried.items():
            bit = next(piece.at for word in self.words for piece in word.pieces if piece.signal.name == name)
            added = 1 << bit - carrier.at + carrier.first
            self.body += [f"    if message.{name}:", f"        {carrier.signal.name} += 0x{added:X}"]

    def _take(self, field: Field) -> None:
        """Get a field's values and refuse those out of range."""
        whole = field.name
        if field.kind in TUPLES:
            self.body.append(f"    {whole} = message.{whole}")
        for number, signal in enumerate(field.signals):
            # By number: a name of a named tuple's field takes half as long again.
            source = f"{whole}[{number}]" if field.kind in TUPLES else f"message.{whole}"
            checks = list(self._checks(field, number)) if field.kind in ("int", *TUPLES) else []
            pieces = [piece for word in self.words for piece in word.pieces if piece.signal == signal]
            closes = any(word.closing == signal for word in self.words if word.pieces)
            is_turned = signal.signed and not closes
            if not checks and len(pieces) == 1 and not is_turned:
                self.names[signal.name] = source
                continue
            self.names[signal.name] = signal.name
            self.body.append(f"    {signal.name} = {source}")
            if is_turned and checks and not signal.is_scaled:
                self.body += self._turned(signal)
                continue
            self.body += checks
            if signal.is_scaled and (len(pieces) > 1 or is_turned):
                self.body.append(f"    {signal.name} = {_scaled(signal, signal.name)}")
                self.scaled.add(signal.name)
            if is_turned:
                self.body += [f"    if {signal.name} < 0:", f"        {signal.name} += 0x{1 << signal.bits:X}"]

    def _checks(self, field: Field, number: int) -> Iterator[str]:
        signal = field.signals[number]
        name = signal.name
        word = next((word for word in self.words if word.pieces and word.closing == signal), None)
        low = word is not None and _is_free(signal, is_low=True)
        low = low or any(word.guarded == signal for word in self.words if word.pieces)
        high = word is not None and _is_free(signal, is_low=False)
        if any(_is_from_table(word, piece) for word in self.words for piece in word.pieces if piece.signal == signal):
            low = high = True
        if low or high:
            path = f"{field.name}.{TUPLES[field.kind][number]}" if field.kind in TUPLES else name
            self.late.append(f'("{self.frame.layout.name}.{path}", {signal.minimum}, {signal.maximum})')
        if low and high:
            return
        # Two comparisons, not a chain: CPython has a fast way for one that a jump follows.
        ends = ([] if low else [f"{name} < {signal.minimum}"]) + ([] if high else [f"{name} > {signal.maximum}"])
        yield f"    if {' or '.join(ends)}:"
        yield self._refusal(signal)

    def _turned(self, signal: SignalLayout) -> Iterator[str]:
        """Both ends of a range, and a negative number to a positive one, with a comparison less than one by one."""
        name, refusal = signal.name, self._refusal(signal)
        yield from (f"    if {name} < 0:", f"        if {name} < {signal.minimum}:", f"    {refusal}")
        yield f"        {name} += 0x{1 << signal.bits:X}"
        yield from (f"    elif {name} > {signal.maximum}:", refusal)

    def _refusal(self, signal: SignalLayout) -> str:
        where = f'"{self.frame.layout.name}.{signal.name}"'
        return f"        raise OutOfRangeError({where}, {signal.name}, {signal.minimum}, {signal.maximum})"

    def result(self) -> tuple[str, str]:
        """The expression of the bytes, and what it raises for a value out of its range."""
        used = [word for word in self.words if word.pieces]
        errors = []
        if not used:
            return f'b"{chr(92)}0" * {_FRAME_BYTES}', ""
        if any(_is_from_table(word, piece) for word in used for piece in word.pieces):
            errors.append("KeyError")
        if used[0].is_number:
            is_late = used[0].closing or (used[0].guarded and not _is_from_table(used[0], used[0].pieces[-1]))
            errors += ["OverflowError"] if is_late else []
            made = f'({self._number(used[0])}).to_bytes({_FRAME_BYTES}, "little")'
        else:
            errors.append("struct.error")
            made = f"{_packer(self.words)[0]}({', '.join(self._number(word) for word in used)})"
        return made, errors[0] if len(errors) == 1 else f"({', '.join(errors)})"

    def _number(self, word: Word) -> str:
        """The expression that makes a word of its pieces, those of one digit of a whole number together."""
        digits: list[list[Piece]] = []
        carried = _carried(word)
        for piece in word.pieces:
            if piece.signal.name in carried:
                continue
            is_apart = _is_fixed(word, piece)
            fits = digits and not _is_fixed(word, digits[-1][0]) and not is_apart
            bits = piece.bits + sum(one == piece for one in carried.values())
            if fits and piece.at + bits - digits[-1][0].at <= _DIGIT_BITS:
                digits[-1].append(piece)
            else:
                digits.append([piece])
        sums = []
        for digit in digits:
            if _is_fixed(word, digit[0]):
                sums.append(self._fixed(digit[0]))
                continue
            total = " + ".join(_times(self._term(word, piece), piece.at - digit[0].at) for piece in digit)
            shift = digit[0].at
            sums.append(_times(f"({total})" if shift and len(digit) > 1 else total, shift))
        return " + ".join(sums)

    def _fixed(self, piece: Piece) -> str:
        name = self.names[piece.signal.name]
        if piece.signal.choices:
            return f"(0x{1 << piece.at:X} if {name} else 0)"
        return f"{_table(piece)[0]}[{name}]"

    def _term(self, word: Word, piece: Piece) -> str:
        """What a piece has of its signal."""
        signal = piece.signal
        name = self.names[signal.name]
        if piece.is_whole:
            term = name if signal.name in self.scaled else _scaled(signal, name)
            return f"({term})" if term != name and len(word.pieces) > 1 else term
        term = f"{name} >> {piece.first}" if piece.first else name
        if not piece.has_sign:
            term += f" & 0x{(1 << piece.bits) - 1:X}"
        # A product binds closer than the mask.
        return f"({term})" if len(word.pieces) > 1 or piece.at else term


def _scaled(signal: SignalLayout, name: str) -> str:
    """What a signal holds of a value."""
    number = f"({name} - {signal.offset})" if signal.offset else name
    return f"{number} // {signal.scale}" if signal.scale != 1 else number


def _times(term: str, shift: int) -> str:
    if shift >= _DIGIT_BITS:
        return f"({term} << {shift})"
    return f"{term} * 0x{1 << shift:X}" if shift else term


def pack_function(frame: DbcMessage) -> str:
    """The function from a message to its bytes."""
    lines = _Lines(frame)
    made, errors = lines.result()
    text = [f"def pack_{function_name(frame)}(message: {frame.layout.name}) -> bytes:", *lines.body]
    if not lines.late:
        return "\n".join([*text, f"    return {made}"]) + "\n"
    text += ["    try:", f"        return {made}", f"    except {errors} as error:"]
    return "\n".join([*text, f"        raise refusal(message, {', '.join(lines.late)}) from error"]) + "\n"


def tools(frame: DbcMessage) -> set[tuple[str, str]]:
    """Names and values of what a frame's function uses."""
    cut = words(frame)
    found = {_table(piece) for word in cut for piece in word.pieces if _is_from_table(word, piece)}
    needs_none = any(word.is_number for word in cut) or not any(word.pieces for word in cut)
    return found if needs_none else found | {_packer(cut)}


def _packer(cut: tuple[Word, ...]) -> tuple[str, str]:
    layout = "<" + "".join(word.letter for word in cut)
    return f"_PACK_{shape(layout)}", f'struct.Struct("{layout}").pack'
