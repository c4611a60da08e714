"""Rows of Gnatowski's graph on the bus: robots, node agents and the order desk over CAN, and the plant beneath."""

from collections.abc import Iterator
from typing import Any, TypeVar

import pytest

from bus_sim.cli import main
from bus_sim.options import RunOptions
from bus_sim.run import BusRun
from bus_sim.session import play
from bus_sim.sites import find_site
from bus_sim.systems.graph.plant import GraphPlant
from bus_sim.systems.stage import SystemStage
from onboard.contract.codes import KindCode, OrderResult, TokenKind
from onboard.contract.constants import NOBODY
from onboard.contract.graph import (
    BodyPlace,
    EdgeNotice,
    EdgeState,
    NodeAnswer,
    NodeVerdict,
    RobotAt,
    RobotMode,
    TurnSignal,
    VisitList,
)
from onboard.contract.messages import Bid, CallForProposals, Message, TokenGrant
from onboard.controller.shell import Controller
from onboard.systems.graph.checks import RULES
from onboard.systems.graph.network import Graph, complete, ring
from onboard.systems.graph.rights import keeper, slot_token
from onboard.systems.graph.robot import GraphRobot
from onboard.systems.graph.rules import Rules
from onboard.systems.graph.site import FactoryGraph
from onboard.trace.check.checks import Checks
from tests.graph.sites import busy_orders, hall, made

M = TypeVar("M", bound=Message)


class Scene:
    """A graph that was played to its end."""

    def __init__(self, site: FactoryGraph, limit_s: float = 600, seed: int = 1) -> None:
        self.site = site
        self.played: SystemStage[Any] = play(site, RunOptions(seed=seed, limit_s=limit_s))
        assert isinstance(self.played.plant, GraphPlant)
        self.plant: GraphPlant = self.played.plant

    def said(self, kind: type[M]) -> list[M]:
        """All messages of a class."""
        return [message for _, message in self.played.messages if isinstance(message, kind)]

    def assert_sound(self) -> None:
        """Every order done, nothing broken, nobody halted, and no checker finds anything."""
        assert self.plant.violations == []
        assert self.played.halted == []
        assert self.played.is_over
        assert all(entry.result is OrderResult.DONE for entry in self.plant.entries)
        checks = Checks(self.site, rules=RULES)
        for time_us, message in self.played.messages:
            checks.feed_message(time_us, message)
        verdict = checks.finish()
        assert verdict.is_good, verdict.lines()

    def moves(self, robot: int) -> Iterator[int]:
        """The nodes in which a robot was or to which it went, each once."""
        last = None
        for at in self.said(RobotAt):
            if at.sender == robot and at.node != last:
                last = at.node
                yield at.node


@pytest.fixture(scope="module")
def shipped() -> Scene:
    site = find_site("graph")
    assert isinstance(site, FactoryGraph)
    return Scene(site)


@pytest.fixture(scope="module")
def crowd() -> Scene:
    """Four robots in a hall of nine nodes, with more to do than they can."""
    return Scene(made(hall(), (0, 4, 8, 2), busy_orders(hall(), 12, 2)))


def test_g04_g07_g23_three_robots_of_the_example_and_more_orders(shipped: Scene) -> None:
    shipped.assert_sound()
    robots = {machine.name: node for node, machine in shipped.site.robots.items()}
    first = [(entry.robot, entry.order.stops) for entry in shipped.plant.entries[:3]]
    assert first == [(robots["R1"], (4, 6)), (robots["R2"], (2, 5)), (robots["R3"], (7, 0))]
    assert len(shipped.site.graph.nodes) >= 8
    # All end free, in nodes.
    last = {at.sender: at for at in shipped.said(RobotAt)}
    assert {at.robot_mode for at in last.values()} == {RobotMode.FREE}
    assert all(body.place is BodyPlace.IN_NODE for body in shipped.plant.bodies.values())
    kinds = {machine.kind for machine in shipped.site.machines.values()}
    assert kinds == {KindCode.VEHICLE, KindCode.NODE, KindCode.DESK}


def test_g11_a_named_robot_visits_its_list_in_turn(shipped: Scene) -> None:
    entry = next(entry for entry in shipped.plant.entries if len(entry.order.stops) == 3)
    lists = [one for one in shipped.said(VisitList) if one.order == entry.number]
    assert lists and {one.robot for one in lists} == {entry.order.robot} == {entry.robot}
    stays = [node for node, since, until in shipped.plant.bodies[entry.robot].stays if until - since >= 5_000_000]
    assert _has_in_turn([*stays, shipped.plant.bodies[entry.robot].node], entry.order.stops)


