"""Enumerations and message classes of a contract as Python text."""

import textwrap
import zlib
from collections.abc import Iterable, Iterator

from onboard.contract.generate.model import TUPLES, DbcFile, DbcMessage, Field, FrameSet, ValueTable

WIDTH = 120
#: What a summary line may hold: the quotes and the indentation off.
_SUMMARY = WIDTH - 4 - 3 - 3
HEAD = '"""{what}\n\nWritten by ``make docs`` from ``dbc/{file}.dbc``: change that file, never this one.\n"""\n\n'


def enumerations(tables: Iterable[ValueTable]) -> str:
    """The classes of value tables."""
    return "\n\n".join(_enumeration(table) for table in tables)


def _enumeration(table: ValueTable) -> str:
    members = "\n".join(f"    {name} = {value}" for value, name in table.choices)
    return f"class {table.name}(IntEnum):\n{docstring(table.comment)}\n\n{members}\n"


def version(contract: DbcFile) -> str:
    """The numbers by which machines of one contract know each other."""
    digest = words_digest(contract) & 0x7F | 0x80
    return (
        f"#: The contract of dbc/{contract.name}.dbc.\nCONTRACT = {contract.version}\n"
        "#: What heartbeats say of it; a machine with another number joins as an obstacle and never bids. While the\n"
        "#: contract is open: 128 plus the low 7 bits of a CRC-32 over the DBC (docs/protocol.md), so that builds\n"
        f"#: of different days are strangers.\nCONTRACT_VERSION = 0x{digest:02X}\n"
    )


def words_digest(contract: DbcFile) -> int:
    """CRC-32 (as of zlib) over the lines that say how its messages are laid out (docs/protocol.md, chapter 16)."""
    lines = [line for line in contract.text.splitlines() if line.startswith(("BO_ ", " SG_ "))]
    return zlib.crc32("\n".join(lines).encode())


def message_class(frame: DbcMessage) -> str:
    """The text of a frame's class, a part of a set or a message of its own."""
    base = "SetFrame" if frame.part_of else "Message"
    return _class(frame.layout.name, base, frame.layout.comment, frame.fields)


def set_classes(one: FrameSet) -> str:
    """The class of a message that is several frames, behind that of the tuple that its last frame is."""
    whole = _class(one.name, "Message", one.comment, one.fields)
    if not one.repeated:
        return whole
    comment = one.frames[-1].layout.comment
    return f"class {one.repeated}(NamedTuple):\n{docstring(comment)}\n\n{_fields(one.repeated_fields)}\n\n\n{whole}"


def _class(name: str, base: str, comment: str, fields: tuple[Field, ...]) -> str:
    ordered = sorted(fields, key=lambda field: bool(field.default))
    body = f"\n\n{_fields(ordered)}" if ordered else ""
    return f"@message(frozen=True, slots=True)\nclass {name}({base}):\n{docstring(comment)}{body}\n"


def _fields(fields: Iterable[Field]) -> str:
    return "\n".join(line for field in fields for line in _field(field))


def _field(field: Field) -> Iterator[str]:
    for number, signal in enumerate(field.signals):
        inner = f"``{TUPLES[field.kind][number]}``: " if field.kind in TUPLES else ""
        unit = f" {signal.unit}" if signal.unit else ""
        values = f" {signal.minimum} to {signal.maximum}{unit}." if not signal.choices else ""
        yield from textwrap.wrap(
            f"{inner}{signal.comment}{values}", WIDTH, initial_indent="    #: ", subsequent_indent="    #: "
        )
    yield f"    {field.name}: {field.kind}{f' = {field.default}' if field.default else ''}"


def docstring(comment: str) -> str:
    """A comment of the DBC as a docstring: its first sentence, then the rest."""
    text = comment.replace("\\", "\\\\")
    first, rest = _split(text)
    lines = textwrap.wrap(rest, WIDTH - 4, initial_indent="    ", subsequent_indent="    ") if rest else []
    if not lines:
        return f'    """{first}"""'
    return "\n".join([f'    """{first}', "", *lines, '    """'])


def _split(text: str) -> tuple[str, str]:
    """A first part that fits into a line, and the rest."""
    for end in (". ", ": ", "; ", ", "):
        at = text.rfind(end, 0, _SUMMARY) if end != ". " else text.find(end)
        if end == ". " and at < 0 and len(text) <= _SUMMARY:
            return text, ""
        if 0 < at < _SUMMARY:
            rest = text[at + 2 :]
            return f"{text[:at]}.", rest[:1].upper() + rest[1:]
    return text, ""


def uses(fields: Iterable[Field]) -> set[str]:
    """Names of the kinds that these fields have, beside int and bool."""
    found = {field.kind for field in fields} - {"int", "bool"}
    found |= {"NO_REFERENCE" for field in fields if field.default == "NO_REFERENCE"}
    return {name for name in found if not name.startswith("tuple")}
