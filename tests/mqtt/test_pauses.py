"""startPause and stopPause: a machine is held by a word on the bus, and what its state tells is its own word."""

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import pytest

from bus_sim.options import RunOptions
from bus_sim.run import BusRun
from bus_sim.session import play
from bus_sim.systems.graph.plant import make_plant as graph_plant
from bus_sim.systems.mapd.plant import make_plant as mapd_plant
from bus_sim.systems.stage import SystemStage
from bus_sim.systems.terminal.playing import play as play_terminal
from bus_sim.systems.terminal.run import TerminalRun
from onboard.contract.codes import CONTRACT_VERSION, KindCode, MachineState, ManualMode
from onboard.contract.graph import RobotAt
from onboard.contract.messages import Heartbeat, ManualOrder, ManualState
from onboard.core.site import Site
from onboard.gateway.dialect import DIALECTS
from onboard.gateway.inbox import MOST_DEPTH, Inbox
from onboard.gateway.machines import Machines
from onboard.gateway.pauses import Pauses
from onboard.history.history import History
from onboard.ports.broker import Publication
from tests.graph.sites import hall, made
from tests.graph.test_named_orders import header, order, topic
from tests.mapd.sites import made as made_floor
from tests.mqtt.logs import VERSIONS, validator
from tests.mqtt.ordered import NODE, Ordered, park_and_order, said
from tests.sites import one_floor
from tests.system.scene import play as play_park
from tests.system.scene import stays
from tests.terminal.seeds import short

R1 = 21
SITE = made(hall(), (0, 8), [(150, "R2", (7,))])


def act(kind: str, name: str, serial: str = "R1", version: str = "2.1.0") -> dict[str, Any]:
    return header(serial, version) | {"actions": [{"actionType": kind, "actionId": name, "blockingType": "NONE"}]}


def actions(ordered: Ordered, serial: str, version: str = "2.1") -> list[tuple[str, list[str]]]:
    """Each instant action's statuses as a machine's states told them, each once."""
    found: dict[str, list[str]] = {}
    for state in ordered.states(serial):
        for one in state["actionStates" if version == "2.1" else "instantActionStates"]:
            if not one["actionId"].endswith(("-pick", "-drop")):
                found.setdefault(one["actionId"], []).append(one["actionStatus"])
    return [(name, list(dict.fromkeys(told))) for name, told in found.items()]


def on(
    site: Site, make_plant: Any, orders: Sequence[tuple[float, str, Any]], stop_s: float = 140.0
) -> tuple[SystemStage[Any], Ordered]:
    ordered = Ordered(orders)

    def prepare(run: BusRun[Any]) -> None:
        ordered.attach(run)
        run.loop.call_at(stop_s, ordered.stop)

    return play(site, RunOptions(quiet=True, limit_s=300), prepare=prepare), ordered


@pytest.mark.parametrize("version", VERSIONS)
def test_a_robot_of_a_car_park_is_paused_by_its_own_word_and_resumes(version: str) -> None:
    number, name = VERSIONS[version], topic("instantActions", serial="MR1", version=version)
    orders = [(21.0, name, act("startPause", "p", "MR1", number)), (90.0, name, act("stopPause", "s", "MR1", number))]
    scene, ordered = park_and_order(one_floor(), 1, orders, extra_s=60.0, version=version)
    scene.assert_sound()
    assert scene.simulation.plant.street.summary().parked == 1
    assert actions(ordered, "MR1", version) == [("p", ["RUNNING", "FINISHED"]), ("s", ["RUNNING", "FINISHED"])]
    states = list(ordered.states("MR1"))
    assert all(validator(version, "state").is_valid(one) for one in states)
    assert not [one for one in states if one["paused"] and one["driving"]]
    paused = [one["paused"] for one in states]
    first, last = paused.index(True), len(paused) - 1 - paused[::-1].index(True)
    assert all(paused[first : last + 1]) and not paused[-1]
    assert not [error for one in states for error in one["errors"]], "to be held is no error"
    rest_us, _ = scene.first(ManualState, lambda one: one.at_rest)
    driven = [one["timestamp"] for one in states if one["paused"]]
    assert driven[0] >= f"2026-03-01T06:{rest_us // 60_000_000:02}:{rest_us / 1e6 % 60:05.2f}"


