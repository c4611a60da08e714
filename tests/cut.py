"""A row that the bus shows: what a test reads of it travelled, and without those frames it would not be shown."""

from collections.abc import Callable, Sequence

import pytest

from onboard.contract.messages import Message


def shown(check: Callable[[Sequence[Message]], None], messages: Sequence[Message], *kinds: type[Message]) -> None:
    """``check`` passes on all that travelled, and raises ``AssertionError`` with all frames of any one kind cut."""
    check(messages)
    for kind in kinds:
        with pytest.raises(AssertionError):
            check([one for one in messages if not isinstance(one, kind)])
