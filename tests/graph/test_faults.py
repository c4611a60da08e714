"""The graph under faults drawn by seed: every order is done all the same, and no checker finds anything."""

from importlib.resources import files
from pathlib import Path

import pytest

from bus_sim.cli import main as bus_sim
from onboard.cli import main as onboard
from onboard.contract.graph import EdgeNotice, EdgeState, NodeAnswer, NodeVerdict, RobotAt, RobotMode, TurnSignal
from onboard.contract.messages import Message
from onboard.systems.graph.checks import RULES
from tests.faults.systems import judged, withstands
from tests.graph.sites import busy_orders, hall, made

SITE = made(hall(), (0, 4, 8), busy_orders(hall(), 5, 7))


@pytest.mark.parametrize("seed", range(16))
def test_the_graph_under_faults(seed: int) -> None:
    withstands(SITE, seed, (12.0, 100.0), 900)


def _at(robot: int, behind: int, node: int) -> RobotAt:
    return RobotAt(robot, behind, node, True, RobotMode.DRIVING, 255, 255, 255, node)


@pytest.mark.parametrize(
    ("rule", "said"),
    [
        ("one-an-edge", [_at(21, 0, 1), _at(22, 1, 0)]),
        ("one-an-edge", [_at(21, 0, 8)]),
        ("no-turning-back", [_at(21, 0, 1), _at(21, 1, 0)]),
        ("agents-of-nodes", [EdgeNotice(2, 0, 1, EdgeState.FREE, 0)]),
        ("grants-are-told", [NodeAnswer(1, 21, 0, NodeVerdict.STOP, 1, 0)]),
        (
            "grants-are-told",
            [TurnSignal(21, 0, 255, 1), NodeAnswer(1, 21, 0, NodeVerdict.GO, 1, 1), *(_at(22, 4, 5),) * 4],
        ),
    ],
)
def test_each_checker_finds_what_it_is_for(rule: str, said: list[Message]) -> None:
    verdict = judged(SITE, [(1_000_000 * number, one) for number, one in enumerate(said, 1)])
    assert verdict.counts[rule] == 1, verdict.lines()


def test_a_log_of_a_graph_is_judged_by_the_rules_of_a_graph(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, site = tmp_path / "graph.log", files("bus_sim") / "sites" / "graph.toml"
    assert bus_sim(["run", "graph", "--trace", str(log)]) == 0
    assert onboard(["trace", "check", str(log), "--site", str(site)]) == 0
    said = capsys.readouterr().out
    assert all(f"{rule.name} " in said for rule in RULES)
    assert "held: every grant answers a signal" in said