def test_a_robot_of_a_graph_ends_its_edge_stands_in_the_node_and_drives_on() -> None:
    name = topic("instantActions")
    orders = [
        (20.0, topic(), order("a", (0, ""), (8, "drop"))),
        (24.0, name, act("startPause", "p")),
        (80.0, name, act("stopPause", "s")),
    ]
    played, ordered = on(SITE, graph_plant, orders)
    assert played.is_good and ordered.lives("made", "R1/a")[-1] == "done"
    assert actions(ordered, "R1") == [("p", ["RUNNING", "FINISHED"]), ("s", ["RUNNING", "FINISHED"])]
    rest_us = next(t for t, one in played.messages if isinstance(one, ManualState) and one.at_rest)
    told = [(t, one) for t, one in played.messages if isinstance(one, RobotAt) and one.sender == R1]
    places = {(one.behind, one.node, one.on_edge) for t, one in told if rest_us < t < 80_000_000}
    assert len(places) <= 1 and not any(on_edge for *_, on_edge in places)
    assert told[-1][1].node == 8 and told[-1][0] > 80_000_000


def test_a_vehicle_of_a_terminal_is_paused_in_the_middle_of_a_mission_and_resumes() -> None:
    """R4 wins the mission and holds its box at 20 s."""
    name = topic("instantActions", serial="R4")
    orders = [(20.0, name, act("startPause", "p", "R4")), (100.0, name, act("stopPause", "s", "R4"))]
    ordered = Ordered(orders)
    site = short('[[missions]]\nat_s = 5\ntranship = ["B4"]\nto = "S4"\n')

    def prepare(run: TerminalRun) -> None:
        ordered.attach(run)
        run.loop.call_at(110.0, ordered.stop)

    assert play_terminal(site, RunOptions(seed=1), limit_us=600_000_000, prepare=prepare).is_good
    assert actions(ordered, "R4") == [("p", ["RUNNING", "FINISHED"]), ("s", ["RUNNING", "FINISHED"])]
    states = list(ordered.states("R4"))
    paused = [one for one in states if one["paused"]]
    assert paused and not any(one["driving"] for one in paused) and not states[-1]["paused"]


def test_robots_that_move_in_step_are_not_held_and_it_says_why() -> None:
    site = made_floor(1, [(0, "1,2", "3,5")])
    (serial,) = (site.machines[node].name for node in site.homes)
    orders = [(5.0, topic("instantActions", serial=serial), act("startPause", "p", serial))]
    played, ordered = on(site, mapd_plant, orders, stop_s=10.0)
    assert not [one for _, one in played.messages if isinstance(one, ManualOrder)]
    (told,) = [one for one in list(ordered.states(serial))[-1]["actionStates"] if one["actionId"] == "p"]
    assert told["actionStatus"] == "FAILED" and "in step" in told["resultDescription"]


def test_who_does_not_answer_is_told_as_failed_and_the_word_is_given_up() -> None:
    orders = [(30.0, topic("instantActions", serial="MR1"), act("startPause", "p", "MR1"))]
    ordered = Ordered(orders)
    scene = play_park(
        one_floor(2), stays(), before=ordered.attach, after=ordered.end, extra_s=60, without=frozenset({"MR1"})
    )
    assert actions(ordered, "MR1") == [("p", ["RUNNING", "FAILED"])]
    assert 5 <= len(said(scene, ManualOrder)) <= 12
    assert not any(one["paused"] for one in ordered.states("MR1"))


def test_a_gateway_that_was_restarted_knows_who_is_held_and_lets_it_go() -> None:
    name = topic("instantActions", serial="MR1")
    orders = [(21.0, name, act("startPause", "p", "MR1")), (90.0, name, act("stopPause", "s", "MR1"))]
    scene, ordered = park_and_order(one_floor(), 1, orders, extra_s=60.0, deaths_s=(60.0,))
    scene.assert_sound()
    after = [one["paused"] for one in ordered.states("MR1") if "06:01:01" <= one["timestamp"][11:19] < "06:01:30"]
    assert after[-1]
    assert actions(ordered, "MR1")[-1] == ("s", ["RUNNING", "FINISHED"])


