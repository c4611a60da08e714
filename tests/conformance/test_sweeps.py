"""A machine that keeps what it waits for says what one says that looks at all it knows after every event.

Who forgets to mark what it changed, or says that it reads less than it does, is found here: its frames come later.
"""

from pathlib import Path

import pytest

from bus_sim.cli import main
from onboard.holon.schedule import Schedule
from tests.conformance.case import Case
from tests.conformance.cases import every_system
from tests.conformance.runs import log_of, site_file

#: Runs in which machines come back, clocks drift and frames are lost; of each system, and of what its traffic is like.
STRUCK = {
    "car-park": ("--fault", "crash:target=MR1,at_s=40,restart_s=5", "--fault", "omission:probability=0.02"),
    # Its parts are polished after 62 s; one whose only word of it is lost would be waited for until the run's own end.
    "polishing": ("--fault", "omission:probability=0.02", "--for", "90"),
}


def played(case: Case, log: Path, *words: str) -> str:
    """What the log of a run says."""
    options = [*case.options, "--seed", "1", "--speed", "max", "--no-web", "--devices", "--trace", str(log), *words]
    assert main(["run", site_file(case.system), *options]) in (0, 1)
    return log.read_text(encoding="utf-8")


@every_system
def test_what_is_kept_changes_no_frame(case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept = log_of(case.system).read_text(encoding="utf-8")
    monkeypatch.setattr(Schedule, "sweeps", True)
    assert played(case, tmp_path / "swept.log") == kept


@every_system
def test_nor_where_machines_come_back_and_frames_are_lost(
    case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = STRUCK.get(case.system, ("--fault", "omission:probability=0.02"))
    kept = played(case, tmp_path / "kept.log", *words)
    monkeypatch.setattr(Schedule, "sweeps", True)
    assert played(case, tmp_path / "swept.log", *words) == kept
