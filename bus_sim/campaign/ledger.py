"""Results that add up: one line a trial in a file, so that a long campaign is played in parts and goes on anywhere.

A line counts for the state of the program under which it was played, which is a digest of its sources, and for the
campaign that it belongs to, its site as it was written then; lines of other states stay in the file and are told of.
"""

import hashlib
import json
from collections import Counter
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cache
from pathlib import Path
from typing import Any, Final, Generic, NamedTuple, TypeVar

import bus_sim
import onboard
from bus_sim.demand import DemandError
from bus_sim.sites import layout_names, site_names, site_text
from onboard.bounded_file import MOST_EXPORT, is_there, read_bounded

#: Files that a run depends on, beside the interpreter.
SOURCES = (".py", ".toml", ".dbc", ".csv")


@cache
def state() -> str:
    """A digest of the program's sources: two checkouts with the same text have the same."""
    found = hashlib.sha256()
    for package in (onboard, bus_sim):
        root = Path(package.__path__[0])
        for path in sorted(one for one in root.rglob("*") if one.suffix in SOURCES):
            found.update(f"{package.__name__}/{path.relative_to(root).as_posix()}\n".encode())
            found.update(path.read_bytes())
    return found.hexdigest()[:16]


def site_as_played(name: str) -> str:
    """A site as a ledger names it: of a site file that does not ship also a digest of its text, which changes."""
    if name in (*site_names(), *layout_names()):
        return name
    return f"{name} {hashlib.sha256(site_text(name).encode()).hexdigest()[:16]}"


VerdictT = TypeVar("VerdictT", bound=StrEnum)
#: What a line says of every trial; all else belongs to one sort of trial.
_OF_ALL: Final = ("state", "campaign", "number", "verdict", "why")


class LedgerEntry(NamedTuple):
    """What a line says of one trial: its verdict, in a failure why, and figures of this sort of trial."""

    verdict: StrEnum
    why: str
    more: Mapping[str, Any]


@dataclass
class Ledger(Generic[VerdictT]):
    """The file at ``path`` as far as it is about ``campaign``, a text that names all that its trials have in common.

    ``verdicts`` are those of its trials, ``failures`` those that make the whole fail.
    """

    path: Path
    campaign: str
    verdicts: type[VerdictT]
    failures: Collection[VerdictT]
    #: Entries of this state by the number of the seed or point, or another name of the trial.
    done: dict[int | str, LedgerEntry] = field(default_factory=dict)
    others: int = 0

    @classmethod
    def read(
        cls, path: Path, campaign: str, verdicts: type[VerdictT], failures: Collection[VerdictT]
    ) -> "Ledger[VerdictT]":
        """A file that is not there yet is empty. Raises ``DemandError`` for one that is no ledger."""
        ledger = cls(path, campaign, verdicts, failures)
        try:
            text = read_bounded(path, MOST_EXPORT).decode() if is_there(path) else ""
            for line in text.splitlines():
                ledger._take(json.loads(line))
        except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
            why = str(error)[:200]
            raise DemandError(f"--add-to {path}: cannot be read as results of campaigns ({why})") from error
        return ledger

    def _take(self, line: dict[str, Any]) -> None:
        if (line["state"], line["campaign"]) == (state(), self.campaign):
            more = {key: value for key, value in line.items() if key not in _OF_ALL}
            number = line["number"] if isinstance(line["number"], str) else int(line["number"])
            self.done[number] = LedgerEntry(self.verdicts(line["verdict"]), str(line["why"]), more)
        else:
            self.others += 1

    def open_of(self, numbers: Iterable[int]) -> list[int]:
        """Those that were not played under this state."""
        return [number for number in numbers if number not in self.done]

    def add(self, number: int | str, verdict: VerdictT, why: str, more: Mapping[str, object] | None = None) -> None:
        """One trial more, on disk at once; ``more`` as ``json.dump`` takes it."""
        self.done[number] = LedgerEntry(verdict, why, more or {})
        head = {"state": state(), "campaign": self.campaign, "number": number, "verdict": verdict.value, "why": why}
        entry = {**head, **self.done[number].more}
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(entry) + "\n")

    @property
    def has_failed(self) -> bool:
        """Whether any trial of this state failed."""
        return any(entry.verdict in self.failures for entry in self.done.values())

    def lines(self) -> list[str]:
        """What the file has of this state by now."""
        counts = Counter(entry.verdict for entry in self.done.values())
        told = ", ".join(f"{verdict.value} {counts[verdict]}" for verdict in self.verdicts if counts[verdict])
        failed = [
            f"  {number}: {entry.verdict.value}: {entry.why}"
            for number, entry in sorted(self.done.items(), key=lambda one: (str(type(one[0])), one[0]))
            if entry.verdict in self.failures
        ]
        return [f"{self.path}: {len(self.done)} runs of state {state()}: {told or 'none'}", *failed]
