"""What ``python -m tests.conform.mutants`` does to a line, and that the play tells it."""

import ast
import sys

import pytest

from tests.conform import mutants
from tests.conform.mutants import UNCHANGED, Mutation, mutated, mutations
from tests.project.rows import ROOT

PARTICIPANT = "onboard/core/negotiation/participant.py"


def changed(line_of: str, what: str) -> str:
    """The first line with these words, mutated so."""
    text = (ROOT / PARTICIPANT).read_text(encoding="utf-8").splitlines()
    number = next(number for number, line in enumerate(text, 1) if line_of in line)
    found = [one for one in mutations(PARTICIPANT, {number}) if one.what == what]
    assert found, (text[number - 1], what)
    assert mutated(found[0]).co_filename.endswith(PARTICIPANT)
    return found[0].what


@pytest.mark.parametrize(
    ("line", "what"),
    [
        ("if now_us > self.cut_off_us:", "contrary"),
        ("self.due_us = now_us + 1", "one more"),
        ("if no_account or not self.is_sound", "no not"),
        ("self.is_stale = False", "contrary"),
    ],
)
def test_each_kind_of_mutation_compiles(line: str, what: str) -> None:
    assert changed(line, what) == what


@pytest.mark.parametrize(
    ("file", "words"),
    [
        (PARTICIPANT, "self.counters.late_bids_ignored += 1"),
        ("onboard/controller/shell.py", "self.ports.telemetry.event("),
        ("onboard/holon/admission.py", "return [Report("),
    ],
)
def test_what_only_the_telemetry_hears_is_not_drawn(file: str, words: str) -> None:
    text = (ROOT / file).read_text(encoding="utf-8").splitlines()
    lines = {number for number, line in enumerate(text, 1) if words in line}
    assert lines and not list(mutations(file, lines))


def test_all_lines_of_a_function_and_none_outside_are_drawn_from() -> None:
    text = (ROOT / PARTICIPANT).read_text(encoding="utf-8")
    lines = {one.line for one in mutations(PARTICIPANT, set(range(1, 1_000)))}
    outside = {one.lineno for one in ast.parse(text).body if isinstance(one, ast.Import | ast.ImportFrom)}
    assert len(lines) > 40 and not lines & outside


def test_nothing_is_measured_by_a_kit_that_our_robot_as_it_is_does_not_keep_to(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def judge(mutation: Mutation) -> list[str]:
        return ["a-check"] if mutation == UNCHANGED else []

    monkeypatch.setattr(sys, "argv", ["mutants"])
    monkeypatch.setattr(mutants, "draw", lambda *_: [])
    monkeypatch.setattr(mutants, "judge", judge)
    assert mutants.main() == 2
    assert "our robot as it is breaks a-check" in capsys.readouterr().out
