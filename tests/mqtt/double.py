"""A broker in this process, for virtual time: ``ports.Broker`` without a network.

What it does is what mosquitto does, as far as a gateway can see it; ``test_brokers`` holds both to the same.
"""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field

from onboard.ports.broker import BrokerError, Publication, ReceivedPublication


def fits(pattern: str, topic: str) -> bool:
    """Whether a topic is one of a subscription (MQTT 3.1.1, section 4.7)."""
    wanted, levels = pattern.split("/"), topic.split("/")
    for place, one in enumerate(wanted):
        if one == "#":
            return True
        if place >= len(levels) or one not in ("+", levels[place]):
            return False
    return len(wanted) == len(levels)


@dataclass
class _Client:
    """What the broker keeps of one client, also between its sessions."""

    subscriptions: tuple[str, ...] = ()
    waiting: list[Publication] = field(default_factory=list)
    session: "DoubleSession | None" = None


class DoubleBroker:
    """A broker. ``kill``, ``freeze`` and ``start`` are what happens to its process; ``all`` is everything it took."""

    def __init__(self, patience_s: float = 5.0) -> None:
        self._patience_s = patience_s
        self.all: list[Publication] = []
        self.retained: dict[str, Publication] = {}
        self.is_up = True
        #: Topics of which one publication is taken and then the connection breaks before the broker has said so.
        self.dies_before_answer: set[str] = set()
        self._thawed = asyncio.Event()
        self._thawed.set()
        self._clients: dict[str, _Client] = {}

    def kill(self) -> None:
        """The process dies: every session breaks, and what is retained is still on its disk."""
        self.is_up = False
        for client in self._clients.values():
            if client.session is not None:
                client.session.lose()
                client.session = None

    def start(self) -> None:
        """Up again after ``kill``."""
        self.is_up = True

    def freeze(self) -> None:
        """The process stands still; connections stay open."""
        self._thawed.clear()

    def thaw(self) -> None:
        """It goes on."""
        self._thawed.set()

    def cut(self, name: str) -> None:
        """One client's connection breaks without a word: its last will is published."""
        client = self._clients[name]
        assert client.session is not None
        session, client.session = client.session, None
        session.lose()
        if session.will is not None:
            self.take(session.will)

    def take(self, publication: Publication) -> None:
        """One publication, from whomever; subscribers get it."""
        self.all.append(publication)
        if publication.retain:
            if publication.payload:
                self.retained[publication.topic] = publication
            else:
                self.retained.pop(publication.topic, None)
        for client in self._clients.values():
            if any(fits(pattern, publication.topic) for pattern in client.subscriptions):
                told = Publication(publication.topic, publication.payload, publication.qos, False)
                if told.qos:
                    client.waiting.append(told)
                if client.session is not None:
                    client.session.bring(told)

    @asynccontextmanager
    async def session(
        self, client: str, will: Publication | None, subscriptions: tuple[str, ...]
    ) -> AsyncIterator["DoubleSession"]:
        """As in the port."""
        await self.answer()
        kept = self._clients.setdefault(client, _Client())
        if kept.session is not None:
            # The same name again: the older session is thrown out (MQTT 3.1.1, section 3.1.4).
            self.cut(client)
        session = kept.session = DoubleSession(self, will, kept.waiting)
        new = set(subscriptions) - set(kept.subscriptions)
        kept.subscriptions = subscriptions
        for topic, publication in self.retained.items():
            if any(fits(pattern, topic) for pattern in new):
                session.bring(publication)
        for publication in kept.waiting:
            session.bring(publication)
        try:
            yield session
        finally:
            if kept.session is session:
                kept.session = None
                session.lose()

    async def answer(self) -> None:
        """Wait for the broker as a client does: not for ever."""
        if not self.is_up:
            raise BrokerError("connection refused")
        try:
            await asyncio.wait_for(self._thawed.wait(), self._patience_s)
        except TimeoutError:
            raise BrokerError("operation timed out") from None


class DoubleSession:
    """``BrokerSession``."""

    def __init__(self, broker: DoubleBroker, will: Publication | None, waiting: list[Publication]) -> None:
        """``waiting`` is what the client has not taken, with QoS 1."""
        self.will = will
        self._arrived: asyncio.Queue[ReceivedPublication] = asyncio.Queue()
        self._brought: list[Publication] = []
        self._broker, self._waiting = broker, waiting
        self._lost = asyncio.Event()

    def lose(self) -> None:
        """The connection is gone."""
        self._lost.set()

    async def publish(self, publication: Publication) -> None:
        """As in the port."""
        if not self._lost.is_set():
            await self._broker.answer()
        if self._lost.is_set():
            raise BrokerError("connection lost")
        self._broker.take(publication)
        if publication.topic in self._broker.dies_before_answer:
            self._broker.dies_before_answer.discard(publication.topic)
            self.lose()
            raise BrokerError("connection lost")

    def bring(self, told: Publication) -> None:
        """One publication comes in."""
        self._brought.append(told)
        number = len(self._brought) - 1
        self._arrived.put_nowait(ReceivedPublication(told.topic, told.payload, told.qos, told.retain, number))

    def taken(self, delivery: ReceivedPublication) -> None:
        """As in the port."""
        if not self._lost.is_set():
            told = self._brought[delivery.number]
            self._waiting[:] = [one for one in self._waiting if one is not told]

    async def incoming(self) -> AsyncIterator[ReceivedPublication]:
        """As in the port."""
        while True:
            next_one, lost = asyncio.ensure_future(self._arrived.get()), asyncio.ensure_future(self._lost.wait())
            try:
                await asyncio.wait((next_one, lost), return_when=asyncio.FIRST_COMPLETED)
                if not next_one.done():
                    raise BrokerError("connection lost")
                yield next_one.result()
            finally:
                next_one.cancel()
                lost.cancel()
