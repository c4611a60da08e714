"""What a gateway relies on of a broker: one body for the double and for the real mosquitto."""

import asyncio
import socket
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any, Protocol

import pytest

from onboard.io.mqtt import MqttBroker, MqttSession
from onboard.ports.broker import Broker, BrokerError, BrokerSession, Publication
from tests.mqtt.double import DoubleBroker, DoubleSession, fits
from tests.mqtt.mosquitto import Mosquitto
from tests.tools import DEADLINE_S


class Case(Protocol):
    """A broker, and what can happen to it."""

    @property
    def broker(self) -> Broker: ...

    async def kill(self) -> None: ...
    async def start(self) -> None: ...
    async def freeze(self) -> None: ...
    async def thaw(self) -> None: ...
    def cut(self, name: str, session: BrokerSession) -> None: ...


class DoubleCase:
    def __init__(self) -> None:
        self.broker = DoubleBroker(patience_s=0.2)

    async def kill(self) -> None:
        self.broker.kill()

    async def start(self) -> None:
        self.broker.start()

    async def freeze(self) -> None:
        self.broker.freeze()

    async def thaw(self) -> None:
        self.broker.thaw()

    def cut(self, name: str, session: BrokerSession) -> None:
        assert isinstance(session, DoubleSession)
        self.broker.cut(name)


class RealCase:
    def __init__(self, mosquitto: Mosquitto) -> None:
        self.mosquitto = mosquitto
        self.broker: MqttBroker = mosquitto.broker()

    async def kill(self) -> None:
        await self.mosquitto.kill()

    async def start(self) -> None:
        await self.mosquitto.start()

    async def freeze(self) -> None:
        self.mosquitto.freeze()

    async def thaw(self) -> None:
        self.mosquitto.thaw()

    def cut(self, name: str, session: BrokerSession) -> None:
        assert isinstance(session, MqttSession)
        wire = session.client._client.socket()
        assert isinstance(wire, socket.socket), "this broker is asked without encryption"
        wire.shutdown(socket.SHUT_RDWR)


@pytest.fixture(params=["double", "mosquitto"])
async def case(request: pytest.FixtureRequest, tmp_path: Path) -> AsyncIterator[Case]:
    if request.param == "double":
        yield DoubleCase()
        return
    mosquitto = Mosquitto(tmp_path)
    await mosquitto.start()
    yield RealCase(mosquitto)
    await mosquitto.stop()


def said(text: str, topic: str = "a/b", **options: Any) -> Publication:
    return Publication(topic, text.encode(), **options)


async def arrives(session: BrokerSession, count: int) -> list[Publication]:
    found: list[Publication] = []
    async with asyncio.timeout(DEADLINE_S):
        async for one in session.incoming():
            session.taken(one)
            found.append(one)
            if len(found) == count:
                break
    return found


async def open_and_close(case: Case, name: str) -> None:
    async with asyncio.timeout(DEADLINE_S), case.broker.session(name, None, ()):
        pass


async def test_what_is_retained_is_told_to_who_comes_later(case: Case) -> None:
    async with case.broker.session("writer", None, ()) as writer:
        await writer.publish(said("old", retain=True, qos=1))
        await writer.publish(said("kept", retain=True, qos=1))
        await writer.publish(said("gone", topic="a/c", qos=1))
        async with case.broker.session("reader", None, ("a/+",)) as reader:
            await writer.publish(said("new", topic="a/c", qos=1))
            kept, new = await arrives(reader, 2)
            assert (kept.payload, kept.retain, new.payload, new.retain) == (b"kept", True, b"new", False)


async def test_a_last_will_is_told_where_a_connection_breaks_and_not_where_it_ends(case: Case) -> None:
    async def breaks() -> None:
        async with case.broker.session("second", said("second", "will", qos=1), ()) as second:
            case.cut("second", second)
            await arrives(second, 1)

    async with case.broker.session("reader", None, ("will",)) as reader:
        async with case.broker.session("first", said("first", "will", qos=1), ()):
            pass
        with pytest.raises(BrokerError):
            await breaks()
        assert [one.payload for one in await arrives(reader, 1)] == [b"second"]


async def test_with_qos_1_nothing_is_lost_for_a_reader_that_is_away(case: Case) -> None:
    async with case.broker.session("reader", None, ("orders",)):
        pass
    async with case.broker.session("writer", None, ()) as writer:
        for number in range(3):
            await writer.publish(said(f"{number}", "orders", qos=1))
    async with case.broker.session("reader", None, ("orders",)) as reader:
        assert [one.payload for one in await arrives(reader, 3)] == [b"0", b"1", b"2"]


async def test_with_qos_1_what_was_not_taken_comes_again_and_what_was_taken_does_not(case: Case) -> None:
    async with case.broker.session("writer", None, ()) as writer:
        async with case.broker.session("reader", None, ("orders",)) as reader:
            await writer.publish(said("first", "orders", qos=1))
            await writer.publish(said("second", "orders", qos=1))
            await arrives(reader, 1)
            unread = reader.incoming()
            assert (await anext(unread)).payload == b"second"
        async with case.broker.session("reader", None, ("orders",)) as reader:
            await writer.publish(said("third", "orders", qos=1))
            assert [one.payload for one in await arrives(reader, 2)] == [b"second", b"third"]


async def test_a_broker_that_dies_breaks_sessions_and_can_be_met_again(case: Case) -> None:
    async def goes_on() -> None:
        async with case.broker.session("writer", None, ()) as writer:
            await writer.publish(said("before", qos=1))
            await case.kill()
            while True:
                await writer.publish(said("lost", qos=1))

    with pytest.raises(BrokerError):
        await goes_on()
    with pytest.raises(BrokerError):
        await open_and_close(case, "writer")
    await case.start()
    await open_and_close(case, "writer")


async def test_a_broker_that_is_frozen_is_noticed_and_takes_up_again(case: Case) -> None:
    async def goes_on() -> None:
        async with case.broker.session("writer", None, ()) as writer:
            await case.freeze()
            async with asyncio.timeout(DEADLINE_S):
                await writer.publish(said("unheard", qos=1))

    with pytest.raises(BrokerError):
        await goes_on()
    with pytest.raises(BrokerError):
        await open_and_close(case, "writer")
    await case.thaw()
    async with case.broker.session("writer", None, ()) as writer:
        await writer.publish(said("heard", qos=1))


async def test_of_two_with_one_name_the_older_is_thrown_out(case: Case) -> None:
    async def stays() -> None:
        async with case.broker.session("one", None, ()) as older:
            await open_and_close(case, "one")
            await arrives(older, 1)

    with pytest.raises(BrokerError):
        await stays()


@pytest.mark.parametrize(
    ("pattern", "topic", "is_met"),
    [
        ("a/b", "a/b", True),
        ("a/b", "a/c", False),
        ("a/+", "a/b", True),
        ("a/+", "a/b/c", False),
        ("a/#", "a/b/c", True),
        ("a/b/c", "a/b", False),
        ("+/b", "a/b", True),
    ],
)
def test_the_double_reads_patterns_as_the_standard_does(pattern: str, topic: str, is_met: bool) -> None:
    assert fits(pattern, topic) is is_met
