"""The cell's plan: working areas, obstacles, robots and parts, contracts as the ways that their winners will go."""

from dataclasses import dataclass

from onboard.contract.cell import ArmPhase, ArmProgress
from onboard.contract.codes import TaskPhase
from onboard.contract.messages import Message, Reference
from onboard.history.history import Fact
from onboard.history.tasks import TaskTold
from onboard.systems.cell.history import ArmTold, MoveTold, PartTold, cell_history
from onboard.systems.cell.site import Area, Cell
from onboard.trace.scene.scene import Json, Spot, shape, still
from onboard.trace.view import SiteView

#: Plan units across the cell, and around it.
WIDTH, MARGIN = 1000.0, 20.0
_MOVING = (ArmPhase.TO_PART, ArmPhase.CARRYING)


@dataclass
class _SeenArm:
    """One robot's last two words on where it is, in mm and us."""

    at: Spot
    since_us: int = 0
    phase: ArmPhase = ArmPhase.IDLE
    speed: Spot = (0.0, 0.0)
    path: list[list[float]] | None = None


class CellScene:
    """Fed beside ``view``, which knows the calls."""

    def __init__(self, site: Cell, view: SiteView) -> None:
        self.site = site
        self.view = view
        self.words = view.words
        areas = [arm.area for arm in site.arms.values()] + list(site.obstacles)
        self._x0, self._y1 = min(one.x0_mm for one in areas), max(one.y1_mm for one in areas)
        span_mm = max(one.x1_mm for one in areas) - self._x0
        self._scale = (WIDTH - 2 * MARGIN) / max(1, span_mm)
        self._height = 2 * MARGIN + (self._y1 - min(one.y0_mm for one in areas)) * self._scale
        self._robots = {node: _SeenArm((float(arm.home.x_mm), float(arm.home.y_mm))) for node, arm in site.arms.items()}
        self._seen = cell_history(view.history)
        #: What each robot has undertaken: from where, and to where it brings the part, by goal.
        self._moves: dict[int, dict[tuple[int, int], tuple[Spot, Spot | None]]] = {}

    def _spot(self, at: Spot) -> Spot:
        return MARGIN + (at[0] - self._x0) * self._scale, MARGIN + (self._y1 - at[1]) * self._scale

    def _corners(self, area: Area) -> list[Spot]:
        return [self._spot((area.x0_mm, area.y1_mm)), self._spot((area.x1_mm, area.y0_mm))]

    def layout(self) -> Json:
        """Areas by their robots' names, and obstacles."""
        shapes = [shape(f"a{node}", "area", arm.name, self._corners(arm.area)) for node, arm in self.site.arms.items()]
        shapes += [
            shape(f"o{number}", "obstacle", "", self._corners(area)) for number, area in enumerate(self.site.obstacles)
        ]
        return {"plan": {"width": WIDTH, "height": self._height, "shapes": shapes}}

    def take(self, message: Message, fact: Fact | None, time_us: int) -> None:
        """Follow arms, goals and parts for the plan."""
        match fact:
            case ArmTold(word=word) if word.sender in self._robots:
                self._on_progress(word, time_us)
            case PartTold(word=at, is_news=True):
                words = "has taken up" if at.aboard else "has" if fact.is_first else "has put down"
                self.view.say(time_us, f"{self.view.name(at.sender)} {words} {self.words.thing(at.part)}")
            case MoveTold():
                self._on_move(fact)
            case TaskTold(report=report) if report.phase in (TaskPhase.DONE, TaskPhase.REFUSED, TaskPhase.FORFEITED):
                self._moves.get(report.sender, {}).pop((report.task.origin, report.task.number), None)

    def _on_move(self, told: MoveTold) -> None:
        """From where comes first; where it was not heard, the part is drawn where it comes to."""
        moves, key = self._moves.setdefault(told.robot, {}), (told.manager, told.goal)
        if told.start is not None:
            moves[key] = told.start, None
        elif told.end is not None:
            moves[key] = moves.get(key, (told.end, None))[0], told.end

    def feed_device(self, node: int, message: Message, time_us: int) -> None:
        """The fleet bus tells all that is drawn."""

    def _on_progress(self, at: ArmProgress, time_us: int) -> None:
        """On the way it is taken to go on as from its last word to this one, for as long."""
        robot, here = self._robots[at.sender], (float(at.x_mm), float(at.y_mm))
        passed_us = time_us - robot.since_us
        was_moving, robot.phase = robot.phase in _MOVING, at.arm_phase
        if here == robot.at and at.arm_phase in _MOVING:
            robot.path = None
            robot.since_us = time_us if not was_moving else robot.since_us
            return
        step = (here[0] - robot.at[0], here[1] - robot.at[1])
        robot.at, robot.since_us = here, time_us
        robot.path = None
        if at.arm_phase in _MOVING and was_moving and passed_us > 0:
            ahead = (here[0] + step[0], here[1] + step[1])
            robot.path = [[*self._whole(here), time_us], [*self._whole(ahead), time_us + passed_us]]

    def _whole(self, at: Spot) -> Spot:
        x, y = self._spot(at)
        return round(x, 1), round(y, 1)

    def machine(self, node: int, now_us: int) -> Json:
        """Where an arm's tool is and which part it carries; a desk has neither."""
        robot = self._robots.get(node)
        if robot is None:
            return {"where": "", "car": None}
        carried = next((part for part, (_, carrier) in self._seen.parts.items() if carrier == node), None)
        doing = robot.phase.name.lower().replace("_", " ")
        told, ahead = [], []
        for (manager, goal), (start, end) in self._moves.get(node, {}).items():
            begin = self._seen.starts.get((manager, goal), start)
            if end is not None:
                ahead += [list(self._whole(begin)), list(self._whole(end))]
                told.append([None, f"carries from {_metres(begin)} to {_metres(end)} for {self.view.name(manager)}"])
        return {
            "where": f"{_metres(robot.at)}, {doing}",
            "car": str(carried.number) if carried is not None else None,
            "path": robot.path if robot.path is not None else still(self._spot(robot.at)),
            "ahead": ahead,
            "held": [],
            "told": told,
        }

    def marks(self, now_us: int) -> Json:
        """Parts where they lie, and where those goals end that are no sub-goals."""
        things: list[Json] = []
        for part, (at, carrier) in self._seen.parts.items():
            if not carrier:
                things.append({"kind": "part", "name": str(part.number), "at": list(self._whole(at))})
        for (manager, goal), end in self._seen.ends.items():
            task = self.view.tasks.get(Reference(manager, goal))
            if (
                manager in self.site.desks
                and task is not None
                and task.phase not in (TaskPhase.DONE, TaskPhase.REFUSED)
            ):
                things.append({"kind": "goal", "name": str(goal), "at": list(self._whole(end))})
        return {"marks": {}, "things": things}


def _metres(at: Spot) -> str:
    return f"({at[0] / 1000:.1f}, {at[1] / 1000:.1f}) m"


SCENE = CellScene
