"""The socketcand server with our own client, with python-can's, and with clients that misbehave."""

import asyncio
import signal
import socket
import subprocess
import sys
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import can
import pytest

from bus_sim.serve import socketcand_session
from bus_sim.serve.socketcand import ServeError, SocketcandServer
from onboard.core.frame import Frame
from onboard.io import socketcand
from onboard.io.open_bus import BusOpenError, BusSettings, OpenBus, open_bus
from onboard.ports.bus import ErrorState
from onboard.trace.candump_reader import CandumpReader
from tests.io.hub import Ears, Hub, until
from tests.tools import DEADLINE_S
from tests.tools import DEADLINE_S as TOOL_DEADLINE_S

#: What the server adds to the bus's time: 2026-11-21 00:00 UTC, us.
EPOCH_US = 1_795_219_200_000_000
Result = TypeVar("Result")
FRAMES = [Frame(0x18FF0200 + number, bytes([number] * (number % 9))) for number in range(50)]


@dataclass
class Served:
    """A hub with two channels, its server and where that is."""

    hubs: dict[str, Hub]
    server: SocketcandServer
    port: int

    async def join(self, channel: str = "fleet") -> OpenBus:
        """Our own client."""
        return await open_bus(BusSettings("socketcand-asyncio", channel, extra=(("port", self.port),)))

    async def raw(self) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        """A client by hand."""
        return await asyncio.open_connection("127.0.0.1", self.port)


@pytest.fixture
async def served() -> AsyncIterator[Served]:
    hubs = {"fleet": Hub(), "MR1": Hub()}
    server = SocketcandServer(
        lambda channel, name: hubs[channel].attach(name) if channel in hubs else None,
        lambda time_us: EPOCH_US + time_us,
        port=0,
    )
    yield Served(hubs, server, await server.start())
    await server.close()


async def say(streams: tuple[asyncio.StreamReader, asyncio.StreamWriter], text: bytes, answer: bytes) -> None:
    """Send and expect exactly this answer."""
    reader, writer = streams
    writer.write(text)
    async with asyncio.timeout(DEADLINE_S):
        assert await reader.readexactly(len(answer)) == answer


async def test_frames_go_both_ways_and_not_back(served: Served) -> None:
    node, ears = served.hubs["fleet"].attach("node"), Ears()
    node.subscribe(ears.on_frame)
    one, two = await served.join(), await served.join()
    ears_one, ears_two = Ears(), Ears()
    one.subscribe(ears_one.on_frame, ears_one.on_sent)
    two.subscribe(ears_two.on_frame)
    assert all(one.send(frame) for frame in FRAMES)
    assert await ears.hear(50) == FRAMES
    assert await ears_two.hear(50) == FRAMES
    assert await ears_one.hear_sent(50) == FRAMES
    assert node.send(Frame(0x7FF, b"\x01", False))
    assert await ears_one.hear(1) == await ears_two.hear(1) == [Frame(0x7FF, b"\x01", False)]
    assert one.health().sent == two.health().received - 1 == 50
    await one.close()
    await two.close()
    await until(lambda: served.hubs["fleet"].nodes == [node])
    assert not one.send(FRAMES[0])


async def test_channels_are_buses_of_their_own(served: Served) -> None:
    fleet, device = await served.join("fleet"), await served.join("MR1")
    node, ears = served.hubs["MR1"].attach("drive"), Ears()
    node.subscribe(ears.on_frame)
    fleet.send(FRAMES[1])
    device.send(FRAMES[2])
    assert await ears.hear(1) == [FRAMES[2]]
    await fleet.close()
    await device.close()


async def test_what_the_protocol_cannot_carry_is_refused(served: Served) -> None:
    bus = await served.join()
    assert not bus.send(Frame(0x100, is_remote=True, remote_dlc=2))
    assert bus.health().send_refused == 1
    await bus.close()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (BusSettings("socketcand-asyncio", "fleet", extra=(("port", 0),)), "port = 0: must be a number"),
        (BusSettings("socketcand-asyncio", "fleet", extra=(("speed", 3),)), "unknown argument speed; it takes host"),
        (BusSettings("socketcand-asyncio", "two words"), "must be one word"),
    ],
)
async def test_mistakes_in_settings_are_one_line(settings: BusSettings, message: str) -> None:
    with pytest.raises(BusOpenError, match=message) as error:
        await open_bus(settings)
    assert "\n" not in str(error.value)


async def test_an_unknown_channel_is_one_line(served: Served) -> None:
    with pytest.raises(BusOpenError, match=r"error could not open bus.*does it have this channel") as error:
        await served.join("can7")
    assert "\n" not in str(error.value)
    assert served.server.counts["refused"] == 1


async def test_nobody_listens() -> None:
    with pytest.raises(BusOpenError, match=r"is the server running"):
        await open_bus(BusSettings("socketcand-asyncio", "fleet", extra=(("port", free_port()),)))


async def test_a_port_in_use_is_one_line(served: Served) -> None:
    with pytest.raises(ServeError, match=f"cannot serve on 127.0.0.1:{served.port}: .*choose another port"):
        await SocketcandServer(lambda channel, name: None, int, port=served.port).start()


