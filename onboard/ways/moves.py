"""What the search of ``onboard.ways.sipp`` asks of where machines move: least times, and moves around reservations.

``Roads`` and ``Edges`` answer for carriers that run along tracks from rest to rest; a floor of cells answers for robots
that move one step at a time (``onboard.ways.steps``).
"""

from typing import Protocol

from onboard.core.site import Segment
from onboard.ways.states import Edge, State


class TimesToGoals(Protocol):
    """Least times to any of some goals."""

    def to_us(self, origin: Segment) -> int:
        """Least time from a position with nobody in the way; FOREVER without a way."""


class Ground(Protocol):
    """What is true whoever else moves."""

    def ways_us(self, goals: frozenset[Segment]) -> TimesToGoals:
        """Least times to any of ``goals``, never more than what moves take in all."""

    def shortest_us(self, origin: Segment, goal: Segment) -> int:
        """Least time between two positions; FOREVER without a way."""

    def lift_at(self, position: Segment) -> tuple[int, int] | None:
        """Lift track and lift index where a position is a platform, else None."""


class Moves(Protocol):
    """States, which are safe intervals of positions, and moves between them."""

    numbered: list[State]

    def states(self, segment: Segment) -> list[State]:
        """The safe intervals for standing at a position, in order."""

    def state_at(self, segment: Segment, time_us: int) -> State | None:
        """The state of standing at a position at a time, or None."""

    def edges(self, state: State, from_us: int) -> list[Edge]:
        """Moves from a state for departures from ``from_us`` on, in a fixed order."""

    def to_goals(self, state: State, goals: frozenset[Segment]) -> list[Edge]:
        """Moves to ``goals`` that are not among ``edges``."""

    def looked_at(self, here: State, edge: Edge) -> list[Edge]:
        """What a move that is only a bound comes to."""
