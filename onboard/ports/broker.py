"""What a gateway needs of a message broker (MQTT 3.1.1, OASIS 2014): sessions with a last will, and publications."""

from collections.abc import AsyncIterator
from contextlib import AbstractAsyncContextManager
from dataclasses import dataclass
from typing import Protocol


class BrokerError(Exception):
    """The broker cannot be reached, refuses, or has fallen silent. ``str`` is one line for a person."""


@dataclass(frozen=True, slots=True)
class Publication:
    """One message on a topic. ``qos`` 0 (sent once) or 1 (kept by the sender until the broker has it)."""

    topic: str
    payload: bytes
    qos: int = 0
    retain: bool = False


@dataclass(frozen=True, slots=True)
class ReceivedPublication(Publication):
    """A publication as it arrived; ``number`` is its name in the session that brought it."""

    number: int = 0


class BrokerSession(Protocol):
    """One connection under one client identifier."""

    async def publish(self, publication: Publication) -> None:
        """Hand one publication over; with QoS 1 return once the broker has acknowledged it. Raises ``BrokerError``."""

    def incoming(self) -> AsyncIterator[ReceivedPublication]:
        """What arrives on the topics subscribed to, until the connection ends. Raises ``BrokerError`` then.

        With QoS 1 the broker keeps each until it is ``taken``, and brings it again in the next session.
        """

    def taken(self, delivery: ReceivedPublication) -> None:
        """What came of it is on disk here: the broker may forget it. Never raises, and says nothing once it is over."""


class Broker(Protocol):
    """A broker that sessions can be opened with, again and again."""

    def session(
        self, client: str, will: Publication | None, subscriptions: tuple[str, ...]
    ) -> AbstractAsyncContextManager[BrokerSession]:
        """Connect as ``client``; entering raises ``BrokerError``. Leaving disconnects in order: no will is sent."""
