"""Where trials are played makes no difference: this process, or the workers of a Dask scheduler."""

import warnings
from functools import partial

import pytest

from bus_sim.campaign.runner import CampaignSettings, run_seed
from bus_sim.cli import main
from bus_sim.engine import on_cores, on_dask
from bus_sim.systems.car_park.demand import Arrivals

PLAN = CampaignSettings("level1", "bus", 3_600.0, Arrivals(cars=1))


def test_a_campaign_over_a_scheduler_comes_to_the_same() -> None:
    distributed = pytest.importorskip("distributed", reason="Dask is not installed: the extra campaign")
    seeds = range(1, 4)
    with warnings.catch_warnings():
        # What Dask deprecates in itself is not ours to repair.
        warnings.simplefilter("ignore")
        with distributed.LocalCluster(
            n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None, protocol="tcp://"
        ) as cluster:
            there = {r.seed: r.report for r in on_dask(cluster.scheduler_address, partial(run_seed, PLAN), seeds)}
    here = {result.seed: result.report for result in on_cores(1, partial(run_seed, PLAN), seeds)}
    assert there == here
    assert len(there) == len(seeds)


@pytest.mark.parametrize(
    "command",
    [
        ["campaign", "level1", "--seeds", "1-2"],
        ["compare", "level1", "--parts", "random", "--seeds", "1-2"],
        ["certify", "ring:3", "--robots", "1", "--up-to", "2"],
        ["design", "level1", "--wait", "300"],
    ],
)
def test_where_no_scheduler_answers_one_line_says_so(
    command: list[str], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("distributed", reason="Dask is not installed: the extra campaign")
    monkeypatch.setattr("bus_sim.engine.ANSWER_S", 0.5)
    assert main([*command, "--dask", "tcp://127.0.0.1:9"]) == 2
    assert "no Dask scheduler answers there" in capsys.readouterr().err
