"""VDA 5050 orders to a robot by name on a factory graph (row G11), and instant actions."""

import json
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import pytest

from bus_sim.faults.injection import parse_injection
from bus_sim.options import RunOptions
from bus_sim.run import BusRun
from bus_sim.session import play
from bus_sim.systems.stage import SystemStage
from onboard.contract.codes import TaskPhase
from onboard.contract.graph import RobotAt, RobotMode, VisitList
from onboard.contract.messages import TaskReport
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


def run(
    orders: Sequence[tuple[float, str, Any]], *, faults: Sequence[str] = (), **options: Any
) -> tuple[SystemStage[Any], Ordered]:
    ordered = Ordered(orders, **options)

    def prepare(simulated: BusRun[Any]) -> None:
        ordered.attach(simulated)
        simulated.loop.call_at(END_S, ordered.stop)

    return play(
        SITE,
        RunOptions(quiet=True, limit_s=300, faults=tuple(parse_injection(one) for one in faults)),
        prepare=prepare,
    ), ordered


def ends(played: SystemStage[Any]) -> list[tuple[int, TaskPhase]]:
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
    ({"nodes": [{**order("x", (1, ""))["nodes"][0], "released": False}]}, "MALFORMED", "$.nodes"),
    ({"orderUpdateId": 3}, "NO_ORDER", "$.orderUpdateId"),
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
    assert {error["errorType"] for error in errors} == {"validationError", "orderError", "orderUpdateError"}
    assert all(validator("2.1", "state").is_valid(one) for one in ordered.states("R1"))


def test_a_robot_has_one_order_by_name_at_a_time() -> None:
    first, second = order("first", (8, "")), order("second", (3, ""))
    played, ordered = run([(20, topic(), first), (24, topic(), second), (90, topic(), second)])
    assert ends(played) == [(21, TaskPhase.DONE)] and ordered.lives("made", "R1/first")[-1] == "done"
    assert [one["reason"] for one in ordered.told("made") if "reason" in one] == ["BUSY"]
    assert ordered.lives("made", "R1/second")[-1] == "done"


def update(number: int, start: int, *nodes: tuple[int, str], horizon: int = 0) -> dict[str, Any]:
    """Update ``number`` of order "a", whose first node has the sequence number ``start``; the last are not released."""
    told = order("a", *nodes) | {"orderUpdateId": number}
    for place, one in enumerate(told["nodes"]):
        one |= {"sequenceId": start + 2 * place, "released": place < len(nodes) - horizon}
    for place, one in enumerate(told["edges"]):
        one |= {"sequenceId": start + 2 * place + 1, "released": place < len(nodes) - 1 - horizon}
    return told


def loadings(played: SystemStage[Any]) -> list[int]:
    """Nodes at which R1 loaded, in turn."""
    told = [one for _, one in played.messages if isinstance(one, RobotAt) and one.sender == 21]
    nodes = [one.node for one in told if one.robot_mode is RobotMode.LOADING]
    return [node for place, node in enumerate(nodes) if place == 0 or nodes[place - 1] != node]


@pytest.mark.parametrize("version", VERSIONS)
def test_an_order_is_driven_as_far_as_it_is_released_and_on_as_updates_release_more(version: str) -> None:
    """To 1 with a horizon; while it waits there, on to 2 and 5; on its way there, on to 4, which is the end."""
    number = VERSIONS[version]
    orders = [
        update(0, 0, (0, ""), (1, "pick"), (2, ""), horizon=1),
        update(1, 2, (1, "pick"), (2, "drop"), (5, ""), (4, ""), horizon=1),
        update(2, 6, (5, ""), (4, "")),
    ]
    orders = [one | {"version": number} for one in orders]
    if version == "3.0":
        for one in orders:
            for edge in one["edges"]:
                del edge["startNodeId"], edge["endNodeId"]
    name = topic(version=version)
    times = (20.0, 60.0, 64.0)
    played, ordered = run(list(zip(times, (name,) * 3, orders, strict=True)), version=version)
    assert played.is_good and loadings(played) == [1, 2, 5, 4]
    lists = {one.order: (one.stop1, one.stop2) for _, one in played.messages if isinstance(one, VisitList)}
    assert sorted(stops for stops in lists.values() if stops != (7, 255)) == [(1, 255), (2, 5), (4, 255)]
    assert [one["phase"] for one in ordered.told("made", "R1/a")].count("done") == 1
    states = [one for one in ordered.states("R1") if one["orderId"] == "a"]
    assert list(dict.fromkeys(one["orderUpdateId"] for one in states)) == [0, 1, 2]
    assert not any(one["errors"] for one in states)
    assert all(validator(version, "state").is_valid(one) for one in states)


@pytest.mark.parametrize("deaths_s", [(40.0,), (62.0, 70.0)])
def test_updates_outlive_the_gateway(deaths_s: tuple[float, ...]) -> None:
    orders = [
        update(0, 0, (0, ""), (1, "pick"), (2, ""), horizon=1),
        update(1, 2, (1, "pick"), (2, "drop")),
        update(2, 4, (2, "drop"), (5, "")),
    ]
    times = (20.0, 60.0, 61.0)
    played, ordered = run(list(zip(times, (topic(),) * 3, orders, strict=True)), deaths_s=deaths_s)
    assert played.is_good and loadings(played) == [1, 2, 5]
    assert ordered.lives("made", "R1/a")[-1] == "done"