def _has_in_turn(nodes: list[int], wanted: tuple[int, ...]) -> bool:
    left = list(wanted)
    for node in nodes:
        if left and node == left[0]:
            left.pop(0)
    return not left


def test_g13_modes_go_from_driving_to_loading_to_free(shipped: Scene) -> None:
    modes = [at.robot_mode for at in shipped.said(RobotAt) if at.sender == 11]
    changes = [one for number, one in enumerate(modes) if number == 0 or one is not modes[number - 1]]
    assert changes[:5] == [
        RobotMode.FREE, RobotMode.LOADING, RobotMode.DRIVING, RobotMode.LOADING, RobotMode.FREE,
    ]  # fmt: skip


def test_g10_g14_a_robot_signals_when_it_passes_the_sensor_and_not_before(shipped: Scene) -> None:
    moving = [one for one in shipped.played.messages if isinstance(one[1], TurnSignal | RobotAt)]
    entered: dict[int, tuple[int, RobotAt]] = {}
    seen = 0
    for time_us, message in moving:
        if isinstance(message, RobotAt):
            before = entered.get(message.sender)
            if before is None or (before[1].behind, before[1].node) != (message.behind, message.node):
                entered[message.sender] = (time_us, message)
        elif isinstance(message, TurnSignal) and (at := entered[message.sender])[1].on_edge:
            length_mm = shipped.site.graph.length_mm(at[1].behind, at[1].node)
            on_edge_ms = (time_us - at[0]) // 1000
            assert message.node == at[1].node
            assert on_edge_ms >= length_mm - shipped.site.approach_mm - 100  # a millimetre a millisecond
            seen += 1
    assert seen >= 5


def test_g05_g06_agents_answer_for_their_own_nodes(shipped: Scene) -> None:
    assert shipped.said(NodeAnswer)
    for answer in shipped.said(NodeAnswer):
        assert answer.sender == shipped.site.hosts[answer.node]
    for notice in shipped.said(EdgeNotice):
        assert notice.sender == shipped.site.hosts[notice.node]
        assert notice.other in shipped.site.graph.neighbours[notice.node]


def test_g08_g15_g18_a_crowd_stops_and_goes_and_nobody_meets(crowd: Scene) -> None:
    crowd.assert_sound()
    answers = [one.node_verdict for one in crowd.said(NodeAnswer)]
    assert answers.count(NodeVerdict.GO) > 30
    assert answers.count(NodeVerdict.STOP) > 3


def test_g17_g22_what_lies_behind_is_given_back_and_who_waits_goes(crowd: Scene) -> None:
    grants = [one for one in crowd.said(TokenGrant) if one.token_kind is TokenKind.SEGMENT]
    holder: dict[int, int] = {}
    for grant in grants:
        holder[grant.token] = grant.holder
    assert holder and all(one in set(crowd.site.hosts.values()) for one in holder.values())
    # Whoever was told to stop was told to go later, without a new signal where nothing was lost.
    waiting: set[int] = set()
    gone = 0
    for message in (message for _, message in crowd.played.messages):
        if isinstance(message, NodeAnswer) and message.node_verdict is NodeVerdict.STOP:
            waiting.add(message.robot)
        elif isinstance(message, TurnSignal):
            waiting.discard(message.sender)
        elif isinstance(message, NodeAnswer) and message.robot in waiting:
            gone += 1
            waiting.discard(message.robot)
    assert gone > 0


def test_g16_g19_two_that_meet_head_on_and_one_takes_another_edge() -> None:
    orders = [(0, "R1", (5,)), (0, "R2", (3,))]
    scene = Scene(made(hall(), (3, 5), orders, Rules.PAPER))
    scene.assert_sound()
    sent = [one for one in scene.said(NodeAnswer) if one.node_verdict is NodeVerdict.ANOTHER]
    assert len(sent) == 1 and sent[0].node == 4
    robot, goal = sent[0].robot, {21: 5, 22: 3}[sent[0].robot]
    way = list(scene.moves(robot))
    # It goes where it was sent, then by a shortest way from there without turning back.
    assert way[1:] == [4, *(scene.site.graph.way(4, sent[0].after, goal) or ())]
    other = 43 - robot
    assert len(list(scene.moves(other))) == 3
    alone = Scene(made(hall(), (3, 5), [(0, "any", (1, 2))], Rules.PAPER))
    alone.assert_sound()
    (goes,) = (list(alone.moves(node)) for node in (21, 22) if len(list(alone.moves(node))) > 1)
    assert len(goes) == 4, "and so does who is called for by no name"


