"""A person's mistakes in a file: all of them at once, one clear line each."""

from dataclasses import dataclass, field
from difflib import get_close_matches


@dataclass(frozen=True, slots=True)
class Problem:
    """One mistake: ``file:line: key = value: what is wrong; remedy``. ``line`` 0 where the file has none for it."""

    file: str
    line: int
    key: str
    value: object
    what: str
    remedy: str

    def __str__(self) -> str:
        place = f"{self.file}:{self.line}" if self.line else self.file
        shown = "" if self.value is None else f" = {_shown(self.value)}"
        key = f" {self.key}{shown}:" if self.key else ""
        return f"{place}:{key} {self.what}; {self.remedy}"


def _shown(value: object) -> str:
    text = f'"{value}"' if isinstance(value, str) else str(value)
    return text if len(text) <= 60 else text[:57] + "..."


class ConfigError(Exception):
    """All mistakes of one or several files; ``str`` gives one line each."""

    def __init__(self, problems: list[Problem]) -> None:
        super().__init__(problems)
        self.problems = problems

    def __str__(self) -> str:
        return "\n".join(str(problem) for problem in self.problems)


def nearest(name: str, known: list[str]) -> str:
    """A remedy for an unknown name: the nearest known one, or all of them."""
    close = get_close_matches(name, known, n=1)
    return f'did you mean "{close[0]}"?' if close else "known here: " + ", ".join(sorted(known))


@dataclass
class Problems:
    """Collects the mistakes of one file."""

    file: str
    found: list[Problem] = field(default_factory=list)

    def add(self, line: int, key: str, value: object, what: str, remedy: str) -> None:
        """Note one mistake."""
        self.found.append(Problem(self.file, line, key, value, what, remedy))

    def raise_if_any(self) -> None:
        """Raise ``ConfigError`` with all mistakes, in the order of the file's lines."""
        if self.found:
            raise ConfigError(sorted(self.found, key=lambda one: one.line))
