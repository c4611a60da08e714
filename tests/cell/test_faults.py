"""The cell under faults drawn by seed: goals are achieved all the same, and no checker finds anything."""

import pytest

from bus_sim.options import RunOptions
from bus_sim.session import play
from onboard.contract.cell import ArmPhase, ArmProgress, GoalPath, PartAt
from onboard.contract.messages import Bid, CallForProposals, Message, Reference
from onboard.systems.cell.checks import RULES
from tests.cell.playing import cell, goal_demand
from tests.faults.systems import judged, withstands

SITE = cell(goal_demand((10, 10), (40, 30)), goal_demand((40, 30), (30, 5), at_s=20, within_s=600))


@pytest.mark.parametrize("seed", range(16))
def test_the_cell_under_faults(seed: int) -> None:
    withstands(SITE, seed, (14.0, 102.0), 1200)


def test_no_checker_finds_anything_where_nothing_is_disturbed() -> None:
    verdict = judged(SITE, play(SITE, RunOptions(limit_s=1200)).messages)
    assert verdict.is_good, verdict.lines()
    assert all(verdict.seen[rule.name] for rule in RULES)


PART = Reference(9, 1)


@pytest.mark.parametrize(
    ("rule", "said"),
    [
        ("inside-area", [ArmProgress(1, 23_000, 10_000, ArmPhase.CARRYING, 1)]),
        (
            "part-passed-on",
            [PartAt(node, PART, 22_000, 10_000, aboard=True) for node in (1, 2, 1)],
        ),
    ],
)
def test_each_checker_finds_what_it_is_for(rule: str, said: list[Message]) -> None:
    verdict = judged(SITE, [(1_000_000 * number, one) for number, one in enumerate(said, 1)])
    assert verdict.counts[rule] == 1


def test_a_predecessor_that_bids_is_found() -> None:
    messages = play(SITE, RunOptions(limit_s=1200)).messages
    path_us, path = next((time_us, one) for time_us, one in messages if isinstance(one, GoalPath) and one.node1)
    call = next(
        one for _, one in messages if isinstance(one, CallForProposals) and one.task == (path.sender, path.goal)
    )
    at = next(number for number, (_, one) in enumerate(messages) if one is call)
    forged = (messages[at][0], Bid(path.node1, call.sender, call.call, 1, 0))
    verdict = judged(SITE, [*messages[: at + 1], forged])
    assert verdict.counts["predecessors"] == 1 and path_us
