"""How many tasks an hour robots finish on a graph, by simulation (row G30): the rules of the certificate with time.

Every robot gets a new goal, drawn by chance, as soon as it has loaded at the last. Nothing is sent; ``bus-sim run`` has
the same rules on the bus.
"""

import random
from dataclasses import dataclass

from bus_sim.systems.graph.certify.model import GraphModel, ModelMove, ModelRobot, State
from onboard.systems.graph.network import NOWHERE


@dataclass(frozen=True)
class Pace:
    """Speed in mm/s and loading time in s, both above 0."""

    speed_mm_s: int = 1000
    load_s: float = 5.0


@dataclass(frozen=True)
class Throughput:
    """Tasks finished in ``hours``; ``stuck_at_s`` is when nobody could move any more, None for never."""

    tasks: int
    hours: float
    stuck_at_s: float | None

    @property
    def per_hour(self) -> float:
        """Tasks an hour over the whole time, the time after sticking included."""
        return self.tasks / self.hours


def measure(model: GraphModel, robots: int, pace: Pace, hours: float = 4.0, seed: int = 1) -> Throughput:
    """Let robots work for so many hours, or until they stick. Raises ``ValueError`` for more robots than nodes."""
    chance = random.Random(f"throughput {seed} {robots}")
    nodes = model.graph.nodes
    state: State = tuple(ModelRobot(NOWHERE, node, _goal(chance, nodes, node)) for node in chance.sample(nodes, robots))
    ready_s = [0.0] * robots
    now_s, done = 0.0, 0
    while now_s < hours * 3600:
        found = [(move, after) for move, after in model.moves(state) if ready_s[move.robot] <= now_s]
        if found:
            # Who has waited longest goes first; between "another edge" and its rivals chance decides (row G19).
            longest = min(ready_s[move.robot] for move, _ in found)
            move, state = chance.choice([one for one in found if ready_s[one[0].robot] == longest])
            ready_s[move.robot] = now_s + _lasts_s(model, move, state[move.robot], pace)
            if move.word == "arrives at":
                done += 1
                robot = ModelRobot(NOWHERE, move.node, _goal(chance, nodes, move.node))
                state = (*state[: move.robot], robot, *state[move.robot + 1 :])
            continue
        later = [time for time in ready_s if time > now_s]
        if not later:
            return Throughput(done, hours, now_s)
        now_s = min(later)
    return Throughput(done, hours, None)


def _goal(chance: random.Random, nodes: tuple[int, ...], here: int) -> int:
    return chance.choice([node for node in nodes if node != here])


def _lasts_s(model: GraphModel, move: ModelMove, robot: ModelRobot, pace: Pace) -> float:
    if move.word == "arrives at":
        return pace.load_s
    return 0.0 if move.word == "enters" else model.graph.length_mm(robot.start, robot.node) / pace.speed_mm_s
