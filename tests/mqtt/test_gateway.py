"""The gateway and a broker that comes and goes: what must not be lost is not, what may be lost is bounded."""

import asyncio
import json
from pathlib import Path
from typing import Any

import pytest

from bus_sim.virtual_time import VirtualTimeLoop
from onboard.gateway import gateway as module
from onboard.gateway import link, reports
from onboard.gateway.gateway import Gateway
from onboard.gateway.link import LAST_WAIT_S, Link, LinkWords
from onboard.gateway.reports import Reports
from onboard.ports.broker import Publication
from tests.mqtt.double import DoubleBroker
from tests.mqtt.logs import validator
from tests.mqtt.played import MemoryJournal, frames, play

REPORT = "onboard/small/report"
ENDS = ["2026-03-01-1.1-done", "2026-03-01-1.2-done"]


def ids(broker: DoubleBroker) -> list[str]:
    return [json.loads(one.payload)["id"] for one in broker.all if one.topic == REPORT]


def told(broker: DoubleBroker, topic: str) -> list[Any]:
    return [json.loads(one.payload) for one in broker.all if one.topic == topic]


def test_a_whole_run_reaches_the_broker_valid_and_in_order(small_log: Path) -> None:
    broker = DoubleBroker()
    gateway = play(small_log, broker)
    assert gateway.frames == len(frames(small_log)) and gateway.frames_dropped == 0
    for one in broker.all:
        interface, _, name = one.topic.rpartition("/")
        if interface.startswith("uagv/v2/"):
            assert not list(validator("2.1", name).iter_errors(json.loads(one.payload)))
    headers = [one["headerId"] for one in told(broker, "uagv/v2/onboard/MR1/state")]
    assert headers == sorted(headers) and len(headers) > 10
    assert ids(broker) == ENDS
    for topic in ("uagv/v2/onboard/MR1/connection", "uagv/v2/onboard/MR2/connection"):
        assert [one["connectionState"] for one in told(broker, topic)] == [
            "OFFLINE",
            "ONLINE",
            "CONNECTIONBROKEN",
            "OFFLINE",
        ]
    assert [one["state"] for one in told(broker, "onboard/small/status")] == ["online", "offline"]