def test_g19_who_is_sent_where_is_drawn_alike_in_every_run() -> None:
    orders = [(0, "R1", (5,)), (0, "R2", (3,))]
    sent = [Scene(made(hall(), (3, 5), orders, Rules.PAPER)).said(NodeAnswer) for _ in range(2)]
    assert sent[0] == sent[1]


def test_g19_the_draw_falls_on_either_robot_and_on_any_free_edge() -> None:
    """Two robots meet head-on again and again: who asked first is sent elsewhere as well as who asked second."""
    orders = [
        (40 * n, robot, (stop,)) for n in range(10) for robot, stop in (("R1", (5, 3)[n % 2]), ("R2", (3, 5)[n % 2]))
    ]
    scene = Scene(made(hall(), (3, 5), orders, Rules.PAPER))
    scene.assert_sound()
    first: dict[int, int] = {}
    sent: list[tuple[bool, int]] = []
    for message in (one for _, one in scene.played.messages):
        if isinstance(message, TurnSignal) and message.node == 4:
            first.setdefault(4, message.sender)
        if isinstance(message, NodeAnswer) and message.node == 4 and message.node_verdict is NodeVerdict.ANOTHER:
            sent.append((message.robot == first[4], message.after))
        if isinstance(message, RobotAt) and message.node in (3, 5) and message.robot_mode is RobotMode.FREE:
            first.clear()
    assert {is_first for is_first, _ in sent} == {True, False}
    assert {after for _, after in sent} == {1, 7}


def test_g20_the_node_at_the_other_end_is_told_of_a_grant(crowd: Scene) -> None:
    granted = [(one.node, one.after, one.robot) for one in crowd.said(NodeAnswer) if one.node_verdict is NodeVerdict.GO]
    notices = crowd.said(EdgeNotice)
    told = [(one.node, one.other, one.robot) for one in notices if one.edge_state is EdgeState.RESERVED]
    assert granted and granted == told


def test_g20_a_kept_edge_that_is_granted_is_told_reserved_and_then_free_once() -> None:
    """By the keep rule with notices: the notice of the grant ends that of keeping, and nothing else does later."""
    scene = Scene(made(hall(), (0, 4, 8), busy_orders(hall(), 8, 2), Rules.KEEP_ON_NOTICE), limit_s=200)
    told = dict[tuple[int, int], list[EdgeState]]()
    for one in scene.said(EdgeNotice):
        told.setdefault((one.node, one.other), []).append(one.edge_state)
    behind = [
        words[number + 2 : number + 4]
        for words in told.values()
        for number in range(len(words))
        if words[number : number + 2] == [EdgeState.KEPT, EdgeState.RESERVED]
    ]
    assert len(behind) >= 3 and all(words[:1] == [EdgeState.FREE] for words in behind)
    assert [EdgeState.FREE, EdgeState.FREE] not in behind


def test_a02_by_the_papers_rules_the_right_to_an_edge_is_enough_to_be_sent_along_it() -> None:
    """No place in the node behind it is needed: both robots are sent to where they shall go."""
    graph = complete(4, 5000)
    scene = Scene(made(graph, (0, 1), [(0, "R1", (2,)), (0, "R2", (3,))], Rules.PAPER), limit_s=90)
    assert [list(scene.moves(robot))[-1] for robot in (21, 22)] == [2, 3]
    scene.assert_sound()


def test_g18_g21_the_last_free_edge_is_kept_and_two_on_a_ring_stick_by_it() -> None:
    # The worked counterexample of section 2.4: by the rule both wait for ever; without it neither does.
    orders = [(0, "R1", (2,)), (0, "R2", (1,))]
    scene = Scene(made(ring(6, 5000), (0, 3), orders, Rules.KEEP), limit_s=90)
    assert not scene.played.is_over and scene.plant.violations == []
    assert {body.place for body in scene.plant.bodies.values()} == {BodyPlace.AT_LINE}
    assert any(one.edge_state is EdgeState.KEPT for one in scene.said(EdgeNotice))
    Scene(made(ring(6, 5000), (0, 3), orders, Rules.PAPER)).assert_sound()


