"""Whoever calls a bench wrongly reads one line that says so, and status 2; ``--help`` says what it is."""

import runpy
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

BENCHES = sorted(path.name for path in (ROOT / "bench").glob("[!_]*.py"))


def called(bench: str, *words: str, monkeypatch: pytest.MonkeyPatch) -> object:
    """The status with which a bench ends at once."""
    monkeypatch.setattr(sys, "argv", [bench, *words])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(Path(ROOT / "bench" / bench)), run_name="__main__")
    return ended.value.code


@pytest.mark.parametrize("bench", BENCHES)
def test_help_says_what_a_bench_is(
    bench: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert called(bench, "--help", monkeypatch=monkeypatch) == 0
    told = capsys.readouterr().out
    assert told.startswith(f"usage: {bench}") and len(told.splitlines()) > 4


@pytest.mark.parametrize("bench", BENCHES)
def test_a_word_that_no_bench_knows_is_one_line(
    bench: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert called(bench, "--no-such-word", monkeypatch=monkeypatch) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.splitlines()[-1].startswith(f"{bench}: error: ")


@pytest.mark.parametrize(
    ("bench", "words", "why"),
    [
        ("recovery.py", ["nowhere"], "no such file, and no such shipped site"),
        ("fuzz.py", ["0"], "frames: 0: must be a whole number, 1 or more"),
        ("power_up.py", ["many"], "machines: many: must be a whole number, 1 or more"),
        ("power_up.py", ["9"], "error: 9 machines: 18 to 108 can start together here"),
        ("power_up.py", ["26", "2", "500000", "off", "-1"], "cars: -1: must be a whole number, 0 or more"),
        ("drawn.py", ["3-1"], "error: 3-1: must be a seed"),
    ],
)
def test_a_mistake_is_named(
    bench: str, words: list[str], why: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert called(bench, *words, monkeypatch=monkeypatch) == 2
    assert why in capsys.readouterr().err.splitlines()[-1]
