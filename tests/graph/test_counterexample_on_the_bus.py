"""Row G29: what the search finds stuck sticks on the bus as well, and edge-and-node grants never do."""

from pathlib import Path

import pytest

from bus_sim.cli import main
from bus_sim.options import RunOptions
from bus_sim.systems.graph.certify.certificate import certify
from bus_sim.systems.graph.certify.on_the_bus import TimedTaskSet, play_scene
from onboard.systems.graph.network import Graph, grid, ring
from onboard.systems.graph.rules import Rules


def scene_of(graph: Graph, robots: int, rules: Rules) -> TimedTaskSet:
    stuck = certify(graph, robots, rules, 1).stuck
    assert stuck is not None
    return TimedTaskSet(graph, rules, 1, *stuck.tasks, stuck.moves)


@pytest.mark.parametrize(
    ("graph", "robots", "rules"),
    [
        (ring(6), 2, Rules.PAPER),
        (ring(6), 2, Rules.KEEP),
        (ring(6), 3, Rules.PAPER),
        (grid(3, 3), 3, Rules.KEEP),
        (grid(3, 3), 2, Rules.KEEP_ON_NOTICE),
    ],
    ids=["ring", "ring-keep", "ring-of-three", "grid-keep", "grid-on-notice"],
)
def test_g29_a_counterexample_sticks_on_the_bus_and_not_with_edge_and_node(
    graph: Graph, robots: int, rules: Rules
) -> None:
    scene = scene_of(graph, robots, rules)
    ending = play_scene(scene, RunOptions(quiet=True, limit_s=600))
    assert ending.played_moves == len(scene.moves)
    assert ending.is_stuck
    assert ending.played.plant.violations == []
    assert list(ending.where.values()) != [f"in N{goal}" for goal in scene.goals]
    certified = play_scene(scene.under(Rules.EDGE_AND_NODE, robots), RunOptions(quiet=True, limit_s=600))
    assert not certified.is_stuck
    assert certified.played.is_good
    assert list(certified.where.values()) == [f"in N{goal}" for goal in scene.goals]


def test_g29_the_command_plays_a_counterexample_on_the_bus(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, log = tmp_path / "stuck.json", tmp_path / "stuck.log"
    options = ["--robots", "2", "--rules", "paper", "--up-to", "1", "--counterexample", str(file)]
    assert main(["certify", "ring:6", "--jobs", "1", *options]) == 1
    assert main(["certify", "--play", str(file), "--bus", "--trace", str(log)]) == 1
    said = capsys.readouterr().out
    assert "2 of 2 moves of the timing came about" in said
    assert "R1 is between N0 and N1" in said
    assert "stuck" in said
    assert log.read_text(encoding="utf-8")
    assert main(["certify", "--play", str(file), "--bus", "--rules", "edge-and-node"]) == 0
    assert "all came to their goals" in capsys.readouterr().out
    file.write_text('{"edges": [[0, 1, 1]], "rules": "paper", "capacity": 1, "starts": [7], "goals": [0], "moves": []}')
    assert main(["certify", "--play", str(file), "--bus"]) == 2
    assert str(file) in capsys.readouterr().err
