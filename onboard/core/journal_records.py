"""A journal record as a dataclass, and the one place where it becomes a journal's entry and is read back by its name.

An entry is flat: JSON of strings and integers, ``record`` naming its type. A field is stored under its own name and by
its type: flags as 0 or 1, numbered enumerations by number, others by name (a ``StrEnum`` by value), floats to the last
bit, tuples of integers as words, a ``Reference`` as two entries (``NAME_origin`` and ``NAME`` unless ``stored_as``
says otherwise). A field with a default may be missing: that is how older journals are read. Names and forms never
change, only new ones come.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import MISSING, Field, dataclass, fields
from enum import Enum, IntEnum, StrEnum
from typing import Any, ClassVar, NamedTuple, TypeVar, get_args, get_type_hints

from onboard.contract.messages import Reference

Entry = Mapping[str, str | int]
_TYPE = "record"
#: Ended tasks of which a machine still knows that they are over: whoever asks again is told so.
MOST_OVER = 500


class Which(Enum):
    """Which records of one family and key are kept when a journal is compacted."""

    NEWEST = "the newest says all"
    FIRST_AND_NEWEST = "the newest says all, the first says since when"
    ALL = "each adds to those before"


class Keep(NamedTuple):
    """A record belongs to ``family``, under the values of its ``key`` fields."""

    family: str
    key: tuple[str, ...] = ()
    which: Which = Which.NEWEST


class RecordEnd(NamedTuple):
    """A record ends all of ``families`` under its ``key``; where ``when`` is given, only with one of these values.

    The newest ``most`` that have ended are kept as they are.
    """

    families: tuple[str, ...]
    key: tuple[str, ...] = ()
    when: tuple[str, tuple[object, ...]] | None = None
    most: int = 0


@dataclass(frozen=True, slots=True)
class JournalRecord:
    """One type of record. ``NAME`` stands in the journal; ``RULES`` say what outlives compaction."""

    NAME: ClassVar[str] = ""
    RULES: ClassVar[tuple[Keep | RecordEnd, ...]] = ()

    @property
    def entry(self) -> Entry:
        """As it stands in the journal."""
        found: dict[str, str | int] = {_TYPE: self.NAME}
        for one in _stored(type(self)):
            value = getattr(self, one.name)
            if value is not None and not (one.is_unsaid and value == one.default):
                found.update(zip(one.keys, one.form.write(value), strict=True))
        return found

    def load_number(self) -> int | None:
        """The number, in its token, of the load that a record is about; None where it is about none."""
        return None


RecordTypes = tuple[type[JournalRecord], ...]
AnyRecord = TypeVar("AnyRecord", bound=JournalRecord)


class RecordShapeError(ValueError):
    """An entry that names a type and has not its fields; ``str`` says which, for a person."""


def stored_as(*keys: str) -> dict[str, Any]:
    """Metadata of a field that stands in the entry under other names than its own."""
    return {"keys": keys}


#: Metadata of a field that is not written where it has its default.
UNSAID = {"unsaid": True}


def records_in(entries: Iterable[Entry], *types: type[AnyRecord]) -> Iterator[AnyRecord]:
    """Records of ``types`` in their order; all others are passed over, and so is what has not the form of its type."""
    named = {one.NAME: one for one in types}
    for entry in entries:
        wanted = named.get(str(entry.get(_TYPE)))
        if wanted is not None:
            try:
                yield _read(wanted, entry)
            except RecordShapeError:
                continue


def read_record(types: Mapping[str, type[JournalRecord]], entry: Entry) -> JournalRecord | None:
    """One entry by types by name (``by_name``); None for a type that is not there. Raises ``RecordShapeError``."""
    wanted = types.get(str(entry.get(_TYPE)))
    return _read(wanted, entry) if wanted is not None else None


def by_name(*types: type[JournalRecord]) -> Mapping[str, type[JournalRecord]]:
    """Types under the names that they have in a journal."""
    return {one.NAME: one for one in types}


def misshapen(entries: Iterable[Entry], types: RecordTypes) -> str:
    """The first entry of a known type that has not its form, for a person; empty where all can be read."""
    known = by_name(*types)
    for number, entry in enumerate(entries, 1):
        try:
            read_record(known, entry)
        except RecordShapeError as error:
            return f"record {number} ({entry[_TYPE]}): {error}"
    return ""


# --- forms -----------------------------------------------------------------------------------------------------


class _Form(NamedTuple):
    """A value to what stands under its keys, and back. ``read`` raises ``ValueError`` or ``KeyError``."""

    write: Callable[[Any], tuple[str | int, ...]]
    read: Callable[..., Any]


class _Stored(NamedTuple):
    name: str
    keys: tuple[str, ...]
    form: _Form
    default: object
    is_unsaid: bool


#: Fields of each type that was met.
_STORED: dict[type[JournalRecord], tuple[_Stored, ...]] = {}


def _stored(record: type[JournalRecord]) -> tuple[_Stored, ...]:
    if record not in _STORED:
        hints = get_type_hints(record)
        _STORED[record] = tuple(_stored_field(one, hints[one.name]) for one in fields(record))
    return _STORED[record]


def _stored_field(one: "Field[Any]", hint: Any) -> _Stored:
    options = [each for each in get_args(hint) if each is not type(None)] if type(None) in get_args(hint) else [hint]
    usual = (f"{one.name}_origin", one.name) if options[0] is Reference else (one.name,)
    keys = one.metadata.get("keys", usual)
    return _Stored(one.name, keys, _form(options[0]), one.default, one.metadata.get("unsaid", False))


def _form(hint: Any) -> _Form:
    """How values of a type are stored; a type that is not among these is a mistake in a record's class."""
    for found, form in _FORMS:
        if hint is found or hint == found:
            return form
    if issubclass(hint, IntEnum):
        return _Form(lambda value: (int(value),), lambda stored: hint(int(stored)))
    if issubclass(hint, StrEnum):
        return _Form(lambda value: (value.value,), lambda stored: hint(str(stored)))
    assert issubclass(hint, Enum), f"no form for {hint}"
    return _Form(lambda value: (value.name,), lambda stored: hint[str(stored)])


_FORMS: tuple[tuple[Any, _Form], ...] = (
    (bool, _Form(lambda value: (int(value),), lambda stored: bool(int(stored)))),
    (int, _Form(lambda value: (int(value),), int)),
    (str, _Form(lambda value: (value,), str)),
    (float, _Form(lambda value: (value.hex(),), lambda stored: float.fromhex(str(stored)))),
    (Reference, _Form(tuple, lambda origin, number: Reference(int(origin), int(number)))),
    (
        tuple[int, ...],
        _Form(lambda value: (" ".join(map(str, value)),), lambda stored: tuple(int(n) for n in str(stored).split())),
    ),
)


def _read(record: type[AnyRecord], entry: Entry) -> AnyRecord:
    values: dict[str, Any] = {}
    for one in _stored(record):
        if all(key in entry for key in one.keys):
            try:
                values[one.name] = one.form.read(*(entry[key] for key in one.keys))
            except (ValueError, KeyError) as error:
                said = ", ".join(f"{key}={entry[key]!r}" for key in one.keys)
                raise RecordShapeError(f"{said} is no {one.name}") from error
        elif one.default is MISSING:
            raise RecordShapeError(f"{' and '.join(one.keys)} is missing")
    return record(**values)
