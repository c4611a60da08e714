"""With ``REQUIRE=all`` in the environment a skipped test is a failed test.

On a desk a missing system tool skips what needs it, by name; in the gate nothing may be missing. An expected failure
(``xfail``) is no skip. Used as a plugin by ``tests/conftest.py``.
"""

import os
from collections.abc import Generator

import pytest

#: Environment variable; ``all`` is its one value with a meaning.
VARIABLE = "REQUIRE"


def skips_are_failures() -> bool:
    """Whether this run must not skip anything."""
    return os.environ.get(VARIABLE) == "all"


def _why(report: pytest.TestReport | pytest.CollectReport) -> str:
    """The reason of a skip: pytest keeps it as (file, line, "Skipped: reason")."""
    if isinstance(report.longrepr, tuple):
        return report.longrepr[2].removeprefix("Skipped: ")
    return str(report.longrepr)


def _fail(report: pytest.TestReport | pytest.CollectReport) -> None:
    why = _why(report)
    report.outcome = "failed"
    report.longrepr = f"{report.nodeid} was skipped: {why}; {VARIABLE}=all allows no skip, so install what is missing"


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Turn the skip of a test into a failure that names test and reason."""
    report = yield
    if report.skipped and not hasattr(report, "wasxfail") and skips_are_failures():
        _fail(report)
    return report


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report() -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """The same for a file that skips itself as a whole."""
    report = yield
    if report.skipped and skips_are_failures():
        _fail(report)
    return report
