"""Tables of others: CSV with any delimiter, encoding and names of columns, as rows of the columns that are known here.

A row that cannot be read is a bad row: all of them are found, with line, value and remedy.
"""

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple, Protocol

from bus_sim.demand import DemandError
from bus_sim.systems.car_park.moments import CellError, MomentForm
from onboard.bounded_file import MOST_EXPORT, read_bounded
from onboard.config.problems import at_most

#: Bad rows that are named one by one; the others are counted.
MOST_ROWS = 20
#: Cells so filled are empty: what spreadsheets and data bases write for nothing.
_NOTHING = frozenset({"", "-", "null", "none", "nan", "nat", "n/a", "na"})
#: How files begin whose encoding is told by their byte-order mark.
_MARKS = ((b"\xef\xbb\xbf", "utf-8-sig"), (b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16"))
#: Longest word about a row, characters.
_MOST_TOLD = 300
#: Delimiters by name, for command lines.
DELIMITERS = {"comma": ",", "semicolon": ";", "tab": "\t", "bar": "|"}


class Readable(Protocol):
    """A file, on disk or inside a package."""

    @property
    def name(self) -> str:
        """Its name, for error lines."""

    def read_bytes(self) -> bytes:
        """Its whole content; raises ``OSError`` for what is no file."""


@dataclass(frozen=True)
class CsvForm:
    """How a table is written.

    ``columns``: the names in the file for a column that is known here; several are joined with a blank, such as those
    of day and hour. A column that is not named here has the name that it is known by. ``encoding`` None: by the
    byte-order mark, UTF-8 without one.
    """

    columns: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    delimiter: str = ","
    encoding: str | None = None
    moments: MomentForm = field(default_factory=MomentForm)
    skip_bad: bool = False

    def names(self, column: str) -> tuple[str, ...]:
        """What the file calls a column."""
        return self.columns.get(column, (column,))


class CsvRow(NamedTuple):
    """One row: its last line in the file, and its cells by the columns known here, stripped; empty ones left out."""

    line: int
    cells: Mapping[str, str]

    def text(self, column: str) -> str:
        """The cell. Raises ``CellError`` where it is empty."""
        if column not in self.cells:
            raise CellError(f"{column} is empty; every row needs one")
        return self.cells[column]

    def number(self, column: str, low: int, high: int) -> int:
        """A whole number of a column. Raises ``CellError`` for an empty cell and for anything else."""
        text = self.text(column)
        try:
            value = float(text)
        except ValueError as error:
            has = "has a comma" if "," in text else "is no number"
            raise CellError(f"{column} {text!r} {has}; write {_whole(text, low, high)}") from error
        if not low <= value <= high or value != int(value):
            raise CellError(f"{column} {text!r} is out of range; write {_whole(text, low, high)}")
        return int(value)


@dataclass
class CsvTable:
    """A table as it is read: its rows once, the bad ones noted as they come."""

    name: str
    form: CsvForm
    bad: list[str] = field(default_factory=list)
    #: Rows that hold anything, good and bad.
    count: int = 0

    def note(self, row: CsvRow, error: CellError) -> None:
        """Keep what is wrong with one row, and what to do about it, for the line that names it."""
        told = str(error)
        # What stands in a cell may be as long as a file.
        told = told if len(told) <= _MOST_TOLD else f"{told[: _MOST_TOLD // 2]} ... {told[-_MOST_TOLD // 2 :]}"
        self.bad.append(f"{self.name}:{row.line}: {told}")

    def rows(self, source: Readable, needed: Sequence[str], optional: Sequence[str]) -> Iterator[CsvRow]:
        """All rows that have as many cells as the first line has names.

        Raises ``DemandError`` where the file cannot be read, or does not have a column that is ``needed`` or named in
        the form.
        """
        text = _decoded(source, self.form.encoding)
        reader = csv.reader(io.StringIO(text, newline=""), delimiter=self.form.delimiter)
        try:
            head = [name.strip() for name in next(reader, [])]
            at = self._places(head, needed, optional)
            for cells in reader:
                if not any(cell.strip() for cell in cells):
                    continue
                self.count += 1
                row = CsvRow(reader.line_num, _known(cells, at))
                if len(cells) < len(head) or any(cell.strip() for cell in cells[len(head) :]):
                    found = f"has {len(cells)} cell{'s' * (len(cells) > 1)}, the first line {len(head)} names"
                    more = ", and write numbers without one" if self.form.delimiter == "," else ""
                    self.note(row, CellError(f"{found}; put values that hold a {self._mark()} in quotes{more}"))
                else:
                    yield row
        except csv.Error as error:
            raise DemandError(f"{self.name}:{reader.line_num}: no CSV ({error}); is a quote left open?") from error

    def checked(self) -> list[str]:
        """What is told of bad rows that are passed over; none where there are none. ``DemandError`` unless asked so."""
        if not self.bad:
            return []
        told = at_most(MOST_ROWS, self.bad)
        if self.form.skip_bad:
            return [f"{self.name}: {len(self.bad)} of {self.count} rows are bad and passed over", *told]
        if len(self.bad) == 1:
            raise DemandError(f"{self.bad[0]}, or pass it over: --skip-bad")
        raise DemandError("\n".join([*told, f"{self.name}: {len(self.bad)} bad rows; --skip-bad passes them over"]))

    # --- the first line ----------------------------------------------------------------------------------------

    def _mark(self) -> str:
        return next((name for name, mark in DELIMITERS.items() if mark == self.form.delimiter), self.form.delimiter)

    def _places(self, head: list[str], needed: Sequence[str], optional: Sequence[str]) -> dict[str, list[int]]:
        """Where each column known here is in a row."""
        unknown = sorted(set(self.form.columns) - {*needed, *optional})
        if unknown:
            known = ", ".join([*needed, *optional])
            raise DemandError(f"--columns {unknown[0]}=...: no such column here; those that can be named: {known}")
        missing = [column for column in needed if not self._is_there(column, head)]
        missing += [column for column in self.form.columns if column not in needed and not self._is_there(column, head)]
        if missing:
            wanted = ", ".join(" + ".join(self.form.names(column)) for column in missing)
            raise DemandError(f"{self.name}:1: no column {wanted}; {self._remedy(head, needed)}")
        there = [column for column in (*needed, *optional) if self._is_there(column, head)]
        twice = [name for column in there for name in self.form.names(column) if head.count(name) > 1]
        if twice:
            raise DemandError(f"{self.name}:1: column {twice[0]} is there twice; give one of them another name")
        return {column: [head.index(name) for name in self.form.names(column)] for column in there}

    def _is_there(self, column: str, head: list[str]) -> bool:
        return all(name in head for name in self.form.names(column))

    def _remedy(self, head: list[str], needed: Sequence[str]) -> str:
        """What to do about a first line without the columns; spreadsheets often divide by other characters."""
        if len(head) == 1:
            for word, mark in DELIMITERS.items():
                if mark != self.form.delimiter and mark in head[0]:
                    return f"its columns are divided by another character; add --delimiter {word}"
        if head and head[0].startswith("sep="):
            return "take that line out: the first line must name the columns"
        if not head:
            return f"the first line must name {', '.join(needed)}"
        named = ",".join(f"{column}=NAME" for column in needed)
        shown = ", ".join(head[:12]) + (", ..." if len(head) > 12 else "")
        return f"it has {shown}; say which is which: --columns {named}"


def _whole(text: str, low: int, high: int) -> str:
    """What to write in the stead of a text: a comma divides neither thousands nor parts."""
    return f"a whole number from {low} to {high}" + (", without a comma" if "," in text else "")


def _known(cells: Sequence[str], at: Mapping[str, Sequence[int]]) -> dict[str, str]:
    found = {
        column: " ".join(cells[place].strip() for place in places if place < len(cells)).strip()
        for column, places in at.items()
    }
    return {column: value for column, value in found.items() if value.casefold() not in _NOTHING}


def _decoded(source: Readable, encoding: str | None) -> str:
    """The text of a file. Raises ``DemandError`` for one that is not there, or not text in this encoding."""
    remedy = "name a CSV file"
    try:
        held = read_bounded(source, MOST_EXPORT) if isinstance(source, Path) else source.read_bytes()
        if held.startswith(b"PK\x03\x04"):
            raise DemandError(f"{source.name}: is a spreadsheet or an archive, no text; save it as CSV")
        told = next((name for mark, name in _MARKS if held.startswith(mark)), None)
        remedy = "name a CSV file, or its encoding: --encoding cp1252 for one of Excel on Windows"
        return held.decode(encoding or told or "utf-8")
    except LookupError as error:
        raise DemandError(f"--encoding {encoding}: no such encoding; such as utf-8, cp1252, latin-1") from error
    except UnicodeDecodeError as error:
        wanted = encoding or "UTF-8"
        raise DemandError(f"{source.name}: cannot be read as {wanted} text ({error.reason}); {remedy}") from error
    except (OSError, ValueError) as error:  # ValueError: a null character in the path
        if isinstance(error, DemandError):
            raise
        why = getattr(error, "strerror", None) or error
        raise DemandError(f"{source.name}: cannot be read ({why}); {remedy}") from error
