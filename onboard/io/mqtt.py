"""``ports.Broker`` over aiomqtt 2.5: the one file that knows it.

One session at a time is one aiomqtt client, thrown away when it ends, so nothing that a broken connection left behind
(paho's queues grow without bound while a socket is full) outlives it. aiomqtt connects in a thread of the loop's
executor, so name look-up and TLS handshake hold nothing up; after that its socket is served by the loop.
"""

import asyncio
import logging
import socket
import ssl
from collections.abc import AsyncIterator, Sequence
from contextlib import AbstractAsyncContextManager, asynccontextmanager

import aiomqtt

from onboard.io.broker_address import BrokerAddress
from onboard.ports.broker import BrokerError, Publication, ReceivedPublication

#: Without a sign of life a connection is given up after one and a half times this (MQTT 3.1.1, 3.1.2.10), s: a link
#: that is gone is noticed within half a minute.
KEEPALIVE_S = 10
#: What the broker has not answered in this time counts as failed, s: longer than a busy broker takes.
TIMEOUT_S = 5.0
#: Orders that wait to be taken up; what comes beyond is counted and lost.
MOST_WAITING = 256

#: paho tells errors that this file raises as well.
_QUIET = logging.getLogger("onboard.mqtt")
_QUIET.addHandler(logging.NullHandler())
_QUIET.propagate = False


class MqttBroker:
    """A broker at an address. ``overflows`` counts publications that came faster than they were taken up.

    ``keepalive_s`` whole seconds and ``timeout_s`` seconds, both above 0.
    """

    def __init__(self, address: BrokerAddress, keepalive_s: int = KEEPALIVE_S, timeout_s: float = TIMEOUT_S) -> None:
        """Raises ``BrokerError`` for certificates that cannot be used."""
        self.address = address
        self.overflows = 0
        self._keepalive_s, self._timeout_s = keepalive_s, timeout_s
        self._tls = _tls_context(address)

    def session(
        self, client: str, will: Publication | None, subscriptions: tuple[str, ...]
    ) -> AbstractAsyncContextManager["MqttSession"]:
        """As in the port. With subscriptions the broker keeps them, and what comes on them, between sessions."""
        return self._session(client, will, subscriptions)

    @asynccontextmanager
    async def _session(
        self, client: str, will: Publication | None, subscriptions: tuple[str, ...]
    ) -> AsyncIterator["MqttSession"]:
        session = MqttSession(self._client(client, will, keep=bool(subscriptions)))
        # By default paho says that it has a message before anybody has read it; a crash then loses it.
        session.client._client.manual_ack_set(True)  # noqa: SLF001  # aiomqtt 2.5 has no option for it
        _hear_out(session.client)
        try:
            async with session.client:
                _hear_out(session.client)
                for topic in subscriptions:
                    if _refused(await session.client.subscribe(topic, 1)):
                        raise BrokerError(f"{self.address}: may not read {topic}; grant it to {client}")
                yield session
        except (aiomqtt.MqttError, OSError) as error:
            raise BrokerError(f"{self.address}: {error}") from error
        finally:
            _let_go(session.client)

    def _client(self, name: str, will: Publication | None, *, keep: bool) -> aiomqtt.Client:
        broker = self

        class Waiting(asyncio.Queue[aiomqtt.Message]):
            """aiomqtt drops what does not fit and only logs it."""

            def put_nowait(self, item: aiomqtt.Message) -> None:
                if self.full():
                    broker.overflows += 1
                super().put_nowait(item)

        address = self.address
        return aiomqtt.Client(
            address.host,
            address.port,
            identifier=name,
            username=address.user,
            password=address.password,
            will=aiomqtt.Will(will.topic, will.payload, will.qos, will.retain) if will is not None else None,
            clean_session=not keep,
            keepalive=self._keepalive_s,
            timeout=self._timeout_s,
            tls_context=self._tls,
            queue_type=Waiting,
            logger=_QUIET,
            max_queued_incoming_messages=MOST_WAITING,
        )


class MqttSession:
    """``BrokerSession``: one aiomqtt client that is connected."""

    def __init__(self, client: aiomqtt.Client) -> None:
        self.client = client

    async def publish(self, publication: Publication) -> None:
        """Hand one publication to paho and wait as QoS says; more than ``TIMEOUT_S`` raises ``BrokerError``."""
        try:
            await self.client.publish(
                publication.topic, publication.payload, qos=publication.qos, retain=publication.retain
            )
        except (aiomqtt.MqttError, OSError) as error:
            raise BrokerError(str(error)) from error

    async def incoming(self) -> AsyncIterator[ReceivedPublication]:
        """Deliveries in the order of aiomqtt's queue. Raises ``BrokerError`` when the connection ends."""
        try:
            async for message in self.client.messages:
                yield ReceivedPublication(
                    str(message.topic), message.payload, message.qos, bool(message.retain), message.mid
                )
        except (aiomqtt.MqttError, OSError) as error:
            raise BrokerError(str(error)) from error

    def taken(self, delivery: ReceivedPublication) -> None:
        """Acknowledge a delivery, so that the broker does not bring it again."""
        self.client._client.ack(delivery.number, delivery.qos)  # noqa: SLF001  # aiomqtt 2.5 hands no such thing on


def _let_go(client: aiomqtt.Client) -> None:
    """Close what aiomqtt 2.5 leaves open where connecting has failed: the socket, and the task that looks after it."""
    task, wire = client._misc_task, client._client.socket()  # noqa: SLF001  # there is no other way to them
    if task is not None:
        task.cancel()
    if wire is not None and isinstance(wire, socket.socket) and wire.fileno() >= 0:
        loop = asyncio.get_running_loop()
        loop.remove_reader(wire.fileno())
        loop.remove_writer(wire.fileno())
        wire.close()


def _hear_out(client: aiomqtt.Client) -> None:
    """Take the reason of a break off aiomqtt's hands: nobody may ask for it, and asyncio would complain."""
    ended = client._disconnected  # noqa: SLF001  # there is no other way to it in 2.5
    ended.add_done_callback(lambda future: future.cancelled() or future.exception())


def _refused(codes: Sequence[object]) -> bool:
    """Whether a broker answered a subscription with 0x80 or above (MQTT 3.1.1, section 3.9.3)."""
    values = [getattr(code, "value", code) for code in codes]
    return any(isinstance(value, int) and value >= 0x80 for value in values)


def _tls_context(address: BrokerAddress) -> ssl.SSLContext | None:
    if not address.tls:
        return None
    try:
        context = ssl.create_default_context(cafile=str(address.ca) if address.ca is not None else None)
        context.minimum_version = ssl.TLSVersion.TLSv1_2
        if address.certificate is not None:
            context.load_cert_chain(address.certificate, address.key)
    except (OSError, ssl.SSLError) as error:
        files = ", ".join(str(path) for path in (address.ca, address.certificate, address.key) if path is not None)
        raise BrokerError(f"{address}: {files}: {error}; name PEM files that can be read") from error
    return context
