"""No change makes the runs dearer without owning up to it: ``python -m tests.work_done --write`` stores what they take.

Where a count is not known here that is said, as a test that is expected to fail, and the other one holds.
"""

import pytest

from tests import work_done
from tests.work_done import CALLS, INSTRUCTIONS, MOST_GROWTH, RUNS, VERSION, growth, stored


def judge(what: str, now: int, options: str) -> None:
    before = stored(what)[options]
    assert growth(now, before) <= MOST_GROWTH, f"{options}: {now:,} {what}, {growth(now, before):+.1f} % of {before:,}"


@pytest.mark.parametrize("options", RUNS)
def test_no_run_makes_more_calls_than_is_owned_up_to(options: str) -> None:
    if options not in stored(CALLS):
        pytest.xfail(f"no calls are stored for Python {VERSION}: python -m tests.work_done --write")
    judge(CALLS, work_done.calls(options), options)


@pytest.mark.parametrize("options", RUNS)
def test_no_run_takes_more_instructions_than_is_owned_up_to(options: str) -> None:
    if options not in stored(INSTRUCTIONS):
        pytest.xfail(f"no instructions are stored for Python {VERSION}: python -m tests.work_done --write")
    now = work_done.instructions(options)
    if isinstance(now, str):
        pytest.xfail(f"instructions are not counted: {now}")
    judge(INSTRUCTIONS, now, options)


def test_growth_beyond_what_is_stored_fails() -> None:
    if not stored(CALLS):
        pytest.xfail(f"no calls are stored for Python {VERSION}")
    options, before = next(iter(stored(CALLS).items()))
    judge(CALLS, before * (100 + MOST_GROWTH) // 100, options)
    with pytest.raises(AssertionError, match=f"{options}: .* calls"):
        judge(CALLS, before * (104 + MOST_GROWTH) // 100, options)
