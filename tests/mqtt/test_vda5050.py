"""What is published of each mobile machine: valid in both versions, and true."""

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from bus_sim.sites import find_site
from onboard.contract.codes import KindCode, MachineState, OperatorAction, Reason
from onboard.contract.messages import (
    Blocked,
    EmergencyStop,
    Halted,
    Heartbeat,
    OperatorOrder,
    Progress,
    Reference,
    Waiting,
)
from onboard.gateway.publisher import FLEET, Outgoing, Publisher
from onboard.gateway.settings import GatewayError, GatewaySettings
from tests.mqtt.logs import EPOCH_US, VERSIONS, content, published, record, validator

RUNS = {
    "graph": ("graph",),
    "terminal": ("terminal",),
}


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory, small_log: Path) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("logs")
    return {"small": small_log} | {name: record(folder / f"{name}.log", *words) for name, words in RUNS.items()}


def vda(found: list[tuple[int, Outgoing]]) -> Iterator[tuple[str, int, str, Any]]:
    """Link, time, message and content of everything that is VDA 5050."""
    for time_us, one in found:
        if one.link != FLEET:
            yield one.link, time_us, one.publication.topic.rsplit("/", 1)[1], content(one)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("name", ["small", *RUNS])
def test_every_message_of_a_run_is_valid_in_the_version_chosen(logs: dict[str, Path], name: str, version: str) -> None:
    seen = set()
    for link, time_us, message, told in vda(published(name, logs[name], version=version)):
        seen.add((link, message))
        wrong = [f"{error.json_path}: {error.message}" for error in validator(version, message).iter_errors(told)]
        assert not wrong, f"{link} {message} at {time_us / 1e6:.3f} s: {wrong}"
    site = find_site(name)
    mobile = {one.name for one in site.machines.values() if one.kind in (KindCode.ROBOT, KindCode.VEHICLE)}
    needed = {"connection", "state", "factsheet"} | ({"visualization"} if name == "small" else set())
    assert {(link, message) for link in mobile for message in needed} <= seen


def test_a_state_valid_in_one_version_is_not_in_the_other(logs: dict[str, Path]) -> None:
    told = next(told for _, _, message, told in vda(published("small", logs["small"])) if message == "state")
    assert not validator("2.1", "state").is_valid({}) and validator("2.1", "state").is_valid(told)
    assert not validator("3.0", "state").is_valid(told)


@pytest.mark.parametrize("version", VERSIONS)
def test_a_state_comes_at_least_every_thirty_seconds_and_not_more_often_than_told(
    logs: dict[str, Path], version: str
) -> None:
    times: dict[str, list[int]] = {}
    for link, time_us, message, _ in vda(published("small", logs["small"], version=version)):
        if message == "state":
            times.setdefault(link, []).append(time_us)
    assert set(times) == {"MR1", "MR2"}
    for link, told_us in times.items():
        gaps = [later - earlier for earlier, later in pairwise(told_us)]
        assert max(gaps) <= 30_000_000, link
        assert min(gaps) >= 200_000, link


def test_a_robot_is_followed_from_its_award_to_the_car_s_place(logs: dict[str, Path]) -> None:
    """The nodes ahead come one by one, and the load is there between taking and setting down."""
    states = [told for link, _, message, told in vda(published("small", logs["small"])) if message == "state"]
    tasks = sorted({told["orderId"] for told in states} - {""})
    assert len(tasks) == 2
    for task in tasks:
        of_task = [told for told in states if told["orderId"] == task]
        sequences = [told["lastNodeSequenceId"] for told in of_task]
        assert sequences == sorted(sequences) and all(number % 2 == 0 for number in sequences)
        assert [told["orderUpdateId"] for told in of_task] == sorted(told["orderUpdateId"] for told in of_task)
        ways = [["WAITING", "WAITING"], ["FINISHED", "WAITING"], ["FINISHED", "FINISHED"]]
        phases = [[action["actionStatus"] for action in told["actionStates"]] for told in of_task]
        assert phases[-1] == ways[2] and [one for one in ways if one in phases] == sorted(
            (one for one in ways if one in phases), key=phases.index
        )
        for told in of_task:
            steps = [told["lastNodeSequenceId"]]
            for edge, node in zip(told["edgeStates"], told["nodeStates"], strict=True):
                steps += [edge["sequenceId"], node["sequenceId"]]
            assert steps == list(range(steps[0], steps[0] + len(steps)))
        between = [told for told in of_task if [one["actionStatus"] for one in told["actionStates"]] == ways[1]]
        assert any(told["loads"] == [{"loadId": tasks[0], "loadType": "car"}] for told in between)
        assert of_task[0]["loads"] == of_task[-1]["loads"] == []
        assert any(told["driving"] for told in of_task) and not of_task[-1]["driving"]


