"""Words of a site file for one run: what ``bus-sim run --set`` says in the stead of the file."""

import re
import tomllib
from collections.abc import Sequence

_WORD = re.compile(r"(?P<table>[a-z_]+)\.(?P<key>[a-z_]+)=(?P<value>.+)")


def with_words(text: str, words: Sequence[str]) -> str:
    """A site file's text with each ``TABLE.KEY=VALUE`` in it; a bare word as the value is taken for a string.

    What the words mean is its reader's to judge. Raises ``ValueError``, in one line, for what is no such word, and
    where the file has the table in one line.
    """
    for word in words:
        found = _WORD.fullmatch(word)
        if found is None:
            raise ValueError(f"--set {word}: write TABLE.KEY=VALUE, such as negotiation.place=cost")
        text = _with(text, found["table"], found["key"], _value(found["value"]), word)
    return text


def _value(text: str) -> str:
    try:
        tomllib.loads(f"value = {text}")
    except tomllib.TOMLDecodeError:
        return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return text


def _with(text: str, table: str, key: str, value: str, word: str) -> str:
    lines = text.splitlines()
    if any(re.match(rf"\s*{table}\s*=", line) for line in lines):
        raise ValueError(f"--set {word}: the file has {table} in one line; write it there, or as [{table}]")
    head = next((number for number, line in enumerate(lines) if re.match(rf"\s*\[{table}\]", line)), None)
    if head is None:
        lines += ["", f"[{table}]"]
        head = len(lines) - 1
    end = next((number for number in range(head + 1, len(lines)) if re.match(r"\s*\[", lines[number])), len(lines))
    there = (number for number in range(head + 1, end) if re.match(rf"\s*{key}\s*=", lines[number]))
    number = next(there, None)
    if number is None:
        lines.insert(head + 1, f"{key} = {value}")
    else:
        lines[number] = f"{key} = {value}"
    return "\n".join(lines) + "\n"
