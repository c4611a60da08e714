"""The states of a search, numbered as they are asked for: safe intervals for standing, and the moves from them."""

from collections.abc import Iterable

from onboard.core.site import Segment
from onboard.ways.departures import Departures
from onboard.ways.reservations import FOREVER, Interval

#: A move that leads from one state to another if it departs during ``[first, last)``: first, last, until, duration, the
#: number of the state that it leads to, what the carrier drives in mm (nothing on a lift), is safe. It pays to make it
#: only while one stands here before ``until``. Departures are bounds, some may be safe at most, unless all are. A plain
#: tuple of integers: thousands are kept, and what refers to nothing else the collector of garbage leaves alone.
Edge = tuple[int, int, int, int, int, int, bool]
#: What is left of a bound that was looked at.
NO_EDGE: Edge = (0, 0, 0, 0, 0, 0, True)


class State:
    """A safe interval ``[from_us, to_us)`` for standing at a position; its number is its place among all states."""

    __slots__ = ("edges", "from_us", "number", "segment", "since_us", "to_goals", "to_us")

    def __init__(self, number: int, segment: Segment, from_us: int, to_us: int) -> None:
        self.number = number
        self.segment = segment
        self.from_us = from_us
        self.to_us = to_us
        #: Edges hold for whoever stands here at ``since_us`` or later; those to goals by the goals' own set.
        self.since_us = FOREVER
        # Most states are never asked for any.
        self.edges: list[Edge] | None = None
        self.to_goals: dict[frozenset[Segment], list[Edge]] | None = None


def number_on(numbered: list[State], segment: Segment, safe: Iterable[Interval]) -> list[State]:
    """The states of a position's safe intervals, in order; they join those that are ``numbered`` already."""
    found = [State(number, segment, *interval) for number, interval in enumerate(safe, start=len(numbered))]
    numbered += found
    return found


class States(dict[Segment, list[State]]):
    """The states of each position around the reservations of ``departures``; worked out when asked for.

    It knows nothing of who asks, so all that is kept of a search goes as soon as nobody needs it: what refers to itself
    would stay until the collector of garbage has gone through everything that a machine knows.
    """

    def __init__(self, departures: Departures) -> None:
        super().__init__()
        #: All states that were asked for, by their numbers.
        self.numbered: list[State] = []
        self._departures = departures

    def __missing__(self, segment: Segment) -> list[State]:
        found = self[segment] = number_on(self.numbered, segment, self._departures.standing(segment))
        return found