def test_header_numbers_count_by_topic_and_names_are_the_machine_s(logs: dict[str, Path]) -> None:
    headers: dict[str, list[int]] = {}
    for _, one in published("small", logs["small"], manufacturer="we", version="3.0"):
        if one.link != FLEET:
            told = content(one)
            assert (told["manufacturer"], told["serialNumber"], told["version"]) == ("we", one.link, "3.0.0")
            assert one.publication.topic.startswith(f"vda5050/v3/we/{one.link}/")
            headers.setdefault(one.publication.topic, []).append(told["headerId"])
    assert all(numbers == list(range(len(numbers))) for numbers in headers.values())


# --- a machine by hand ------------------------------------------------------------------------------------------------


class Told:
    """A publisher of the small site, fed by hand."""

    def __init__(self, **settings: Any) -> None:
        self.site = find_site("small")
        self.publisher = Publisher(self.site, GatewaySettings(epoch_us=EPOCH_US, **settings))
        self.said: list[Outgoing] = []

    def hear(self, message: Any, now_us: int) -> None:
        self.said += self.publisher.feed(message, now_us)

    def wait(self, until_us: int) -> None:
        while (due_us := self.publisher.next_wake()) <= until_us:
            self.said += self.publisher.wake(due_us)

    def last(self, link: str, name: str) -> Any:
        found = [one for one in self.said if one.link == link and one.publication.topic.endswith("/" + name)]
        return content(found[-1]) if found else None


def beat(node: int, state: MachineState = MachineState.IDLE) -> Heartbeat:
    return Heartbeat(node, 1, find_site("small").digest, 0, 1, KindCode.ROBOT, state)


def test_connection_follows_the_machine_s_own_signs_of_life() -> None:
    """Retained, QoS 1; broken where the gateway's session breaks, and where the machine falls silent on the bus."""
    told = Told()
    first = told.publisher.hello("MR1", 0)[0]
    assert (first.qos, first.retain) == (1, True) and b'"OFFLINE"' in first.payload
    will = told.publisher.will("MR1", 0)
    assert (will.topic, will.qos, will.retain) == ("uagv/v2/onboard/MR1/connection", 1, True)
    assert b'"CONNECTIONBROKEN"' in will.payload
    told.hear(beat(11), 1_000_000)
    assert told.last("MR1", "connection")["connectionState"] == "ONLINE"
    told.wait(1_000_000 + 4 * told.site.timing.heartbeat_us)
    assert told.last("MR1", "connection")["connectionState"] == "CONNECTIONBROKEN"
    assert [error["errorType"] for error in told.last("MR1", "state")["errors"]] == ["machineSilent"]
    told.hear(beat(11), 60_000_000)
    assert told.last("MR1", "connection")["connectionState"] == "ONLINE"
    assert b'"OFFLINE"' in told.publisher.goodbye("MR1", 0).payload


