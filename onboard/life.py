"""One life of a controller's process: it waits for its buses, runs, and its exit status says who starts it again."""

import asyncio
import sys
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from onboard.contract.codes import Reason
from onboard.controller.shell import Controller
from onboard.io.endings import ExitStatus, ending_of
from onboard.io.lasting_bus import LastingBus
from onboard.io.lives import LifeBook
from onboard.io.open_bus import BusSettings, OpenBus, open_bus
from onboard.io.signals import ended_by
from onboard.io.watchdog import SystemdWatchdog
from onboard.ports.ending import OWN_FAULTS

#: The supervisor hears so often, s, that somebody who waits for an interface is alive; its period is ten.
ALIVE_S = 1.0


@dataclass(frozen=True, slots=True)
class LifeEnd:
    """What ended a life, and who brings the machine back."""

    ending: ExitStatus
    why: str = ""
    own_fault: bool = False


class ControllerLife:
    """Made on the running loop. ``begin``, ``open_buses``, ``follow``, ``over``, ``end``, in this order."""

    def __init__(self, name: str, journal: Path) -> None:
        """``name`` is the machine's, ``journal`` its journal's folder."""
        self.watchdog = SystemdWatchdog()
        self._name = name
        self._loop = asyncio.get_running_loop()
        self._begin_s = self._loop.time()
        self._lives = LifeBook(journal)
        self._befell = Reason.NONE
        self._ended: asyncio.Future[LifeEnd] = self._loop.create_future()
        self._buses: list[OpenBus] = []
        self._watching: list[asyncio.Task[None]] = []

    def ended_by_signals(self) -> AbstractContextManager[None]:
        """A signal ends this life as its supervisor asks for: nothing is wrong."""
        return ended_by(self._loop, lambda _: self._end(LifeEnd(ExitStatus.STOPPED)))

    def begin(self) -> None:
        """Tell how the last life ended, where that is worth telling."""
        last = self._lives.begin()
        self._befell = last.reason
        if last.line:
            self.tell(last.line)

    def tell(self, text: str) -> None:
        """One line for a person, on the console and as the service's state."""
        print(f"onboard: {self._name}: {text}", file=sys.stderr, flush=True)
        self.watchdog.status(text)

    async def open_buses(self, fleet: BusSettings, device: BusSettings) -> tuple[OpenBus, OpenBus] | None:
        """Both buses, however late their interfaces are; None where this life ended before.

        Not before: a machine that took the silence of a missing interface for an empty site would believe in rights
        that others have. Raises ``BusOpenError`` for what no waiting heals.
        """
        opening = self._loop.create_task(self._open(fleet, device))
        self.watchdog.ready()
        while not opening.done() and not self._ended.done():
            either: set[asyncio.Future[Any]] = {opening, self._ended}
            await asyncio.wait(either, timeout=ALIVE_S, return_when=asyncio.FIRST_COMPLETED)
            self.watchdog.alive()
        if self._ended.done():
            opening.cancel()
            await asyncio.wait({opening})
        if not opening.done() or opening.cancelled() or opening.exception() is not None:
            for bus in self._buses:
                await bus.close()
        return None if self._ended.done() else opening.result()

    async def _open(self, fleet: BusSettings, device: BusSettings) -> tuple[OpenBus, OpenBus]:
        first = await self._made(fleet, None)
        other = first if device == fleet else await self._made(device, first)
        return first, other

    async def _made(self, settings: BusSettings, needs: OpenBus | None) -> OpenBus:
        if "give_up_s" in dict(settings.extra):
            # Whoever says how long to wait for a server wants the process to end after that.
            plain = await open_bus(settings)
            self._buses.append(plain)
            return plain
        lasting = LastingBus(settings, self.tell, needs=needs if isinstance(needs, LastingBus) else None)
        self._buses.append(lasting)
        await lasting.start()
        return lasting

    def follow(self, controller: Controller) -> None:
        """This life ends with the controller's, which has been started, and with a bus that is gone for good."""
        if self._befell is not Reason.NONE:
            controller.note(self._befell)
        for bus in self._buses:
            self._watching.append(self._loop.create_task(self._watch(bus)))
            if isinstance(bus, LastingBus):
                bus.on_loss = lambda: controller.note(Reason.BUS_LOST)
        assert controller.stopped is not None
        controller.stopped.add_done_callback(lambda why: self._halted(controller, why.result()))

    async def over(self) -> None:
        """Wait until something has ended it."""
        await asyncio.wait({self._ended})
        for task in self._watching:
            task.cancel()

    def end(self) -> ExitStatus:
        """Write down and tell how it has ended; the exit status."""
        end = self._ended.result()
        ending = self._lives.end(end.ending, self._lived_us, own_fault=end.own_fault)
        if end.why:
            after = "it waits for a person" if ending is ExitStatus.WAITS_FOR_PERSON else "it is to be started again"
            print(f"onboard: {self._name}: {end.why}; {after}", file=sys.stderr, flush=True)
        return ending

    @property
    def _lived_us(self) -> int:
        return round((self._loop.time() - self._begin_s) * 1_000_000)

    def needs_person(self, reason: Reason | None) -> bool:
        """Whether this life, if it halts now, is one of too many, or for a reason that only a person can know."""
        after = self._lives.foreseen(ending_of(reason), self._lived_us, own_fault=reason in OWN_FAULTS)
        return after is ExitStatus.WAITS_FOR_PERSON

    def _end(self, end: LifeEnd) -> None:
        if not self._ended.done():
            self._ended.set_result(end)

    async def _watch(self, bus: OpenBus) -> None:
        self._end(LifeEnd(ExitStatus.COMES_BACK, f"the bus is gone: {await bus.wait_lost()}"))

    def _halted(self, controller: Controller, why: str) -> None:
        reason = controller.halted_for
        self._end(LifeEnd(ending_of(reason), f"halted: {why}", own_fault=reason in OWN_FAULTS))
