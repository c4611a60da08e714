"""The one file that knows cantools: a DBC text becomes plain layouts.

cantools changes its internals with every release (it is pinned); nothing but this file would have to follow.
"""

import re
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from functools import cache, partial
from typing import NamedTuple

from cantools.database import DecodeError, load_string
from cantools.database import Message as DbcMessage
from cantools.database import Signal as DbcSignal
from cantools.database.can.database import Database
from cantools.database.namedsignalvalue import NamedSignalValue

from dbc import (
    announce_dbc_text,
    battery_dbc_text,
    change_dbc_text,
    device_dbc_text,
    fleet_dbc_text,
    seal_dbc_text,
    system_dbc_text,
)


@dataclass(frozen=True, slots=True)
class SignalLayout:
    """One signal: value = raw * scale + offset; raw has ``bits`` bits at ``shift`` of the little-endian word."""

    name: str
    shift: int
    bits: int
    signed: bool
    scale: int
    offset: int
    minimum: int
    maximum: int
    unit: str
    comment: str
    choices: tuple[tuple[int, str], ...]

    @property
    def is_scaled(self) -> bool:
        """Whether a value is another number than the raw one."""
        return (self.scale, self.offset) != (1, 0)


@dataclass(frozen=True, slots=True)
class MessageLayout:
    """One message; ``frame_id`` has 0 in its lowest byte, where the sender's node-ID goes.

    ``cycle_ms`` is 0 for a message that is sent on events only, ``on_events`` False for one that is sent in its cycle
    only. ``timeout_ms`` is how long a drive goes on without hearing it, 0 where it is no such message.
    """

    name: str
    frame_id: int
    length: int
    cycle_ms: int
    on_events: bool
    timeout_ms: int
    comment: str
    senders: tuple[str, ...]
    receivers: tuple[str, ...]
    signals: tuple[SignalLayout, ...]


def _signal(signal: DbcSignal) -> SignalLayout:
    if signal.byte_order != "little_endian" or signal.minimum is None or signal.maximum is None:
        raise ValueError(f"signal {signal.name} must be little-endian and have a range")
    numbers = (signal.scale, signal.offset, signal.minimum, signal.maximum)
    if any(number != int(number) for number in numbers):
        raise ValueError(f"signal {signal.name} must have a whole scale, offset and range, not {numbers}")
    choices = tuple(sorted((value, str(name)) for value, name in (signal.choices or {}).items()))
    return SignalLayout(
        signal.name,
        signal.start,
        signal.length,
        signal.is_signed,
        int(signal.scale),
        int(signal.offset),
        int(signal.minimum),
        int(signal.maximum),
        signal.unit or "",
        signal.comment or "",
        choices,
    )


def _message(message: DbcMessage) -> MessageLayout:
    signals = tuple(_signal(signal) for signal in sorted(message.signals, key=lambda one: one.start))
    receivers = tuple(dict.fromkeys(node for signal in message.signals for node in signal.receivers))
    timeout = message.dbc.attributes.get("DriveTimeOutMs") if message.dbc is not None else None
    return MessageLayout(
        message.name,
        message.frame_id,
        message.length,
        message.cycle_time or 0,
        message.send_type != "Cyclic",
        int(timeout.value) if timeout is not None else 0,
        message.comment or "",
        tuple(message.senders),
        receivers,
        signals,
    )


def _load(text: str) -> Database:
    database = load_string(text, database_format="dbc", strict=True, sort_signals=None)
    assert isinstance(database, Database)
    return database


def read_layouts(text: str) -> tuple[MessageLayout, ...]:
    """All messages of a DBC text, in the order of their identifiers.

    Raises cantools' errors for a bad text and ``ValueError`` for one that our codec cannot take.
    """
    return tuple(_message(message) for message in sorted(_load(text).messages, key=lambda one: one.frame_id))


def read_nodes(text: str) -> tuple[tuple[str, str], ...]:
    """Name and comment of all nodes of a DBC text, in the file's order."""
    return tuple((node.name, node.comment or "") for node in _load(text).nodes)


class Annotations(NamedTuple):
    """What a DBC says for the generator of ``onboard/contract``, beside its layouts: tables, attributes, the order."""

    version: int
    tables: dict[str, tuple[tuple[int, str], ...]]
    messages: dict[str, dict[str, str]]
    signals: dict[tuple[str, str], dict[str, str]]
    order: dict[str, tuple[str, ...]]


def read_annotations(text: str) -> Annotations:
    """Value tables by name, attributes by message and signal, and the signals of each message in the file's order."""
    database = _load(text)
    assert database.dbc is not None
    return Annotations(
        int(database.dbc.attributes["ContractVersion"].value),
        {
            name: tuple(sorted((value, str(word)) for value, word in choices.items()))
            for name, choices in database.dbc.value_tables.items()
        },
        {message.name: _attributes(message) for message in database.messages},
        {
            (message.name, signal.name): _attributes(signal)
            for message in database.messages
            for signal in message.signals
        },
        {message.name: tuple(signal.name for signal in message.signals) for message in database.messages},
    )