def test_waits_blocked_segments_and_an_emergency_stop_are_told_with_their_reasons() -> None:
    told = Told(version="3.0")
    told.hear(beat(11), 0)
    told.hear(Waiting(11, 1, 3, 12, Reason.TOKEN_HELD_BY_OTHER), 1_000_000)
    told.wait(2_000_000)
    information = told.last("MR1", "state")["information"]
    assert information[0]["infoType"] == "waiting"
    assert {one["referenceKey"]: one["referenceValue"] for one in information[0]["infoReferences"]} == {
        "nodeId": "p(1,3)",
        "reason": "TOKEN_HELD_BY_OTHER",
        "serialNumber": "MR2",
    }
    event = told.last(FLEET, "event")
    assert (event["event"], event["by"], event["blocker"], event["reason"], event["code"]) == (
        *("Waiting", "MR1", "MR2", "TOKEN_HELD_BY_OTHER", 5),
    )
    told.hear(Blocked(5, 1, 7, Reason.OPERATOR), 3_000_000)
    told.hear(EmergencyStop(5, Reason.OPERATOR), 3_000_100)
    told.wait(4_000_000)
    state = told.last("MR1", "state")
    assert state["errors"][0]["errorReferences"] == [{"referenceKey": "nodeId", "referenceValue": "p(1,7)"}]
    assert state["safetyState"]["activeEmergencyStop"] == "MANUAL"
    told.hear(beat(11, MachineState.WORKING), 5_000_000)
    told.wait(6_000_000)
    assert told.last("MR1", "state")["safetyState"]["activeEmergencyStop"] == "NONE"


def test_a_robot_on_its_way_is_seen_about_once_a_second() -> None:
    told = Told()
    for number in range(40):
        told.hear(Progress(11, 0, 0, 1, 3, 10 * number, 400), 100_000 * number)
    seen = [content(one) for one in told.said if one.publication.topic.endswith("visualization")]
    assert len(seen) == 4
    assert seen[0]["agvPosition"] | {"x": 0} == {
        "x": 0,
        "y": 0.0,
        "theta": 0.0,
        "mapId": "floor-1",
        "positionInitialized": True,
    }
    assert [one["agvPosition"]["x"] for one in seen] == [4.8, 4.9, 5.0, 5.1]
    assert seen[0]["velocity"]["vx"] == 0.4


def test_of_one_machine_alone_nothing_is_told_of_others() -> None:
    told = Told(serials=frozenset({"MR2"}))
    assert told.publisher.links == ("MR2",)
    told.hear(beat(11), 0)
    told.hear(beat(12), 0)
    told.hear(OperatorOrder(251, 1, OperatorAction.PRESS_KEY, Reference(0, 0)), 0)
    told.wait(70_000_000)
    assert {one.link for one in told.said} == {"MR2"}


@pytest.mark.parametrize("settings", [{"version": "2.0"}, {"manufacturer": "a/b"}, {"prefix": "+"}, {"prefix": ""}])
def test_what_cannot_be_a_topic_is_refused_in_one_line(settings: dict[str, str]) -> None:
    with pytest.raises(GatewayError, match=r"^--") as caught:
        GatewaySettings(**settings)  # type: ignore[arg-type]  # options by name
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("version", VERSIONS)
def test_a_machine_that_needs_a_person_is_told_as_such_with_what_to_do(version: str) -> None:
    """``Halted`` in VDA 5050's words: FATAL where a person is needed, with a hint; gone once it works again."""
    told = Told(version=version)
    told.hear(beat(11, MachineState.WORKING), 1_000_000)
    told.hear(Halted(1, 11, Reason.FALSE_STATEMENT, 0, True, 1), 1_200_000)
    told.wait(3_000_000)
    state = told.last("MR1", "state")
    assert not list(validator(version, "state").iter_errors(state))
    (error,) = state["errors"]
    assert (error["errorType"], error["errorLevel"]) == ("machineHalted", "FATAL")
    assert "MR1 stands: false statement; it needs a person" in error["errorDescription"]
    assert "tow it" in error["errorHint"]
    told.hear(Halted(11, 11, Reason.JOURNAL_SHORT, 0, True, 1), 3_100_000)
    told.wait(4_000_000)
    assert "onboard operate regenerate MR1" in told.last("MR1", "state")["errors"][0]["errorHint"]
    told.hear(beat(11), 4_200_000)
    told.wait(6_000_000)
    assert told.last("MR1", "state")["errors"] == []


def test_a_word_about_a_machine_that_acts_and_does_not_stand_is_no_error() -> None:
    told = Told()
    told.hear(beat(11), 1_000_000)
    told.hear(Halted(12, 11, Reason.NODE_SILENT, 0, False, 1), 1_200_000)
    told.wait(3_000_000)
    assert told.last("MR1", "state")["errors"] == [], "others speak for silent machines only"
