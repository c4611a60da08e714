"""How the last life of this board's controller ended, beside its journal: what a process killed cannot tell itself.

Two files: ``NAME.life`` is the controller's own, ``NAME.ended`` what its supervisor saw (deploy/files/onboard.service,
``ExecStopPost``). Neither is needed for anything but telling people and for not starting again for ever: a board
without them starts.
"""

import contextlib
import json
from dataclasses import dataclass
from pathlib import Path

from onboard.bounded_file import read_bounded
from onboard.contract.codes import Reason
from onboard.io.endings import ExitStatus

#: So many lives in a row that an own fault ended within ``HEALTHY_US`` each, and the machine waits for a person.
LIMIT = 3
#: A life that took so long has done its work, us; what ends it is news.
HEALTHY_US = 600_000_000

#: Each of the two files is one line of some dozen characters, bytes.
_MOST_BYTES = 1_024

#: What systemd says of a service that ended in ``$SERVICE_RESULT`` (systemd.exec(5)), in words for a person.
_RESULTS = {
    "watchdog": "it hung, and its watchdog ended it",
    "timeout": "it did not start or end in time, and was killed",
    "signal": "it was killed",
    "core-dump": "it crashed",
    "oom-kill": "the board's memory was full, and it was killed",
    "resources": "the board had no room for it",
}


@dataclass(frozen=True, slots=True)
class LastLife:
    """``line`` is for a person, empty where there is nothing to tell; ``reason`` is for the bus."""

    line: str = ""
    reason: Reason = Reason.NONE


class LifeBook:
    """The book of one controller's lives. What cannot be read or written is passed over: telling is not working."""

    def __init__(self, journal: Path) -> None:
        """``journal`` is the journal's folder; the files lie beside it."""
        self._own = journal.with_name(f"{journal.name}.life")
        self._seen = journal.with_name(f"{journal.name}.ended")
        self._short = 0

    def begin(self) -> LastLife:
        """How the last life ended; from now on this one goes on."""
        before, seen = self._read(), self._result()
        short = before.get("short")
        self._short = short if isinstance(short, int) else 0
        was_running = before.get("end") == "running"
        self._write("running")
        with contextlib.suppress(OSError):
            self._seen.unlink()
        if seen == "watchdog":
            return LastLife(f"the last life: {_RESULTS[seen]}", Reason.WATCHDOG)
        if not was_running:
            return LastLife()
        return LastLife(f"the last life: {_RESULTS.get(seen, 'the board was reset or lost its power')}")

    def end(self, ending: ExitStatus, lived_us: int, *, own_fault: bool = False) -> ExitStatus:
        """Write down how this life ends. One ended by a fault of its own too often waits for a person."""
        after = self.foreseen(ending, lived_us, own_fault=own_fault)
        self._short = 0 if after is not ending else self._counted(lived_us, own_fault=own_fault)
        self._write(after.name)
        return after

    def foreseen(self, ending: ExitStatus, lived_us: int, *, own_fault: bool = False) -> ExitStatus:
        """The same, and nothing is written: it goes on."""
        is_too_often = self._counted(lived_us, own_fault=own_fault) >= LIMIT
        return ExitStatus.WAITS_FOR_PERSON if is_too_often else ending

    def _counted(self, lived_us: int, *, own_fault: bool) -> int:
        """So many short lives in a row with this one, us."""
        return self._short + 1 if own_fault and lived_us < HEALTHY_US else 0

    def _result(self) -> str:
        try:
            return read_bounded(self._seen, _MOST_BYTES).decode("utf-8", "replace").strip()
        except OSError:
            return ""

    def _read(self) -> dict[str, object]:
        try:
            found = json.loads(read_bounded(self._own, _MOST_BYTES))
        except (OSError, ValueError, RecursionError):
            return {}
        return found if isinstance(found, dict) else {}

    def _write(self, end: str) -> None:
        with contextlib.suppress(OSError):
            self._own.write_text(json.dumps({"end": end, "short": self._short}) + "\n", encoding="utf-8")
