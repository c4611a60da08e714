"""Which machines run in processes of their own, and from when to when: ``--processes``, ``--join``, ``--leave``."""

import math
import signal
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from onboard.config.machine_text import BusTable, Value, machine_text
from onboard.config.problems import nearest

#: A controller whose server has been away for so long ends by itself, s: no process outlives a killed simulator.
GIVE_UP_S = 5


class PowerChange(Enum):
    """What happens to a machine while the site runs; endings stand first, so that both may fall on one moment."""

    LEAVE = "leave"
    KILL = "kill"
    JOIN = "join"

    @property
    def signal(self) -> signal.Signals:
        """How the process is told to end: politely, or without warning as by a power cut."""
        return signal.SIGKILL if self is PowerChange.KILL else signal.SIGTERM


@dataclass(frozen=True, slots=True)
class Moment:
    """One change of one machine, in seconds of the run."""

    at_s: float
    change: PowerChange
    machine: str

    def __str__(self) -> str:
        return f"--{self.change.value} {self.machine}={self.at_s:g}"


@dataclass(frozen=True, slots=True)
class PowerSpan:
    """A machine is on from ``begin_s`` until ``end``, or until the run ends where that is None."""

    begin_s: float
    end: Moment | None


@dataclass(frozen=True, slots=True)
class ProcessPlan:
    """``site_text`` is the site file that every process reads; ``directory`` keeps all files where it is not None."""

    site_text: str
    moments: tuple[Moment, ...] = ()
    directory: Path | None = None


def parse_moments(change: PowerChange, texts: Sequence[str]) -> list[Moment]:
    """``MACHINE=SECONDS`` options. Raises ``ValueError`` with one line for a person."""
    found = []
    for text in texts:
        machine, equals, seconds = text.partition("=")
        try:
            at_s = float(seconds)
        except ValueError:
            at_s = math.nan
        if not (machine and equals and 0 <= at_s < math.inf):
            raise ValueError(f"--{change.value} {text}: must be MACHINE=SECONDS, such as MR1=30")
        found.append(Moment(at_s, change, machine))
    return found


def spans_of(moments: Iterable[Moment], machines: Sequence[str]) -> dict[str, list[PowerSpan]]:
    """When each machine is on. One whose first change is a join is off until then, any other on from the beginning.

    Raises ``ValueError`` with one line for a machine that is not there, or is told to join or leave twice.
    """
    order = list(PowerChange)
    by_machine: dict[str, list[Moment]] = {name: [] for name in machines}
    for moment in sorted(moments, key=lambda one: (one.at_s, order.index(one.change))):
        if moment.machine not in by_machine:
            raise ValueError(f"{moment}: no such machine among those run; {nearest(moment.machine, list(by_machine))}")
        by_machine[moment.machine].append(moment)
    return {name: _spans(found) for name, found in by_machine.items()}


def _spans(moments: list[Moment]) -> list[PowerSpan]:
    begin_s: float | None = None if moments and moments[0].change is PowerChange.JOIN else 0.0
    spans = []
    for moment in moments:
        if moment.change is PowerChange.JOIN:
            if begin_s is not None:
                raise ValueError(f"{moment}: it is on at that time; let it leave before, or choose another time")
            begin_s = moment.at_s
        elif begin_s is None:
            raise ValueError(f"{moment}: it is off at that time; let it join before, or choose another time")
        else:
            spans.append(PowerSpan(begin_s, moment))
            begin_s = None
    return spans if begin_s is None else [*spans, PowerSpan(begin_s, None)]


def machine_file(name: str, served: Mapping[str, str | int]) -> str:
    """The machine file of a process: the served fleet bus, and its own device bus, by what reaches their server."""
    where: dict[str, Value] = {**served, "give_up_s": GIVE_UP_S}
    fleet, devices = (BusTable("socketcand-asyncio", channel, where) for channel in ("fleet", name))
    return machine_text(name, "site.toml", fleet, devices)
