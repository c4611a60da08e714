"""Typed look-ups in a TOML document that note every mistake and go on with a stand-in value."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeVar

from onboard.config.problems import Problems, closest, nearest
from onboard.config.toml_lines import Document, KeyPath, path_text

_T = TypeVar("_T")
_TYPE_NAMES = {
    bool: "true or false",
    int: "a whole number",
    float: "a decimal number",
    str: "a text",
    list: "a list",
    dict: "a table",
}


def type_name(value: object) -> str:
    """The type of a TOML value in words."""
    return _TYPE_NAMES.get(type(value), "a date or time")


class Common(NamedTuple):
    """What is read of every site file first: its name, and the fleet bus's bit/s.

    ``crowded`` lets more machines in than find room to rest: for studies of what they do in each other's way.
    """

    name: str
    bitrate: int
    crowded: bool = False


@dataclass
class TomlTable:
    """One table of a document.

    The stand-in for a wrong value is the default where there is one, else the lowest value allowed; ``wrong`` names
    the keys that have a stand-in, so that no second mistake is reported that only follows from the first.
    """

    document: Document
    problems: Problems
    path: KeyPath
    values: dict[str, Any]
    asked: set[str] = field(default_factory=set)
    wrong: set[str] = field(default_factory=set)
    below: "list[TomlTable]" = field(default_factory=list)

    def bad(self, name: str, value: object, what: str, remedy: str, *, item: int | None = None) -> None:
        """Note a mistake at one key, or at one ``item`` of the list there."""
        self.wrong.add(name)
        path = (*self.path, name) if item is None else (*self.path, name, item)
        self.problems.add(self.document.line(path), path_text(path), value, what, remedy)

    def has(self, name: str) -> bool:
        """Whether the key is there."""
        self.asked.add(name)
        return name in self.values

    def integer(self, name: str, low: int, high: int, default: int | None = None) -> int:
        """A whole number in ``[low, high]``; ``default`` None makes the key required."""
        stand_in = low if default is None else default
        words = f"a whole number from {low} to {high}"
        value = self._get(name, int, words, required=default is None)
        if value is None:
            return stand_in
        if not low <= value <= high:
            self.bad(name, value, "out of range", f"write {words}")
            return stand_in
        return int(value)

    def number(self, name: str, low: float, high: float, default: float | None = None) -> float:
        """A number in ``[low, high]``, whole or with decimals; ``default`` None makes the key required."""
        words = f"a number from {low:g} to {high:g}"
        if type(self.values.get(name)) is int:
            self.values[name] = _as_float(self.values[name])
        value = self._get(name, float, words, required=default is None)
        stand_in = low if default is None else default
        if value is None:
            return stand_in
        if not low <= value <= high:  # not a number is in no range
            self.bad(name, value, "out of range", f"write {words}")
            return stand_in
        return float(value)

    def text(self, name: str, default: str | None = None) -> str:
        """A text that is not empty; the stand-in without a default is the empty text."""
        value = self._get(name, str, "a text in quotes", required=default is None)
        if value == "":
            self.bad(name, value, "empty", "write a text in quotes")
        return value or default or ""

    def choice(self, name: str, known: Sequence[str], default: str | None = None) -> str:
        """One of a few words; the stand-in without a default is the first of them."""
        value = self._get(name, str, " or ".join(f'"{word}"' for word in known), required=default is None)
        if value is not None and value not in known:
            self.bad(name, value, "unknown word", nearest(value, known))
            value = None
        return value or default or known[0]

    def items(self, name: str, words: str) -> list[Any] | None:
        """A list as it is, each item still to be judged; None where it is missing or no list."""
        value: list[Any] | None = self._get(name, list, words, required=False)
        return value

    def parsed(self, name: str, parse: Callable[[str], _T | None], what: str, form: str) -> _T | None:
        """A text as ``parse`` understands it; None where it is missing, or of another ``form`` and so not ``what``."""
        value = self._get(name, str, form, required=True)
        if value is None:
            return None
        found = parse(value)
        if found is None:
            self.bad(name, value, f"not {what}", f"write {form}")
        return found

    def flag(self, name: str, *, default: bool) -> bool:
        """True or false; the default where the key is missing or of another type."""
        value = self._get(name, bool, "true or false", required=False)
        return default if value is None else bool(value)

    def table(self, name: str, *, required: bool = False) -> "TomlTable":
        """A table within; an empty one where it is missing. Ask once for each."""
        self.asked.add(name)
        key = self._meant(name, dict) if required else name
        value = self.values.get(name)
        if value is None and required:
            self.bad(name, None, "missing", f"add a table [{path_text((*self.path, name))}]")
        if value is not None and not isinstance(value, dict):
            self.bad(name, value, f"is {type_name(value)}", f"write a table [{path_text((*self.path, name))}]")
            value = None
        return self._below((*self.path, key), value or {})

    def tables(self, name: str) -> "list[TomlTable]":
        """An array of tables, ``[[name]]``; empty where it is missing. Ask once for each."""
        self.asked.add(name)
        key = self._meant(name, list)
        values = self.values.get(name, [])
        if not isinstance(values, list) or not all(isinstance(value, dict) for value in values):
            self.bad(name, values, "not an array of tables", f"write [[{path_text((*self.path, name))}]]")
            return []
        return [self._below((*self.path, key, number), value) for number, value in enumerate(values)]

    def _meant(self, name: str, kind: type) -> str:
        """The key of a table, or of an array of tables, that is likely to be meant by this name: its own, or misspelt.

        What is misspelt is noted, and found at the name from then on.
        """
        others = [(key, value) for key, value in self.values.items() if key not in self.asked]
        tables = [
            key
            for key, value in others
            if type(value) is kind and (not isinstance(value, list) or all(isinstance(one, dict) for one in value))
        ]
        # Other tables may still be asked for by names that are a little alike: missions, stations.
        key = closest(name, tables, alike=0.8) if tables and name not in self.values else None
        if key is None:
            return name
        self.bad(key, None, "unknown key", f'did you mean "{name}"?')
        self.values[name] = self.values.pop(key)
        return key

    def pass_over(self, is_such: Callable[[str], bool]) -> None:
        """Call no such key unknown: which are known follows from something that is mistaken."""
        self.asked.update(name for name in self.values if is_such(name))

    def check_unknown(self) -> None:
        """Note every key here and below that nobody asked for, with the nearest known name.

        Where that one is missing, it is not told as well.
        """
        for name in self.values:
            if name not in self.asked:
                known = sorted(self.asked)
                meant = closest(name, known)
                if meant is not None and meant not in self.values:
                    self.problems.forget(path_text((*self.path, meant)))
                self.bad(name, None, "unknown key", nearest(name, known))
        for table in self.below:
            table.check_unknown()

    def _get(self, name: str, kind: type, words: str, *, required: bool) -> Any:
        """The value if it is there and of its type, else None."""
        self.asked.add(name)
        if name not in self.values:
            if required:
                self.bad(name, None, "missing", f"write {words}")
            return None
        value = self.values[name]
        if type(value) is not kind:  # isinstance would take true for a whole number
            self.bad(name, value, f"is {type_name(value)}", f"write {words}")
            return None
        return value

    def _below(self, path: KeyPath, values: dict[str, Any]) -> "TomlTable":
        table = TomlTable(self.document, self.problems, path, values)
        self.below.append(table)
        return table


def _as_float(value: int) -> float:
    """The same number; infinite, which is in no range, where it is too long for a float."""
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf
