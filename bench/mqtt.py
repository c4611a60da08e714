"""What publishing costs: the large site's fleet bus in real time, through a gateway, to a mosquitto of its own.

    python bench/mqtt.py [--seconds N] [--day LOG --site NAME]

The bus is recorded first (cars every 15 s) and then fed to a gateway frame by frame at its own pace; ``mosquitto_sub``
notes when each publication reaches it. Beside the rates this measures: the delay from a frame's reception to the
broker's reader (by the time stamps of `visualization`, in whole milliseconds), how late frames come with and without a
gateway on the same loop, and how long it takes to catch up after the broker was killed and started again.
``--day`` instead checks every message that a recorded day makes against the schemas, in both versions.
"""

import argparse
import asyncio
import contextlib
import json
import signal
import statistics
import sys
import tempfile
import time
from asyncio.subprocess import DEVNULL, PIPE
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from bus_sim.cli import main as bus_sim
from bus_sim.sites import find_site
from onboard.core.frame import Frame
from onboard.gateway.gateway import Gateway
from onboard.gateway.reports import Reports
from onboard.gateway.settings import GatewaySettings
from onboard.io.broker_address import BrokerAddress
from onboard.io.journal import FileJournal
from onboard.io.mqtt import MqttBroker
from onboard.systems.contract import codecs_for
from tests.mqtt.logs import VERSIONS, content, published, validator
from tests.mqtt.mosquitto import Mosquitto
from tests.mqtt.played import frames

SITE = "large"
#: The machines find each other first; what is measured begins here, s of the record.
LEAD_S = 60.0
#: The broker is dead for so long, s, after this share of the record.
DEAD_S, DEAD_AT = 20.0, 0.6


class Lateness(NamedTuple):
    """How late frames came to a loop, ms, and the share of one processor that it all took."""

    median: float
    p99: float
    most: float
    cpu: float


def percentile(values: list[float], share: float) -> float:
    return sorted(values)[min(len(values) - 1, int(share * len(values)))]


async def fed(part: list[tuple[int, Frame]], gateway: Gateway | None) -> Lateness:
    """Feed frames at their times; to nobody where there is no gateway."""
    loop = asyncio.get_running_loop()
    late: list[float] = []
    base_s = loop.time() + 0.1
    begun_s, cpu_s = time.monotonic(), time.process_time()
    for time_us, frame in part:
        due_s = base_s + (time_us - part[0][0]) / 1e6
        if due_s - loop.time() > 0.0005:
            await asyncio.sleep(due_s - loop.time())
        now_s = loop.time()
        late.append((now_s - due_s) * 1000)
        if gateway is not None:
            gateway.on_frame(frame, round(now_s * 1e6))
    share = (time.process_time() - cpu_s) / (time.monotonic() - begun_s)
    return Lateness(statistics.median(late), percentile(late, 0.99), max(late), share)


