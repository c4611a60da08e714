"""One machine alone, with its journal, among others that live: what it says, and when."""

from collections.abc import Collection, Iterable
from typing import TypeVar

from onboard.contract.codes import CONTRACT_VERSION, MachineState
from onboard.contract.messages import Heartbeat, Message
from onboard.core.effects import Effect, Record, Report, Send, Tell
from onboard.core.journal_records import Entry
from onboard.core.site import Site
from onboard.holon.holon import Holon
from onboard.systems.registry import factory_for

M = TypeVar("M", bound=Message)
SECOND = 1_000_000


class Alone:
    """A machine that was started with these entries; the rights that nobody claims are its own."""

    def __init__(self, site: Site, node: int, entries: Iterable[Entry] = (), boot: int = 1) -> None:
        machine = site.machines[node]
        self.site, self.node, self.journal = site, node, list(entries)
        self.holon = Holon(site, machine, factory_for(site, machine.kind), boot=boot, entries=self.journal)
        self.now_us = 0
        self.said: list[Effect] = []
        self._take(self.holon.start(0))
        self.holon.tokens.trust()

    def _take(self, effects: Iterable[Effect]) -> None:
        for one in effects:
            self.said.append(one)
            if isinstance(one, Record):
                self.journal.append(one.entry)

    def passes(self, seconds: float, step_us: int = SECOND, *, silent: int = 0, held: Collection[int] = ()) -> None:
        """Time goes by, and all the others tell that they live, but who is ``silent``."""
        until_us = self.now_us + round(seconds * SECOND)
        while self.now_us < until_us:
            self.now_us += step_us
            for node, machine in self.site.machines.items():
                if node not in (self.node, silent):
                    state = MachineState.WAITING if node in held else MachineState.IDLE
                    beat = Heartbeat(node, CONTRACT_VERSION, self.site.digest, 0, 1, machine.kind, state)
                    self.hears(beat)
            while (due_us := self.holon.next_wake()) is not None and due_us <= self.now_us:
                self._take(self.holon.wake(self.now_us))

    def senses(self, *words: Message) -> None:
        """From its devices."""
        for one in words:
            self._take(self.holon.sense(one, self.now_us))

    def hears(self, *words: Message) -> None:
        """From the others."""
        for one in words:
            self._take(self.holon.receive(one, self.now_us))

    def sent(self, kind: type[M]) -> list[M]:
        """Said to all."""
        return [e.message for e in self.said if isinstance(e, Send) and isinstance(e.message, kind)]

    def told(self, kind: type[M]) -> list[M]:
        """Said to its own devices."""
        return [e.message for e in self.said if isinstance(e, Tell) and isinstance(e.message, kind)]

    def reported(self) -> list[str]:
        """Said to a person."""
        return [e.text for e in self.said if isinstance(e, Report)]
