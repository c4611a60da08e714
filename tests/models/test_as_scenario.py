"""A counterexample is played in the simulator: what the exploration found comes about there too."""

from pathlib import Path

import pytest

from bus_sim.campaign.report import RunVerdict
from bus_sim.campaign.trial import play
from bus_sim.cli import main as bus_sim
from bus_sim.faults.scenario import load_scenario
from tests.models import planted
from tests.models.as_scenario import as_scenario
from tests.models.award import BAY, CHEAP, AwardPart
from tests.models.engine import Engine, Limits


def test_a_counterexample_is_a_scenario_that_is_played(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "counterexample.toml"
    with monkeypatch.context() as bug:
        one = planted.AWARD["what was given away is held again after a restart"]
        bug.setattr(one.owner, one.name, one.made(getattr(one.owner, one.name)))
        engine = Engine(AwardPart(calls=1, nodes=(BAY, CHEAP)), Limits(crashes=1))
        wrong = engine.run().wrong
        assert wrong is not None
        file.write_text(as_scenario(engine, wrong).to_toml(engine.told(wrong)), encoding="utf-8")
        scenario, site = load_scenario(file)
        assert play(site, scenario).verdict is RunVerdict.HELD
    assert play(site, scenario).verdict is RunVerdict.SERVED
    assert bus_sim(["run", "--scenario", str(file), "--trace", str(tmp_path / "run.log")]) == 0
