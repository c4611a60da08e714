"""Every value of a TOML file is found on its line, however it is written."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.config.problems import Problems, quoted
from onboard.config.toml_lines import Document, KeyPath, parse, path_text

TRICKY = '''\
# [not.a.header]
title = "a # b = [c]"            # d = 1
"quoted key" . 'x.y' = 1
[ "two words" . inner ]
multi = """
[inside]
key = "no key" \\"""
"""""
literal = \'\'\'
[[inside]]
a = 1\'\'\'
array = [
  1, # ] }
  [2, "]"],
  { a = 1, b.c = [
    3,
  ] },
]
date = 1979-05-27 07:32:01
[[fruit]]
name = 'apple'
[fruit.skin]
colour = "red"
[[fruit.kind]]
name = "x"
[[fruit.kind]]
name = "y"
[[fruit]]
name = "pear"
[[fruit.kind]]
name = "z"
[super]
[super.low]
[late.deep]
[late]
key = 1
'''

LINES: dict[KeyPath, int] = {
    ("title",): 2,
    ("quoted key", "x.y"): 3,
    ("two words",): 4,
    ("two words", "inner", "multi"): 5,
    ("two words", "inner", "literal"): 9,
    ("two words", "inner", "array"): 12,
    ("two words", "inner", "array", 0): 13,
    ("two words", "inner", "array", 1, 1): 14,
    ("two words", "inner", "array", 2, "b", "c"): 15,
    ("two words", "inner", "array", 2, "b", "c", 0): 16,
    ("two words", "inner", "date"): 19,
    ("fruit",): 20,
    ("fruit", 0, "name"): 21,
    ("fruit", 0, "skin", "colour"): 23,
    ("fruit", 0, "kind", 0, "name"): 25,
    ("fruit", 0, "kind", 1): 26,
    ("fruit", 1, "name"): 29,
    ("fruit", 1, "kind", 0, "name"): 31,
    ("super", "low"): 33,
    ("late", "deep"): 34,
    ("late",): 35,
    ("late", "key"): 36,
}


def read(text: str) -> Document:
    problems = Problems("x.toml")
    document = parse(text, "x.toml", problems)
    assert problems.found == []
    return document


@pytest.mark.parametrize(("path", "line"), LINES.items(), ids=map(path_text, LINES))
def test_line_of(path: KeyPath, line: int) -> None:
    assert read(TRICKY).line(path) == line


def test_lines_are_the_same_with_windows_line_ends() -> None:
    assert read(TRICKY.replace("\n", "\r\n")).lines == read(TRICKY).lines


def test_what_is_not_there_has_the_line_of_what_is_around_it() -> None:
    document = read(TRICKY)
    assert document.line(("fruit", 1, "seed", "count")) == 28
    assert document.line(("nothing",)) == 0


def test_other_line_separators_of_unicode_are_no_line_ends() -> None:
    assert read('a = "\u2028\u0085"\nb = 1').line(("b",)) == 2


def test_a_path_is_written_as_a_person_would() -> None:
    assert path_text(("robots", 0, "home")) == "robots[0].home"
    assert path_text(("fleet bus", "x.y", "a\nb")) == '"fleet bus"."x.y"."a\\nb"'


@pytest.mark.parametrize(
    "text", ["[" * 3000, "a = " + "[" * 3000 + "]" * 3000, "a = " + "9" * 5000, "a = 1999-99-99", "\ufeff", "a = \x00"]
)
def test_what_tomllib_cannot_read_is_one_problem(text: str) -> None:
    problems = Problems("x.toml")
    assert parse(text, "x.toml", problems).values == {}
    assert len(problems.found) == 1


# --- a document of any shape, written in any of TOML's ways, with the line of each value known -----------------------

KEYS = st.sampled_from(["a", "b-1", "2", "x.y", "with space", 'quo"te', "tab\t", "é", ""])
SCALARS = st.sampled_from(
    ["1", "-2.5e3", "true", "1979-05-27T07:32:00Z", '"# [x]"', "'''a\n'''", '"""b\n\\"""\n"""', "'='", '"\\\\"', "''"]
)


class Writer:
    """Text and, at the same time, the paths that it holds with their lines."""

    def __init__(self) -> None:
        self.text = ""
        self.lines: dict[KeyPath, int] = {}

    def at(self, path: KeyPath) -> None:
        self.lines[path] = self.text.count("\n") + 1

    def value(self, draw: st.DrawFn, path: KeyPath, depth: int) -> None:
        form = draw(st.sampled_from(["scalar", "scalar", "array", "table"])) if depth else "scalar"
        if form == "scalar":
            self.text += draw(SCALARS)
        elif form == "array":
            self.text += "["
            for number in range(draw(st.integers(0, 3))):
                self.text += draw(st.sampled_from([" ", "\n", " # ] x = 1\n"]))
                self.at((*path, number))
                self.value(draw, (*path, number), depth - 1)
                self.text += draw(st.sampled_from([",", "\n,"]))
            self.text += draw(st.sampled_from(["]", "\n]"]))
        else:
            self.text += "{ "
            for number, key in enumerate(draw(st.lists(KEYS, unique=True, max_size=3))):
                self.text += ", " if number else ""
                self.pair(draw, path, key, depth)
            self.text += " }"

    def pair(self, draw: st.DrawFn, path: KeyPath, key: str, depth: int) -> None:
        self.at((*path, key))
        self.text += f"{quoted(key)} = "
        self.value(draw, (*path, key), depth - 1)

    def body(self, draw: st.DrawFn, path: KeyPath) -> None:
        for key in draw(st.lists(KEYS, unique=True, max_size=3)):
            self.pair(draw, path, key, 3)
            self.text += draw(st.sampled_from(["\n", " # y = 2\n", "\n\n"]))


@st.composite
def documents(draw: st.DrawFn) -> Writer:
    writer = Writer()
    writer.body(draw, ())
    for table in range(draw(st.integers(0, 3))):
        if draw(st.booleans()):
            writer.at((f"table{table}",))
            writer.text += f"[table{table}]\n"
            writer.body(draw, (f"table{table}",))
            continue
        writer.at((f"array{table}",))
        for number in range(draw(st.integers(1, 3))):
            writer.at((f"array{table}", number))
            writer.text += f"[[ array{table} ]]\n"
            writer.body(draw, (f"array{table}", number))
    return writer


def paths_of(value: Any, path: KeyPath) -> set[KeyPath]:
    if isinstance(value, dict):
        return {path}.union(*(paths_of(item, (*path, key)) for key, item in value.items()))
    if isinstance(value, list):
        return {path}.union(*(paths_of(item, (*path, number)) for number, item in enumerate(value)))
    return {path}


@given(documents())
def test_every_path_of_any_document_has_its_line_and_nothing_else_has(writer: Writer) -> None:
    document = read(writer.text)
    assert set(document.lines) | {()} == paths_of(document.values, ())
    assert document.lines == writer.lines
