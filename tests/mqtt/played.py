"""A gateway in virtual time: the frames of a log at their times, a double for the broker, and what happens to it."""

import asyncio
from collections.abc import Callable, Iterable, Sequence
from copy import copy
from functools import cache
from pathlib import Path

from bus_sim.sites import find_site
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.core.frame import Frame
from onboard.core.journal_state import INTACT
from onboard.gateway.gateway import Gateway
from onboard.gateway.reports import Reports
from onboard.gateway.settings import GatewaySettings
from onboard.ports.journal import Compaction, Entry
from onboard.systems.contract import codecs_for
from onboard.trace.candump_reader import CandumpReader
from tests.mqtt.double import DoubleBroker
from tests.mqtt.logs import EPOCH_US

#: What happens to broker or gateway, and when, s of the log.
Act = tuple[float, Callable[[Gateway], object]]


class MemoryJournal:
    """``ports.Journal`` that a restart finds again; ``is_full`` makes writes fail."""

    def __init__(self) -> None:
        self.kept: list[Entry] = []
        self.condition = INTACT
        self.has_grown = False
        self.is_full = False

    def replay(self) -> list[Entry]:
        return [copy(entry) for entry in self.kept]

    async def append(self, entry: Entry) -> None:
        if self.is_full:
            raise OSError(28, "No space left on device")
        self.kept.append(entry)

    async def compact(self, fewer: Compaction) -> None:
        self.kept = fewer(self.kept)

    async def renew(self, entries: Iterable[Entry]) -> None:
        self.kept = list(entries)

    async def close(self) -> None:
        pass


@cache
def frames(log: Path) -> tuple[tuple[int, Frame], ...]:
    """Frames with their times, us from the first."""
    records = list(CandumpReader(log.read_bytes().splitlines(keepends=True)))
    return tuple((one.time_us - records[0].time_us, one.frame) for one in records)


def play(
    log: Path,
    broker: DoubleBroker | None = None,
    journal: MemoryJournal | None = None,
    acts: Sequence[Act] = (),
    *,
    tail_s: float = 40.0,
    site_name: str = "small",
) -> Gateway:
    """Let a gateway listen to a log, and end it in order."""
    loop = VirtualTimeLoop()
    try:
        return loop.run_until_complete(_play(log, broker, journal, acts, tail_s, site_name))
    finally:
        loop.close()


async def _play(
    log: Path,
    broker: DoubleBroker | None,
    journal: MemoryJournal | None,
    acts: Sequence[Act],
    tail_s: float,
    site_name: str,
) -> Gateway:
    loop = asyncio.get_running_loop()
    site = find_site(site_name)
    codec = codecs_for(site).fleet
    reports = Reports(journal if journal is not None else MemoryJournal())
    gateway = Gateway(site, codec, broker or DoubleBroker(), GatewaySettings(epoch_us=EPOCH_US), reports=reports)
    for time_us, frame in frames(log):
        loop.call_at(time_us / 1e6, gateway.on_frame, frame, time_us)
    for time_s, act in acts:
        loop.call_at(time_s, act, gateway)
    running = asyncio.ensure_future(gateway.run())
    await asyncio.sleep(frames(log)[-1][0] / 1e6 + tail_s)
    gateway.stop()
    await running
    return gateway
