"""The gateway and the real mosquitto: killed, frozen, and behind a network that has gone dead."""

import asyncio
import contextlib
import json
from collections.abc import Callable
from pathlib import Path

import pytest

from bus_sim.sites import find_site
from onboard.core.frame import Frame
from onboard.gateway.gateway import Gateway
from onboard.gateway.reports import Reports
from onboard.gateway.settings import GatewaySettings
from onboard.io.broker_address import BrokerAddress
from onboard.io.journal import FileJournal
from onboard.io.mqtt import MqttBroker
from onboard.wire.codec import fleet_codec
from tests.mqtt.logs import EPOCH_US
from tests.mqtt.mosquitto import Mosquitto
from tests.mqtt.played import frames
from tests.tools import DEADLINE_S

REPORT = "onboard/small/report"


class Wire:
    """A network between gateway and broker: while it is ``dead`` every byte is swallowed and nobody is told."""

    def __init__(self, port: int) -> None:
        self.is_dead = False
        self._port = port
        self._pumps: set[asyncio.Task[None]] = set()
        self._server: asyncio.Server | None = None

    async def open(self) -> int:
        """The port to connect to."""
        self._server = await asyncio.start_server(self._accept, "127.0.0.1", 0)
        return int(self._server.sockets[0].getsockname()[1])

    async def close(self) -> None:
        assert self._server is not None
        self._server.close()
        for pump in list(self._pumps):
            pump.cancel()
        await asyncio.gather(*self._pumps, return_exceptions=True)

    async def _accept(self, near: asyncio.StreamReader, back: asyncio.StreamWriter) -> None:
        try:
            far, there = await asyncio.open_connection("127.0.0.1", self._port)
        except OSError:
            back.close()
            return
        for source, sink in ((near, there), (far, back)):
            pump = asyncio.ensure_future(self._pump(source, sink))
            self._pumps.add(pump)
            pump.add_done_callback(self._pumps.discard)

    async def _pump(self, source: asyncio.StreamReader, sink: asyncio.StreamWriter) -> None:
        try:
            with contextlib.suppress(OSError):
                while data := await source.read(4096):
                    if not self.is_dead:
                        sink.write(data)
                        await sink.drain()
        finally:
            sink.close()


async def until(condition: Callable[[], object]) -> None:
    """Wait for something that other tasks bring about."""
    async with asyncio.timeout(DEADLINE_S):
        while not condition():  # noqa: ASYNC110  # what is waited for is told by no event
            await asyncio.sleep(0.01)


async def reported(broker: MqttBroker, count: int) -> list[str]:
    """The reports that wait for a reader that was there before, by name."""
    found: list[str] = []
    async with asyncio.timeout(DEADLINE_S), broker.session("reader", None, (REPORT,)) as session:
        async for one in session.incoming():
            session.taken(one)
            found.append(json.loads(one.payload)["id"].split("-", 3)[3])
            if len(set(found)) == count:
                return found
    raise AssertionError("the session ended")


def feed(gateway: Gateway, part: tuple[tuple[int, Frame], ...]) -> None:
    base_us = round(asyncio.get_running_loop().time() * 1e6)
    for time_us, frame in part:
        gateway.on_frame(frame, base_us + time_us)


# paho leaves the socket of a connection that was refused half-way to the garbage collector, which warns.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("how", ["killed", "frozen", "half-open"])
async def test_reports_are_delivered_once_in_effect_whatever_happens_to_the_broker(
    small_log: Path, tmp_path: Path, how: str
) -> None:
    mosquitto = Mosquitto(tmp_path / "broker")
    await mosquitto.start()
    wire = Wire(mosquitto.port)
    near = MqttBroker(BrokerAddress("127.0.0.1", await wire.open()), keepalive_s=5, timeout_s=0.5)
    async with mosquitto.broker().session("reader", None, (REPORT,)):
        pass
    journal = FileJournal(tmp_path / "spool", "small gateway")
    reports = Reports(journal)
    settings = GatewaySettings(epoch_us=EPOCH_US)
    gateway = Gateway(find_site("small"), fleet_codec(), near, settings, reports=reports)
    running = asyncio.ensure_future(gateway.run())
    every = frames(small_log)
    half = len(every) // 2
    await until(lambda: gateway.links[""].is_connected)
    feed(gateway, every[:half])
    await until(lambda: reports.is_known("1.1-done") and not reports.pending)
    assert await reported(mosquitto.broker(), 1) == ["1.1-done"]
    if how == "killed":
        await mosquitto.kill()
    elif how == "frozen":
        mosquitto.freeze()
    else:
        wire.is_dead = True
    feed(gateway, every[half:])
    # The broker's silence is noticed, and the second report waits on the disk.
    await until(lambda: gateway.links[""].counts.broken and reports.pending)
    assert list(reports.pending) == ["1.2-done"]
    # What waits is noted by a thread of its own.
    await until(lambda: b'"1.2-done"' in (tmp_path / "spool" / "journal.log").read_bytes())
    if how == "killed":
        # A broker that is killed forgets who reads: the reader comes back before the gateway can.
        wire.is_dead = True
        await mosquitto.start()
        async with mosquitto.broker().session("reader", None, (REPORT,)):
            wire.is_dead = False
    elif how == "frozen":
        mosquitto.thaw()
    else:
        wire.is_dead = False
    await until(lambda: not reports.pending)
    gateway.stop()
    await running
    await journal.close()
    assert set(await reported(mosquitto.broker(), 1)) == {"1.2-done"}
    await wire.close()
    await mosquitto.stop()
