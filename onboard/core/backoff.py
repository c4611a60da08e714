"""When what waits for an answer is said again: soon at first, then ever later up to a bound (rule 10 of the protocol).

Speaking hurries nobody: a holder remembers the request, and a grant's receiver that was away asks when it is back.
"""

from collections.abc import Hashable
from dataclasses import dataclass, field

#: So many repeats come at the quick pace: they bridge lost frames.
QUICK = 3
#: The longest time between two repeats of one thing, in token repeats: 5 s at the default of 200 ms.
LONGEST_REPEATS = 25
#: The same for what is asked for without an agreed order: the oldest petition keeps all younger ones back.
UNORDERED_REPEATS = 10
#: Petitions lapse after this many of the longest times, in halves: two repeats may be lost (rule 10).
LAPSE_HALVES = 5
#: All that one machine repeats comes to no more than one frame in this time, us (issue 13, item 5).
PACE_US = 1_000_000


def delay_us(times: int, repeat_us: int, longest_us: int) -> int:
    """The time from the ``times``-th time that something is said, from 1, to the next."""
    return repeat_us if times <= QUICK else min(longest_us, repeat_us << min(times - QUICK, 20))


@dataclass
class BackOff:
    """What one machine says again: how often each thing was said, and when last (bus us)."""

    repeat_us: int
    _said: dict[Hashable, tuple[int, int]] = field(default_factory=dict)

    @property
    def longest_us(self) -> int:
        """The longest time between two repeats while few things wait."""
        return LONGEST_REPEATS * self.repeat_us

    def say(self, what: Hashable, now_us: int, waiting: int = 1, longest_us: int | None = None) -> int:
        """It is said now; when it is to be said again, with ``waiting`` things to be said again in all."""
        times = self._said.get(what, (0, 0))[0] + 1
        self._said[what] = times, now_us
        longest_us = longest_us or self.longest_us
        paced_us = min(longest_us, waiting * PACE_US) if times > QUICK else 0
        return now_us + max(delay_us(times, self.repeat_us, longest_us), paced_us)

    def lapses_us(self, *, is_ordered: bool) -> int:
        """How long a petition outlives its last repeat; one without an order stands before others: it lapses soon."""
        return LAPSE_HALVES * (self.longest_us if is_ordered else self.unordered_us) // 2

    @property
    def unordered_us(self) -> int:
        """The longest time between two repeats of what is asked for without an agreed order."""
        return UNORDERED_REPEATS * self.repeat_us

    def last_us(self, what: Hashable) -> int | None:
        """When it was said last, or None."""
        found = self._said.get(what)
        return None if found is None else found[1]

    def forget(self, what: Hashable) -> None:
        """It waits no more, or begins anew."""
        self._said.pop(what, None)

    def begin_anew(self) -> None:
        """Somebody has come back: all is said soon again."""
        self._said.clear()
