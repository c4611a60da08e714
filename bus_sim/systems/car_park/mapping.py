"""How a table of somebody else is written, as command lines and mapping files say it."""

from argparse import Namespace
from pathlib import Path
from typing import Any

from bus_sim.demand import DemandError
from bus_sim.demand_options import TABLE_OPTIONS
from bus_sim.systems.car_park import counts, sessions
from bus_sim.systems.car_park.csv_rows import DELIMITERS, CsvForm
from bus_sim.systems.car_park.moments import MomentForm, checked_format, zone_named
from onboard.config.files import read_text, root_table
from onboard.config.problems import Problems
from onboard.config.reader import TomlTable

#: All columns that a person can name.
COLUMNS = (*sessions.NEEDED, *sessions.OPTIONAL, *counts.NEEDED)


def table_form(args: Namespace) -> CsvForm:
    """The form that the options ask for; those of the command line count before those of the mapping file.

    Raises ``DemandError`` for an option that says nothing here, and ``ConfigError`` for mistakes in the file.
    """
    given = {name: getattr(args, name) for name in TABLE_OPTIONS if getattr(args, name)}
    if given and args.sessions is None and args.counts is None:
        option = next(iter(given)).replace("_", "-")
        raise DemandError(f"--{option}: is about a table; add --sessions FILE or --counts FILE, or leave it out")
    words = _of_file(args.mapping) if args.mapping is not None else {}
    words |= {name: value for name, value in given.items() if name not in ("columns", "mapping")}
    columns = words.get("columns", {}) | _of_text(args.columns or "")
    zone = words.get("zone")
    return CsvForm(
        columns,
        _delimiter(words.get("delimiter", "comma")),
        words.get("encoding"),
        MomentForm(
            tuple(map(checked_format, words.get("date_format", ()))), zone_named(zone) if zone is not None else None
        ),
        bool(words.get("skip_bad", False)),
    )


def _of_text(text: str) -> dict[str, tuple[str, ...]]:
    """``COLUMN=NAME,COLUMN=NAME+NAME``."""
    columns = {}
    for part in text.split(",") if text else ():
        column, sign, name = (word.strip() for word in part.partition("="))
        if not sign or not name:
            raise DemandError(
                f"--columns {part}: must be COLUMN=NAME; a name that holds a comma goes into a file: --mapping FILE"
            )
        if column not in COLUMNS:
            raise DemandError(f"--columns {part}: no such column; those that can be named: {', '.join(COLUMNS)}")
        if column in columns:
            raise DemandError(f"--columns {part}: {column} is named twice; leave one out, or join both: {column}=A+B")
        columns[column] = _names(name)
    return columns


def _names(text: str) -> tuple[str, ...]:
    """The names that make one column: a plus joins them."""
    return tuple(name.strip() for name in text.split("+"))


def _column(table: TomlTable, name: str) -> tuple[str, ...]:
    """The same in a mapping file, where they may be a list, too: of names that hold a plus."""
    texts = _texts(table, name)
    return _names(texts[0]) if isinstance(table.values[name], str) else tuple(texts)


def _of_file(path: Path) -> dict[str, Any]:
    """The words of a mapping file. Raises ``ConfigError`` with all its mistakes."""
    problems = Problems(str(path))
    root = root_table(read_text(path, "mapping"), problems)
    words: dict[str, Any] = {name: root.text(name) for name in ("delimiter", "zone", "encoding") if root.has(name)}
    if root.has("date_format"):
        words["date_format"] = _texts(root, "date_format")
    table = root.table("columns")
    words["columns"] = {name: _column(table, name) for name in COLUMNS if table.has(name)}
    root.check_unknown()
    problems.raise_if_any()
    return words


def _texts(table: TomlTable, name: str) -> list[str]:
    """One text, or a list of them."""
    if isinstance(table.values[name], str):
        return [table.text(name)]
    found = table.items(name, "a text, or a list of texts") or []
    for item, value in enumerate(found):
        if not isinstance(value, str):
            table.bad(name, value, "is no text", "write it in quotes", item=item)
    return [value for value in found if isinstance(value, str)]


def _delimiter(text: str) -> str:
    mark = DELIMITERS.get(text, text)
    if len(mark) != 1 or mark in '"\r\n':
        raise DemandError(f"--delimiter {text}: must be one character, or one of {', '.join(DELIMITERS)}")
    return mark
