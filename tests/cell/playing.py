"""Cells played in virtual time for tests, from the shipped site with other goals, robots or obstacles."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, TypeVar, cast

from bus_sim.options import RunOptions
from bus_sim.run import BusRun
from bus_sim.session import play
from bus_sim.sites import find_site
from bus_sim.systems.cell.plant import CellPlant, GoalEntry
from bus_sim.systems.cell.view import CellView
from bus_sim.systems.stage import SystemStage
from onboard.contract.codes import KindCode
from onboard.contract.messages import Message
from onboard.core.site import Machine, Segment
from onboard.systems.cell.contracts import Arm
from onboard.systems.cell.geometry import Area, Point
from onboard.systems.cell.robot import ArmRobot
from onboard.systems.cell.site import Cell, GoalDemand
from tests.cell.witness import ARMS, DESK, GOAL

M = TypeVar("M", bound=Message)


def cell(
    *goals: GoalDemand,
    arms: tuple[Arm, ...] = ARMS,
    obstacles: tuple[Area, ...] = (),
    desks: tuple[int, ...] = (DESK,),
) -> Cell:
    """A cell with these goals; by default the paper's robots, and nothing in the way."""
    site = find_site("cell")
    assert isinstance(site, Cell)
    machines = {one.node_id: Machine(one.node_id, one.name, KindCode.ARM, Segment(0, 0)) for one in arms}
    machines |= {node: Machine(node, f"GM{node}", KindCode.DESK, Segment(0, 0)) for node in desks}
    return replace(
        site,
        machines=dict(sorted(machines.items())),
        arms={one.node_id: one for one in arms},
        obstacles=obstacles,
        goals=goals or (GoalDemand(0, GOAL.start, GOAL.end),),
    )


class Scene:
    """A cell that was played to its end."""

    def __init__(self, site: Cell, prepare: Callable[[BusRun[Any]], None] | None = None, limit_s: float = 600) -> None:
        self.site = site
        self.view = CellView(site)

        def before(run: BusRun[Any]) -> None:
            run.observers.append(lambda message, _: self.view.feed(message))
            if prepare is not None:
                prepare(run)

        self.played: SystemStage[Any] = play(site, RunOptions(limit_s=limit_s), prepare=before)

    @property
    def plant(self) -> CellPlant:
        """The plant."""
        return cast("CellPlant", self.played.plant)

    @property
    def entries(self) -> list[GoalEntry]:
        """Orders at the counters."""
        return self.plant.entries

    def robot(self, node: int) -> ArmRobot:
        """A robot's behaviour as it is at the end."""
        behaviour = self.played.run.controllers[node].holon.behaviour
        assert isinstance(behaviour, ArmRobot)
        return behaviour

    def said(self, kind: type[M]) -> Iterator[tuple[int, M]]:
        """All messages of a class, with their times."""
        return ((time_us, message) for time_us, message in self.played.messages if isinstance(message, kind))

    def assert_sound(self) -> None:
        """Everybody was served or told why, nothing broke, nobody halted."""
        assert self.plant.violations == []
        assert self.played.halted == []
        assert self.played.is_over


def goal_demand(
    start: tuple[float, float], end: tuple[float, float], *, at_s: float = 0, within_s: int = 0
) -> GoalDemand:
    """A goal by metres and seconds."""
    one, other = (Point(round(1000 * x), round(1000 * y)) for x, y in (start, end))
    return GoalDemand(round(1000 * at_s), one, other, within_s * 1000)
