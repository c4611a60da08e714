"""Every row of the list of systems has a test that carries its name (docs/decisions.md says what the rows are).

Rows P01 to P60 are what the paper on the robotized car park states (Pujo, Ounnar, Zanni 2006), in the order of its
text; P29 was left free. A test for a row is called ``test_pNN_...``, or ``test_pNN_pMM_...`` for two.
"""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]
#: No such row.
FREE = {29}
#: The turning cell (P24 to P27) and the second domain (P59) are sites of their own, and not built yet.
LATER = {24, 25, 26, 27, 59}
ROWS = sorted(set(range(1, 61)) - FREE - LATER)


def rows_of(name: str) -> list[int]:
    """The rows that a test's name begins with."""
    found = re.match(r"test((?:_p\d\d)+)_\w", name)
    return [int(row) for row in re.findall(r"p(\d\d)", found.group(1))] if found else []


def functions_of(path: Path) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and node.name.startswith("test_"):
            yield node


@cache
def named() -> dict[int, list[str]]:
    """Tests by row."""
    found: dict[int, list[str]] = {}
    for path in sorted(TESTS.rglob("test_*.py")):
        for function in functions_of(path):
            for row in rows_of(function.name):
                found.setdefault(row, []).append(f"{path.relative_to(TESTS)}::{function.name}")
    return found


def asserts(function: ast.AST) -> bool:
    """Whether a test judges anything: an assert, an expected error, or a helper or ``first`` that fails by itself."""
    for node in ast.walk(function):
        if isinstance(node, ast.Assert):
            return True
        called = node.func if isinstance(node, ast.Call) else None
        name = called.attr if isinstance(called, ast.Attribute) else called.id if isinstance(called, ast.Name) else ""
        if name in ("raises", "first") or name.startswith(("assert_", "check")):
            return True
    return False


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"P{row:02}")
def test_every_row_has_a_test_of_its_name(row: int) -> None:
    assert row in named(), f"no test is called test_p{row:02}_..."


def test_no_test_names_a_row_that_is_not_in_the_list() -> None:
    known = set(ROWS) | LATER
    unknown = {test for row, tests in named().items() if row not in known for test in tests}
    assert not unknown


def test_every_test_of_a_row_judges_something() -> None:
    empty = [
        f"{path.name}::{function.name}"
        for path in sorted(TESTS.rglob("test_*.py"))
        for function in functions_of(path)
        if rows_of(function.name) and not asserts(function)
    ]
    assert not empty


def test_a_name_may_tell_several_rows_and_only_at_its_beginning() -> None:
    assert rows_of("test_p10_p47_a_bid_comes") == [10, 47]
    assert rows_of("test_p08_bids") == [8]
    assert rows_of("test_several_p08_bids") == rows_of("test_p8_bids") == rows_of("test_p08") == []
