"""What holds for every test: repeatable properties, signals that end, an end, and skips that fail where none may be.

``pytest --hypothesis-profile explore`` looks for new counterexamples; what it finds becomes an ``@example``.
"""

import gc

import hypothesis
import pytest

from tests import once
from tests.dispositions import give_children_the_default
from tests.endless import pytest_runtest_call, pytest_runtest_setup
from tests.skips import pytest_make_collect_report, pytest_runtest_makereport

__all__ = [
    "pytest_make_collect_report",
    "pytest_runtest_call",
    "pytest_runtest_makereport",
    "pytest_runtest_setup",
]

# No deadline, and no complaint about slow examples: a shared machine's pace is not a property of the code. No database:
# the same examples in every clone.
_PATIENT = [hypothesis.HealthCheck.too_slow]
hypothesis.settings.register_profile(
    "repeatable", derandomize=True, deadline=None, database=None, suppress_health_check=_PATIENT
)
hypothesis.settings.register_profile(
    "explore", max_examples=2_000, deadline=None, database=None, print_blob=True, suppress_health_check=_PATIENT
)
hypothesis.settings.load_profile("repeatable")

give_children_the_default()


def pytest_configure(config: pytest.Config) -> None:
    """A folder for what is made once."""
    once.begin(config)


@pytest.hookimpl(trylast=True)
def pytest_collection_finish() -> None:
    """Look for cycles seldom, and never among what is there for the whole session: that took 3 % of all time."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 20, 20)


def pytest_unconfigure(config: pytest.Config) -> None:
    """Libraries that count what is left of theirs at the end would complain of what was put aside."""
    gc.unfreeze()
    once.end(config)
