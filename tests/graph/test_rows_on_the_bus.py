"""Rows G01 to G03, G09, G12, G15, G28, G30 and P04, each read from what robots, agents and desk say on the bus."""

import random
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from bus_sim.cli import main
from bus_sim.options import RunOptions
from bus_sim.session import play
from onboard.config.site import parse_site
from onboard.contract.codes import Operation, TaskPhase
from onboard.contract.graph import NodeAnswer, NodeVerdict, RobotAt, RobotMode, TurnSignal, VisitList
from onboard.contract.messages import Award, Bid, CallForProposals, Message, Reference, TaskReport
from onboard.systems.graph.fields import stops_of
from onboard.systems.graph.network import NOWHERE, Graph, complete, edge, grid
from onboard.systems.graph.rules import Rules
from onboard.systems.graph.site import FactoryGraph
from tests.cut import Timed, first_of, shown, shown_at
from tests.graph.brute_force import least
from tests.graph.sites import Wanted, busy_orders, hall, made, site_text

#: A robot of tests, and what its speed of a metre a second comes to beside the length of an edge, ms: it asks, and is
#: granted, before the end of an edge; from a node it begins to move when its rights have come.
R1, R2, BESIDE_MS = 21, 22, 100


def listen(site: FactoryGraph, limit_s: float = 600) -> list[Timed]:
    """All that is said on the fleet bus until all is done, or so long. Nothing may be broken."""
    played = play(site, RunOptions(limit_s=limit_s))
    assert played.violations() == [] and played.halted == []
    return played.messages


def legs(said: Sequence[Timed], robot: int) -> Iterator[tuple[int, int, int, int]]:
    """The edges that a robot says it is on: from which node to which, and from when to when, us."""
    on: tuple[int, int, int] | None = None
    for at_us, one in said:
        if not isinstance(one, RobotAt) or one.sender != robot:
            continue
        here = (one.behind, one.node) if one.on_edge else None
        if on is not None and here != on[:2]:
            yield (*on, at_us)
        if here is None:
            on = None
        elif on is None or here != on[:2]:
            on = (*here, at_us)


def way_of(said: Sequence[Timed], robot: int) -> list[int]:
    """The nodes to which a robot says it went, one after the other."""
    driven = list(legs(said, robot))
    assert all(one[1] == other[0] for one, other in pairwise(driven)), "it goes on from where it is"
    return [*(start for start, *_ in driven[:1]), *(end for _, end, *_ in driven)]


# --- lengths ---------------------------------------------------------------------------------------------------------


def test_g01_three_short_edges_are_driven_rather_than_one_long_one() -> None:
    """From 0 to 3 there is an edge, and a way over 1 and 2: which is driven, and how long that takes, lengths say."""
    rest = {(0, 1): 4000, (1, 2): 5000, (2, 3): 6000}
    for direct_mm, expected in ((16000, [0, 1, 2, 3]), (14000, [0, 3])):
        site = made(Graph({**rest, (0, 3): direct_mm}), (0,), [(0, "any", (0, 3))])

        def check(said: Sequence[Timed], site: FactoryGraph = site, expected: list[int] = expected) -> None:
            way = way_of(said, R1)
            assert way == expected
            for start, end, from_us, to_us in legs(said, R1):
                took_ms = (to_us - from_us) // 1000
                assert abs(took_ms - site.graph.length_mm(start, end)) <= BESIDE_MS
            # What it bids is when it would be there: its way's length and two loadings behind the deadline.
            length_mm = sum(site.graph.length_mm(*ends) for ends in pairwise(way))
            call = first_of(said, CallForProposals)[1]
            assert first_of(said, Bid)[1].cost - call.deadline_ms == length_mm + 2 * site.load_ms

        shown_at(check, listen(site), RobotAt, CallForProposals, Bid)


def _some_lengths(seed: int) -> Graph:
    """A grid of two by four nodes, its corners joined, no two ways of one length."""
    chance = random.Random(seed)
    ends = [*grid(2, 4).lengths_mm, (0, 7)]
    return Graph({one: chance.randint(3000, 15000) for one in ends})


