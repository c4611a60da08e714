"""The broker's configuration as it is shipped: who gets in, and who may do what."""

import asyncio
from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path

import pytest

from onboard.io.broker_address import BrokerAddress
from onboard.io.mqtt import MqttBroker
from onboard.ports.broker import BrokerError, Publication
from tests.mqtt.mosquitto import ROLES, WITNESS, Mosquitto, certificates
from tests.tools import DEADLINE_S

TOLD = ("status", "task", "report", "call", "event", "indicators", "machine/ER1", "log/MR1")
MACHINE = ("connection", "state", "visualization", "factsheet")
INTERFACES = ("uagv/v2/onboard/MR1", "vda5050/v3/onboard/MR1")
TELEMETRY = {
    *(f"onboard/site/{name}" for name in TOLD),
    *(f"{interface}/{name}" for interface in INTERFACES for name in MACHINE),
}
ANSWERS = {"onboard/site/order/7"}
ORDERS = {
    "onboard/site/orders/dispatcher",
    *(f"{one}/{name}" for one in INTERFACES for name in ("order", "instantActions")),
}
OF_ANOTHER = {
    "onboard/site/orders",
    "onboard/site/orders/other",
    "uagv/v2/onboard/MR2/state",
    "onboard/site/log/MR2",
    "uagv/v2/other/MR1/state",
    "elsewhere",
    "$SYS/x",
}
EVERY = TELEMETRY | ANSWERS | ORDERS | OF_ANOTHER
#: Who may write and read what.
MAY_WRITE = {
    "gateway": TELEMETRY | ANSWERS | {"uagv/v2/onboard/MR2/state", "onboard/site/log/MR2"},
    "dispatcher": ORDERS,
    "viewer": set[str](),
    "MR1": {one for one in TELEMETRY if "/MR1/" in one} | {"onboard/site/log/MR1"},
}
MAY_READ = {
    "gateway": ORDERS,
    "dispatcher": TELEMETRY | ANSWERS | ORDERS,
    "viewer": TELEMETRY,
    "MR1": set[str](),
}


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return certificates(tmp_path_factory.mktemp("certificates"))


@pytest.fixture
async def mosquitto(tmp_path: Path, keys: Path) -> AsyncIterator[Mosquitto]:
    broker = Mosquitto(tmp_path, tls=keys)
    await broker.start()
    yield broker
    await broker.stop()


async def heard_until(broker: MqttBroker, patterns: tuple[str, ...], last: bytes, ready: asyncio.Event) -> set[str]:
    """Topics heard by one that subscribes, up to a payload that ends it."""
    found: set[str] = set()
    async with asyncio.timeout(DEADLINE_S), broker.session("listener", None, patterns) as session:
        ready.set()
        async for one in session.incoming():
            session.taken(one)
            if one.payload == last:
                return found
            found.add(one.topic)
    raise AssertionError("the session ended")


@pytest.mark.parametrize("role", MAY_WRITE)
async def test_each_role_writes_what_it_may_and_nothing_else(mosquitto: Mosquitto, role: str) -> None:
    """What is forbidden vanishes, as MQTT 3.1.1 has it (3.3.5): who reads it all does not see it."""
    ready = asyncio.Event()
    witness = asyncio.ensure_future(heard_until(mosquitto.broker(WITNESS), ("#",), b"last", ready))
    async with asyncio.timeout(DEADLINE_S):
        await ready.wait()
    async with mosquitto.broker(role).session(f"{role}-1", None, ()) as session:
        for topic in sorted(EVERY):
            await session.publish(Publication(topic, b"x", 1))
    async with mosquitto.broker("dispatcher").session("end", None, ()) as session:
        await session.publish(Publication("onboard/site/orders/dispatcher", b"last", 1))
    assert await witness == MAY_WRITE[role]


