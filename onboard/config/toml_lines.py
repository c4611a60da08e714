"""TOML with line numbers: ``tomllib`` reads the values, a small scanner finds on which line each key stands."""

import re
import tomllib
from dataclasses import dataclass, field
from typing import Any

from onboard.config.problems import Problems

_HEADER = re.compile(r"^\s*(\[\[?)\s*([^\]]+?)\s*\]\]?\s*(#.*)?$")
_KEY = re.compile(r"""^\s*((?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*')(?:\s*\.\s*(?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*'))*)\s*=""")
_WORD = re.compile(r"""[A-Za-z0-9_-]+|"[^"]*"|'[^']*'""")
_LINE_IN_MESSAGE = re.compile(r"\(at line (\d+), column \d+\)")


@dataclass
class Document:
    """Parsed values, and the line of each key path such as ``robots[0].home`` (the table's line for a table)."""

    file: str
    values: dict[str, Any] = field(default_factory=dict)
    lines: dict[str, int] = field(default_factory=dict)

    def line(self, path: str) -> int:
        """Line of a key; of the table around it where the key is not there; 0 where neither is."""
        while path:
            if path in self.lines:
                return self.lines[path]
            path = path.rpartition(".")[0]
        return 0


def parse(text: str, file: str, problems: Problems) -> Document:
    """Read a TOML text; a text that is not TOML becomes one problem and an empty document."""
    try:
        values = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        found = _LINE_IN_MESSAGE.search(str(error))
        what = _LINE_IN_MESSAGE.sub("", str(error)).strip()
        line = int(found.group(1)) if found else text.count("\n") + 1
        problems.add(line, "", None, f"not TOML: {what}", "see https://toml.io")
        return Document(file)
    return Document(file, values, _scan(text))


def _scan(text: str) -> dict[str, int]:
    """Line of every key. Lines inside multi-line strings and arrays hold no keys and are passed over."""
    lines: dict[str, int] = {}
    arrays: dict[str, int] = {}
    prefix = ""
    depth, quote = 0, ""
    for number, line in enumerate(text.splitlines(), start=1):
        if not depth and not quote:
            header = _HEADER.match(line)
            if header is not None:
                prefix = _header_path(header.group(2), header.group(1) == "[[", arrays)
                lines.setdefault(prefix, number)
                continue
            key = _KEY.match(line)
            if key is not None:
                path = ".".join(word.strip("\"'") for word in _WORD.findall(key.group(1)))
                lines.setdefault(f"{prefix}.{path}" if prefix else path, number)
        depth, quote = _nesting(line, depth, quote)
    return lines


def _header_path(name: str, is_array: bool, arrays: dict[str, int]) -> str:
    words = [word.strip("\"'") for word in _WORD.findall(name)]
    path = ""
    for place, word in enumerate(words):
        path = f"{path}.{word}" if path else word
        last = place == len(words) - 1
        if last and is_array:
            arrays[path] = arrays.get(path, -1) + 1
        if path in arrays:
            path = f"{path}[{arrays[path]}]"
    return path


def _nesting(line: str, depth: int, quote: str) -> tuple[int, str]:
    """Bracket depth and open multi-line quote after a line."""
    place = 0
    while place < len(line):
        if quote:
            end = line.find(quote, place)
            if end < 0:
                return depth, quote if len(quote) == 3 else ""
            place, quote = end + len(quote), ""
            continue
        letter = line[place]
        if letter == "#":
            break
        if line[place : place + 3] in ('"""', "'''"):
            quote = line[place : place + 3]
            place += 3
            continue
        if letter in "\"'":
            place = _end_of_string(line, place)
        elif letter in "[{":
            depth += 1
        elif letter in "]}":
            depth = max(0, depth - 1)
        place += 1
    return depth, quote


def _end_of_string(line: str, start: int) -> int:
    mark, place = line[start], start + 1
    while place < len(line) and line[place] != mark:
        place += 2 if line[place] == "\\" and mark == '"' else 1
    return place
