"""A test that computes without end fails under its own name, and the run goes on.

pytest's ``faulthandler_timeout`` alone does not do that: it takes the stack of a thread that runs, which has killed the
worker (Python 3.11), and the log named the test at the end only. It stays as the net for what waits.
"""

import signal
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

#: Seconds of processor time of one phase of a test; the dearest takes some 20 on a busy machine (measured).
MOST_S = 240.0
#: An event loop may swallow it on its way out, and wait for ever then: it is thrown again after this, s of the wall.
_AGAIN_S = 5.0


@contextmanager
def processor_limit(seconds: float) -> Iterator[None]:
    """Fail the test inside where it computes for longer; time in which it waits does not count."""

    def over(_number: int, _frame: object) -> None:
        signal.signal(signal.SIGALRM, over)
        signal.setitimer(signal.ITIMER_REAL, _AGAIN_S, _AGAIN_S)
        pytest.fail(f"it computed for {seconds:.0f} s of processor time and was not over")

    signal.signal(signal.SIGPROF, over)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.setitimer(signal.ITIMER_REAL, 0)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup() -> Iterator[None]:
    """What is made for it may take as long."""
    with processor_limit(MOST_S):
        return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call() -> Iterator[None]:
    """The test itself."""
    with processor_limit(MOST_S):
        return (yield)
