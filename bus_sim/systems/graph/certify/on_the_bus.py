"""A counterexample played on the bus: real robots and node agents, and drives as slow as the timing of it wants.

The certificate is about all timings, so no machine is told anything: only the plant keeps each robot before its next
approach sensor, and each order from its desk, until it is that robot's turn. When the timing has been played, or
cannot be, all drives are free; then either everybody comes to its goal, or nobody ever moves again.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from bus_sim.devices.link import BusDeviceLink
from bus_sim.devices.timers import Timers
from bus_sim.options import RunOptions
from bus_sim.session import play
from bus_sim.systems.graph.body import GraphRobotBody
from bus_sim.systems.graph.certify.model import ModelMove
from bus_sim.systems.graph.plant import GraphPlant
from bus_sim.systems.graph.simulated import SIMULATED
from bus_sim.systems.stage import SystemStage
from onboard.config.site import parse_site
from onboard.contract.graph import BodyPlace
from onboard.systems.graph.network import Graph
from onboard.systems.graph.rules import Rules
from onboard.systems.graph.site import FactoryGraph

#: The shortest edge of the hall that is played, mm: a graph without measures is made so large.
EDGE_MM = 6_000
#: Orders begin so long after power-up, us: the machines find each other first.
BEGIN_US = 10_000_000
#: A move that does not come about in this time is refused by the rules: then the timing cannot be played. Four signals
#: of a robot that waits, or the longest edge that is made here, fit in.
PATIENCE_US = 30_000_000
#: Nobody has moved for so long with all drives free: nobody ever will. Robots signal every 2 s.
STILL_US = 60_000_000
_HOST, _DESK, _FIRST_ROBOT = 1, 9, 21


@dataclass(frozen=True)
class TimedTaskSet:
    """A task set on a graph and a timing of it, under the rules that it is to be played with."""

    graph: Graph
    rules: Rules
    capacity: int
    starts: tuple[int, ...]
    goals: tuple[int, ...]
    moves: tuple[ModelMove, ...]

    def under(self, rules: Rules, capacity: int) -> "TimedTaskSet":
        """The same scene under other rules."""
        return replace(self, rules=rules, capacity=capacity)

    def site(self) -> FactoryGraph:
        """The hall: robot n has node-ID 20 + n; one host for all node agents. Raises ``ConfigError``."""
        lengths = self.graph.lengths_mm
        scale = max(1, -(-EDGE_MM // min(lengths.values())))
        edges = [[*ends, length * scale] for ends, length in sorted(lengths.items())]
        robots = "".join(
            f'[[robots]]\nname = "R{number}"\nnode = {_FIRST_ROBOT - 1 + number}\nat = {node}\n\n'
            for number, node in enumerate(self.starts, start=1)
        )
        text = (
            f'[site]\nsystem = "graph"\nname = "counterexample"\n\n[graph]\nrules = "{self.rules.value}"\n'
            f"capacity = {min(15, self.capacity)}\nload_ms = 1000\nedges = {edges}\n\n"
            f'[[hosts]]\nname = "Nodes"\nnode = {_HOST}\nnodes = {list(self.graph.nodes)}\n\n'
            f'[[desks]]\nname = "Desk"\nnode = {_DESK}\n\n{robots}'
        )
        for number, goal in enumerate(self.goals, start=1):
            text += f'[[orders]]\nrobot = "R{number}"\nvisit = [{goal}]\n\n'
        site = parse_site(text, "counterexample")
        assert isinstance(site, FactoryGraph)
        return site


class TimedPlant(GraphPlant):
    """A graph's plant that lets robots pass their sensors in the order of ``moves`` only, then all of them."""

    def __init__(
        self, site: FactoryGraph, timers: Timers, links: dict[int, BusDeviceLink], moves: Sequence[ModelMove]
    ) -> None:
        super().__init__(site, timers, links)
        self._moves = list(moves)
        self.played_moves = 0
        self.is_free = False
        self.moved_us = 0
        self._ordered: set[int] = set()
        self._since_us = BEGIN_US

    def start(self) -> None:
        """Power on; orders come when their robots' first moves are due."""
        for body in self.bodies.values():
            body.start()
        self.timers.call_at(BEGIN_US, self._next)
        self._look()

    @property
    def is_over(self) -> bool:
        """Whether all came to their goals, or nobody will ever move again."""
        return super().is_over or self.is_stuck

    @property
    def is_stuck(self) -> bool:
        """Whether all drives are free and nobody has moved for a long time."""
        still_us = self.timers.now_us() - max(self.moved_us, self._since_us)
        return self.is_free and still_us >= STILL_US and not super().is_over

    def holds(self, body: GraphRobotBody) -> bool:
        """It is not this robot's turn."""
        return not self.is_free and not (self._moves and self._robot(self._moves[0]) == body.machine.node_id)

    def check_onto(self, body: GraphRobotBody, start: int, end: int) -> None:
        """As ever; and this is a move."""
        super().check_onto(body, start, end)
        self.moved_us = self.timers.now_us()
        self._came_about(body, end)

    def check_into(self, body: GraphRobotBody) -> None:
        """As ever; at the goal this is a move."""
        super().check_into(body)
        self.moved_us = self.timers.now_us()
        if self._moves and self._moves[0].word == "arrives at":
            self._came_about(body, body.node)

    def _robot(self, move: ModelMove) -> int:
        return _FIRST_ROBOT + move.robot

    def _came_about(self, body: GraphRobotBody, node: int) -> None:
        if self.is_free:
            return
        if self._moves and (self._robot(self._moves[0]), self._moves[0].node) == (body.machine.node_id, node):
            self._moves.pop(0)
            self.played_moves += 1
            # Not from within the body's own step.
            self.timers.call_at(self.timers.now_us(), self._next)

    def _next(self) -> None:
        """Let the next robot of the timing go, or all of them."""
        self._since_us = self.timers.now_us()
        if not self._moves:
            self._free()
            return
        self._order(self._robot(self._moves[0]))
        self.bodies[self._robot(self._moves[0])].go_on()

    def _free(self) -> None:
        self.is_free = True
        self._since_us = self.timers.now_us()
        for node, body in self.bodies.items():
            self._order(node)
            body.go_on()

    def _order(self, node: int) -> None:
        if node not in self._ordered:
            self._ordered.add(node)
            self._come(next(iter(self.counters.values())), self.site.orders[node - _FIRST_ROBOT])

    def _look(self) -> None:
        """Once a second: a move that does not come about ends the timing."""
        now_us = self.timers.now_us()
        if not self.is_free and now_us > self._since_us + PATIENCE_US:
            self._free()
        self.timers.call_at(now_us + 1_000_000, self._look)


@dataclass(frozen=True)
class PlayEnding:
    """How it ended: ``played_moves`` of the timing came about; ``where`` is each robot's place in words, by name."""

    played: SystemStage[TimedPlant]
    played_moves: int
    is_stuck: bool
    where: dict[str, str] = field(default_factory=dict)


def play_scene(scene: TimedTaskSet, options: RunOptions) -> PlayEnding:
    """Play it on the virtual bus until it is over. Raises ``ConfigError`` for a graph that no site can have."""

    def make_plant(site: FactoryGraph, timers: Timers, links: dict[int, BusDeviceLink], _: int) -> TimedPlant:
        return TimedPlant(site, timers, links, scene.moves)

    played: SystemStage[TimedPlant] = play(scene.site(), options, system=replace(SIMULATED, plant=make_plant))
    plant = played.plant
    where = {body.machine.name: _place(body) for body in plant.bodies.values()}
    return PlayEnding(played, plant.played_moves, plant.is_stuck, where)


def _place(body: GraphRobotBody) -> str:
    if body.place is BodyPlace.IN_NODE:
        return f"in N{body.node}"
    return f"between N{body.behind} and N{body.node}"