async def measure(part: list[tuple[int, Frame]], folder: Path) -> None:
    site = find_site(SITE)
    codec = codecs_for(site).fleet
    mosquitto = Mosquitto(folder / "broker")
    await mosquitto.start()
    reader = await asyncio.create_subprocess_exec(
        *("mosquitto_sub", "-h", "127.0.0.1", "-p", str(mosquitto.port), "-t", "#", "-F", "%U %t %p"),
        stdout=PIPE,
        stderr=DEVNULL,
    )
    assert reader.stdout is not None
    lines: list[bytes] = []

    async def read(stream: asyncio.StreamReader) -> None:
        while line := await stream.readline():
            lines.append(line)

    alone = await fed(part[: len(part) // 4], None)
    reading = asyncio.ensure_future(read(reader.stdout))
    journal = FileJournal(folder / "spool", f"{site.name} gateway")
    broker = MqttBroker(BrokerAddress("127.0.0.1", mosquitto.port))
    gateway = Gateway(
        site, codec, broker, GatewaySettings(), reports=Reports(journal), wall_us=lambda: time.time_ns() // 1000
    )
    running = asyncio.ensure_future(gateway.run())
    await until(lambda: all(link.is_connected for link in gateway.links.values()))
    await asyncio.sleep(1)
    hello = len(lines)
    cut = int(len(part) * DEAD_AT)
    beside = await fed(part[:cut], gateway)
    await asyncio.sleep(1)
    calm = list(lines[hello:])
    seconds = (part[cut - 1][0] - part[0][0]) / 1e6
    shape = f"{len(site.machines)} machines, {len(gateway.links)} sessions, {seconds:.0f} s of its bus in real time"
    print(f"site {SITE}: {shape}")
    print(f"frames                        {cut / seconds:8.1f} /s")
    print(f"publications                  {len(calm) / seconds:8.1f} /s")
    kinds = Counter(line.split(b" ", 2)[1].rsplit(b"/", 1)[1].decode() for line in calm)
    print("  of them                     " + ", ".join(f"{name} {count}" for name, count in kinds.most_common(6)))
    print(f"bytes                         {sum(map(len, calm)) / seconds / 1000:8.1f} kB/s")
    print(f"CPU, gateway and its feeding  {beside.cpu:8.1%} of one processor (feeding alone {alone.cpu:.1%})")
    delays = list(delays_ms(calm))
    middle, slow = statistics.median(delays), percentile(delays, 0.99)
    print(f"bus frame to broker's reader  {middle:8.1f} ms median, {slow:.1f} ms 99 %")
    for name, one in (("without", alone), ("with", beside)):
        delay = f"{one.median:.2f} ms median, {one.p99:.2f} ms 99 %, {one.most:.2f} ms most"
        print(f"frames late, {name:<8} gateway  {delay}")
    await outage(part[cut:], gateway, mosquitto)
    gateway.stop()
    await running
    await journal.close()
    reader.send_signal(signal.SIGTERM)
    await reader.wait()
    await reading
    await mosquitto.stop()


async def outage(part: list[tuple[int, Frame]], gateway: Gateway, mosquitto: Mosquitto) -> None:
    """The broker is killed and started again while the bus goes on."""
    links = gateway.links.values()
    await mosquitto.kill()
    feeding = asyncio.ensure_future(fed(part, gateway))
    await asyncio.sleep(DEAD_S)
    waiting = sum(link.waiting for link in links)
    await mosquitto.start()
    begun_s = time.monotonic()
    await until(lambda: all(link.is_connected for link in links))
    back_s = time.monotonic() - begun_s
    await until(lambda: not any(link.waiting for link in links))
    caught_s = time.monotonic() - begun_s
    late = await feeding
    dropped = sum(link.counts.dropped for link in links)
    print(f"broker dead for {DEAD_S:.0f} s          {waiting} publications wait, {dropped} dropped")
    print(f"  all sessions there again    {back_s:8.2f} s after its start; caught up {caught_s - back_s:.3f} s later")
    print(f"frames late, broker dead      {late.median:.2f} ms median, {late.p99:.2f} ms 99 %, {late.most:.2f} ms most")


async def until(condition: Callable[[], bool]) -> None:
    while not condition():  # noqa: ASYNC110  # what is waited for is told by no event
        await asyncio.sleep(0.005)


def delays_ms(lines: list[bytes]) -> list[float]:
    """From a frame's reception, by the time stamp in a message, to its arrival at the reader."""
    found = []
    for line in lines:
        arrived, topic, payload = line.split(b" ", 2)
        if topic.endswith(b"/visualization"):
            stamp = json.loads(payload)["timestamp"]
            seconds = time.mktime(time.strptime(stamp[:19], "%Y-%m-%dT%H:%M:%S")) - time.timezone
            found.append((float(arrived) - seconds) * 1000 - int(stamp[20:23]))
    return found


def check_day(log: Path, site: str) -> int:
    """Every message of a recorded day, in both versions; the number that are not valid."""
    wrong = 0
    for version in VERSIONS:
        count: Counter[str] = Counter()
        begun_s = time.process_time()
        everything = published(site, log, version=version)
        took_s = time.process_time() - begun_s
        for _, one in everything:
            if one.link:
                name = one.publication.topic.rsplit("/", 1)[1]
                count[name] += 1
                wrong += not validator(version, name).is_valid(content(one))
        each = ", ".join(f"{name} {number}" for name, number in sorted(count.items()))
        print(f"VDA 5050 {version}: {sum(count.values())} messages ({each}), {wrong} not valid; made in {took_s:.1f} s")
    return wrong


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--seconds", type=float, default=100.0, help="how much of the bus (default: %(default)s)")
    parser.add_argument("--day", type=Path, metavar="LOG", help="check a recorded day instead")
    parser.add_argument("--site", default="level1", help="the site of --day (default: %(default)s)")
    args = parser.parse_args()
    if args.day is not None:
        return 1 if check_day(args.day, args.site) else 0
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "large.log"
        with contextlib.redirect_stdout(sys.stderr):
            words = ["--random", "15", "3", "--cars", "60", "--for", str(LEAD_S + args.seconds)]
            bus_sim(["run", SITE, *words, "--trace", str(log)])
        part = [one for one in frames(log) if one[0] >= LEAD_S * 1e6]
        asyncio.run(measure(part, Path(folder)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
