"""A row that the bus shows: what a test reads of it travelled, and without those frames it would not be shown."""

from collections.abc import Callable, Sequence
from typing import TypeVar

import pytest

from onboard.contract.messages import Message

M = TypeVar("M", bound=Message)
#: A message, and when its last frame ended, us.
Timed = tuple[int, Message]


def shown(check: Callable[[Sequence[Message]], None], messages: Sequence[Message], *kinds: type[Message]) -> None:
    """``check`` passes on all that travelled, and raises ``AssertionError`` with all frames of any one kind cut."""
    shown_at(lambda timed: check([one for _, one in timed]), [(0, one) for one in messages], *kinds)


def shown_at(check: Callable[[Sequence[Timed]], None], messages: Sequence[Timed], *kinds: type[Message]) -> None:
    """``shown`` for a check that looks at times as well."""
    check(messages)
    for kind in kinds:
        with pytest.raises(AssertionError):
            check([one for one in messages if not isinstance(one[1], kind)])


def first_of(
    said: Sequence[Timed], kind: type[M], where: Callable[[M], bool] = lambda _: True, after_us: int = 0
) -> tuple[int, M]:
    """The first message of a class that fits; raises ``AssertionError`` where none does."""
    for at_us, one in said:
        if at_us >= after_us and isinstance(one, kind) and where(one):
            return at_us, one
    raise AssertionError(f"no {kind.__name__} as expected after {after_us / 1e6:.3f} s")
