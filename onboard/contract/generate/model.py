"""The contract's DBC files as the generator sees them: modules of enumerations, frames and messages.

What a DBC says by standard means is taken from there: ``VAL_TABLE_`` names an enumeration, and a signal has the one
whose values its own ``VAL_`` repeats. The rest are attributes:

* ``Noun`` of a message: the module that it goes to, where the file's would be too long;
* ``PartOf`` of a message: the set of frames that it is a part of, in the order of their identifiers; ``SetComment``
  of the first one says what the set is; ``Repeats`` of a last one "Leg legs leg" means that the set's field ``legs``,
  whose count the first frame tells, is a tuple of ``Leg``, numbered by the signal ``leg``; ``FieldOrder`` is the order
  of the fields of ``Leg``, and at the first message of the set, where it is not that of the signals;
* ``Default`` of a signal: what its field is where nobody names it;
* ``TableComment`` of a signal: what its value table is, told at one of the signals that have it.
"""

from dataclasses import dataclass
from typing import NamedTuple

from onboard.contract.base import Reference, Stamp
from onboard.wire.dbc_file import CONTROLLER, Annotations, MessageLayout, SignalLayout, read_annotations, read_layouts

#: Signals ``x_origin`` and ``x_number`` together are a field ``x`` of this kind.
TUPLES = {kind.__name__: kind._fields for kind in (Reference, Stamp)}
YES_NO = ((0, "NO"), (1, "YES"))


class ContractError(ValueError):
    """A DBC that the generator cannot make code of; one line with file, message and signal."""


@dataclass(frozen=True, slots=True)
class ValueTable:
    """An enumeration of a DBC: ``choices`` are values with their names, ``module`` where it stands."""

    name: str
    comment: str
    choices: tuple[tuple[int, str], ...]
    module: str


class Field(NamedTuple):
    """A field of a message: ``kind`` is int, bool, an enumeration or a tuple, ``signals`` what it is made of."""

    name: str
    kind: str
    signals: tuple[SignalLayout, ...]
    default: str


@dataclass(frozen=True, slots=True)
class DbcMessage:
    """One message of a DBC; ``part_of`` names the set that it is a part of."""

    layout: MessageLayout
    module: str
    fields: tuple[Field, ...]
    part_of: str
    is_device: bool


@dataclass(frozen=True, slots=True)
class FrameSet:
    """A message that is several frames. ``repeated`` is the name of the tuple of its last, empty where none is."""

    name: str
    module: str
    comment: str
    frames: tuple[DbcMessage, ...]
    fields: tuple[Field, ...]
    repeated: str
    repeated_fields: tuple[Field, ...]


@dataclass(frozen=True, slots=True)
class DbcFile:
    """One DBC file; ``name`` is the file's, ``text`` the DBC."""

    name: str
    text: str
    version: int
    tables: tuple[ValueTable, ...]
    frames: tuple[DbcMessage, ...]
    sets: tuple[FrameSet, ...]


def read_contract(name: str, text: str, module: str, known: tuple[ValueTable, ...]) -> DbcFile:
    """A DBC text; ``module`` is for its enumerations, ``known`` those of the contracts of all. ``ContractError``."""
    notes = read_annotations(text)
    layouts = read_layouts(text)
    comments = {
        signal.choices: notes.signals[layout.name, signal.name]["TableComment"]
        for layout in layouts
        for signal in layout.signals
        if "TableComment" in notes.signals.get((layout.name, signal.name), {})
    }
    tables = tuple(ValueTable(one, comments.get(choices, ""), choices, module) for one, choices in notes.tables.items())
    every = {table.choices: table for table in (*known, *tables)}
    frames = tuple(_frame(name, layout, notes, every) for layout in layouts)
    for table in tables:
        if not table.comment:
            raise ContractError(f"{name}.dbc: value table {table.name}: no signal that has it has a TableComment")
    return DbcFile(name, text, notes.version, tables, frames, _sets(frames, notes))


