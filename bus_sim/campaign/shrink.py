"""Fewest faults that still fail: delta debugging (ddmin).

Zeller, Hildebrandt: Simplifying and isolating failure-inducing input, IEEE Transactions on Software Engineering 28,
2002.
"""

from collections.abc import Callable, Sequence
from typing import TypeVar

T = TypeVar("T")

#: Trials spent on one failure at most; what is left then still fails, but may not be the least.
TRIALS_LIMIT = 40


def shrink(items: Sequence[T], fails: Callable[[Sequence[T]], bool], limit: int = TRIALS_LIMIT) -> list[T]:
    """A part of ``items``, in their order, that still fails, and of which no single item can be left out.

    ``fails`` is asked at most ``limit`` times, and never with all of them, of which it is taken for granted.
    """
    kept, parts, asked = list(items), 2, 0
    while kept and asked < limit:
        size = -(-len(kept) // parts)
        for begin in range(0, len(kept), size):
            rest = kept[:begin] + kept[begin + size :]
            asked += 1
            if fails(rest):
                kept, parts = rest, max(2, parts - 1)
                break
            if asked >= limit:
                return kept
        else:
            if parts >= len(kept):
                break
            parts = min(len(kept), 2 * parts)
    return kept
