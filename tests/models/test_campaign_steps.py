"""Tokens and calls in seeds of a campaign, crashes included: what the controllers do are steps of the models."""

from pathlib import Path

import pytest

from bus_sim.campaign.profiles import draw_faults
from bus_sim.campaign.trial import play
from bus_sim.faults.scenario import FaultScenario
from bus_sim.sites import find_site
from bus_sim.systems.car_park.demand import Arrivals
from onboard.core.authority import TokenBook
from tests.models.recorder import Recorder
from tests.models.refused import refused_calls, refused_tokens
from tests.thinned import some


def _recorded(profile: str, seed: int) -> Recorder:
    site, recorder = find_site("small"), Recorder()
    arrivals = Arrivals(2, 60.0, 20.0, 100.0)
    with pytest.MonkeyPatch.context() as patch:
        recorder.attach(patch)
        play(site, FaultScenario("small", seed, 1_200.0, arrivals, draw_faults(profile, seed, site)))
    return recorder


@pytest.mark.parametrize("seed", some([1, 5, 7], 2))
def test_tokens_move_as_in_the_model_while_controllers_crash_and_the_power_is_cut(seed: int, tmp_path: Path) -> None:
    recorder = _recorded("crash", seed)
    assert recorder.crashes.total() > 10
    assert refused_tokens(tmp_path, recorder) == {}


@pytest.mark.parametrize("seed", [3, 9])
def test_tokens_and_calls_go_as_in_the_models_while_the_bus_fails(seed: int, tmp_path: Path) -> None:
    recorder = _recorded("bus", seed)
    assert refused_tokens(tmp_path, recorder) == {}
    assert refused_calls(tmp_path, recorder) == {}


def test_a_restart_that_keeps_what_was_given_away_is_caught(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    replay = TokenBook.replay

    def greedy(book: TokenBook, entries: list[dict[str, str | int]]) -> None:
        replay(book, [entry for entry in entries if entry.get("record") == "token_held"])

    monkeypatch.setattr(TokenBook, "replay", greedy)
    recorder = _recorded("crash", 5)
    refused = refused_tokens(tmp_path, recorder)
    assert refused
    assert any(step.startswith("expect") for step in refused.values())
