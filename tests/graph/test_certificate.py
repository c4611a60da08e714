"""Rows G02, G17 to G19, G21, G29, G30: all interleavings of the rules, certificates and counterexamples."""

import json
import random
from pathlib import Path

import pytest

from bus_sim.cli import main
from bus_sim.systems.graph.certify.certificate import certify, count_stuck, number_of_task_sets, sampled
from bus_sim.systems.graph.certify.model import GraphModel
from bus_sim.systems.graph.certify.search import DeadlockSearch, TaskSet, task_sets
from bus_sim.systems.graph.certify.throughput import Pace, measure
from onboard.systems.graph.network import Graph, complete, cube, edge, grid, ring
from onboard.systems.graph.rules import Rules
from tests.graph.brute_force import can_stick
from tests.thinned import some

#: SYSTEMS 2.4: graph, robots, task sets, and how many of them can stick with rule G21 off, on, and to the letter.
ROWS = [
    ("3x3 grid", grid(3, 3), 2, 2052, 32, 0, 60),
    ("Q3", cube(3), 2, 1204, 0, 0, 0),
    ("C5", ring(5), 2, 130, 5, 5, 15),
    ("C6", ring(6), 2, 315, 24, 23, 47),
    ("C8", ring(8), 2, 1204, 130, 129, 201),
    ("C6", ring(6), 3, 1420, 282, 318, 618),
    ("K4", complete(4), 2, 42, 0, 0, 0),
    ("K4", complete(4), 3, 44, 0, 0, 0),
    ("K5", complete(5), 3, 320, 0, 0, 0),
]


@pytest.mark.parametrize(
    ("graph", "robots", "sets", "off", "on", "letter"), [row[1:] for row in ROWS], ids=lambda one: ""
)
def test_g21_g29_the_exhaustive_rows_to_the_last_integer(
    graph: Graph, robots: int, sets: int, off: int, on: int, letter: int
) -> None:
    assert count_stuck(graph, robots, Rules.PAPER) == (sets, off)
    assert count_stuck(graph, robots, Rules.KEEP) == (sets, on)
    assert count_stuck(graph, robots, Rules.KEEP_ON_NOTICE) == (sets, letter)


#: Those that take seconds each: the usual run plays the first, which was in dispute.
LARGE_ROWS = [
    (grid(3, 3), 3, Rules.KEEP, 29904, 175),
    (grid(3, 3), 3, Rules.PAPER, 29904, 1580),
    (cube(3), 3, Rules.PAPER, 12712, 72),
    (cube(3), 3, Rules.KEEP, 12712, 0),
    (cube(3), 3, Rules.KEEP_ON_NOTICE, 12712, 0),
    (grid(3, 3), 3, Rules.KEEP_ON_NOTICE, 29904, 3440),
]


@pytest.mark.parametrize(("graph", "robots", "rules", "sets", "stuck"), some(LARGE_ROWS, 1), ids=lambda one: "")
def test_g21_g29_the_large_rows_to_the_last_integer(
    graph: Graph, robots: int, rules: Rules, sets: int, stuck: int
) -> None:
    assert count_stuck(graph, robots, rules) == (sets, stuck)


def test_g21_the_ring_where_the_rule_itself_sticks() -> None:
    tasks = TaskSet((0, 3), (2, 1))
    assert not DeadlockSearch(GraphModel(ring(6), Rules.PAPER)).can_stick(tasks)
    stuck = DeadlockSearch(GraphModel(ring(6), Rules.KEEP)).counterexample(tasks)
    assert stuck is not None
    assert [(move.robot, move.node) for move in stuck.moves] == [(0, 1), (1, 2)]
    assert {(robot.start, robot.node) for robot in stuck.state} == {(0, 1), (3, 2)}


def _some_graph(chance: random.Random) -> Graph:
    """A ring of 5 or 6 with chords: every node has two edges or more."""
    nodes = chance.choice((5, 6))
    lengths = {edge(node, (node + 1) % nodes): 1 for node in range(nodes)}
    for _ in range(chance.randint(1, 3)):
        lengths[edge(*chance.sample(range(nodes), 2))] = 1
    return Graph(lengths)


@pytest.mark.parametrize("seed", range(6))
def test_g29_a_search_of_its_own_agrees_on_other_graphs(seed: int) -> None:
    chance = random.Random(seed)
    graph = _some_graph(chance)
    edges = frozenset(frozenset(ends) for ends in graph.lengths_mm)
    for rules in (Rules.PAPER, Rules.KEEP, Rules.KEEP_ON_NOTICE):
        search = DeadlockSearch(GraphModel(graph, rules))
        for robots, most in ((2, 60), (3, 40)):
            every = list(task_sets(graph, robots))
            for tasks in chance.sample(every, most):
                expected = can_stick(edges, *tasks, rule=rules.value)
                assert search.can_stick(tasks) == expected, (graph, rules, tasks)


@pytest.mark.parametrize(
    ("graph", "robots", "rules", "certified"),
    [
        (ring(6), 2, Rules.PAPER, False),
        (ring(6), 2, Rules.KEEP, False),
        (grid(3, 3), 3, Rules.PAPER, False),
        (grid(3, 3), 3, Rules.KEEP, False),
        (complete(4), 3, Rules.PAPER, True),
        (grid(3, 3), 2, Rules.KEEP, True),
    ],
)
def test_g24_g29_what_is_certified_and_what_is_not(graph: Graph, robots: int, rules: Rules, *, certified: bool) -> None:
    found = certify(graph, robots, rules, 1)
    assert found.certified is certified
    if not certified:
        # The counterexample is one: all moves are allowed, one after the other, and then nobody has one.
        assert found.stuck is not None
        model = GraphModel(graph, rules)
        state = model.start(*found.stuck.tasks)
        for move in found.stuck.moves:
            state = dict(model.moves(state))[move]
        assert not model.moves(state)
        assert not model.is_over(state)


