"""Nobody looks into a journal's record by a string but the one file that turns records into entries and back."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ONE_FILE = "onboard/core/journal_records.py"

LOOK_UPS = (
    'x = entry["boot"]',
    'x = effect.entry["boot"]',
    'x = entry.get("boot", 0)',
    'x = {"record": "boot", "boot": 1}',
    'x = one.get("record") == "boot"',
    'x = "cancelled" in entry',
)


def look_ups(text: str) -> Iterator[int]:
    """Lines in which an entry, or what calls itself a record, is looked into by a string."""
    if "entry" not in text and "record" not in text:
        return
    for node in ast.walk(ast.parse(text)):
        match node:
            case ast.Subscript(value=of, slice=ast.Constant(value=str(key))) if _is_entry(of) or key == "record":
                yield node.lineno
            case ast.Call(func=ast.Attribute(value=of, attr="get"), args=[ast.Constant(value=str(key)), *_]) if (
                _is_entry(of) or key == "record"
            ):
                yield node.lineno
            case ast.Dict(keys=keys) if any(isinstance(one, ast.Constant) and one.value == "record" for one in keys):
                yield node.lineno
            case ast.Compare(left=ast.Constant(value=str()), ops=[ast.In()], comparators=[of]) if _is_entry(of):
                yield node.lineno


def _is_entry(of: ast.expr) -> bool:
    name = of.id if isinstance(of, ast.Name) else of.attr if isinstance(of, ast.Attribute) else ""
    return name == "entry" or name.endswith("_entry")


def test_records_are_looked_into_in_one_file_only() -> None:
    files = [one for folder in ("onboard", "bus_sim", "hil") for one in (ROOT / folder).rglob("*.py")]
    found = [
        f"{file.relative_to(ROOT)}:{line}"
        for file in sorted(files)
        if file != ROOT / ONE_FILE
        for line in look_ups(file.read_text(encoding="utf-8"))
    ]
    assert found == []


@pytest.mark.parametrize("text", LOOK_UPS)
def test_a_look_up_is_found(text: str) -> None:
    assert list(look_ups(text)) == [1]