def _attributes(of: DbcMessage | DbcSignal) -> dict[str, str]:
    return {name: str(one.value) for name, one in of.dbc.attributes.items()} if of.dbc is not None else {}


#: The node of a DBC that is a machine's controller on its own device bus: others do not hear what it says there.
CONTROLLER = "Controller"


@cache
def fleet_layouts(system: str = "") -> tuple[MessageLayout, ...]:
    """Layouts of the fleet bus: of all files of all systems, and of what a system adds."""
    beside = (*seal_layouts(), *battery_layouts(), *change_layouts(), *announce_layouts()[0])
    return (*read_layouts(fleet_dbc_text()), *beside, *system_layouts(system)[0])


def seal_layouts() -> tuple[MessageLayout, ...]:
    """What proves who said a frame: in the contract of every site, said only where its file asks for it."""
    return read_layouts(seal_dbc_text())


def battery_layouts() -> tuple[MessageLayout, ...]:
    """What machines tell of their batteries: in the contract of every site, said only where its file has them."""
    return read_layouts(battery_dbc_text())


def change_layouts() -> tuple[MessageLayout, ...]:
    """The word of a change of site: in the contract of every site, said only while an operator changes it."""
    return read_layouts(change_dbc_text())


def announce_layouts() -> tuple[tuple[MessageLayout, ...], tuple[MessageLayout, ...]]:
    """What is said of announced times, on the fleet bus and on device buses: in the contract of every site."""
    return _by_bus(announce_dbc_text())


@cache
def device_layouts(system: str = "") -> tuple[MessageLayout, ...]:
    """Layouts of the device buses: of all systems, and of what a system adds."""
    return (*read_layouts(device_dbc_text()), *announce_layouts()[1], *system_layouts(system)[1])


@cache
def system_layouts(system: str) -> tuple[tuple[MessageLayout, ...], tuple[MessageLayout, ...]]:
    """What a system says beyond the two contracts of all: on the fleet bus, and on device buses."""
    text = system_dbc_text(system) if system else None
    return _by_bus(text) if text is not None else ((), ())


def _by_bus(text: str) -> tuple[tuple[MessageLayout, ...], tuple[MessageLayout, ...]]:
    layouts = read_layouts(text)
    device = tuple(one for one in layouts if CONTROLLER in (*one.senders, *one.receivers))
    return tuple(one for one in layouts if one not in device), device


#: A signal or message of more bits or bytes than five digits write: the longest transport of J1939 has 14,280 bits, and
#: cantools lays each bit out.
_TOO_WIDE = re.compile(r"^[ \t]*SG_[^:\n]*:[ \t]*(?:\d{6,}\||\d+\|\d{6,})|^BO_[^:\n]*:[ \t]*\d{5,}", re.MULTILINE)
#: Words of signals that are remembered, some 150 bytes each.
_TOLD_KEPT = 1 << 16


class AnyDbcError(ValueError):
    """A text that is no DBC; one line."""


class Decoded(NamedTuple):
    """A frame by a DBC: the message's name, its length in bytes, and in words the signals with their units."""

    name: str
    length: int
    text: str


class _Told(dict[int, str]):
    """Words of a signal by its bits, as a number without sign; what is not there yet is put into words."""

    def __init__(self, tell: Callable[[int], str]) -> None:
        super().__init__()
        self._tell = tell

    def __missing__(self, raw: int) -> str:
        words = self._tell(raw)
        self[raw] = words
        return words


class _Cut(NamedTuple):
    """A signal of whole numbers: its bits in the big-endian or little-endian number of the message's bytes."""

    told: _Told
    is_big: bool
    shift: int
    mask: int


class _Plain(NamedTuple):
    """A message that always has the same signals, each of whole numbers; ``little`` where all are little-endian."""

    begins: str
    length: int
    cuts: tuple[_Cut, ...]
    little: tuple[tuple[_Told, int, int], ...]

    def text(self, data: bytes) -> str:
        """The signals of a frame that is long enough."""
        little, big = int.from_bytes(data, "little"), int.from_bytes(data[: self.length], "big")
        return ", ".join([told[(big if is_big else little) >> shift & mask] for told, is_big, shift, mask in self.cuts])


