"""What a search costs, in counted steps, and how it is worked out a slice at a time: motion is served in between.

A search is a generator that tells now and then how many steps it has done since it last did. By slices it comes to what
it comes to at once, where what it searches stays the same meanwhile: whoever slices it searches a copy.
"""

from collections.abc import Callable, Generator
from dataclasses import dataclass
from functools import wraps
from typing import ParamSpec, Protocol, TypeVar, runtime_checkable

T = TypeVar("T")
_Given = ParamSpec("_Given")

#: Tells steps, and comes to its result in the end.
Search = Generator[int, None, T]

#: A step is the free-flow bound of one place; a state taken off a search's queue, with its moves, takes as long as ten
#: of them (``python -m bench.steps``).
POP_STEPS = 10
#: So many steps and then something else has its turn: 2 ms where figures are measured, 20 ms on a board that is ten
#: times as slow; a drive waits 500 ms for its next order, and is given one each 200 ms.
SLICE_STEPS = 250


@dataclass
class Effort:
    """What all searches of one machine cost."""

    #: Counted since power-up.
    steps: int = 0
    #: After how many steps a search that can wait gives way; None: each is worked out at once.
    slice_steps: int | None = None
    _sliced_us: int | None = None

    def slice(self, search: Search[T], now_us: int) -> tuple[T] | None:
        """Go on with a search: its result, in a tuple, or None where it is not over. One slice of all at a moment."""
        until = self.steps + (self.slice_steps or SLICE_STEPS)
        if now_us == self._sliced_us:
            return None
        self._sliced_us = now_us
        while self.steps < until:
            try:
                self.steps += next(search)
            except StopIteration as over:
                return (over.value,)
        return None

    def whole(self, search: Search[T]) -> T:
        """The result of a search, at once."""
        while True:
            try:
                self.steps += next(search)
            except StopIteration as over:
                # What a generator comes to has no type of its own here.
                result: T = over.value
                return result


@runtime_checkable
class Searching(Protocol):
    """A task-generation function that searches."""

    effort: Effort


def at_once(searching: Callable[_Given, Search[T]]) -> Callable[_Given, T]:
    """The same as a plain function, whose steps nobody counts."""

    @wraps(searching)
    def search(*given: _Given.args, **named: _Given.kwargs) -> T:
        return Effort().whole(searching(*given, **named))

    return search
