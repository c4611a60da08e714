"""A fleet bus whose frames are sealed: in the place of the plain one, whatever is plugged into it."""

import asyncio
import secrets
from collections.abc import Callable, Iterable
from pathlib import Path

from onboard.core.frame import Frame
from onboard.core.site import Site
from onboard.io.seal_lives import next_life
from onboard.ports.bus import Bus, BusHealth, FrameHandler
from onboard.seal.gate import Gate, GateSettings
from onboard.seal.keys import Keys
from onboard.seal.subjects import Reading

_NONCE_BITS = 48


class SealedBus:
    """One node's connection through its gate (``onboard/seal``). Nothing is heard before it is open.

    To be made on the running loop. What is said before it is open goes out then.
    """

    def __init__(self, plain: Bus, gate: Gate) -> None:
        self.name = plain.name
        self.plain = plain
        self.gate = gate
        self._loop = asyncio.get_running_loop()
        self._handlers: list[FrameHandler] = []
        self._on_sent: list[FrameHandler] = []
        self._early: list[Frame] = []
        self._then: Callable[[], object] | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._sealing: asyncio.Handle | None = None

    async def opened(self) -> None:
        """``open``, and wait until it is."""
        done: asyncio.Future[None] = self._loop.create_future()
        self.open(lambda: done.set_result(None))
        await done

    def open(self, then: Callable[[], object]) -> None:
        """Ask all others how far they are; ``then`` is called once they have answered, or their time is over."""
        self._then = then
        self.plain.subscribe(self._hear, self._sent)
        self._put(self.gate.begin(self._now_us()))
        self._go_on()

    def subscribe(self, on_frame: FrameHandler, on_sent: FrameHandler | None = None) -> None:
        """What is handed on of others; of this node's own frames all, seals too."""
        self._handlers.append(on_frame)
        if on_sent is not None:
            self._on_sent.append(on_sent)

    def send(self, frame: Frame) -> bool:
        """As the plain bus does; seals follow by themselves."""
        if not self.gate.is_open:
            self._early.append(frame)
            return True
        is_taken = self._put(self.gate.say(frame, self._now_us()))
        if self._sealing is None and self.gate.waits_for_seal:
            # What one decision says has one seal. To wait for more saves few, and lets others speak in between.
            self._sealing = self._loop.call_soon(self._seal)
        return is_taken

    def health(self) -> BusHealth:
        """The counters of the plain bus, where seals are frames like all others."""
        return self.plain.health()

    def be_quiet(self) -> None:
        """Nothing more is said or handed on, as when the board loses its power."""
        self._then = None
        self._early.clear()
        self._handlers.clear()
        self._on_sent.clear()
        for handle in (self._timer, self._sealing):
            if handle is not None:
                handle.cancel()

    async def close(self) -> None:
        """Seal the last words and leave the bus."""
        self._put(self.gate.seal(self._now_us()))
        self.be_quiet()
        await self.plain.close()

    def _now_us(self) -> int:
        return round(self._loop.time() * 1_000_000)

    def _put(self, frames: Iterable[Frame]) -> bool:
        taken = [self.plain.send(frame) for frame in frames]
        return all(taken)

    def _seal(self) -> None:
        self._sealing = None
        self._put(self.gate.seal(self._now_us()))

    def _hear(self, frame: Frame, time_us: int) -> None:
        handed, said = self.gate.hear(frame, time_us)
        self._put(said)
        self._go_on()
        for one in handed:
            for handler in self._handlers:
                handler(one, time_us)

    def _sent(self, frame: Frame, time_us: int) -> None:
        for handler in self._on_sent:
            handler(frame, time_us)

    def _wake(self) -> None:
        self._timer = None
        self._put(self.gate.wake(self._now_us()))
        self._go_on()

    def _go_on(self) -> None:
        if self.gate.is_open and self._then is not None:
            then, self._then = self._then, None
            early, self._early = self._early, []
            for frame in early:
                self.send(frame)
            then()
        due_us = self.gate.next_us
        if due_us is None or (self._timer is not None and self._timer.when() <= due_us / 1_000_000):
            return
        if self._timer is not None:
            self._timer.cancel()
        self._timer = self._loop.call_at(due_us / 1_000_000, self._wake)


def settings_of(site: Site, node: int) -> GateSettings:
    """What a node of a site's gate is told of the site."""
    return GateSettings(frozenset(site.machines) - {node}, site.bitrate, is_required=site.seals == "required")


async def sealed_bus(plain: Bus, site: Site, keys: Keys, beside: Path, reading: Reading) -> SealedBus:
    """The bus behind its gate, once that is open; the number of the node's lives is kept ``beside`` a file or folder.

    Raises ``OSError`` and ``SealLivesError``.
    """

    def nonce() -> int:
        return secrets.randbits(_NONCE_BITS)

    gate = Gate(keys, settings_of(site, keys.node), next_life(beside, keys.made), nonce, reading)
    sealed = SealedBus(plain, gate)
    await sealed.opened()
    return sealed
