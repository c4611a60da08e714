"""VDA 5050 orders to a robot by name on a factory graph (row G11), and instant actions."""

import json
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import pytest

from bus_sim.run import BusRun
from bus_sim.systems.graph.plant import make_plant
from bus_sim.systems.registry import SystemOptions
from bus_sim.systems.session import Played, play
from onboard.core.codes import TaskPhase
from onboard.core.messages import TaskReport
from onboard.kinds.graph.messages import RobotAt, VisitList
from tests.graph.sites import hall, made
from tests.mqtt.logs import VERSIONS, validator
from tests.mqtt.ordered import NODE, FatalJournal, Ordered, park_and_order
from tests.sites import one_floor

#: The run lasts until the desk's own order at 150 s is done; the gateway ends before.
SITE = made(hall(), (0, 8), [(150, "R2", (7,))])
END_S = 140.0


def order(
    name: str, *nodes: tuple[int, str], serial: str = "R1", version: str = "2.1.0", **changes: Any
) -> dict[str, Any]:
    """An order over nodes with an action each, or none where that is empty."""
    actions = [
        [{"actionType": action, "actionId": f"{name}-{place}", "blockingType": "HARD"}] if action else []
        for place, (_, action) in enumerate(nodes)
    ]
    told = [
        {"nodeId": str(node), "sequenceId": 2 * place, "released": True, "actions": actions[place]}
        for place, (node, _) in enumerate(nodes)
    ]
    edges = [
        {"edgeId": f"e{place}", "sequenceId": 2 * place + 1, "released": True, "actions": []}
        | ({"startNodeId": str(one[0]), "endNodeId": str(other[0])} if version == "2.1.0" else {})
        for place, (one, other) in enumerate(pairwise(nodes))
    ]
    return header(serial, version) | {"orderId": name, "orderUpdateId": 0, "nodes": told, "edges": edges} | changes


def header(serial: str = "R1", version: str = "2.1.0") -> dict[str, Any]:
    return {
        "headerId": 1,
        "timestamp": "2026-03-01T06:00:00.00Z",
        "version": version,
        "manufacturer": "onboard",
        "serialNumber": serial,
    }


def action(kind: str, name: str, version: str = "2.1.0") -> dict[str, Any]:
    return header(version=version) | {"actions": [{"actionType": kind, "actionId": name, "blockingType": "NONE"}]}


def topic(name: str = "order", serial: str = "R1", version: str = "2.1") -> str:
    return f"{'uagv/v2' if version == '2.1' else 'vda5050/v3'}/onboard/{serial}/{name}"


def run(orders: Sequence[tuple[float, str, Any]], **options: Any) -> tuple[Played, Ordered]:
    ordered = Ordered(orders, **options)

    def prepare(simulated: BusRun) -> None:
        ordered.attach(simulated)
        simulated.loop.call_at(END_S, ordered.stop)

    return play(SITE, SystemOptions(quiet=True, limit_s=300), make_plant, prepare=prepare), ordered


def ends(played: Played) -> list[tuple[int, TaskPhase]]:
    """Ends of the gateway's tasks as robots told them, each once."""
    reports = [one for _, one in played.messages if isinstance(one, TaskReport) and one.task.origin == NODE]
    over = [(one.sender, one.phase) for one in reports if one.phase in (TaskPhase.DONE, TaskPhase.REFUSED)]
    return list(dict.fromkeys(over))


@pytest.mark.parametrize("version", VERSIONS)
def test_an_order_to_a_robot_is_driven_and_its_state_names_it(version: str) -> None:
    """Over node 1 without a stop, with one at 2, to 5; sent twice."""
    told = order("night/7", (0, ""), (1, ""), (2, "pick"), (5, "drop"), version=VERSIONS[version])
    name = topic(version=version)
    played, ordered = run([(20, name, told), (22, name, told | {"headerId": 9})], version=version)
    assert played.is_good
    assert ends(played) == [(21, TaskPhase.DONE)]
    lists = {one for _, one in played.messages if isinstance(one, VisitList) and one.sender == NODE}
    assert {(one.robot, one.stop1, one.stop2, one.stop3) for one in lists} == {(21, 2, 5, 255)}
    assert ordered.lives("made", "R1/night/7") == ["accepted", "awarded", "done"]
    states = [one for one in ordered.states("R1") if one["orderId"] == "night/7"]
    assert states[-1]["lastNodeId"] == "5" and not states[-1]["driving"]
    assert all(validator(version, "state").is_valid(one) for one in ordered.states("R1"))
    last = max(at for at, one in played.messages if isinstance(one, RobotAt) and one.sender == 21)
    assert last < 150_000_000


@pytest.mark.parametrize("deaths_s", [(20.001,), (20.5, 30.0)])
def test_an_order_is_driven_once_though_the_gateway_dies(deaths_s: tuple[float, ...]) -> None:
    told = order("a", (0, ""), (4, "pick"), (3, "drop"))
    played, ordered = run([(20, topic(), told), (24, topic(), told)], deaths_s=deaths_s)
    assert played.is_good and ends(played) == [(21, TaskPhase.DONE)]
    assert len({one.order for _, one in played.messages if isinstance(one, VisitList) and one.sender == NODE}) == 1
    phases = [one["phase"] for one in ordered.told("made", "R1/a")]
    assert phases.count("done") == 1 and "refused" not in phases


