"""A counterexample as a file, and playing it: the rules judge each step again, and at the end nobody has a move."""

import json
from pathlib import Path

from bus_sim.options import RunOptions
from bus_sim.sites import SiteNotFoundError
from bus_sim.systems.graph.certify.model import GraphModel, ModelMove, State
from bus_sim.systems.graph.certify.on_the_bus import STILL_US, TimedTaskSet, play_scene
from bus_sim.systems.graph.certify.search import Stuck
from onboard.bounded_file import read_bounded
from onboard.systems.graph.network import Graph, edge
from onboard.systems.graph.rules import Rules


def write_counterexample(file: Path, graph: Graph, rules: Rules, capacity: int, stuck: Stuck) -> None:
    """Write it as JSON, with all that playing it needs."""
    content = {
        "edges": [[*ends, length] for ends, length in sorted(graph.lengths_mm.items())],
        "rules": rules.value,
        "capacity": capacity,
        "starts": stuck.tasks.starts,
        "goals": stuck.tasks.goals,
        "moves": [list(move) for move in stuck.moves],
    }
    file.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def read_counterexample(file: Path) -> TimedTaskSet:
    """What a file holds. Raises ``SiteNotFoundError`` with one line for a file that cannot be read."""
    try:
        content = json.loads(read_bounded(file))
        graph = Graph({edge(one, other): length for one, other, length in content["edges"]})
        moves = tuple(ModelMove(int(robot), str(word), int(node)) for robot, word, node in content["moves"])
        scene = TimedTaskSet(
            graph,
            Rules(content["rules"]),
            int(content["capacity"]),
            tuple(map(int, content["starts"])),
            tuple(map(int, content["goals"])),
            moves,
        )
        # A node, start or goal that is none shows here.
        GraphModel(graph, scene.rules, scene.capacity).start(scene.starts, scene.goals)
        if not {*scene.starts, *scene.goals} <= {*graph.nodes} or any(
            not 0 <= m.robot < len(scene.starts) for m in moves
        ):
            raise ValueError("a robot or node that there is not")
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise SiteNotFoundError(f"{file}: no counterexample ({error}); write one with --counterexample") from error
    return scene


def play_file(file: Path) -> int:
    """Play a file by the rules alone: 0 where every step is allowed and nobody can move at the end, else 1.

    Raises ``SiteNotFoundError`` with one line for a file that cannot be read.
    """
    scene = read_counterexample(file)
    model = GraphModel(scene.graph, scene.rules, scene.capacity)
    after = replay(model, model.start(scene.starts, scene.goals), list(scene.moves))
    if after is None or model.moves(after) or model.is_over(after):
        print("the file does not end where all are stuck")
        return 1
    print("nobody can move: stuck")
    return 0


def play_on_bus(file: Path, rules: Rules | None, options: RunOptions) -> int:
    """Play a file on the virtual bus, under its own rules or others: 1 where robots stick, 0 where all arrive.

    Under ``edge-and-node`` every node has a slot for each robot. Raises ``SiteNotFoundError`` as ``play_file``, and
    ``ConfigError`` for a graph that no site can have.
    """
    scene = read_counterexample(file)
    if rules is not None:
        scene = scene.under(rules, len(scene.starts) if rules is Rules.EDGE_AND_NODE else scene.capacity)
    ending = play_scene(scene, options)
    print(f"{len(scene.starts)} robots on the bus, rules {scene.rules.value}: ", end="")
    print(f"{ending.played_moves} of {len(scene.moves)} moves of the timing came about")
    for name, where in ending.where.items():
        print(f"{name} is {where}")
    plant = ending.played.plant
    for violation in plant.violations:
        print(f"violation: {violation}")
    if ending.is_stuck:
        print(f"nobody has moved for {STILL_US // 1_000_000} s: stuck")
        return 1
    is_good = ending.played.is_good
    print("all came to their goals" if is_good else "not over")
    return 0 if is_good else 1


def replay(model: GraphModel, state: State, moves: list[ModelMove]) -> State | None:
    """The state after these moves, each printed; None where the rules do not allow one of them."""
    for number, move in enumerate(moves, start=1):
        allowed = dict(model.moves(state))
        if move not in allowed:
            print(f"{number:3}. R{move.robot + 1} {move.word} N{move.node}: not allowed by the rules")
            return None
        state = allowed[move]
        print(f"{number:3}. R{move.robot + 1} {move.word} N{move.node}")
    return state
