"""What the tests cost, folder by folder: ``make test PYTEST_ARGS="-p tests.cost"``.

Processor time of each test with its fixtures and of the programs that it has started and waited for, s; beside it the
workers' own, which is collection most of all. A guest's is not in it.
"""

from collections import Counter
from collections.abc import Generator

import pytest

from tests.quick import processor_s

_COST = "processor_s"
_DEAREST = 30
_begun_s = pytest.StashKey[float]()
#: Of this process: when the last test was over.
_last_s = [0.0]


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """What was spent since the last test is the worker's own."""
    item.stash[_begun_s] = processor_s()
    item.user_properties.append(("before_s", item.stash[_begun_s] - _last_s[0]))
    done = yield
    _last_s[0] = processor_s()
    return done


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """The last report of a test takes along what it cost."""
    report = yield
    if report.when == "teardown":
        report.user_properties.append((_COST, processor_s() - item.stash[_begun_s]))
    return report


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """The table, the dearest tests, and the sum."""
    folders, tests, own_s = Counter[str](), Counter[str](), 0.0
    for report in terminalreporter.getreports(""):
        known = dict(report.user_properties) if report.when == "teardown" else {}
        if _COST in known:
            folders["/".join(report.nodeid.split("/")[:2])] += known[_COST]
            tests[report.nodeid] += known[_COST]
            own_s += known["before_s"]
    terminalreporter.section("processor time")
    for name, cost_s in [*folders.most_common(), ("the workers themselves", own_s)]:
        terminalreporter.write_line(f"{cost_s:8.1f} s  {name}")
    terminalreporter.write_line(f"{folders.total() + own_s:8.1f} s  in all; the dearest tests:")
    for name, cost_s in tests.most_common(_DEAREST):
        terminalreporter.write_line(f"{cost_s:8.1f} s  {name}")