BAD_UPDATES: list[tuple[dict[str, Any], str, str]] = [
    (update(1, 2, (8, ""), (7, "")), "OLD_UPDATE", "$.orderUpdateId"),
    (update(2, 2, (8, ""), (5, "")), "NAME_TAKEN", "$.orderId"),
    (update(3, 2, (7, ""), (4, "")), "NOT_CONTINUED", "$.nodes[0]"),
    (update(3, 4, (8, ""), (7, "")), "NOT_CONTINUED", "$.nodes[0]"),
    (update(3, 2, (8, ""), (7, ""), (77, "")), "UNKNOWN_PLACE", "$.nodes[2].nodeId"),
]


def test_updates_that_do_not_fit_are_refused_and_the_order_stays_as_it_was() -> None:
    """As VDA 5050 2.1, section 6.6.4, has it: older, another of one number, not from the last node, too late."""
    first, second = update(0, 0, (0, ""), (8, ""), horizon=0), update(2, 2, (8, ""), horizon=0)
    told: list[tuple[float, str, Any]] = [(20.0, topic(), first), (21.0, topic(), second), (22.0, topic(), second)]
    told += [(23.0 + place, topic(), one) for place, (one, *_) in enumerate(BAD_UPDATES)]
    played, ordered = run([*told, (120.0, topic(), update(3, 2, (8, ""), (7, "")))])
    assert played.is_good and ends(played) == [(21, TaskPhase.DONE)] and loadings(played) == [8]
    refused = [(one["reason"], one["path"]) for one in ordered.told("made") if "path" in one]
    assert refused == [*((reason, path) for _, reason, path in BAD_UPDATES), ("ORDER_OVER", "$.orderId")]
    kinds = {
        error["errorDescription"].split(":")[0]: error["errorType"]
        for one in ordered.states("R1")
        for error in one["errors"]
    }
    assert {kinds[reason] for reason in ("OLD_UPDATE", "NOT_CONTINUED", "ORDER_OVER")} == {"orderUpdateError"}


@pytest.mark.parametrize("deaths_s", [(), (30.2,)])
def test_an_order_that_a_robot_has_is_taken_back_and_it_takes_the_next(
    deaths_s: tuple[float, ...],
) -> None:
    """It ends its edge; also where the gateway dies right after it has said so. What was not done is not done later."""
    cancel = [(30.0, topic("instantActions"), action("cancelOrder", "c"))]
    orders = [(20.0, topic(), order("a", (0, ""), (8, "drop"))), *cancel, (60.0, topic(), order("b", (3, "drop")))]
    played, ordered = run(orders, deaths_s=deaths_s)
    assert played.is_good and loadings(played) == [3]
    assert ends(played) == [(21, TaskPhase.REFUSED), (21, TaskPhase.DONE)]
    (over,) = [one for one in ordered.told("made", "R1/a") if one["phase"] == "refused"]
    assert over["reason"] == "CANCELLED"
    stood = [one for t, one in played.messages if isinstance(one, RobotAt) and one.sender == 21 and 45e6 < t < 60e6]
    assert not any(one.on_edge for one in stood)
    if not deaths_s:
        told = [one for state in ordered.states("R1") for one in state["actionStates"] if one["actionId"] == "c"]
        assert list(dict.fromkeys(one["actionStatus"] for one in told)) == ["RUNNING", "FINISHED"]


def test_an_order_that_waits_for_its_update_is_cancelled_at_once_and_one_that_is_done_cannot_be() -> None:
    orders = [
        (20.0, topic(), update(0, 0, (0, ""), (1, "pick"), (2, ""), horizon=1)),
        (60.0, topic("instantActions"), action("cancelOrder", "c")),
        (62.0, topic("instantActions"), action("cancelOrder", "d")),
    ]
    played, ordered = run(orders)
    assert ends(played) == [(21, TaskPhase.DONE)] and ordered.told("made", "R1/a")[-1]["reason"] == "CANCELLED"
    told = {one["actionId"]: one for one in list(ordered.states("R1"))[-1]["actionStates"] if "description" not in one}
    assert (told["c"]["actionStatus"], told["d"]["actionStatus"]) == ("FINISHED", "FAILED")
    assert told["d"]["resultDescription"] == "there is no order"


def test_numbers_of_lists_are_not_used_again_after_a_restart() -> None:
    """R1's order was given first and is over last: what was written last is not the newest number."""
    orders = [
        (20.0, topic(), order("a", (8, "drop"))),
        (22.0, topic(serial="R2"), order("b", (8, ""), serial="R2")),
        (100.0, topic(serial="R2"), order("c", (5, "drop"), serial="R2")),
    ]
    played, _ = run(orders, deaths_s=(90.0,))
    lists = {(one.order, one.robot) for _, one in played.messages if isinstance(one, VisitList) and one.sender == NODE}
    assert len(lists) == len({number for number, _ in lists}) == 3


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


def test_a_name_that_the_schema_does_not_know_may_hold_anything() -> None:
    """The gateway ended at each of these, and nobody could order before it had started again."""
    orders = [
        (18.0, topic("instantActions"), action("stateRequest", "s") | {"orderId": None}),
        (20.0, topic(), order("a", (0, ""), (8, "drop"), actions=1.5, before=5)),
    ]
    played, ordered = run(orders)
    assert played.is_good
    assert ordered.lives("made", "R1/a")[-1] == "done"
