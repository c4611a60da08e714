"""The plan that is carried out if a bid wins, worked out while the call is still open, a slice at a time.

An award is answered at once, however slow the board: nothing is left to be searched then unless others have planned
otherwise in the last moment.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

from onboard.contract.messages import CallForProposals
from onboard.core.negotiation import CallKey
from onboard.systems.car_park.alternatives import Solution
from onboard.ways.effort import Effort, Search

#: Most bids of one machine that stand best at a time; what came of older ones was not asked for.
_MOST = 8


def key_of(call: CallForProposals) -> CallKey:
    """What all frames of one call share."""
    return CallKey(call.sender, call.call)


class Checked(NamedTuple):
    """A solution, and whether it still holds at a time, bus us."""

    solution: Solution
    stands: Callable[[int], bool]


@dataclass
class Ahead:
    """Of one robot, for each bid of its that stands best, by call."""

    effort: Effort
    _found: dict[CallKey, list[Checked]] = field(default_factory=dict)
    _searches: dict[CallKey, Search[Checked | None]] = field(default_factory=dict)
    _due_us: int = 0

    def begin(self, key: CallKey, promised: Checked, search: Search[Checked | None], now_us: int) -> None:
        """Begin to search for what is better than, or instead of, what was promised."""
        self._found[key], self._searches[key], self._due_us = [promised], search, now_us + 1
        while len(self._found) > _MOST:
            self.end(next(iter(self._found)), now_us)

    def end(self, key: CallKey, now_us: int) -> Solution | None:
        """The bid is won, or lost: what was found last and still holds, None for nothing."""
        self._searches.pop(key, None)
        holding = [one.solution for one in self._found.pop(key, ()) if one.stands(now_us)]
        return holding[-1] if holding else None

    def go_on(self, now_us: int) -> None:
        """A slice of the first search that is not over."""
        if now_us < self._due_us or not self._searches:
            return
        key = next(iter(self._searches))
        over = self.effort.slice(self._searches[key], now_us)
        self._due_us = now_us + 1
        if over is not None:
            del self._searches[key]
            self._found[key] += [one for one in over if one is not None]

    def next_wake(self) -> int | None:
        """When there is a slice to be done, bus us."""
        return self._due_us if self._searches else None
