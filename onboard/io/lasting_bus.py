"""A bus whose interface may be late, or go and come back: an adapter that is plugged in anew, a driver loaded again."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Self

from onboard.core.frame import Frame
from onboard.io.open_bus import OpenBus, open_bus
from onboard.io.settings import BusOpenError, BusSettings
from onboard.ports.bus import BusHealth, ErrorState, FrameHandler

#: A missing interface is looked for so often, s. Looking costs a system call, and a machine stands meanwhile.
RETRY_S = 0.5

Opener = Callable[[BusSettings], Awaitable[OpenBus]]


class LastingBus:
    """``OpenBus`` over any interface, opened again whenever it is gone.

    While it is away ``send`` refuses and ``health`` tells bus-off; so does a bus that ``needs`` another one which is
    away: drives get no orders from a machine that could not hear a stop. ``losses`` counts how often it was gone.
    """

    def __init__(
        self,
        settings: BusSettings,
        tell: Callable[[str], None],
        *,
        needs: Self | None = None,
        opener: Opener = open_bus,
    ) -> None:
        """``tell`` gets one line for a person whenever something changes. ``start`` opens it."""
        self.name = str(settings)
        self.losses = 0
        #: Called whenever it is gone.
        self.on_loss: Callable[[], None] = lambda: None
        self._settings = settings
        self._tell = tell
        self._needs = needs
        self._opener = opener
        self._bus: OpenBus | None = None
        self._subscribers: list[tuple[FrameHandler, FrameHandler | None]] = []
        self._keeping: asyncio.Task[None] | None = None
        self._refused = 0
        self._lost: asyncio.Future[str] = asyncio.get_running_loop().create_future()

    async def start(self) -> None:
        """Open it, however long that takes. Raises ``BusOpenError`` for what no waiting heals."""
        self._bus = await self._come()
        self._keeping = asyncio.get_running_loop().create_task(self._keep())

    @property
    def is_away(self) -> bool:
        """Whether nothing can be said or heard."""
        return self._bus is None

    def subscribe(self, on_frame: FrameHandler, on_sent: FrameHandler | None = None) -> None:
        """As in the port, for as often as it is opened."""
        self._subscribers.append((on_frame, on_sent))
        if self._bus is not None:
            self._bus.subscribe(on_frame, on_sent)

    def send(self, frame: Frame) -> bool:
        """Queue; False, and counted, while the interface or the bus that this one needs is away."""
        if self._bus is None or (self._needs is not None and self._needs.is_away):
            self._refused += 1
            return False
        return self._bus.send(frame)

    def health(self) -> BusHealth:
        """Counters since the interface was opened last; bus-off while it is away."""
        return BusHealth(ErrorState.BUS_OFF, send_refused=self._refused) if self._bus is None else self._bus.health()

    async def wait_lost(self) -> str:
        """As ``OpenBus`` says: once it could be opened and never can be again."""
        return await asyncio.shield(self._lost)

    async def close(self) -> None:
        """Stop looking for the interface, and close it where it is open."""
        if self._keeping is not None:
            self._keeping.cancel()
            await asyncio.wait([self._keeping])
        if self._bus is not None:
            bus, self._bus = self._bus, None
            await bus.close()

    async def _keep(self) -> None:
        while self._bus is not None:
            why = await self._bus.wait_lost()
            gone, self._bus = self._bus, None
            self.losses += 1
            self.on_loss()
            self._tell(f"the bus is gone: {why}; the machine stands until it is back")
            await gone.close()
            try:
                bus = await self._come()
            except BusOpenError as error:
                self._lost.set_result(str(error))
                return
            self._bus = bus
            for on_frame, on_sent in self._subscribers:
                bus.subscribe(on_frame, on_sent)
            self._tell(f"the bus {self.name} is back")

    async def _come(self) -> OpenBus:
        reason = ""
        while True:
            try:
                return await self._opener(self._settings)
            except BusOpenError as error:
                if not error.may_come:
                    raise
                if str(error) != reason:
                    reason = str(error)
                    self._tell(f"waits for its bus: {reason}")
            await asyncio.sleep(RETRY_S)
