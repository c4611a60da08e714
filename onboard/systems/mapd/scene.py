"""The pick-up and delivery site's plan: its floor, robots from cell to cell along their paths, tasks that wait.

Its calls stand until somebody has picked their tasks up, and are awarded again and again until then: who has which task
is told to the view from here.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise

from onboard.contract.codes import CallResult
from onboard.contract.mapd import StepState
from onboard.contract.mapd_device import CartState
from onboard.contract.messages import CallForProposals, Message, Reference
from onboard.history.calls import CallAnswered, CallOpened, CallRepeated
from onboard.history.history import Fact
from onboard.systems.mapd.fields import NO_TASK
from onboard.systems.mapd.history import CellTold, TurnTold, mapd_history
from onboard.systems.mapd.site import FREE, Mapd
from onboard.trace.scene.arrange import arrange
from onboard.trace.scene.scene import Json, Spot, along, shape, still
from onboard.trace.view import SiteView

#: Plan units of a cell, and around all.
CELL, MARGIN = 40.0, 30.0
#: Tasks whose cells are remembered: the newest.
MOST_TASKS = 1024


@dataclass
class _SeenGridRobot:
    """Where a robot is, by step, its task, and how it is drawn."""

    cell: int
    step: int = 0
    task: int = NO_TASK
    won: int = NO_TASK
    loaded: bool = False
    bound_for: int = -1
    path: list[list[float]] = field(default_factory=list)


class MapdScene:
    """Fed beside ``view``, which is told of tasks here."""

    def __init__(self, site: Mapd, view: SiteView) -> None:
        self.site = site
        self.view = view
        self.words = view.words
        self._spots = _spots(site)
        self._robots = {node: _SeenGridRobot(cell, bound_for=cell) for node, cell in site.homes.items()}
        self._tasks: dict[int, CallForProposals] = {}
        for robot in self._robots.values():
            robot.path = still(self._spots[robot.cell])

    def layout(self) -> Json:
        """Of a map its free cells, blocked ones left out; of a network its cells as nodes and its ways as edges."""
        floor, shapes = self.site.floor, []
        if self.site.rows:
            half = CELL * 0.46
            for cell, (x, y) in self._spots.items():
                corners = [(x - half, y - half), (x + half, y + half)]
                kind = "endpoint" if cell in self.site.endpoints else "cell"
                shapes.append(shape(f"c{cell}", kind, floor.names[cell], corners))
        else:
            shapes += [
                shape(f"w{one}-{other}", "link", "", [self._spots[one], self._spots[other]])
                for one, ways in enumerate(floor.ways)
                for other in ways
                if one < other or one not in floor.ways[other]
            ]
            for cell, spot in self._spots.items():
                name = floor.names[cell] if cell in self.site.endpoints else ""
                shapes.append(shape(f"c{cell}", "node" if name else "point", name, [spot]))
        width = max(x for x, _ in self._spots.values()) + MARGIN
        height = max(y for _, y in self._spots.values()) + MARGIN
        return {"plan": {"width": width, "height": height, "shapes": shapes}}

    def take(self, message: Message, fact: Fact | None, time_us: int) -> None:
        """Follow robots, tasks and rounds for the plan."""
        match fact:
            case CallOpened() | CallRepeated():
                self._on_call(fact.call.terms, time_us)
            case TurnTold(word=word) if not word.won and word.robot in self._robots:
                self._on_change(word.robot, NO_TASK, time_us)
            case CallAnswered(award=award) if award.result is CallResult.AWARDED and award.winner in self._robots:
                self._on_change(award.winner, award.task.number, time_us)
            case CellTold(word=word):
                self._on_state(self._robots[word.sender], word, time_us)

    def _on_call(self, call: CallForProposals, time_us: int) -> None:
        if call.task.number in self._tasks:
            return
        self._tasks[call.task.number] = call
        if len(self._tasks) > MOST_TASKS:
            del self._tasks[next(iter(self._tasks))]
        ways = f"from {self.words.place(call.from_station)} to {self.words.place(call.to_station)}"
        self.view.say(time_us, f"{self._thing(call.task.number)}: {ways}")

    def _on_change(self, node: int, task: int, time_us: int) -> None:
        """What a robot had and has not picked up is anybody's again, unless another has won it in the same round."""
        robot = self._robots[node]
        if robot.won == task:
            return
        if robot.won != NO_TASK and not (robot.loaded and robot.task == robot.won):
            before = self.view.tasks.get(self._reference(robot.won))
            if before is not None and before.is_waiting and before.owner == node:
                self.view.history.tasks.own(self._reference(robot.won), 0)
        robot.won = task
        if task != NO_TASK:
            self.view.history.tasks.own(self._reference(task), node)
            self.view.say(time_us, f"{self.view.name(node)} wins {self._thing(task)}")

    def _on_state(self, robot: _SeenGridRobot, state: StepState, time_us: int) -> None:
        if state.cell not in self._spots:
            return
        if state.loaded and not robot.loaded:
            self.view.say(time_us, f"{self.view.name(state.sender)} has picked up {self._thing(state.task)}")
        if state.served and robot.task != NO_TASK:
            self.view.end(self._reference(robot.task), time_us)
            self.view.say(time_us, f"{self.view.name(state.sender)} has delivered {self._thing(robot.task)}")
        self._go(robot, state.cell, time_us)
        robot.cell, robot.step, robot.task, robot.loaded = state.cell, state.step, state.task, state.loaded

    def feed_device(self, node: int, message: Message, time_us: int) -> None:
        """A body says where it is going before its controller says that it has come."""
        robot = self._robots.get(node)
        if robot is not None and isinstance(message, CartState) and message.cell in self._spots:
            self._go(robot, message.cell, time_us)

    def _go(self, robot: _SeenGridRobot, cell: int, time_us: int) -> None:
        """To the next cell, unless it is on its way there already."""
        if cell == robot.bound_for:
            return
        ends = [self._spots[robot.bound_for], self._spots[cell]]
        robot.path = along(ends, time_us, time_us + self.site.travel_us)
        robot.bound_for = cell

    def machine(self, node: int, now_us: int) -> Json:
        """The cell where a robot is, its task and its way; nothing of the desk."""
        robot = self._robots.get(node)
        if robot is None:
            return {"where": "", "car": None}
        told = [] if robot.task == NO_TASK else [[None, f"{self._thing(robot.task)}, {self._ways(robot.task)}"]]
        return {
            "where": f"{self.words.place(robot.cell)}, step {robot.step}",
            "car": str(robot.task) if robot.loaded else None,
            "path": robot.path,
            "ahead": [[round(x, 1), round(y, 1)] for x, y in (self._spots[cell] for cell in self._ahead(node))],
            "held": [],
            "told": told,
        }

    def _ahead(self, node: int) -> Iterator[int]:
        """The cells of its path that a robot has not come to yet; incomplete, a path is not shown."""
        heard = mapd_history(self.view.history).paths.get(node)
        path = heard.path(self.site.floor) if heard is not None else None
        for (_, before), (step, cell) in pairwise(path.steps()) if path is not None else ():
            if step > self._robots[node].step and cell != before:
                yield cell

    def marks(self, now_us: int) -> Json:
        """Where tasks wait to be picked up."""
        aboard = {robot.task for robot in self._robots.values() if robot.loaded}
        things: list[Json] = []
        for number, call in self._tasks.items():
            record = self.view.tasks.get(self._reference(number))
            if record is not None and record.is_waiting and number not in aboard and call.from_station in self._spots:
                x, y = self._spots[call.from_station]
                things.append({"kind": "part", "name": str(number), "at": [round(x, 1), round(y, 1)]})
        return {"marks": {}, "things": things}

    def _reference(self, task: int) -> Reference:
        return Reference(self.site.desk, task)

    def _thing(self, task: int) -> str:
        return self.words.thing(self._reference(task))

    def _ways(self, task: int) -> str:
        call = self._tasks.get(task)
        if call is None:
            return "long called"
        return f"from {self.words.place(call.from_station)} to {self.words.place(call.to_station)}"


def _spots(site: Mapd) -> dict[int, Spot]:
    """Of a map its free cells, row by row; of a network its cells by the steps between them."""
    if site.rows:
        wide = len(site.rows[0])
        free = [mark in FREE for row in site.rows for mark in row]
        return {
            cell: (MARGIN + cell % wide * CELL, MARGIN + cell // wide * CELL)
            for cell, is_free in enumerate(free)
            if is_free
        }
    lengths = {(one, other): 1.0 for one, ways in enumerate(site.floor.ways) for other in ways}
    spots = arrange(lengths, list(range(site.floor.size)), CELL)
    return {cell: (x + MARGIN, y + MARGIN) for cell, (x, y) in spots.items()}


SCENE = MapdScene
