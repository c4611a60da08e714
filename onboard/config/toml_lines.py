"""TOML with line numbers: ``tomllib`` reads the values, a scanner finds on which line each of them stands.

The scanner follows the grammar of TOML 1.0 (https://toml.io/en/v1.0.0) and relies on ``tomllib`` having accepted the
text: it looks for keys and for where values end, and judges nothing.
"""

import re
import tomllib
from bisect import bisect_right
from dataclasses import dataclass, field
from typing import Any

from onboard.config.problems import Problems, quoted
from onboard.nesting import is_deeper

#: Where a value is: keys of tables and, from 0, numbers in arrays.
KeyPath = tuple[str | int, ...]

_BLANK = re.compile(r"(?:[ \t\n]|#[^\n]*)*")
_SPACE = re.compile(r"[ \t]*")
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_STRING = re.compile(
    r'"""(?:\\.|[^\\])*?"{3,5}' + r"|'''.*?'{3,5}" + r'|"(?:\\.|[^"\\\n])*"' + r"|'[^'\n]*'", re.DOTALL
)
_OTHER_VALUE = re.compile(r"[^,\]}#\n]*")
#: Parts of a key joined by dots: deeper than any file of ours by a factor of ten.
_MOST_PARTS = 32
#: Tables and arrays within each other: the parser takes some hundreds, whoever shows a value does not.
_MOST_DEPTH = 64
#: The largest site has some hundreds.
_MOST_TABLES = 10_000
_PART = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')"""
_KEY_OF_MANY = re.compile(rf"(?<![\w\"'.-]){_PART}(?:[ \t]*+\.[ \t]*+{_PART}){{{_MOST_PARTS}}}")
_LINE_IN_MESSAGE = re.compile(r"\s*\(at line (\d+), column \d+\)")


def path_text(path: KeyPath) -> str:
    """A path as a person writes it: ``robots[0].home``; keys that TOML would quote are quoted."""
    text = ""
    for part in path:
        if isinstance(part, int):
            text += f"[{part}]"
        else:
            text += ("." if text else "") + (part if _BARE_KEY.fullmatch(part) else quoted(part))
    return text


@dataclass
class Document:
    """Parsed values, and the line of each table, key and array element by its path."""

    file: str
    values: dict[str, Any] = field(default_factory=dict)
    lines: dict[KeyPath, int] = field(default_factory=dict)

    def line(self, path: KeyPath) -> int:
        """Line of a value, from 1; of what is around it where it is not there; 0 where neither is."""
        while path and path not in self.lines:
            path = path[:-1]
        return self.lines.get(path, 0)


def parse(text: str, file: str, problems: Problems) -> Document:
    """Read a TOML text; one that is not TOML becomes one problem and an empty document."""
    if (deep := _KEY_OF_MANY.search(text)) is not None:
        # The parser's time grows with the square of a key's parts.
        line = text.count("\n", 0, deep.start()) + 1
        problems.add(line, "", None, f"a key of more than {_MOST_PARTS} parts", "write the file in the documented form")
        return Document(file)
    if text.count("\n[") > _MOST_TABLES:
        problems.add(0, "", None, f"more than {_MOST_TABLES} tables", "write the file in the documented form")
        return Document(file)
    try:
        values = tomllib.loads(text)
        if is_deeper(values, _MOST_DEPTH):
            raise RecursionError
        return Document(file, values, _Scanner(text.replace("\r\n", "\n")).scan())
    except RecursionError:
        problems.add(0, "", None, "arrays or tables nested too deeply", "write the file in the documented form")
    except ValueError as error:
        # Not only tomllib.TOMLDecodeError: numbers of thousands of digits are refused by int() itself.
        found = _LINE_IN_MESSAGE.search(str(error))
        line = int(found.group(1)) if found else 0
        what = _LINE_IN_MESSAGE.sub("", str(error))
        problems.add(line, "", None, f"not TOML: {what}", _remedy(what))
    return Document(file)


def _remedy(what: str) -> str:
    """Of what tomllib says; a table written twice is most often one of several."""
    found = re.search(r"Cannot (?:declare|mutate immutable namespace) \('([A-Za-z0-9_-]+)',\)", what)
    if found is not None:
        return f"where there are several, each begins with [[{found.group(1)}]]"
    if "overwrite" in what:
        return "it is there above already; write it once, or [[NAME]] each time"
    return "correct the syntax there (https://toml.io)"


class _Scanner:
    """One pass over a valid text; ``place`` is the offset of the next character."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.place = 0
        self.newlines = [found.start() for found in re.finditer("\n", text)]
        self.lines: dict[KeyPath, int] = {}
        self.implied: dict[KeyPath, int] = {}
        self.last_element: dict[KeyPath, int] = {}

    def scan(self) -> dict[KeyPath, int]:
        """Lines of all paths; a table that has no header of its own gets the line that first mentions it."""
        table: KeyPath = ()
        self._pass(_BLANK)
        while self.place < len(self.text):
            if self.text[self.place] == "[":
                table = self._header()
            else:
                self._pair(table)
            self._pass(_BLANK)
        return self.implied | self.lines

    def _header(self) -> KeyPath:
        line = self._line()
        is_array = self.text.startswith("[[", self.place)
        self.place += 2 if is_array else 1
        path: KeyPath = ()
        words = self._dotted_key()
        for number, word in enumerate(words):
            path = (*path, word)
            self.implied.setdefault(path, line)
            if is_array and number == len(words) - 1:
                self.last_element[path] = self.last_element.get(path, -1) + 1
            if path in self.last_element:
                path = (*path, self.last_element[path])
        self.lines[path] = line
        self.place += 2 if is_array else 1
        return path

    def _pair(self, table: KeyPath) -> None:
        line = self._line()
        path = table
        for word in self._dotted_key():
            path = (*path, word)
            self.implied.setdefault(path, line)
        self.lines[path] = line
        self.place += 1  # the equals sign
        self._pass(_SPACE)
        self._value(path)

    def _dotted_key(self) -> list[str]:
        words = []
        while True:
            self._pass(_SPACE)
            raw = self._pass(_STRING) or self._pass(_BARE_KEY)
            # tomllib itself undoes quotes and escapes.
            words.append(next(iter(tomllib.loads(f"{raw} = 0"))))
            self._pass(_SPACE)
            if not self.text.startswith(".", self.place):
                return words
            self.place += 1

    def _value(self, path: KeyPath) -> None:
        first = self.text[self.place]
        if first == "[":
            self._array(path)
        elif first == "{":
            self._inline_table(path)
        elif not self._pass(_STRING):
            self._pass(_OTHER_VALUE)

    def _array(self, path: KeyPath) -> None:
        number = 0
        while self._next_item("]"):
            self.lines[(*path, number)] = self._line()
            self._value((*path, number))
            number += 1

    def _inline_table(self, path: KeyPath) -> None:
        while self._next_item("}"):
            self._pair(path)

    def _next_item(self, end: str) -> bool:
        """Step over the opening bracket or comma before an item; False, and past the end, where none follows."""
        self._pass(_BLANK)
        if self.text[self.place] != end:
            self.place += 1
            self._pass(_BLANK)
        if self.text[self.place] == end:
            self.place += 1
            return False
        return True

    def _pass(self, pattern: re.Pattern[str]) -> str:
        found = pattern.match(self.text, self.place)
        if found is None:
            return ""
        self.place = found.end()
        return found.group()

    def _line(self) -> int:
        return bisect_right(self.newlines, self.place) + 1