@pytest.mark.parametrize("seed", [1, 2])
def test_g12_a_robot_goes_to_its_list_and_along_it_by_the_shortest_ways(seed: int) -> None:
    """Every way between two stops of a list, as told, is as long as the shortest that trying all ways finds."""
    graph = _some_lengths(seed)
    site = made(graph, (0,), [(0, "R1", (6, 3, 5, 0, 7)), (0, "R1", (2, 4))])

    def check(said: Sequence[Timed]) -> None:
        lists = dict.fromkeys(one for _, one in said if isinstance(one, VisitList))
        stops = [stop for one in lists for stop in stops_of(one)]
        assert stops == [6, 3, 5, 0, 7, 2, 4], "as ordered"
        here, driven_mm = 0, 0
        ways: list[tuple[int, int]] = []
        for _, one in said:
            if not isinstance(one, RobotAt):
                continue
            if one.on_edge and (not ways or ways[-1] != (one.behind, one.node)):
                ways.append((one.behind, one.node))
                driven_mm += graph.length_mm(one.behind, one.node)
            elif one.robot_mode is RobotMode.LOADING and stops and one.node == stops[0] and not one.on_edge:
                assert driven_mm == least(graph.lengths_mm, NOWHERE, here, one.node, 60_000)
                here, driven_mm, ways = stops.pop(0), 0, []
        assert not stops

    shown_at(check, listen(site), VisitList, RobotAt)


# --- only on edges, and only forward ----------------------------------------------------------------------------------


def test_g03_robots_are_in_nodes_or_on_edges_and_come_from_one_to_the_next() -> None:
    """Four robots in a hall of nine nodes, more to do than they can: nobody is beside the graph, not even to pass."""
    site = made(hall(), (0, 4, 8, 2), busy_orders(hall(), 12, 2))
    said = listen(site)

    def check(said: Sequence[Timed]) -> None:
        where: dict[int, RobotAt] = {}
        since_us: dict[int, int] = {}
        loads: set[tuple[int, int]] = set()
        moves = 0
        for at_us, one in said:
            if not isinstance(one, RobotAt):
                continue
            if one.on_edge:
                assert edge(one.behind, one.node) in site.graph.lengths_mm
                assert not any(
                    other.on_edge and edge(other.behind, other.node) == edge(one.behind, one.node)
                    for robot, other in where.items()
                    if robot != one.sender
                ), "nobody passes anybody"
            before = where.get(one.sender)
            where[one.sender] = one
            if before is not None and (before.node, before.on_edge) != (one.node, one.on_edge):
                if one.on_edge:
                    assert one.behind == before.node, "onto an edge from the node at its end"
                    moves += 1
                else:
                    assert before.on_edge and one.node == before.node, "into the node at the edge's end"
                if before.on_edge:
                    length_mm = site.graph.length_mm(before.behind, before.node)
                    assert (at_us - since_us[one.sender]) // 1000 >= length_mm - BESIDE_MS, "by all of the edge"
                since_us[one.sender] = at_us
            if one.robot_mode is RobotMode.LOADING and not one.on_edge:
                loads.add((one.sender, one.node))
        done = {
            (one.sender, one.task) for _, one in said if isinstance(one, TaskReport) and one.phase is TaskPhase.DONE
        }
        calls = {one.task: one for _, one in said if isinstance(one, CallForProposals)}
        assert len(done) == len(calls) == 12 and moves > 30
        for robot, task in done:
            assert {(robot, calls[task].from_station), (robot, calls[task].to_station)} <= loads

    shown_at(check, said, RobotAt, TaskReport, CallForProposals)


#: Two who meet head-on in node 1: from 0 to 2 and back there is a long way round by 4; the third edge of 1 leads to 3.
MEETING = Graph({(0, 1): 6000, (1, 2): 6000, (1, 3): 3000, (0, 4): 20000, (2, 4): 20000, (3, 4): 30000})
MEET: list[Wanted] = [(0, "R1", (2,)), (0, "R2", (0,))]


@pytest.fixture(scope="module")
def meeting() -> list[Timed]:
    return listen(made(MEETING, (0, 2), MEET, Rules.PAPER))


def test_g09_who_is_sent_elsewhere_goes_round_rather_than_back(meeting: list[Timed]) -> None:
    """The way back would be much shorter: from 3 over 1 to its goal 9 m, round by 4 it is 50 m."""

    def check(messages: Sequence[Message]) -> None:
        said = [(0, one) for one in messages]
        sent = [one for one in messages if isinstance(one, NodeAnswer) and one.node_verdict is NodeVerdict.ANOTHER]
        assert [(one.node, one.after) for one in sent] == [(1, 3)]
        start, goal = {R1: (0, 2), R2: (2, 0)}[sent[0].robot]
        assert way_of(said, sent[0].robot) == [start, 1, 3, 4, goal]
        # Nor does anybody say that it wants to turn, or come into a node and out again by the same edge.
        signals = [one for one in messages if isinstance(one, TurnSignal)]
        assert {one.node for one in signals} >= {1, 3, 4} and all(one.after != one.behind for one in signals)

    shown(check, [one for _, one in meeting], NodeAnswer, RobotAt, TurnSignal)


