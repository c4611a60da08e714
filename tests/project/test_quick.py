"""``make check`` keeps its promise: a slow test in it fails and is named, and its lists name what is there."""

import subprocess
from pathlib import Path

import pytest

from tests import quick

pytest_plugins = ["pytester"]
ROOT = Path(__file__).parents[2]


def test_a_test_that_takes_more_than_a_second_of_processor_time_fails_by_name(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    monkeypatch.setattr(quick, "LIMIT_S", 0.05)
    pytester.makeini("[pytest]\nasyncio_default_fixture_loop_scope = function")
    pytester.makepyfile(
        test_it="""
        import time
        def test_quick(): pass
        def test_slow():
            end = time.process_time() + 0.1
            while time.process_time() < end: pass
        """
    )
    done = pytester.inline_run("-p", "tests.quick", "-p", "no:cacheprovider")
    passed, _, failed = done.listoutcomes()
    assert [one.nodeid for one in passed] == ["test_it.py::test_quick"]
    assert "test_it.py::test_slow took 0.1 s of processor time" in str(failed[0].longrepr)


def test_an_image_step_without_time_left_is_a_failure() -> None:
    done = subprocess.run(["bash", str(ROOT / ".ci" / "image"), "0"], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "FAILED: no time was left for the image's tests" in done.stderr


def test_the_lists_name_tests_that_are_there() -> None:
    assert quick.main() == 0
    for name in quick.SLOW:
        file, _, test = name.partition("::")
        assert f"def {test}" in (ROOT / file).read_text(encoding="utf-8"), name
