"""Every row of the papers has a test that carries its name, and a mutation of the product that this test finds.

``docs/systems/*.toml`` has a table for each row; ``python -m tests.mutate`` makes the mutations.
"""

import ast

import pytest

from tests.project.rows import ROOT, TESTS, all_names, by_row, functions_of, page, read_rows, rows_of


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


def test_there_are_159_rows_and_each_has_a_table() -> None:
    assert len(all_names()) == 159
    assert [name for name in all_names() if name not in read_rows()] == []


@pytest.mark.parametrize("name", all_names())
def test_every_row_is_done_or_says_why_not(name: str) -> None:
    row = read_rows()[name]
    if row.not_done is not None:
        assert row.not_done and not row.check
        assert row.test is None and row.mutation is None
        return
    assert row.check
    assert row.test in by_row().get(name, []), f"{row.test} is no test named after {name}"
    assert row.mutation is not None
    assert [one.mistake for one in row.mutations.values() if one.mistake is not None] == []


def test_no_test_and_no_table_names_a_row_that_is_not_in_the_list() -> None:
    assert not set(read_rows()) - set(all_names())
    assert not set(by_row()) - set(all_names())


def test_of_two_rows_no_mutation_is_the_same() -> None:
    """One change of the product that does for two rows would say little about either."""
    made = [one for row in read_rows().values() for one in row.mutations.values()]
    assert [one for one in made if made.count(one) > 1] == []


def test_the_page_shows_the_tables() -> None:
    assert (ROOT / "docs" / "systems.md").read_text(encoding="utf-8") == page(), "run `make docs`"


def test_every_test_of_a_row_judges_something() -> None:
    empty = [
        f"{path.name}::{function.name}"
        for path in sorted(TESTS.rglob("test_*.py"))
        for function in functions_of(path)
        if rows_of(function.name) and not asserts(function)
    ]
    assert not empty


def test_a_name_may_tell_several_rows_and_only_at_its_beginning() -> None:
    assert rows_of("test_p10_m07_a_bid_comes") == ["P10", "M07"]
    assert rows_of("test_c08_bids") == ["C08"]
    assert rows_of("test_several_p08_bids") == rows_of("test_p8_bids") == rows_of("test_p08") == []
