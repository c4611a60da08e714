"""``make check``: the tests that a person runs after each change, and the proof that none of them takes long.

A plugin for pytest (``-p tests.quick``): a test that takes more than a second of processor time, its fixtures and the
programs that it starts counted, fails and is named. Processor time, as a busy machine is no fault of a test.
"""

import resource
import time
from collections.abc import Generator

import pytest

#: Of one test, s of processor time: so nobody waits for a single one (issue "One house", item 7).
LIMIT_S = 1.0
_spent_s = pytest.StashKey[float]()


def _processor_s() -> float:
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """Start the item's clock: what is before its first step counts."""
    item.stash[_spent_s] = _processor_s()
    return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """A test that was too slow fails when its work is done, by its name and what it took."""
    report = yield
    spent_s = _processor_s() - item.stash[_spent_s]
    if call.when == "call" and report.passed and spent_s > LIMIT_S:
        report.outcome = "failed"
        report.longrepr = (
            f"{item.nodeid} took {spent_s:.1f} s of processor time, and a test of `make check` at most {LIMIT_S:g} s: "
            "make it faster, or take its file out of QUICK in the Makefile"
        )
    return report
