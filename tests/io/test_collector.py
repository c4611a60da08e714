import contextlib
import gc
from collections.abc import Iterator

import pytest

from onboard.io.collector import rare_looks


@pytest.fixture(autouse=True)
def _nothing_has_settled() -> Iterator[None]:
    # A run of tests has settled what it loads itself.
    gc.unfreeze()
    yield
    gc.freeze()


def test_looks_are_rare_and_then_as_before() -> None:
    before = gc.get_threshold()
    with contextlib.suppress(KeyError), rare_looks(before[0] + 9_000):
        assert gc.get_threshold() == (before[0] + 9_000, *before[1:])
        raise KeyError
    assert gc.get_threshold() == before


def test_looks_are_never_more_frequent_than_before() -> None:
    before = gc.get_threshold()
    with rare_looks(before[0] - 1):
        assert gc.get_threshold() == before


def test_what_has_settled_is_not_looked_at_until_all_is_over() -> None:
    with rare_looks(10_000, settled=True):
        there = gc.get_freeze_count()
        assert there > 1_000
        # Whoever is within it leaves that as it is.
        with rare_looks(10_000, settled=True):
            pass
        assert gc.get_freeze_count() == there
    assert gc.get_freeze_count() == 0


def test_an_interpreter_without_thresholds_runs_as_it_does(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(gc, "get_threshold")
    with rare_looks(50_000, settled=True):
        assert not gc.get_freeze_count()
