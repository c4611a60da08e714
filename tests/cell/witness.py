"""The witness geometry of the paper's printed run (Panescu, Miron 2006, Fig. 5): 1 in the paper is 1 m here."""

from onboard.contract.messages import Reference
from onboard.systems.cell.contracts import Arm, Goal
from onboard.systems.cell.geometry import Area, Point

_ROBOTS = (
    ((2, 4, 22, 16), (8, 11)),
    ((22, 0, 42, 18), (39, 3)),
    ((30, 18, 46, 34), (34, 22)),
    ((4, 16, 18, 34), (6, 30)),
    ((18, 20, 30, 36), (20, 34)),
)
DESK = 9


def metres(x: int, y: int) -> Point:
    """A point by its coordinates in m."""
    return Point(1000 * x, 1000 * y)


def arm(node: int, area: tuple[int, int, int, int], home: tuple[int, int], unit_cost: float = 1.0) -> Arm:
    """A robot by metres."""
    return Arm(node, f"R{node}", Area(*(1000 * value for value in area)), metres(*home), unit_cost)


ARMS = tuple(arm(number, area, home) for number, (area, home) in enumerate(_ROBOTS, 1))
HOMES = {one.node_id: one.home for one in ARMS}
GOAL = Goal(Reference(DESK, 1), Reference(DESK, 7), metres(10, 10), metres(40, 30))
