"""How long an emulated computer may take: by what it has worked, not by the clock on the wall.

A busy host gives an emulator a tenth of a processor. It then needs ten times as long for the same work, and nothing is
wrong. So a limit here is of the emulator's own processor time, and only one that neither works nor says anything is
given up by the clock.
"""

import os
import time
from pathlib import Path

#: An emulator that has neither worked ``_WORK_S`` nor said a word for so long is stuck, s: with a hundredth of a
#: processor it would have worked three times that.
STILL_S = 300.0
_WORK_S = 1.0
#: How often it is looked at, s.
LOOK_S = 0.5


class Effort:
    """Watches one process with all its threads. It must not have been waited for: its number names it."""

    def __init__(self, pid: int, limit_s: float) -> None:
        """``limit_s`` is processor time, counted from now on."""
        self._pid = pid
        self._limit_s = limit_s
        self._begin_s = self._moved_s = processor_time_s(pid)
        self._said = 0
        self._moved_at_s = time.monotonic()

    def why_over(self, said: int) -> str | None:
        """Why it is to be given up, or None. ``said`` is how many bytes it has said so far."""
        now_s, worked_s = time.monotonic(), processor_time_s(self._pid)
        if worked_s - self._begin_s > self._limit_s:
            return f"it has worked for {self._limit_s:g} s of processor time"
        if said != self._said or worked_s - self._moved_s > _WORK_S:
            self._said, self._moved_s, self._moved_at_s = said, worked_s, now_s
        if now_s - self._moved_at_s > STILL_S:
            return f"it has neither worked nor said anything for {STILL_S:g} s"
        return None


def processor_time_s(pid: int) -> float:
    """Processor time of a process and all its threads, s (proc(5), ``stat``, fields 14 and 15)."""
    # The second field, the program's name, may hold anything, blanks and brackets included.
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
