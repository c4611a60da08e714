"""One session with the broker, opened again and again: what waits is bounded, and the oldest telemetry goes first."""

import asyncio
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from onboard.gateway.reports import Reports
from onboard.ports.broker import Broker, BrokerError, BrokerSession, Publication

#: Telemetry of one link that waits for the broker; of more the oldest is dropped and counted.
MOST_WAITING = 256
#: Wait before the next attempt to connect: the first, doubled up to the last, s: a broker that restarts is back in
#: seconds, one that is gone is not hammered.
FIRST_WAIT_S, LAST_WAIT_S = 0.5, 5.0


@dataclass
class LinkCounts:
    """Since the start: what the broker took, telemetry dropped, sessions opened and broken, disk writes failed."""

    published: int = 0
    dropped: int = 0
    opened: int = 0
    broken: int = 0
    disk_errors: int = 0


@dataclass
class LinkWords:
    """What a link says by itself: last will, first and last words; asked for when they are needed."""

    will: Callable[[], Publication]
    hello: Callable[[], list[Publication]]
    goodbye: Callable[[], Publication]


class Link:
    """One client of the broker. ``post`` from the loop; ``run`` is its task, ended by ``stop``."""

    def __init__(
        self,
        broker: Broker,
        client: str,
        words: LinkWords,
        *,
        reports: Reports | None = None,
        subscriptions: tuple[str, ...] = (),
        on_order: Callable[[Publication, Callable[[], None]], None] | None = None,
    ) -> None:
        self.counts = LinkCounts()
        self.is_connected = False
        #: Why the last session broke, in one line; empty while there is one.
        self.trouble = ""
        self._broker, self._client, self._words, self._reports = broker, client, words, reports
        self._subscriptions, self._on_order = subscriptions, on_order
        self._queue: deque[Publication] = deque()
        self._news = asyncio.Event()
        self._stopping = asyncio.Event()

    @property
    def waiting(self) -> int:
        """How many publications wait for the broker."""
        return len(self._queue)

    def post(self, publication: Publication) -> None:
        """Queue telemetry; never blocks. What waits for a session that does not come makes room for what is new."""
        if len(self._queue) >= MOST_WAITING:
            self._queue.popleft()
            self.counts.dropped += 1
        self._queue.append(publication)
        self._news.set()

    def wake(self) -> None:
        """A report waits, or the end is near."""
        self._news.set()

    def stop(self) -> None:
        """Say goodbye where there is a session, and end ``run``."""
        self._stopping.set()
        self._news.set()

    async def run(self) -> None:
        """Open one session after another until ``stop`` is called, with growing pauses between them."""
        wait_s = FIRST_WAIT_S
        while not self._stopping.is_set():
            published = self.counts.published
            try:
                await self._one_session()
            except BrokerError as error:
                self.trouble = str(error)
                self.counts.broken += 1
            self.is_connected = False
            wait_s = FIRST_WAIT_S if self.counts.published > published else min(2 * wait_s, LAST_WAIT_S)
            if not self._stopping.is_set():
                await _until(self._stopping, wait_s)

    async def _one_session(self) -> None:
        opening = self._broker.session(self._client, self._words.will(), self._subscriptions)
        async with opening as session:
            self.counts.opened += 1
            self.is_connected, self.trouble = True, ""
            hello = self._words.hello()
            # What the broker keeps is said anew: an older word that still waits must not come after it.
            said = {one.topic for one in hello if one.retain}
            self._queue = deque(one for one in self._queue if not one.retain or one.topic not in said)
            for publication in hello:
                await self._publish(session, publication)
            listening = asyncio.ensure_future(self._listen(session))
            try:
                await self._send(session, listening)
            finally:
                listening.cancel()
                await asyncio.wait([listening])
            await self._publish(session, self._words.goodbye())

    async def _send(self, session: BrokerSession, listening: "asyncio.Future[None]") -> None:
        """Reports first, then telemetry in its order; a publication leaves its queue once the broker has it."""
        while not self._stopping.is_set():
            self._news.clear()
            while not self._stopping.is_set() and await self._send_one(session):
                pass
            news = asyncio.ensure_future(self._news.wait())
            try:
                await asyncio.wait((news, listening), return_when=asyncio.FIRST_COMPLETED)
            finally:
                news.cancel()
            if listening.done():
                listening.result()
                raise BrokerError("the connection has ended")

    async def _send_one(self, session: BrokerSession) -> bool:
        if self._reports is not None and self._reports.pending:
            name, report = next(iter(self._reports.pending.items()))
            await self._publish(session, report)
            try:
                await self._reports.delivered(name)
            except OSError:
                self.counts.disk_errors += 1
            return True
        if not self._queue:
            return False
        publication = self._queue[0]
        await self._publish(session, publication)
        # Meanwhile the queue may have overflowed, and this one with it.
        if self._queue and self._queue[0] is publication:
            self._queue.popleft()
        return True

    async def _publish(self, session: BrokerSession, publication: Publication) -> None:
        await session.publish(publication)
        self.counts.published += 1

    async def _listen(self, session: BrokerSession) -> None:
        async for delivery in session.incoming():
            if self._on_order is not None:
                self._on_order(delivery, partial(session.taken, delivery))


async def _until(event: asyncio.Event, seconds: float) -> None:
    """Wait for an event, or so long."""
    try:
        await asyncio.wait_for(event.wait(), seconds)
    except TimeoutError:
        return
