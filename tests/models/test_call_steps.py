"""What the controllers do in the calls of a run with lost frames is a sequence of steps of the model."""

from pathlib import Path

import pytest

from bus_sim.can.faults import FaultKind, InjectedFault
from bus_sim.sites import find_site
from onboard.core.negotiation import participant
from tests.models.recorder import Call, Recorder
from tests.models.refused import refused_calls
from tests.system.scene import play, stays


def _refused(folder: Path, seed: int) -> tuple[int, dict[Call, str]]:
    """How many calls a run of the small site had, and the first refused step of each."""
    recorder = Recorder()
    faults = [InjectedFault(FaultKind.OMISSION, probability=0.03, seed=seed)]
    with pytest.MonkeyPatch.context() as patch:
        recorder.attach(patch)
        cars = stays((0, 120), (10, 130), (20, 140))
        play(find_site("small"), cars, seed=seed, limit_s=400, faults=faults, extra_s=0)
    return len(recorder.calls), refused_calls(folder, recorder)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_calls_of_a_run_with_lost_frames_go_as_in_the_model(seed: int, tmp_path: Path) -> None:
    calls, refused = _refused(tmp_path, seed)
    assert calls > 3
    assert refused == {}


def test_a_participant_that_takes_its_belief_for_an_award_is_caught(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = (participant.ParticipantState.PRE_ASSIGNED, participant.ParticipantEvent.DEADLINE)
    hasty = (participant.ParticipantState.ASSIGNED, participant.Participant.assign)
    monkeypatch.setitem(participant.TABLE, before, hasty)
    _, refused = _refused(tmp_path, 1)
    assert refused
    assert all(step.startswith("expect") and "ASSIGNED" in step for step in refused.values())
