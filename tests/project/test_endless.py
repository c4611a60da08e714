"""A test without an end is a failure of its own, and no other test suffers from it."""

import pytest

from tests.endless import processor_limit


def _compute_for_ever() -> None:
    with processor_limit(0.05):
        while True:
            pass


def test_what_computes_without_end_fails_and_says_so() -> None:
    with pytest.raises(pytest.fail.Exception, match="computed for 0 s"):
        _compute_for_ever()


def test_what_ends_in_time_is_left_alone() -> None:
    with processor_limit(0.05):
        pass
    sum(range(3_000_000))
