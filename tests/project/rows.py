"""The rows of the source papers: what was checked of each, by which test, and two mutations that its tests find.

Rows are numbered in the order of the papers: P01 to P60 (Pujo, Ounnar, Zanni 2006; P29 was left free), M01 to M39
(Le Page, Barras 1995), G01 to G31 (Gnatowski 2010), C01 to C24 (Panescu, Miron 2006). A01 to A06 are of no paper: what
moves in each system. Each has a table in one of ``docs/systems/*.toml``::

    [M22]
    check = "what was checked"
    test = "tests/terminal/test_x.py::test_m22_..."
    mutation = { file = "onboard/...", old = "text that is there once", new = "text that breaks the row" }
    drawn = { file = "onboard/...", old = "...", new = "..." }

``drawn`` was drawn by ``tests.drawn`` from the function in which ``mutation`` stands. Where a row is not done on
purpose its table is ``not_done = "why"``.
"""

import ast
import re
import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
TESTS = ROOT / "tests"
PAPERS = {
    "P": ("Pujo, Ounnar, Zanni: robotized car park, and turning", 60),
    "M": ("Le Page, Barras: MARTHA, container terminal", 39),
    "G": ("Gnatowski: several robots on a graph", 31),
    "C": ("Panescu, Miron: contract net, manufacturing cell", 24),
    "A": ("Authority: what moves anything passes `authorised`, in each of the six systems", 6),
}
#: No such row.
FREE = frozenset({"P29"})


@dataclass(frozen=True, slots=True)
class Mutation:
    """One change of product code: ``old``, which is in ``file`` exactly once, becomes ``new``."""

    file: str
    old: str
    new: str

    @property
    def mistake(self) -> str | None:
        """Why it cannot be made, or None."""
        path = ROOT / self.file
        if not self.file.startswith(("onboard/", "bus_sim/", "dbc/")) or not path.is_file():
            return f"{self.file} is no file of the product"
        if self.old == self.new:
            return f"{self.file}: {self.old!r} stays as it is"
        count = path.read_text(encoding="utf-8").count(self.old)
        return None if count == 1 else f"{self.file} has this text {count} times: {self.old!r}"


@dataclass(frozen=True, slots=True)
class Row:
    """What became of one row. ``test`` and ``mutation`` are None only where ``not_done`` says why."""

    name: str
    check: str
    test: str | None
    mutation: Mutation | None
    not_done: str | None
    drawn: Mutation | None = None

    @property
    def mutations(self) -> dict[str, Mutation]:
        """Both, by their keys in the table, those that there are."""
        both = {"mutation": self.mutation, "drawn": self.drawn}
        return {key: one for key, one in both.items() if one is not None}


def all_names() -> list[str]:
    """The names of all rows, in order."""
    names = [f"{letter}{number:02}" for letter, (_, last) in PAPERS.items() for number in range(1, last + 1)]
    return [name for name in names if name not in FREE]


@cache
def read_rows() -> dict[str, Row]:
    """Every row that has a table. Raises ``ValueError`` for a table twice or with unknown keys."""
    found: dict[str, Row] = {}
    for path in sorted((ROOT / "docs" / "systems").glob("*.toml")):
        for name, table in tomllib.loads(path.read_text(encoding="utf-8")).items():
            unknown = set(table) - {"check", "test", "mutation", "drawn", "not_done"}
            if unknown or name in found:
                raise ValueError(f"{path.name}: [{name}]: {', '.join(sorted(unknown)) or 'stands twice'}")
            made = {key: Mutation(**table[key]) for key in ("mutation", "drawn") if key in table}
            words = (table.get("check", ""), table.get("test"), made.get("mutation"), table.get("not_done"))
            found[name] = Row(name, *words, made.get("drawn"))
    return found


def rows_of(test: str) -> list[str]:
    """The rows that a test's name begins with."""
    found = re.match(r"test((?:_[pmgca]\d\d)+)_\w", test)
    return [row.upper() for row in re.findall(r"_([pmgca]\d\d)", found.group(1))] if found else []


@cache
def functions_of(path: Path) -> list[ast.FunctionDef | ast.AsyncFunctionDef]:
    """All test functions of a file, and of the classes in it."""
    found: list[ast.FunctionDef | ast.AsyncFunctionDef] = []
    bodies = [ast.parse(path.read_text(encoding="utf-8")).body]
    while bodies:
        for node in bodies.pop(0):
            if isinstance(node, ast.ClassDef):
                bodies.append(node.body)
            elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and node.name.startswith("test_"):
                found.append(node)
    return found


@cache
def by_row() -> dict[str, list[str]]:
    """Tests by the rows of their names, as pytest calls them."""
    found: dict[str, list[str]] = {}
    for path in sorted(TESTS.rglob("test_*.py")):
        for function in functions_of(path):
            for row in rows_of(function.name):
                found.setdefault(row, []).append(f"{path.relative_to(ROOT)}::{function.name}")
    return found


def page() -> str:
    """``docs/systems.md``: all rows, what was checked, by what, and the mutation that shows it."""
    rows, lines = read_rows(), [_HEAD]
    done = sum(row.not_done is None for row in rows.values())
    lines.append(f"{done} of {len(all_names())} rows are done.\n")
    for letter, (title, _) in PAPERS.items():
        lines += [f"## {letter}: {title}", "", "| row | what is checked | test | mutation |", "|---|---|---|---|"]
        for name in (name for name in all_names() if name[0] == letter):
            row = rows.get(name)
            if row is None or row.not_done is not None:
                lines.append(f"| {name} | not done: {row.not_done if row is not None else 'no entry'} | | |")
            else:
                where = row.mutation.file if row.mutation is not None else ""
                lines.append(f"| {name} | {_cell(row.check)} | `{row.test}` | `{where}` |")
        lines.append("")
    return "\n".join(lines).rstrip("\n") + "\n"


def _cell(text: str) -> str:
    return text.replace("|", r"\|")


_HEAD = """\
# What the papers ask for

Written by `make docs` from `docs/systems/*.toml`. Every row of the four papers has a test named after it, and two
changes of product code that are to make a test of its name fail: one made by hand, and one drawn by a seed from the
same function (`drawn`, `python -m tests.drawn`). `make mutants` makes each of them in a copy and runs the tests. What
was found, and by which, is in `tests/mutate.toml`, what was not in [figures.md](figures.md); the gate plays a minute's
worth of the found ones again. Rows A are of no paper: what moves anything in each system, and what lets it.
"""