async def test_our_client_comes_back_when_the_server_does(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(socketcand, "BACKOFF_S", 0.001)
    bus, ears = await served.join(), Ears()
    bus.subscribe(ears.on_frame)
    await served.server.close()
    await until(lambda: bus.health().state is ErrorState.BUS_OFF)
    assert not bus.send(FRAMES[0])
    hub = served.hubs["fleet"]
    again = SocketcandServer(lambda channel, name: hub.attach(name), int, port=served.port)
    await again.start()
    await until(lambda: bus.health().state is ErrorState.ERROR_ACTIVE)
    hub.attach("node").send(FRAMES[1])
    assert await ears.hear(1) == [FRAMES[1]]
    await bus.close()
    await again.close()


async def test_the_protocol_step_by_step(served: Served) -> None:
    """The conversation that SavvyCAN and Kayak have, cut and joined by TCP."""
    hub = served.hubs["fleet"]
    node, ears = hub.attach("node"), Ears()
    node.subscribe(ears.on_frame)
    client = await served.raw()
    await say(client, b"", b"< hi >")
    await say(client, b"< open fle", b"")
    await say(client, b"et >", b"< ok >")
    await say(client, b"< echo >< send 123 1 5 >< echo >", b"< echo >< echo >")
    await say(client, b"< rawmode >", b"< ok >")
    await say(client, b"< send ffffffff98ff0201 2 8 ffffffffffffffc3 >", b"")
    assert await ears.hear(2) == [Frame(0x123, b"\x05", False), Frame(0x18FF0201, b"\x08\xc3")]
    hub.time_us = 1_500_000
    node.send(Frame(0x18FF0201, b"\x08\xc3"))
    node.send(Frame(0x12, is_remote=True))
    node.send(Frame(0x12, b"", False))
    await say(client, b"", b"< frame 18FF0201 1795219201.500000 08C3 >< frame 012 1795219201.500000  >")
    assert served.server.counts["remote_dropped"] == 1
    await say(client, b"< bcmmode >", b"< ok >")
    node.send(FRAMES[1])
    await say(client, b"< echo >", b"< echo >")
    client[1].close()
    await until(lambda: hub.nodes == [node])


async def test_raw_mode_begins_with_an_answer_alone(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    """python-can's client fails where a frame comes in one piece with the answer; the pause ends at its first word."""
    monkeypatch.setattr(socketcand_session, "HOLD_S", 1_000)
    node = served.hubs["fleet"].attach("node")
    client = await served.raw()
    await say(client, b"", b"< hi >")
    await say(client, b"< open fleet >", b"< ok >")
    client[1].write(b"< rawmode >")
    await until(lambda: served.server.counts["listening"] == 1)
    node.send(FRAMES[1])
    await until(lambda: served.server.counts["received"] == 1)
    async with asyncio.timeout(DEADLINE_S):
        assert await client[0].read(1_000) == b"< ok >"
    await say(client, b"< echo >", b"< frame 18FF0201 1795219200.000000 01 >< echo >")
    client[1].close()


async def test_the_pause_of_raw_mode_ends_by_itself(served: Served) -> None:
    node = served.hubs["fleet"].attach("node")
    client = await served.raw()
    await say(client, b"", b"< hi >")
    await say(client, b"< open fleet >< rawmode >", b"< ok >< ok >")
    node.send(FRAMES[1])
    await say(client, b"", b"< frame 18FF0201 1795219200.000000 01 >")
    client[1].close()


async def test_garbage_is_answered_and_counted(served: Served) -> None:
    client = await served.raw()
    await say(client, b"", b"< hi >")
    await say(client, b"< rawmode >", b"< error this server serves")
    await say(client, b"", b" open, rawmode, bcmmode, send and echo >")
    await say(client, b"<open fleet>", b"< ok >")
    await say(client, b"\xff\xfe< send 123 1 zz >", b"< error not a message >< error byte 'zz' is not 0 to ff >")
    await say(client, b"< send 123 9 >", b"< error length '9' is not 0 to 8 >")
    await say(client, b"< subscribe 0 0 123 >", b"< error this server serves")
    assert served.server.counts["malformed"] == 3
    assert served.server.counts["unknown_command"] == 2
    client[1].close()


async def test_savvycan_reconnects_and_its_node_with_it(served: Served) -> None:
    """SavvyCAN drops and makes its connection anew every ten idle seconds."""
    hub = served.hubs["fleet"]
    for _ in range(5):
        client = await served.raw()
        await say(client, b"", b"< hi >")
        await say(client, b"< open fleet >< rawmode >", b"< ok >< ok >")
        client[1].transport.abort()
        await until(lambda: not hub.nodes)
    assert served.server.counts["opened"] == 5


async def test_a_client_that_does_not_read_is_disconnected(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(socketcand_session, "WRITE_LIMIT", 10_000)
    hub = served.hubs["fleet"]
    node = hub.attach("node")
    client = await served.raw()
    await say(client, b"", b"< hi >")
    await say(client, b"< open fleet >< rawmode >", b"< ok >< ok >")
    await say(client, b"< echo >", b"< echo >")
    client[1].transport.pause_reading()  # type: ignore[attr-defined]  # the transport of a socket can read
    async with asyncio.timeout(DEADLINE_S):
        while served.server.counts["too_slow"] == 0:
            for _ in range(200):
                node.send(FRAMES[8])
            await asyncio.sleep(0)
    await until(lambda: hub.nodes == [node])
    client[1].transport.abort()


async def test_a_full_node_is_counted(served: Served) -> None:
    bus = await served.join()
    served.hubs["fleet"].nodes[0].refuse = True
    bus.send(FRAMES[0])
    await until(lambda: served.server.counts["send_refused"] == 1)
    await bus.close()


# --- python-can's client --------------------------------------------------------------------------------------------


def python_can_client(port: int) -> can.BusABC:
    return can.Bus("fleet", interface="socketcand", host="127.0.0.1", port=port, ignore_config=True)


async def in_thread(work: Callable[[], Result]) -> Result:
    async with asyncio.timeout(DEADLINE_S):
        return await asyncio.to_thread(work)


async def test_python_can_joins_a_busy_bus(served: Served) -> None:
    """Whatever else is on the bus while it joins, it joins, and both ways work."""
    hub = served.hubs["fleet"]
    node, ears = hub.attach("node"), Ears()
    node.subscribe(ears.on_frame)
    joined = asyncio.ensure_future(in_thread(lambda: python_can_client(served.port)))
    while not joined.done():
        node.send(FRAMES[3])
        await asyncio.sleep(0)
    bus = joined.result()
    sent = can.Message(arbitration_id=0x18FF0203, data=b"\x01\x02", is_extended_id=True)
    await in_thread(lambda: bus.send(sent))
    await in_thread(
        lambda: bus.send(can.Message(arbitration_id=0x100, is_remote_frame=True, dlc=2, is_extended_id=False))
    )
    assert await ears.hear(2) == [
        Frame(0x18FF0203, b"\x01\x02"),
        Frame(0x100, b"", False, is_remote=True, remote_dlc=2),
    ]
    hub.time_us = 2_000_001
    node.send(Frame(0x123, b"\xab", False))
    message = None
    while message is None or message.arbitration_id != 0x123:
        message = await in_thread(lambda: bus.recv(DEADLINE_S))
        assert message is not None
    assert (bytes(message.data), message.is_extended_id) == (b"\xab", False)
    assert message.timestamp == pytest.approx(1_795_219_202.000001)
    await in_thread(bus.shutdown)


async def test_python_can_behind_our_port(served: Served) -> None:
    """``interface = "socketcand"``: python-can's client in a thread of ours; the server's end is noticed."""
    node, ears_node, ears = served.hubs["fleet"].attach("node"), Ears(), Ears()
    node.subscribe(ears_node.on_frame)
    bus = await open_bus(BusSettings("socketcand", "fleet", extra=(("host", "127.0.0.1"), ("port", served.port))))
    bus.subscribe(ears.on_frame, ears.on_sent)
    assert all(bus.send(frame) for frame in FRAMES)
    assert await ears_node.hear(50) == FRAMES
    assert await ears.hear_sent(50) == FRAMES
    node.send(FRAMES[4])
    assert await ears.hear(1) == [FRAMES[4]]
    await served.server.close()
    async with asyncio.timeout(DEADLINE_S):
        assert "socketcand:fleet: the server has closed the connection" in await bus.wait_lost()
    assert not bus.send(FRAMES[0])
    await bus.close()


async def test_python_can_without_a_server_fails_at_once() -> None:
    """By itself it would try again for ten seconds, at full speed and with a warning each time."""
    settings = BusSettings("socketcand", "fleet", extra=(("host", "127.0.0.1"), ("port", free_port())))
    began = asyncio.get_running_loop().time()
    with pytest.raises(BusOpenError, match="Connection refused; is the server running"):
        await open_bus(settings)
    assert asyncio.get_running_loop().time() - began < 5


async def test_can_logger_joins(served: Served, tmp_path: Path) -> None:
    """The stock tool, in a process of its own, writes what is on the bus."""
    hub = served.hubs["fleet"]
    node = hub.attach("node")
    log = tmp_path / "bus.log"
    arguments = [
        "-i",
        "socketcand",
        "-c",
        "fleet",
        "-f",
        str(log),
        "--bus-kwargs",
        "host=127.0.0.1",
        f"port={served.port}",
    ]
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "can.logger", *arguments, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    )
    async with asyncio.timeout(TOOL_DEADLINE_S):
        await until(lambda: served.server.counts["listening"] == 1)
        for frame in FRAMES:
            node.send(frame)
        # The logger flushes its file on its own terms: more traffic makes it.
        await until(lambda: node.send(Frame(0x7FF)) and log.exists() and log.read_bytes().count(b"\n") > 50)
        process.send_signal(signal.SIGINT)
        await process.communicate()
    with log.open("rb") as lines:
        heard = [record.frame for record in CandumpReader(lines)]
    assert heard[:50] == FRAMES


def free_port() -> int:
    """A port on which nobody listens."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
