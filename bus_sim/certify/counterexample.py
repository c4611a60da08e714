"""A counterexample as a file, and playing it: the rules judge each step again, and at the end nobody has a move."""

import json
from pathlib import Path

from bus_sim.certify.model import Model, Move, State
from bus_sim.certify.search import Stuck
from bus_sim.sites import SiteNotFoundError
from onboard.kinds.graph.network import Graph, edge
from onboard.kinds.graph.rules import Rules


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


def play_file(file: Path) -> int:
    """Play a file: 0 where every step is allowed and nobody can move at the end, else 1.

    Raises ``SiteNotFoundError`` with one line for a file that cannot be read.
    """
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
        graph = Graph({edge(one, other): length for one, other, length in content["edges"]})
        model = Model(graph, Rules(content["rules"]), int(content["capacity"]))
        state = model.start(tuple(content["starts"]), tuple(content["goals"]))
        moves = [Move(int(robot), str(word), int(node)) for robot, word, node in content["moves"]]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise SiteNotFoundError(f"{file}: no counterexample ({error}); write one with --counterexample") from error
    after = replay(model, state, moves)
    if after is None or model.moves(after) or model.is_over(after):
        print("the file does not end where all are stuck")
        return 1
    print("nobody can move: stuck")
    return 0


def replay(model: Model, state: State, moves: list[Move]) -> State | None:
    """The state after these moves, each printed; None where the rules do not allow one of them."""
    for number, move in enumerate(moves, start=1):
        allowed = dict(model.moves(state))
        if move not in allowed:
            print(f"{number:3}. R{move.robot + 1} {move.word} N{move.node}: not allowed by the rules")
            return None
        state = allowed[move]
        print(f"{number:3}. R{move.robot + 1} {move.word} N{move.node}")
    return state