@pytest.mark.parametrize("how", ["killed", "frozen"])
def test_reports_outlive_an_outage_and_the_oldest_telemetry_goes_first(
    small_log: Path, how: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(link, "MOST_WAITING", 30)
    broker = DoubleBroker(patience_s=2.0)
    down, up = (broker.kill, broker.start) if how == "killed" else (broker.freeze, broker.thaw)
    before: list[int] = []
    gateway = play(
        small_log,
        broker,
        acts=[(20, lambda _: down()), (170, lambda _: before.append(len(broker.all))), (170.5, lambda _: up())],
    )
    fleet = gateway.links[""].counts
    assert fleet.dropped > 0 and fleet.broken >= 5
    assert ids(broker) == ENDS
    later = [json.loads(one.payload) for one in broker.all[before[0] :] if one.topic.startswith("onboard/small/")]
    times = [one["at"] for one in later if "at" in one and "id" not in one]
    assert times == sorted(times) and len(times) >= 15
    assert times[0] > "2026-03-01T06:01:10"
    connected = [one["connectionState"] for one in told(broker, "uagv/v2/onboard/MR1/connection")]
    assert connected[-1] == "OFFLINE"


def test_what_waits_is_bounded_however_long_the_broker_is_away(
    small_log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(link, "MOST_WAITING", 30)
    broker = DoubleBroker()
    broker.kill()
    most: list[int] = []
    watch = [
        (float(at), lambda g: most.append(max(one.waiting for one in g.links.values()))) for at in range(1, 180, 5)
    ]
    gateway = play(small_log, broker, acts=watch)
    assert max(most) == 30 == gateway.links[""].waiting
    assert broker.all == []
    assert list(gateway.reports.pending) == ["1.1-done", "1.2-done"]  # type: ignore[union-attr]  # play gives reports
    attempts = gateway.links[""].counts.broken
    assert 5 < attempts <= (frames(small_log)[-1][0] / 1e6 + 40) / LAST_WAIT_S + 8


def test_after_a_restart_nothing_is_reported_twice_and_nothing_is_forgotten(small_log: Path) -> None:
    """The first life ends without a broker; the second hears the whole bus again; a third has nothing to add."""
    journal, broker = MemoryJournal(), DoubleBroker()
    broker.kill()
    play(small_log, broker, journal)
    broker.start()
    play(small_log, broker, journal)
    assert ids(broker) == ENDS
    play(small_log, broker, journal)
    assert ids(broker) == ENDS


def test_a_report_whose_acknowledgement_was_lost_comes_again_under_the_same_id(small_log: Path) -> None:
    broker = DoubleBroker()
    broker.dies_before_answer = {REPORT}
    play(small_log, broker)
    assert ids(broker) == [ENDS[0], *ENDS]
    assert list(dict.fromkeys(ids(broker))) == ENDS


def test_a_full_disk_costs_the_report_s_life_after_a_crash_and_nothing_else(small_log: Path) -> None:
    journal, broker = MemoryJournal(), DoubleBroker()
    journal.is_full = True
    gateway = play(small_log, broker, journal)
    assert ids(broker) == ENDS
    assert gateway.disk_errors == 2 and gateway.links[""].counts.disk_errors == 2


def test_a_machine_that_broke_off_is_told_of_by_its_last_will(small_log: Path) -> None:
    broker = DoubleBroker()
    play(small_log, broker, acts=[(100, lambda _: broker.cut("onboard-MR1"))])
    states = [one["connectionState"] for one in told(broker, "uagv/v2/onboard/MR1/connection")]
    assert states[:4] == ["OFFLINE", "ONLINE", "CONNECTIONBROKEN", "ONLINE"]
    assert (
        "CONNECTIONBROKEN" not in [one["connectionState"] for one in told(broker, "uagv/v2/onboard/MR2/connection")][:2]
    )


async def test_the_journal_of_reports_stays_small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reports, "SLACK_RECORDS", 20)
    monkeypatch.setattr(reports, "MOST_KNOWN", 10)
    monkeypatch.setattr(reports, "MOST_PENDING", 5)
    journal = MemoryJournal()
    kept = Reports(journal)
    for number in range(200):
        assert await kept.take(f"{number}", Publication("t", b"{}", 1))
        await kept.delivered(f"{number}")
    for number in range(200, 210):
        await kept.take(f"{number}", Publication("t", b"{}", 1))
    assert len(journal.kept) <= 20 + 10 + 5 + 2
    assert kept.given_up == 5 and list(kept.pending) == ["205", "206", "207", "208", "209"]
    again = Reports(journal)
    assert list(again.pending) == list(kept.pending) and again.is_known("199") and not again.is_known("1")


def test_a_gateway_that_is_flooded_drops_the_oldest_frames_and_counts_them(
    small_log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "MOST_FRAMES", 100)
    monkeypatch.setattr(link, "MOST_WAITING", 5)
    gateway: Gateway | None = None

    def flood(running: Gateway) -> None:
        nonlocal gateway
        gateway = running
        for time_us, frame in frames(small_log)[:500]:
            running.on_frame(frame, time_us)

    done = play(small_log, acts=[(0.0001, flood)])
    assert gateway is done and done.frames_dropped == 400


def test_what_the_broker_keeps_is_never_older_than_what_was_said_last() -> None:
    """An old word that waited for the broker does not come after the new one that begins a session."""
    broker = DoubleBroker()
    broker.kill()
    new, old = Publication("t", b"new", 1, retain=True), Publication("t", b"old", 1, retain=True)
    last = Publication("t/end", b"", 1)

    async def live() -> None:
        words = LinkWords(lambda: last, lambda: [new], lambda: last)
        one = Link(broker, "c", words)
        running = asyncio.ensure_future(one.run())
        one.post(old)
        one.post(Publication("other", b"x"))
        await asyncio.sleep(3)
        broker.start()
        await asyncio.sleep(10)
        one.stop()
        await running

    loop = VirtualTimeLoop()
    try:
        loop.run_until_complete(live())
    finally:
        loop.close()
    assert broker.retained["t"] == new
    assert [one.topic for one in broker.all] == ["t", "other", "t/end"]