def test_a_number_that_an_earlier_life_used_is_not_taken_for_its_order() -> None:
    pauses = Pauses(NODE, seed=0)
    pauses.ask(11, {"actionType": "stopPause"}, 0)
    (order_,), _ = pauses.wake(0)
    assert isinstance(order_, ManualOrder)
    assert pauses.feed(ManualState(11, order_.number, ManualMode.HELD, True), 0) == [], "that was another order"
    (again,), _ = pauses.wake(1_000_000)
    assert isinstance(again, ManualOrder) and again.number != order_.number
    assert [failure for *_, failure in pauses.feed(ManualState(11, again.number, ManualMode.AUTOMATIC, False), 0)] == [
        ""
    ]


def test_a_machine_whose_word_was_lost_is_asked_again_whether_it_has_come_to_rest() -> None:
    pauses = Pauses(NODE, seed=0)
    pauses.ask(11, {"actionType": "startPause"}, 0)
    (order_,), _ = pauses.wake(0)
    assert isinstance(order_, ManualOrder)
    assert pauses.feed(ManualState(11, order_.number, ManualMode.HELD, False), 200_000) == []
    assert pauses.wake(4_000_000) == ([], []), "it has answered"
    assert pauses.wake(30_000_000) == ([order_], []), "and is not given up"
    assert [failure for *_, failure in pauses.feed(ManualState(11, order_.number, ManualMode.HELD, True), 0)] == [""]
    assert list(pauses.due()) == []


@pytest.mark.parametrize("state", [MachineState.IDLE, MachineState.WORKING])
def test_a_machine_that_works_is_not_told_as_paused_though_its_word_was_lost(state: MachineState) -> None:
    site = one_floor()
    history = History(site)
    machines = Machines(site, history)
    node = site.machine("MR1").node_id
    history.feed(ManualState(node, 1, ManualMode.HELD, True), 0)
    beat = Heartbeat(node, CONTRACT_VERSION, site.digest, 0, 1, KindCode.ROBOT, MachineState.OBSTACLE)
    history.feed(beat, 1)
    assert machines.bodies[node].is_paused
    history.feed(replace(beat, state=state), 2)
    assert not machines.bodies[node].is_paused


def test_a_pause_waits_behind_no_flood_of_orders() -> None:
    """As a client of the broker that may give orders, and gives hundreds, would have it."""
    flood = [(21.0, "onboard/test/orders", {"id": f"n{number}", "from": "IOC1"}) for number in range(200)]
    pause = (21.0, topic("instantActions", serial="MR1"), act("startPause", "p", "MR1"))
    _, ordered = park_and_order(one_floor(), 0, [*flood, pause], extra_s=60.0)
    assert actions(ordered, "MR1") == [("p", ["RUNNING", "FINISHED"])]
    assert any(state["paused"] for state in ordered.states("MR1"))


@pytest.mark.parametrize("version", sorted(DIALECTS))
def test_a_parameter_that_is_nested_beyond_any_order_is_refused(version: str) -> None:
    """A parser that takes it says nothing of what comes after: it may be gone into and written again."""
    inbox = Inbox(DIALECTS[version], "onboard/small", "acme")
    name = next(one for one in inbox.subscriptions if one.endswith("/instantActions")).replace("+", "MR1")
    parameter = {"key": "a", "value": "DEEP"}
    action = {"actionType": "x", "actionId": "1", "blockingType": "NONE", "actionParameters": [parameter]}
    head = {"headerId": 0, "timestamp": "2026-11-23T00:00:00.000Z", "version": DIALECTS[version].number}
    body = json.dumps({**head, "manufacturer": "acme", "serialNumber": "MR1", "actions": [action]})
    # Five are around the value.
    for deep, reason in ((MOST_DEPTH - 5, ""), (MOST_DEPTH - 4, "MALFORMED"), (900, "MALFORMED")):
        text = body.replace('"DEEP"', "[" * deep + "]" * deep)
        found = inbox.judge(Publication(name, text.encode(), 1, retain=False), 0)
        assert found is not None and found.reason == reason, (deep, found)


def test_whoever_floods_one_machine_with_actions_takes_no_other_machines_pause_away() -> None:
    flood = [(21.0, topic("instantActions", serial="R2"), act("stopPause", f"n{number}", "R2")) for number in range(40)]
    pause = (21.0, topic("instantActions"), act("startPause", "p"))
    _, ordered = on(SITE, graph_plant, [*flood, pause], stop_s=60.0)
    assert actions(ordered, "R1") == [("p", ["RUNNING", "FINISHED"])]