class AnyDbc:
    """A DBC of whatever bus, for looking at logs. Files found in the wild leave out sections that the format wants.

    ``warning`` says what had to be added, empty where nothing. Raises ``AnyDbcError``.
    """

    def __init__(self, text: str) -> None:
        missing = [section for section in ("BS_", "BU_") if not re.search(rf"^\s*{section}\s*:", text, re.MULTILINE)]
        self.warning = f"without {' and '.join(missing)}: read as if both were there and empty" if missing else ""
        if missing:
            first = re.search(r"^BO_\s", text, re.MULTILINE)
            at = first.start() if first is not None else len(text)
            # In the format's order: what is there already stays where it is only if the other follows it.
            text = text[:at] + "".join(f"{section}:\n\n" for section in missing) + text[at:]
        if (wide := _TOO_WIDE.search(text)) is not None:
            raise AnyDbcError(f"line {text.count(chr(10), 0, wide.start()) + 1}: wider than any frame")
        try:
            database = load_string(text, database_format="dbc", strict=False)
        except Exception as error:  # cantools and its parser have a dozen errors of their own for a bad text
            raise AnyDbcError(" ".join(str(error).split())[:200]) from error
        assert isinstance(database, Database)
        self._messages = {(one.frame_id, one.is_extended_frame): one for one in database.messages}
        #: Words of signals that are said alike, whichever messages they are in; and how many words there are.
        self._told: dict[Hashable, _Told] = {}
        self._words_kept = 0
        self._plain = {key: self._plain_of(one) for key, one in self._messages.items()}

    def decode(self, can_id: int, data: bytes, *, is_extended: bool) -> Decoded | None:
        """The frame in words, or None for an identifier that the DBC has not. A short frame gives what it holds."""
        message = self._messages.get((can_id, is_extended))
        if message is None:
            return None
        if (plain := self._plain[can_id, is_extended]) is not None and len(data) >= message.length:
            return Decoded(message.name, message.length, plain.text(data))
        units = {signal.name: signal.unit or "" for signal in message.signals}
        try:
            values = message.decode(data, allow_truncated=True)
        except (DecodeError, ValueError, KeyError):
            return Decoded(message.name, message.length, f"data {data.hex().upper() or 'none'}")
        assert isinstance(values, dict)
        text = ", ".join(f"{name} {_told(value, units.get(name, ''))}" for name, value in values.items())
        return Decoded(message.name, message.length, text)

    def words(self, can_id: int, data: bytes, *, is_extended: bool) -> str | None:
        """Name and signals of a whole frame; None for what ``decode`` must look at."""
        plain = self._plain.get((can_id, is_extended))
        if plain is None or len(data) < plain.length:
            return None
        if not plain.little:
            return plain.begins + plain.text(data)
        bits = int.from_bytes(data, "little")
        return plain.begins + ", ".join([told[bits >> shift & mask] for told, shift, mask in plain.little])

    def _plain_of(self, message: DbcMessage) -> _Plain | None:
        """None where signals depend on others, are no whole numbers, or do not lie in the message: cantools judges."""
        bits = 8 * message.length
        cuts: list[_Cut] = []
        for signal in message.signals:
            is_big = signal.byte_order == "big_endian"
            # Of a big-endian signal the DBC names the highest bit, counted from the lowest of each byte.
            first = 8 * (signal.start // 8) + 7 - signal.start % 8 if is_big else signal.start
            if message.is_multiplexed() or signal.is_float or not 0 < signal.length <= bits - first:
                return None
            shift = bits - first - signal.length if is_big else first
            cuts.append(_Cut(self._told_of(signal), is_big, shift, (1 << signal.length) - 1))
        if len({signal.name for signal in message.signals}) < len(cuts):
            return None
        little = () if any(cut.is_big for cut in cuts) else tuple((cut.told, cut.shift, cut.mask) for cut in cuts)
        return _Plain(f"{message.name}: ", message.length, tuple(cuts), little)

    def _told_of(self, signal: DbcSignal) -> _Told:
        choices = tuple(sorted((value, str(name)) for value, name in (signal.choices or {}).items()))
        form = signal.length, signal.is_signed, repr(signal.scale), repr(signal.offset), choices
        return self._told.setdefault((signal.name, signal.unit, *form), _Told(partial(self._tell, signal)))

    def _tell(self, signal: DbcSignal, raw: int) -> str:
        if self._words_kept >= _TOLD_KEPT:
            self._words_kept = 0
            for told in self._told.values():
                told.clear()
        self._words_kept += 1
        half = 1 << signal.length - 1
        value = signal.conversion.raw_to_scaled((raw ^ half) - half if signal.is_signed else raw, decode_choices=True)
        return f"{signal.name} {_told(value, signal.unit or '')}"


def _told(value: object, unit: str) -> str:
    if isinstance(value, NamedSignalValue):
        return str(value.name)
    text = f"{value:.10g}" if isinstance(value, float) else str(value)
    return f"{text} {unit}".rstrip()
