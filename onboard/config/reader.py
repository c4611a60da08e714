"""Typed look-ups in a TOML document that note every mistake and go on with a stand-in value."""

import re
from dataclasses import dataclass, field
from typing import Any

from onboard.config.problems import Problems, nearest
from onboard.config.toml_lines import Document

_SEGMENT = re.compile(r"^p\(\s*(\d+)\s*,\s*(\d+)\s*\)$")


@dataclass
class Table:
    """One table of a document; ``path`` as in ``robots[0]``, empty for the whole file."""

    document: Document
    problems: Problems
    path: str
    values: dict[str, Any]
    asked: set[str] = field(default_factory=set)

    def key(self, name: str) -> str:
        """Full path of a key."""
        return f"{self.path}.{name}" if self.path else name

    def bad(self, name: str, value: object, what: str, remedy: str) -> None:
        """Note a mistake at one key."""
        self.problems.add(self.document.line(self.key(name)), self.key(name), value, what, remedy)

    def has(self, name: str) -> bool:
        """Whether the key is there."""
        self.asked.add(name)
        return name in self.values

    def _get(self, name: str, default: Any, kind: type, words: str) -> Any:
        self.asked.add(name)
        if name not in self.values:
            if default is None:
                self.bad(name, None, "missing", f"write {name} = {words}")
            return default
        value = self.values[name]
        if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
            self.bad(name, value, f"wrong type {type(value).__name__}", f"write {words}")
            return default
        return value

    def integer(self, name: str, low: int, high: int, default: int | None = None) -> int:
        """A whole number in ``[low, high]``; ``default`` None makes the key required."""
        value = self._get(name, default, int, f"a whole number from {low} to {high}")
        if value is None:
            return low
        if not low <= value <= high:
            self.bad(name, value, "out of range", f"write a whole number from {low} to {high}")
            return low
        return int(value)

    def text(self, name: str, default: str | None = None) -> str:
        """A text that is not empty."""
        value = self._get(name, default, str, "a text in quotes")
        if value == "":
            self.bad(name, value, "empty", "write a text in quotes")
        return value or ""

    def choice(self, name: str, known: list[str], default: str | None = None) -> str:
        """One of a few words."""
        value = self.text(name, default)
        if value and value not in known:
            self.bad(name, value, "unknown word", nearest(value, known))
            return known[0]
        return value or known[0]

    def integers(self, name: str, low: int, high: int, default: list[int] | None = None) -> list[int]:
        """A list of whole numbers in ``[low, high]``."""
        values = self._get(name, default, list, f"a list of whole numbers from {low} to {high}")
        good = []
        for value in values or []:
            if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
                self.bad(name, value, "not a whole number in range", f"write whole numbers from {low} to {high}")
            else:
                good.append(value)
        return good

    def segment(self, name: str) -> tuple[int, int]:
        """A position written ``p(track,index)``; (0, 0) where it is wrong."""
        value = self._get(name, None, str, 'a position such as "p(1,4)"')
        if value is None:
            return 0, 0
        found = _SEGMENT.match(value)
        if found is None:
            self.bad(name, value, "not a position", 'write a position such as "p(1,4)": floor 1, index 4')
            return 0, 0
        return int(found.group(1)), int(found.group(2))

    def table(self, name: str, *, required: bool = False) -> "Table":
        """A table within; an empty one where it is missing."""
        self.asked.add(name)
        value = self.values.get(name)
        if value is None and required:
            self.problems.add(self.document.line(self.path), self.key(name), None, "missing", f"add a table [{name}]")
        if value is not None and not isinstance(value, dict):
            self.bad(name, value, "not a table", f"write it as [{self.key(name)}]")
            value = None
        return Table(self.document, self.problems, self.key(name), value or {})

    def tables(self, name: str) -> "list[Table]":
        """An array of tables, ``[[name]]``."""
        self.asked.add(name)
        values = self.values.get(name, [])
        if not isinstance(values, list) or not all(isinstance(value, dict) for value in values):
            self.bad(name, None, "not an array of tables", f"write it as [[{self.key(name)}]]")
            return []
        return [
            Table(self.document, self.problems, f"{self.key(name)}[{number}]", value)
            for number, value in enumerate(values)
        ]

    def check_unknown(self) -> None:
        """Note every key that nobody asked for, with the nearest known name."""
        for name in self.values:
            if name not in self.asked:
                self.bad(name, None, "unknown key", nearest(name, sorted(self.asked)))
