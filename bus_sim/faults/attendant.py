"""A person who comes after a machine has lost its journal, and has its rights made anew (docs/operate.md)."""

from collections.abc import Callable
from functools import partial
from typing import Any

from bus_sim.faults.journals import hurt
from bus_sim.faults.operators import give
from bus_sim.run import BusRun
from onboard.contract.codes import Reason
from onboard.contract.messages import Halted, Message
from onboard.core.journal_state import RIGHTS_LOST
from onboard.core.site import Machine
from onboard.operate.commands import CommandRequest

#: How long a board is off whose foreign journal is taken out, s.
EXCHANGE_S = 5.0
#: Who was not given its rights, as it or another was moving, is looked at again after this, us.
AGAIN_US = 30_000_000


class Attendant:
    """Waits for one machine to say that it holds for its journal, and comes ``after_us`` later, until it works."""

    def __init__(self, run: BusRun[Any], machine: Machine, after_us: int, restart_later: Callable[[int], None]) -> None:
        self._run = run
        self._machine = machine
        self._after_us = after_us
        self._restart_later = restart_later
        self._is_coming = False
        run.observers.append(self._hear)

    def _hear(self, message: Message, time_us: int) -> None:
        if not isinstance(message, Halted) or (message.sender, message.machine) != (self._machine.node_id,) * 2:
            return
        if message.reason in RIGHTS_LOST and message.needs_person and not self._is_coming:
            self._is_coming = True
            self._run.plant.timers.call_at(time_us + self._after_us, partial(self._come, message.reason))

    def _come(self, reason: Reason) -> None:
        self._is_coming = False
        if self._machine.node_id not in self._run.controllers:
            return
        if reason is Reason.JOURNAL_FOREIGN:
            # Its own is not to be had: the other's is taken out, and it begins with none.
            self._run.crash(self._machine)
            hurt(self._run.journals[self._machine.node_id], "lost", 1)
            self._restart_later(self._run.loop.now_us() + round(EXCHANGE_S * 1e6))
            return
        self._is_coming = True
        body = self._run.body_slots(self._machine)
        asked = CommandRequest("regenerate", machine=self._machine.name, body=body)
        give(self._run, asked, self._ended)

    def _ended(self, status: int | None) -> None:
        """It is served again from now on; or somebody was still moving, and the person tries once more."""
        for tell in self._run.after_repair if status == 0 else ():
            tell()
        self._run.plant.timers.call_at(self._run.loop.now_us() + (0 if status == 0 else AGAIN_US), self._leave)

    def _leave(self) -> None:
        self._is_coming = False
