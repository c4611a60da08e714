"""The fleet's own topics: every call with its bids, every task to its end, and nothing that grows for ever."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from bus_sim.sites import find_site
from onboard.contract.codes import CallResult, Criterion, KindCode, Operation, Reason
from onboard.contract.messages import Award, Bid, CallForProposals, Reference
from onboard.gateway.publisher import FLEET, Outgoing, Publisher
from onboard.gateway.settings import GatewaySettings
from onboard.history.history import CALL_LIMIT, TASK_LIMIT
from tests.mqtt.logs import EPOCH_US, content, published


@pytest.fixture(scope="module")
def told(small_log: Path) -> list[tuple[int, Outgoing]]:
    return [(time_us, one) for time_us, one in published("small", small_log, prefix="house") if one.link == FLEET]


def of(told: list[tuple[int, Outgoing]], name: str) -> list[Any]:
    return [content(one) for _, one in told if one.publication.topic == f"house/small/{name}"]


def test_a_call_is_told_when_it_opens_and_with_its_bids_when_it_closes(told: list[tuple[int, Outgoing]]) -> None:
    calls = [one for one in of(told, "call") if one["what"] == "park"]
    assert [one["result"] for one in calls] == [None, "awarded"]
    opened, closed = calls
    assert opened["id"] == closed["id"] and opened["bids"] == [] and opened["at"] <= closed["deadline"] <= closed["at"]
    assert closed["winner"] in [bid["by"] for bid in closed["bids"]]
    assert all(set(bid) == {"by", "at", "cost"} and bid["cost"]["end"] > bid["at"] for bid in closed["bids"])
    assert (closed["from"], closed["reason"], closed["code"]) == ("IOC1", "NONE", 0)


def test_a_task_s_life_is_told_step_by_step(told: list[tuple[int, Outgoing]]) -> None:
    for number, what in ((1, "park"), (2, "retrieve")):
        life = [one for one in of(told, "task") if one["task"] == f"1.{number}"]
        phases = [one["phase"] for one in life]
        assert list(dict.fromkeys(phases)) == ["called", "awarded", "moving", "done"]
        assert {one["what"] for one in life} == {what}
        assert life[-1]["owner"] in ("MR1", "MR2") and life[-1]["promised"] > life[0]["at"]
    assert of(told, "task")[0]["from"] == "IOC1"


def test_the_end_of_a_task_is_a_report_with_a_name_that_stays_the_same(told: list[tuple[int, Outgoing]]) -> None:
    reports = [one for _, one in told if one.publication.topic == "house/small/report"]
    assert {one.publication.qos for one in reports} == {1}
    assert [content(one)["id"] for one in reports] == ["2026-03-01-1.1-done", "2026-03-01-1.2-done"]
    assert [one.report for one in reports] == ["1.1-done", "1.2-done"]
    assert [one.report for _, one in told if one.publication.topic != "house/small/report" and one.report] == []


def test_elevators_and_compartments_are_told_on_change_only(told: list[tuple[int, Outgoing]]) -> None:
    lift, bay = of(told, "machine/ER1"), of(told, "machine/IOC1")
    assert {one["kind"] for one in lift} == {"lift"} and {one["kind"] for one in bay} == {"compartment"}
    assert len({one["floor"] for one in lift if "floor" in one}) > 1
    assert "working" in [one["state"] for one in bay]
    for shown in (lift, bay):
        assert all(one != other for one, other in pairwise(shown))


def test_indicators_are_kept_by_the_broker_and_count_what_was_done(told: list[tuple[int, Outgoing]]) -> None:
    found = [one.publication for _, one in told if one.publication.topic.endswith("/indicators")]
    assert all(one.retain for one in found) and len(found) >= 2
    last = of(told, "indicators")[-1]
    assert last["calls"] >= 2 and last["parked"]["count"] == 1
    assert {one["machine"] for one in last["machines"]} == {"MR1", "MR2", "ER1", "ER2"}


def test_what_is_over_is_forgotten_and_a_call_number_may_come_again() -> None:
    publisher = Publisher(find_site("small"), GatewaySettings(epoch_us=EPOCH_US))
    said: list[Outgoing] = []
    for number in range(3_000):
        wire = number % 1_000 + 1
        task = Reference(1, wire)
        call = CallForProposals(
            *(1, wire, task, Operation.PARK, KindCode.ROBOT, Criterion.FINISH_TIME, 1, 0, 3_000, 1, 2, task, 2_700)
        )
        now_us = 1_000 * number
        said = publisher.feed(call, now_us)
        publisher.feed(Bid(11, 1, wire, 5_000, 1), now_us)
        said += publisher.feed(Award(1, wire, 11, task, 1, CallResult.REFUSED, Reason.NO_BID), now_us + 1)
        assert [content(one)["result"] for one in said if one.publication.topic.endswith("/call")] == [None, "refused"]
    view = publisher.fleet.picture.view
    assert len(view.calls) <= CALL_LIMIT and len(view.tasks) <= TASK_LIMIT