def test_g02_nobody_comes_out_of_a_node_with_one_edge(
    meeting: list[Timed], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A site that has one is turned away; were it run, who is sent there would stay there."""
    joined = made(MEETING, (0, 2), MEET, Rules.PAPER)
    edges = {ends: mm for ends, mm in MEETING.lengths_mm.items() if ends != (3, 4)}
    file = tmp_path / "dead.toml"
    file.write_text(site_text(Graph(edges), (0, 2), MEET, Rules.PAPER), encoding="utf-8")
    assert main(["run", str(file)]) == 2
    told = capsys.readouterr().err
    assert "dead.toml:" in told and "3: a node with one edge; give it another" in told

    def check(messages: Sequence[Message], *, comes_out: bool) -> None:
        sent = next((one.robot for one in messages if isinstance(one, NodeAnswer) and one.after == 3), None)
        assert sent is not None
        last = [one for one in messages if isinstance(one, RobotAt) and one.sender == sent][-1:]
        assert [(one.node, one.robot_mode) for one in last] == (
            [({R1: 2, R2: 0}[sent], RobotMode.FREE)] if comes_out else [(3, RobotMode.DRIVING)]
        )
        done = {one.sender for one in messages if isinstance(one, TaskReport) and one.phase is TaskPhase.DONE}
        assert done == ({R1, R2} if comes_out else {R1, R2} - {sent})

    dead = replace(joined, edges=tuple((*ends, mm) for ends, mm in sorted(edges.items())))
    stays = [one for _, one in listen(dead, limit_s=200)]
    shown(lambda said: check(said, comes_out=False), stays, NodeAnswer, RobotAt, TaskReport)
    shown(lambda said: check(said, comes_out=True), [one for _, one in meeting], NodeAnswer, RobotAt, TaskReport)


def test_g15_who_is_told_go_goes_and_stop_stays_and_another_edge_is_taken(meeting: list[Timed]) -> None:
    """All three answers to two robots that meet, and what each then does: onto the edge named, or nowhere."""

    def check(messages: Sequence[Message]) -> None:
        answered: dict[int, NodeAnswer] = {}
        asked: dict[int, TurnSignal] = {}
        heard = set()
        went = []
        for one in messages:
            match one:
                case TurnSignal():
                    asked[one.sender] = one
                case NodeAnswer():
                    assert one.robot in asked, "whoever is answered has asked"
                    signal = asked[one.robot]
                    is_as_asked = (one.node, one.after) == (signal.node, signal.after)
                    assert is_as_asked is (one.node_verdict is not NodeVerdict.ANOTHER)
                    answered[one.robot] = one
                    heard.add(one.node_verdict)
                case RobotAt() if one.on_edge:
                    assert one.sender in answered, "nobody goes before it has an answer"
                    answer = answered[one.sender]
                    if one.behind != asked[one.sender].node:
                        continue
                    assert answer.node_verdict is not NodeVerdict.STOP
                    assert (one.behind, one.node) == (answer.node, answer.after)
                    went.append((one.sender, one.node))
        assert heard == set(NodeVerdict)
        assert len(dict.fromkeys(went)) == 6

    shown(check, [one for _, one in meeting], TurnSignal, NodeAnswer, RobotAt)


# --- who goes, and how many ------------------------------------------------------------------------------------------


def test_g28_of_the_free_robots_the_nearest_as_told_on_the_bus_has_the_order() -> None:
    """Where robots say they are and what they do, before a call: the one that is free and nearest to it has it."""
    orders: list[Wanted] = [(0, "any", (7, 6)), (60, "any", (1, 2)), (100, "R2", (0, 6, 8)), (102, "any", (3, 4))]
    site = made(hall(), (0, 8), orders)

    def check(messages: Sequence[Message]) -> None:
        where: dict[int, RobotAt] = {}
        calls: dict[Reference, tuple[CallForProposals, dict[int, int]]] = {}
        bids: dict[Reference, list[int]] = {}
        open_calls: dict[tuple[int, int], Reference] = {}
        won = []
        for one in messages:
            match one:
                case RobotAt():
                    where[one.sender] = one
                case CallForProposals() if one.operation is Operation.TRANSPORT:
                    free = {robot: at for robot, at in where.items() if at.robot_mode is RobotMode.FREE}
                    far = {
                        robot: site.graph.distance_mm(NOWHERE, at.node, one.from_station) or 0
                        for robot, at in free.items()
                    }
                    calls[one.task] = (one, far)
                    open_calls[one.sender, one.call] = one.task
                case Bid():
                    assert (one.initiator, one.call) in open_calls
                    task = open_calls[one.initiator, one.call]
                    bids.setdefault(task, []).append(one.sender)
                    call, far = calls[task]
                    if one.sender in far and len(far) == len(where):
                        loaded_mm = site.graph.distance_mm(NOWHERE, call.from_station, call.to_station) or 0
                        way_ms = far[one.sender] + loaded_mm  # a metre a second
                        assert one.cost - call.deadline_ms == way_ms + 2 * site.load_ms
                case Award():
                    assert bids.keys() >= {one.task} and calls[one.task][1], "of those that told where they are"
                    far = calls[one.task][1]
                    assert one.winner == min(far, key=lambda robot: far[robot])
                    assert bids[one.task][-1] == one.winner
                    won.append((one.winner, len(far)))
                case _:
                    pass
        # Near 7 it is R2, near 1 R1, and near 3 the one that has nothing to do though the other is nearer.
        assert list(dict.fromkeys(won)) == [(R2, 2), (R1, 2), (R1, 1)]

    shown(check, [one for _, one in listen(site)], RobotAt, CallForProposals, Bid, Award)


def test_p04_ten_calls_of_one_desk_at_once_end_as_they_do_one_after_the_other() -> None:
    """Ten robots in a hall of 25 nodes; orders, shuffled, from where each of them stands to a node beside it."""
    homes = tuple(range(0, 25, 5)) + tuple(range(4, 25, 5))
    wanted = [(node, node + (1 if node % 5 == 0 else -1)) for node in homes]
    random.Random(4).shuffle(wanted)

    def winners(messages: Sequence[Message], at_once: int) -> dict[tuple[int, int], int]:
        """Who has which task, by where it begins and ends; so many calls must have stood at one moment."""
        standing: dict[tuple[int, int], CallForProposals] = {}
        bids: dict[int, list[tuple[int, int]]] = {}
        won: dict[tuple[int, int], int] = {}
        most = 0
        for one in messages:
            match one:
                case CallForProposals():
                    standing[one.sender, one.call] = one
                    most = max(most, len(standing))
                case Bid():
                    bids.setdefault(one.call, []).append((one.cost, one.sender))
                case Award() if (call := standing.pop((one.sender, one.call), None)) is not None:
                    assert one.call in bids and one.winner == min(bids[one.call])[1]
                    won[call.from_station, call.to_station] = one.winner
                case _:
                    pass
        assert most == at_once
        return won

    def said(every_s: int) -> list[Message]:
        orders: list[Wanted] = [(every_s * number, "any", stops) for number, stops in enumerate(wanted)]
        return [one for _, one in listen(made(grid(5, 5, 6000), homes, orders, capacity=10), limit_s=14 + 10 * every_s)]

    serially = winners(said(2), 1)
    assert serially == {(home, other): R1 + homes.index(home) for home, other in wanted}

    def check(messages: Sequence[Message]) -> None:
        assert winners(messages, 10) == serially

    shown(check, said(0), CallForProposals, Bid, Award)


def test_g30_the_number_that_is_proposed_does_most_on_the_bus(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of one to three robots that always have a next goal three do most: as much on the bus as the proposal says."""
    graph, chance, for_s = complete(4, 12000), random.Random(30), 140

    def text(robots: int) -> str:
        """Each robot visits all nodes again and again, in an order that is drawn, none twice in turn."""
        orders: list[Wanted] = []
        for robot in range(robots):
            here = robot
            for number in range(4):
                others = [node for node in graph.nodes if node != here]
                stops = [chance.choice(others)]
                stops += chance.sample([node for node in graph.nodes if node not in stops], 3)
                here = stops[-1]
                orders.append((50 * number, f"R{robot + 1}", tuple(stops)))
        return site_text(graph, tuple(range(robots)), orders, Rules.PAPER).replace("load_ms = 2000", "load_ms = 5000")

    file = tmp_path / "three.toml"
    file.write_text(text(3), encoding="utf-8")
    assert main(["certify", str(file), "--up-to", "3", "--jobs", "1"]) == 0
    lines = capsys.readouterr().out.splitlines()
    table = [line.split() for line in lines[-4:-1]]
    assert [words[:2] for words in table] == [["1", "yes"], ["2", "yes"], ["3", "yes"]]
    assert lines[-1].startswith("proposed: 3 robots")
    for robots, words in enumerate(table, start=1):
        site = parse_site(text(robots), "made.toml")
        assert isinstance(site, FactoryGraph)

        def check(said: Sequence[Timed], robots: int = robots, measured: float = float(words[2])) -> None:
            """Whoever begins to load has come to a goal: so many goals an hour, from its first to its last."""
            modes: dict[int, RobotMode] = {}
            at_goal: dict[int, list[int]] = {}
            for at_us, one in said:
                if isinstance(one, RobotAt):
                    if one.robot_mode is RobotMode.LOADING is not modes.get(one.sender):
                        at_goal.setdefault(one.sender, []).append(at_us)
                    modes[one.sender] = one.robot_mode
            assert len(at_goal) == robots
            per_hour = sum(3.6e9 * (len(times) - 1) / (times[-1] - times[0]) for times in at_goal.values())
            assert abs(per_hour - measured) < measured / 10

        shown_at(check, listen(site, limit_s=for_s), RobotAt)