def test_g24_what_is_certified_does_not_stick_on_the_bus() -> None:
    graph = complete(4, 5000)
    Scene(made(graph, (0, 1, 2), busy_orders(graph, 10, 1), Rules.PAPER)).assert_sound()
    Scene(made(ring(5, 5000), (0, 1, 3), busy_orders(ring(5, 5000), 10, 3))).assert_sound()


def test_g25_no_central_unit_and_any_size() -> None:
    graph = ring(12, 4000)
    site = made(graph, (0, 6), [(0, "any", (2, 4)), (0, "any", (8, 10))])
    assert {machine.kind for machine in site.machines.values()} == {KindCode.VEHICLE, KindCode.NODE, KindCode.DESK}
    assert set(site.hosts.values()) == {1, 2}
    assert {keeper(site, slot_token(node, 1)) for node in site.hosts} == {1, 2}
    assert keeper(site, slot_token(200, 1)) == NOBODY, "what is in no site is kept by nobody"
    Scene(site).assert_sound()


def test_g26_little_is_said(shipped: Scene) -> None:
    # A signal, an answer and a notice for each edge driven; calls only for orders that name nobody.
    signals = len(shipped.said(TurnSignal))
    gos = [one for one in shipped.said(NodeAnswer) if one.node_verdict is NodeVerdict.GO]
    assert len(gos) <= signals <= len(gos) + 5
    assert len(shipped.said(CallForProposals)) == sum(entry.order.robot == 0 for entry in shipped.plant.entries)


def test_g28_the_nearest_free_robot_wins_the_call() -> None:
    scene = Scene(made(hall(), (0, 8), [(0, "any", (7, 6)), (1, "any", (1, 2))]))
    scene.assert_sound()
    assert [entry.robot for entry in scene.plant.entries] == [22, 21]
    assert len(scene.said(Bid)) <= 4
    # Where the nearest has something to do already, the other is nearer in time.
    busy = Scene(made(hall(), (0, 8), [(0, "R2", (8, 0, 8, 0)), (4, "any", (7, 6))]))
    busy.assert_sound()
    assert busy.plant.entries[1].robot == 21


def test_g31_a_robot_plans_around_what_others_have_told() -> None:
    # R2 comes along 2, 1, 0: R1 takes the edge from 0 to 2, which is longer than the two over 1.
    orders = [(0, "R2", (2, 0)), (4, "R1", (2,))]
    graph = Graph({**hall().lengths_mm, (0, 2): 15000})
    scene = Scene(made(graph, (0, 2), orders))
    scene.assert_sound()
    assert 1 not in list(scene.moves(21))
    alone = Scene(made(graph, (0, 2), [(4, "R1", (2,))]))
    assert list(alone.moves(21)) == [0, 1, 2]


def test_g27_a_robot_with_another_map_does_not_drive() -> None:
    site = made(hall(), (0, 8), [(0, "any", (1, 2)), (0, "any", (7, 6)), (0, "R1", (2,))])
    stale = made(hall(7000), (0, 8), [])
    assert stale.digest != site.digest

    def swap(controller: Controller) -> None:
        holon = controller.holon
        if holon.node_id == 21:
            assert isinstance(holon.behaviour, GraphRobot)
            holon.site = holon.behaviour.fleet.site = stale

    def prepare(run: BusRun[Any]) -> None:
        run.before_start.append(swap)

    played = play(site, RunOptions(limit_s=120), prepare=prepare)
    assert played.plant.violations == []
    assert isinstance(played.plant, GraphPlant)
    assert [entry.robot for entry in played.plant.entries[:2]] == [22, 22]
    # Among strangers it does not even answer: the order is with the desk for a person to see.
    assert played.plant.entries[2].result is OrderResult.RECEIVED
    assert played.plant.bodies[21].stays == []


def test_g03_a_run_from_the_command_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "graph", "--trace", "/dev/null"]) == 0
    said = capsys.readouterr().out
    assert "deadlock-free under these rules" in said
    assert "violations: none" in said
    assert "order 1: R1 visits N4, N6: done" in said
