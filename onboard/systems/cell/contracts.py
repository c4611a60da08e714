"""Goals, robots and contracts of the cell, and what a robot would do for a goal (rows C06, C08, C12 to C16)."""

from dataclasses import dataclass
from enum import Enum

from onboard.contract.codes import TokenKind
from onboard.contract.messages import Reference
from onboard.core.serial import ms_after
from onboard.core.token_keys import TokenKey
from onboard.systems.cell.fields import FIRST_PATH
from onboard.systems.cell.geometry import Area, Point, shortest_way, way_length_m
from onboard.systems.cell.offers import OFFERS, OfferRule, via_points

#: A goal without a time limit.
NO_LIMIT = 0


def part_token(part: Reference) -> TokenKey:
    """The token of one part: its holder may touch it."""
    return TokenKey(TokenKind.CAR, part.origin << 16 | part.number)


@dataclass(frozen=True, slots=True)
class Arm:
    """A robot as the site file describes it (row C16): a point that works in ``area`` and starts at ``home``.

    ``unit_cost`` is the paper's C_j, per metre, above 0; ``speed_mm_s`` is above 0.
    """

    node_id: int
    name: str
    area: Area
    home: Point
    unit_cost: float = 1.0
    speed_mm_s: int = 1000


@dataclass(frozen=True, slots=True)
class Urgency:
    """Order among goals (row C15): the earlier time limit first, none last; then by name, alike on every robot."""

    time_limit_ms: int
    part: Reference

    def __lt__(self, other: "Urgency") -> bool:
        if (self.time_limit_ms == NO_LIMIT) != (other.time_limit_ms == NO_LIMIT):
            return other.time_limit_ms == NO_LIMIT
        return (ms_after(self.time_limit_ms, other.time_limit_ms), self.part) < (0, other.part)


@dataclass(frozen=True, slots=True)
class Goal:
    """Bring ``part`` from ``start`` to ``end`` (row C03). ``task`` is the goal's own name: its manager and a number.

    ``path`` are the robots that work on the goal already, the main contractor first: its length is the goal's level in
    the tree of contracts (row C11), and none deeper than ``deepest`` is called for. ``time_limit_ms`` is bus time,
    ``NO_LIMIT`` for none (row C14).
    """

    task: Reference
    part: Reference
    start: Point
    end: Point
    path: tuple[int, ...] = ()
    time_limit_ms: int = NO_LIMIT
    deepest: int = FIRST_PATH

    @property
    def level(self) -> int:
        """Depth in the tree of contracts, 0 for the goal manager's own."""
        return len(self.path)

    @property
    def urgency(self) -> "Urgency":
        """Rank among goals (row C15)."""
        return Urgency(self.time_limit_ms, self.part)

    def part_of(self, robot: int, number: int, via: Point) -> "Goal":
        """The sub-goal that ``robot`` makes of it when it puts the part down at ``via``."""
        task, path = Reference(robot, number), (*self.path, robot)
        return Goal(task, self.part, via, self.end, path, self.time_limit_ms, self.deepest)


class Filter(Enum):
    """Why a goal is not for a robot (rows C12, C13)."""

    PREDECESSOR = "works on it already"
    START = "start outside the working area"


def filtered(goal: Goal, arm: Arm) -> Filter | None:
    """The filter that keeps a goal from a robot, or None.

    Not sending a goal to predecessors loses nothing where areas are convex and paths do not go round (row C12).
    """
    if arm.node_id in goal.path:
        return Filter.PREDECESSOR
    return None if arm.area.contains(goal.start) else Filter.START


@dataclass(frozen=True, slots=True)
class ArmMove:
    """What one robot would do: come along ``approach`` to take the part, bring it along ``carry`` and put it down."""

    approach: tuple[Point, ...]
    carry: tuple[Point, ...]

    @property
    def via(self) -> Point:
        """Where the part is put down."""
        return self.carry[-1]

    def cost(self, arm: Arm) -> float:
        """C_j times L_j, L_j by initial, via and final point (the paper's expression 1, row C08)."""
        return arm.unit_cost * (way_length_m(self.approach) + way_length_m(self.carry))


@dataclass(frozen=True, slots=True)
class Contract:
    """A robot's offer for a goal (row C14): what it does itself, what the whole costs, and every robot involved."""

    goal: Goal
    node: int
    move: ArmMove
    own_cost: float
    cost: float
    nodes: tuple[int, ...]


def moves(
    goal: Goal, arm: Arm, position: Point, obstacles: tuple[Area, ...], rules: tuple[OfferRule, ...] = OFFERS
) -> tuple[ArmMove, ...]:
    """What a robot standing at ``position`` can do for a goal: all of it, else up to three parts of it (row C06).

    One move that ends at the goal where the robot reaches it; else one for each offer; empty where it can do nothing.
    """
    if filtered(goal, arm) is not None:
        return ()
    approach = shortest_way(position, goal.start, arm.area, obstacles)
    if approach is None:
        return ()
    whole = shortest_way(goal.start, goal.end, arm.area, obstacles)
    if whole is not None:
        return (ArmMove(approach, whole),)
    ways = (
        shortest_way(goal.start, via, arm.area, obstacles)
        for via in via_points(arm.area, goal.start, goal.end, obstacles, rules)
    )
    return tuple(ArmMove(approach, way) for way in ways if way is not None)