@pytest.mark.parametrize("role", MAY_READ)
async def test_each_role_reads_what_it_may_and_nothing_else(mosquitto: Mosquitto, role: str) -> None:
    async with mosquitto.broker(role).session("reader", None, ("#",)) as reader:
        async with mosquitto.broker(WITNESS).session("writer", None, ()) as session:
            for topic in sorted(TELEMETRY | ANSWERS | ORDERS):
                await session.publish(Publication(topic, b"x", 1))
        found: set[str] = set()
        async with asyncio.timeout(DEADLINE_S):
            while len(found) < len(MAY_READ[role]):
                one = await anext(reader.incoming())
                # More than 20 that are not taken, and the broker brings no more.
                reader.taken(one)
                found.add(one.topic)
        assert found == MAY_READ[role]
        # Nothing else is on its way: the broker has acknowledged all publications, and this session's own as well.
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.2):
                await anext(reader.incoming())


# paho leaves the socket of a failed handshake to the garbage collector, which closes it with a warning.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
async def test_a_certificate_of_another_authority_or_none_does_not_get_in(mosquitto: Mosquitto, keys: Path) -> None:
    async def enter(address: BrokerAddress) -> None:
        broker = MqttBroker(address, keepalive_s=5, timeout_s=0.7)
        async with broker.session("gateway", None, ()) as session:
            await session.publish(Publication("onboard/site/status", b"x", 1))

    good = mosquitto.address("gateway")
    await enter(good)
    false = mosquitto.address(certificate="gateway-false")
    none = replace(good, certificate=None, key=None)
    plain = replace(good, tls=False)
    deceived = replace(good, ca=keys / "stranger.pem")
    for address in (false, none, plain, deceived):
        with pytest.raises(BrokerError):
            await enter(address)


async def test_nobody_takes_the_gateways_place_under_its_client_id(mosquitto: Mosquitto) -> None:
    """A viewer under the gateway's id threw it out, and what waited for it was gone."""
    mine = ("onboard/+/orders/+",)
    async with mosquitto.broker("gateway").session("onboard-site-fleet", None, mine):
        pass
    async with mosquitto.broker("viewer").session("onboard-site-fleet", None, ()) as viewer:
        await viewer.publish(Publication("elsewhere", b"x", 1))
    async with mosquitto.broker("dispatcher").session("onboard-site-fleet", None, ()) as dispatcher:
        await dispatcher.publish(Publication("onboard/site/orders/dispatcher", b"A1", 1))
        async with mosquitto.broker("gateway").session("onboard-site-fleet", None, mine) as gateway:
            async with asyncio.timeout(DEADLINE_S):
                assert (await anext(gateway.incoming())).payload == b"A1", "it waited for the gateway"
            # Both are there still: the broker answers both.
            await dispatcher.publish(Publication("onboard/site/orders/dispatcher", b"A2", 1))
            await gateway.publish(Publication("onboard/site/status", b"x", 1))


# paho leaves the socket of a failed handshake to the garbage collector, which closes it with a warning.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("role", ["viewer", "dispatcher", "MR1"])
async def test_only_the_gateways_own_authority_opens_its_port(mosquitto: Mosquitto, role: str) -> None:
    broker = MqttBroker(replace(mosquitto.address(role), port=mosquitto.gateway_port), keepalive_s=5, timeout_s=0.7)
    with pytest.raises(BrokerError):
        async with broker.session("onboard-site-fleet", None, ()) as session:
            await session.publish(Publication("onboard/site/status", b"x", 1))


async def test_a_file_that_is_no_certificate_is_one_clear_line(tmp_path: Path, keys: Path) -> None:
    wrong = tmp_path / "wrong.pem"
    wrong.write_text("nothing\n", encoding="ascii")
    address = replace(Mosquitto(tmp_path, tls=keys).address("gateway"), certificate=wrong)
    with pytest.raises(BrokerError, match=r"wrong\.pem.*name PEM files") as caught:
        MqttBroker(address)
    assert "\n" not in str(caught.value)


def test_every_role_of_the_list_is_tried_here() -> None:
    assert set(MAY_WRITE) == set(MAY_READ) == {*ROLES, "MR1"}