def test_g29_sampled_task_sets_are_the_same_every_time_and_judged_as_by_a_search_of_its_own() -> None:
    graph, sample = grid(3, 3), (12, 7)
    drawn = sampled(graph, 4, *sample)
    assert drawn == sampled(graph, 4, *sample) != sampled(graph, 4, 12, 8)
    assert len(set(drawn)) == 12
    edges = frozenset(frozenset(ends) for ends in graph.lengths_mm)
    for rules in (Rules.PAPER, Rules.KEEP, Rules.KEEP_ON_NOTICE):
        expected = sum(can_stick(edges, *tasks, rule=rules.value) for tasks in drawn)
        assert count_stuck(graph, 4, rules, sample=sample) == (12, expected)


def test_g02_a_dead_end_is_not_certified() -> None:
    found = certify(Graph({(0, 1): 1, (1, 2): 1, (0, 2): 1, (2, 3): 1}), 1, Rules.EDGE_AND_NODE, 4)
    assert found.certified is False
    assert "N3" in found.reason


@pytest.mark.parametrize(("graph", "robots"), [(ring(5), 3), (grid(3, 3), 2), (complete(4), 3), (ring(6), 3)])
def test_g29_an_edge_with_its_node_never_sticks(graph: Graph, robots: int) -> None:
    # The certificate has an argument for it; the search through all timings confirms the argument.
    assert count_stuck(graph, robots, Rules.EDGE_AND_NODE, capacity=robots)[1] == 0
    assert certify(graph, robots, Rules.EDGE_AND_NODE, robots).certified
    # With one slot a node too few robots find room: the search says so.
    assert count_stuck(graph, robots, Rules.EDGE_AND_NODE, capacity=1)[1] > 0


def test_g29_a_search_that_is_too_large_is_not_called_certified() -> None:
    found = certify(complete(5), 3, Rules.PAPER, 1, limit=50)
    assert found.certified is None
    assert "50 states" in found.reason


def test_g30_the_best_number_of_robots_is_measured_and_certified(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["certify", "grid:3x3", "--robots", "2", "--rules", "keep", "--up-to", "3", "--jobs", "1"]) == 0
    said = capsys.readouterr().out
    assert "deadlock-free under these rules" in said
    assert "proposed: 2 robots" in said  # three are not certified, and two do more than one
    one, two = (measure(GraphModel(grid(3, 3), Rules.KEEP), robots, Pace(1, 0.5)) for robots in (1, 2))
    assert one.per_hour < two.per_hour < 2 * one.per_hour
    assert one.stuck_at_s is two.stuck_at_s is None


def test_g30_robots_that_stick_have_no_throughput_afterwards() -> None:
    result = measure(GraphModel(ring(6), Rules.PAPER), 2, Pace(1, 0.5))
    assert result.stuck_at_s is not None
    assert result.stuck_at_s < 600


def test_g29_a_counterexample_is_written_and_played(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "stuck.json"
    options = ["--robots", "2", "--rules", "paper", "--up-to", "1", "--counterexample", str(file)]
    assert main(["certify", "ring:6", "--jobs", "1", *options]) == 1
    assert "not certified" in capsys.readouterr().out
    assert main(["certify", "--play", str(file)]) == 0
    assert "nobody can move" in capsys.readouterr().out
    content = json.loads(file.read_text())
    content["moves"].pop()
    file.write_text(json.dumps(content))
    assert main(["certify", "--play", str(file)]) == 1
    file.write_text("{}")
    assert main(["certify", "--play", str(file)]) == 2
    assert str(file) in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "word"),
    [(["ring:2"], "too small"), (["standard"], "no graph"), (["ring:6", "--robots", "7"], "--robots 7")],
)
def test_g29_a_mistake_in_the_command_line_is_one_line(
    arguments: list[str], word: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["certify", *arguments]) == 2
    error = capsys.readouterr().err
    assert word in error
    assert error.count("\n") == 1


def test_g29_stuck_task_sets_are_counted_on_any_graph(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["certify", "grid:3x3", "--robots", "2", "--count"]) == 1
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert lines[0] == ["grid:3x3,", "2", "robots:", "2052", "task", "sets"]
    assert lines[2:] == [["paper", "32"], ["keep", "0"], ["keep-on-notice", "60"], ["edge-and-node", "0"]]
    assert main(["certify", "graph", "--robots", "2", "--count", "--rules", "keep", "--sample", "50"]) in (0, 1)
    assert "50 of them drawn with seed 1" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["ring:12", "--robots", "4", "--count"], "4170375 task sets of 4 robots; draw some of them with --sample N"),
        (["ring:5", "--count", "--sample", "131"], "--sample 131: must be 1 to 130, as many as there are"),
        (["ring:5", "--sample", "10"], "--sample: only with --count"),
    ],
)
def test_g29_what_cannot_be_counted_is_one_line(
    words: list[str], line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["certify", *words]) == 2
    assert line in capsys.readouterr().err


@pytest.mark.parametrize("robots", [1, 2, 3, 4])
def test_g29_as_many_task_sets_are_told_as_there_are(robots: int) -> None:
    for graph in (ring(5), complete(4), grid(2, 3)):
        assert number_of_task_sets(graph, robots) == len(list(task_sets(graph, robots)))
