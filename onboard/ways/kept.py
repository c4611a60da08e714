"""What is worked out of a site once and kept, for some sites: one in a machine, some in a test run."""

from collections.abc import Callable
from typing import Generic, TypeVar

_MAX_KEPT = 16

Of = TypeVar("Of")
What = TypeVar("What")


class Kept(Generic[Of, What]):
    """Answers of ``work_out`` by the very object that was asked about."""

    def __init__(self, work_out: Callable[[Of], What]) -> None:
        self._work_out = work_out
        self._kept: dict[int, tuple[Of, What]] = {}

    def of(self, one: Of) -> What:
        """The answer for ``one``, worked out at the first call."""
        found = self._kept.get(id(one))
        # A kept answer holds what it is of, so an identity in use is never that of another.
        if found is None:
            if len(self._kept) >= _MAX_KEPT:
                del self._kept[next(iter(self._kept))]
            found = self._kept[id(one)] = one, self._work_out(one)
        return found[1]