def _frame(
    file: str, layout: MessageLayout, notes: Annotations, tables: dict[tuple[tuple[int, str], ...], ValueTable]
) -> DbcMessage:
    attributes = notes.messages[layout.name]
    by_name = {signal.name: signal for signal in layout.signals}
    names = list(notes.order[layout.name])
    fields = []
    while names:
        signal = by_name[names[0]]
        group = _group(names)
        default = notes.signals.get((layout.name, signal.name), {}).get("Default", "")
        if group is not None:
            kind, field = group
            signals = tuple(by_name[f"{field}_{inner}"] for inner in TUPLES[kind])
            fields.append(Field(field, kind, signals, "NO_REFERENCE" if default else ""))
            names = names[len(signals) :]
            continue
        names = names[1:]
        kind = _kind(f"{file}.dbc: {layout.name}.{signal.name}", signal, tables)
        if default:
            default = str(bool(int(default))) if kind == "bool" else default
        fields.append(Field(signal.name, kind, (signal,), default))
    is_device = file == "device" or CONTROLLER in (*layout.senders, *layout.receivers)
    module = file if file == "device" or not is_device else f"{file}_device"
    return DbcMessage(layout, attributes.get("Noun") or module, tuple(fields), attributes.get("PartOf", ""), is_device)


def _group(names: list[str]) -> tuple[str, str] | None:
    """Kind and name of the tuple field that the first of these signals begin."""
    for kind, inners in TUPLES.items():
        field = names[0].removesuffix(f"_{inners[0]}")
        if field != names[0] and names[: len(inners)] == [f"{field}_{inner}" for inner in inners]:
            return kind, field
    return None


def _kind(where: str, signal: SignalLayout, tables: dict[tuple[tuple[int, str], ...], ValueTable]) -> str:
    if not signal.choices:
        return "int"
    if signal.choices == YES_NO:
        return "bool"
    if signal.choices not in tables:
        raise ContractError(f"{where}: no VAL_TABLE_ has these values")
    if [value for value, _ in signal.choices] != list(range(len(signal.choices))):
        raise ContractError(f"{where}: values must count from 0 without a gap")
    if (signal.minimum, signal.maximum) != (0, len(signal.choices) - 1):
        raise ContractError(f"{where}: its range must be that of its values, 0 to {len(signal.choices) - 1}")
    return tables[signal.choices].name


def _sets(frames: tuple[DbcMessage, ...], notes: Annotations) -> tuple[FrameSet, ...]:
    return tuple(
        _set(name, tuple(frame for frame in frames if frame.part_of == name), notes)
        for name in dict.fromkeys(frame.part_of for frame in frames if frame.part_of)
    )


def _set(name: str, frames: tuple[DbcMessage, ...], notes: Annotations) -> FrameSet:
    attributes = notes.messages[frames[0].layout.name]
    repeats = notes.messages[frames[-1].layout.name].get("Repeats", "")
    fields = {field.name: field for frame in (frames[:-1] if repeats else frames) for field in frame.fields}
    inner: tuple[Field, ...] = ()
    repeated = ""
    if repeats:
        repeated, many, number = repeats.split()
        counted = fields.pop(many)
        left_out = (*fields, number)
        order = notes.messages[frames[-1].layout.name].get("FieldOrder", "").split()
        inner = tuple(field for field in frames[-1].fields if field.name not in left_out)
        inner = tuple(sorted(inner, key=lambda field: order.index(field.name) if order else 0))
        fields[many] = Field(many, f"tuple[{repeated}, ...]", counted.signals, "")
    order = attributes.get("FieldOrder", "").split()
    ordered = sorted(fields.values(), key=lambda field: order.index(field.name) if order else bool(field.default))
    return FrameSet(name, frames[0].module, attributes["SetComment"], frames, tuple(ordered), repeated, inner)
