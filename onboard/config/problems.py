"""A person's mistakes in a file: all of them at once, one clear line each."""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, field

_LONGEST_SHOWN = 60
#: Of more mistakes than this in one file only so many are told, as they fit a screen: many have one cause.
MOST_NAMED = 40


@dataclass(frozen=True, slots=True)
class Problem:
    """One mistake: ``file:line: key = value: what is wrong; remedy``.

    ``line`` is 0 where the file has none for it, ``key`` empty where the whole file is meant, and ``value`` None where
    there is none to show.
    """

    file: str
    line: int
    key: str
    value: object
    what: str
    remedy: str

    def __str__(self) -> str:
        place = f"{self.file}:{self.line}" if self.line else self.file
        value = "" if self.value is None else f" = {_shown(self.value)}"
        key = f" {self.key}{value}:" if self.key else ""
        return f"{place}:{key} {self.what}; {self.remedy}"


def _shown(value: object) -> str:
    """A value as TOML writes it, on one line, shortened."""
    text = _written(value)
    return text if len(text) <= _LONGEST_SHOWN else text[: _LONGEST_SHOWN - 3] + "..."


def _written(value: object) -> str:
    match value:
        case bool():
            return "true" if value else "false"
        case str():
            return quoted(value)
        case int():
            # Python refuses to write very long numbers in decimal (sys.get_int_max_str_digits).
            return str(value) if value.bit_length() <= 64 else hex(value)
        case list():
            return "[" + ", ".join(_written(item) for item in value[:_LONGEST_SHOWN]) + "]"
        case dict():
            pairs = list(value.items())[:_LONGEST_SHOWN]
            return "{" + ", ".join(f"{quoted(key)} = {_written(item)}" for key, item in pairs) + "}"
    return str(value)


def quoted(text: str) -> str:
    """A text in double quotes on one line, with everything that is not printable escaped."""
    return json.dumps(text, ensure_ascii=not text.isprintable())


def at_most(most: int, lines: Sequence[str]) -> list[str]:
    """The first ``most``, and how many more there are."""
    more = len(lines) - most
    return [*lines[:most], *([f"and {more} more"] if more > 0 else [])]


class ConfigError(Exception):
    """All mistakes of one or several files; ``str`` gives one line each, for the first ``MOST_NAMED``."""

    def __init__(self, problems: list[Problem]) -> None:
        super().__init__(problems)
        self.problems = problems

    def __str__(self) -> str:
        return "\n".join(at_most(MOST_NAMED, [str(problem) for problem in self.problems]))


def closest(name: str, known: Sequence[str], alike: float = 0.6) -> str | None:
    """The known name that an unknown one is likely to mean, or None; ``alike``: 0 for any name, 1 for the same one."""
    from difflib import get_close_matches  # noqa: PLC0415  # a machine without a mistake must not carry it

    return next(iter(get_close_matches(name, known, n=1, cutoff=alike)), None)


def nearest(name: str, known: Sequence[str]) -> str:
    """A remedy for an unknown name: the nearest known one, or all of them."""
    close = closest(name, known)
    if close is not None:
        return f'did you mean "{close}"?'
    return "known here: " + ", ".join(sorted(known)) if known else "remove it"


@dataclass
class Problems:
    """Collects the mistakes of one file."""

    file: str
    found: list[Problem] = field(default_factory=list)

    def add(self, line: int, key: str, value: object, what: str, remedy: str) -> None:
        """Note one mistake in ``line`` (from 1); ``what`` is wrong with the value, ``remedy`` mends it."""
        self.found.append(Problem(self.file, line, key, value, what, remedy))

    def none_in(self, tables: str, harmless: str = "") -> bool:
        """Whether no mistake is in any of those tables (``"lifts|spurs"``), other than at a key that is harmless there.

        ``harmless`` is the last part of such keys, likewise.
        """
        of_them = re.compile(rf"({tables})\b")
        passed_over = re.compile(rf".*\.({harmless})(\[\d+\])?")
        return not any(of_them.match(one.key) and not passed_over.fullmatch(one.key) for one in self.found)

    def forget(self, key: str) -> None:
        """Take back what was noted of a key, as it follows from another mistake."""
        self.found = [one for one in self.found if one.key != key]

    def in_order(self) -> list[Problem]:
        """All mistakes in the order of the file's lines."""
        return sorted(self.found, key=lambda one: one.line)

    def raise_if_any(self) -> None:
        """Raise ``ConfigError`` with all mistakes, in the order of the file's lines."""
        if self.found:
            raise ConfigError(self.in_order())
