"""What the controllers do with tokens in a run with faults is a sequence of steps of the model."""

from pathlib import Path

import pytest

from bus_sim.can.faults import FaultKind, InjectedFault
from bus_sim.sites import find_site
from onboard.core.authority import TokenBook, TokenKey
from onboard.core.effects import Effect
from tests.models.recorder import Recorder
from tests.models.refused import refused_tokens
from tests.system.scene import play, stays


def _refused(folder: Path, seed: int) -> tuple[int, dict[TokenKey, str]]:
    """How many token steps a run of the small site made, and the first refused step of each token."""
    recorder = Recorder()
    faults = [
        InjectedFault(FaultKind.OMISSION, probability=0.01, seed=seed),
        InjectedFault(FaultKind.DUPLICATE, probability=0.02, delay_us=3_000, seed=seed + 100),
    ]
    with pytest.MonkeyPatch.context() as patch:
        recorder.attach(patch)
        play(find_site("small"), stays((0, 120)), seed=seed, limit_s=240, faults=faults, extra_s=0)
    refused = refused_tokens(folder, recorder, most=12)
    return sum(map(len, recorder.tokens.values())), refused


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_tokens_of_a_run_with_lost_and_doubled_frames_move_as_in_the_model(seed: int, tmp_path: Path) -> None:
    steps, refused = _refused(tmp_path, seed)
    assert steps > 100
    assert refused == {}


def test_a_controller_that_sends_before_it_journals_is_caught(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    give = TokenBook.give

    def hasty(book: TokenBook, key: TokenKey, to: int, now_us: int) -> list[Effect]:
        return give(book, key, to, now_us)[::-1]

    monkeypatch.setattr(TokenBook, "give", hasty)
    _, refused = _refused(tmp_path, 1)
    assert refused
    assert all(step.startswith("send_grant") for step in refused.values())