@pytest.mark.parametrize("written", [False, True])
def test_an_order_that_the_broker_has_handed_over_is_not_lost_where_the_gateway_dies(written: bool) -> None:
    """Given once; the power fails between its delivery and `accepted`."""
    journal = FatalJournal(written=written)
    played, ordered = run([(20, topic(), order("a", (0, ""), (4, "pick"), (3, "drop")))], journal=journal)
    assert journal.is_over and played.is_good and ends(played) == [(21, TaskPhase.DONE)]
    phases = [one["phase"] for one in ordered.told("made", "R1/a")]
    assert phases.count("done") == 1 and "refused" not in phases
    assert len({one.order for _, one in played.messages if isinstance(one, VisitList) and one.sender == NODE}) == 1


REFUSED: list[tuple[dict[str, Any], str, str]] = [
    ({"serialNumber": "R9"}, "MALFORMED", "$.serialNumber"),
    ({"manufacturer": "other"}, "MALFORMED", "$.manufacturer"),
    ({"orderUpdateId": -1}, "MALFORMED", "$.orderUpdateId"),
    ({"orderId": "x" * 65}, "TOO_LONG", "$.orderId"),
    ({"nodes": []}, "MALFORMED", "$.nodes"),
    ({"nodes": [{"nodeId": "1"}]}, "MALFORMED", "$.nodes[0].sequenceId"),
    (order("x", (77, "")), "UNKNOWN_PLACE", "$.nodes[0].nodeId"),
    (order("x", (1, "dance")), "UNSUPPORTED", "$.nodes[0].actions[0].actionType"),
    (order("x", *((node, "pick") for node in (1, 2, 5, 4, 3, 0))), "TOO_LONG", "$.nodes"),
    ({"nodes": [{**order("x", (1, ""))["nodes"][0], "released": False}]}, "UNSUPPORTED", "$.nodes[0].released"),
]


def test_orders_that_cannot_be_driven_are_refused_on_the_robot_s_own_state() -> None:
    good = order("x", (1, ""), (2, ""))
    played, ordered = run([(20.0 + 2 * at, topic(), good | changes) for at, (changes, _, _) in enumerate(REFUSED)])
    assert played.is_good and ends(played) == []
    refused = [(one["reason"], one["path"]) for one in ordered.told("made")]
    assert refused == [(reason, path) for _, reason, path in REFUSED]
    errors = [error for one in ordered.states("R1") for error in one["errors"]]
    described = {error["errorDescription"].split(": ")[0] for error in errors}
    assert described == {reason for _, reason, _ in REFUSED}
    assert {error["errorType"] for error in errors} == {"validationError", "orderError"}
    assert all(validator("2.1", "state").is_valid(one) for one in ordered.states("R1"))


def test_a_robot_has_one_order_by_name_at_a_time_and_updates_are_refused() -> None:
    first, second = order("first", (8, "")), order("second", (3, ""))
    update = first | {"orderUpdateId": 1}
    played, ordered = run([(20, topic(), first), (24, topic(), second), (26, topic(), update), (90, topic(), second)])
    assert ends(played) == [(21, TaskPhase.DONE)] and ordered.lives("made", "R1/first")[-1] == "done"
    assert [one["reason"] for one in ordered.told("made") if "reason" in one] == ["BUSY", "NAME_TAKEN"]
    assert ordered.lives("made", "R1/second")[-1] == "done"


@pytest.mark.parametrize("version", VERSIONS)
def test_instant_actions_are_done_or_refused_with_a_reason_and_once_each(version: str) -> None:
    number = VERSIONS[version]
    name = topic("instantActions", version=version)
    kinds = ("stateRequest", "factsheetRequest", "cancelOrder", "startPause", "stopPause", "fly")
    orders = [(30.0 + 2 * at, name, action(kind, f"i{at}", number)) for at, kind in enumerate(kinds)]
    _, ordered = run([*orders, (50, name, action("stateRequest", "i0", number))], version=version)
    states = list(ordered.states("R1"))
    assert all(validator(version, "state").is_valid(one) for one in states)
    key, why = ("actionStates", "resultDescription") if version == "2.1" else ("instantActionStates", "actionResult")
    last = {one["actionType"]: one for one in states[-1][key]}
    assert {kind: one["actionStatus"] for kind, one in last.items()} == {
        "stateRequest": "FINISHED",
        "factsheetRequest": "FINISHED",
        "cancelOrder": "FAILED",
        "startPause": "FINISHED",
        "stopPause": "FINISHED",
        "fly": "FAILED",
    }
    assert all(one.get(why) for one in last.values() if one["actionStatus"] == "FAILED")
    assert [one["actionId"] for one in states[-1][key]] == [f"i{at}" for at in range(len(kinds))]
    sheets = [one for one in ordered.broker.all if one.topic.endswith("/R1/factsheet")]
    assert len(sheets) == 2
    at_once = [one for one in states if one["timestamp"].startswith("2026-03-01T06:00:30.0")]
    assert at_once


def test_an_order_that_was_not_given_yet_can_be_cancelled() -> None:
    """Before the gateway has listened it gives no orders; then the robot never hears of it."""
    told = [(0.5, topic(), order("early", (4, ""))), (1.0, topic("instantActions"), action("cancelOrder", "c"))]
    played, ordered = run(told)
    assert ends(played) == [] and ordered.lives("made", "R1/early") == ["accepted", "refused"]
    assert (
        json.loads(next(one.payload for one in ordered.broker.all if b'"FINISHED"' in one.payload))["actionStates"][-1][
            "actionType"
        ]
        == "cancelOrder"
    )


def test_in_a_car_park_a_robot_takes_no_orders_by_name() -> None:
    told = order("x", (1, ""), serial="MR1")
    _, ordered = park_and_order(one_floor(), 0, [(20, topic(serial="MR1"), told)], extra_s=40)
    refused = ordered.told("test")
    assert [(one["id"], one["reason"]) for one in refused] == [("MR1/x", "UNSUPPORTED")]
