"""Long rows of cases: the usual run plays some of them, spread evenly; ``make test-long`` plays all.

What is thinned is one claim tried at many moments, seeds or sizes. The cases that are left in are fixed, so that each
run of the tests plays the same ones, and nothing is drawn.
"""

import os
from collections.abc import Sequence
from typing import TypeVar

T = TypeVar("T")
#: Environment variable; anything but an empty text asks for all.
VARIABLE = "LONG"


def is_long() -> bool:
    """Whether everything is to be played."""
    return bool(os.environ.get(VARIABLE))


def some(cases: Sequence[T], count: int) -> Sequence[T]:
    """``count`` of the cases in their order: the first, the last and what is evenly between them; of one the first."""
    if is_long() or count >= len(cases):
        return cases
    if count == 1:
        return cases[:1]
    return [cases[number * (len(cases) - 1) // (count - 1)] for number in range(count)]
