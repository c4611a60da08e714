"""Shipped award, custody and lift's gate, explored: one holder, a clear sill, no trap; planted bugs are found."""

from collections.abc import Callable, Mapping

import pytest

from onboard.contract.codes import Reason, TaskPhase
from onboard.contract.messages import TaskReport
from tests.models import planted
from tests.models.award import BAY, CAR, CHEAP, PLACE, TASK, AwardPart
from tests.models.custody import CustodyPart
from tests.models.engine import Engine, Limits, Part
from tests.models.gate import FIRST, LIFT, GatePart
from tests.models.moving import engine_of

#: The compartment and one robot: all that two robots add is who of them wins.
PAIR = (BAY, CHEAP)
PARTS: Mapping[str, Callable[[], Part]] = {
    "award": lambda: AwardPart(calls=1, nodes=PAIR),
    "taking": lambda: CustodyPart(calls=1, nodes=PAIR, laden=False),
    "leaving": lambda: CustodyPart(calls=1, nodes=PAIR),
    "boarding": lambda: GatePart(nodes=(LIFT, FIRST)),
    "riding": lambda: GatePart(nodes=(LIFT, FIRST), aboard=True),
    "two-riding": lambda: GatePart(aboard=True),
}
PLANTED = {
    "award": planted.AWARD,
    "leaving": planted.LEAVING,
    "boarding": planted.BOARDING,
    "riding": planted.RIDING,
}
BUGS = [(part, bug) for part, bugs in PLANTED.items() for bug in bugs]


@pytest.mark.parametrize(
    ("part", "limits", "at_least"),
    [
        ("award", Limits(crashes=0), 30_000),
        ("award", Limits(crashes=1, most_states=2_000), 2_500),
        ("taking", Limits(crashes=1, most_states=2_000), 2_500),
        ("leaving", Limits(crashes=1, most_states=2_000), 2_500),
        ("boarding", Limits(crashes=0, most_states=1_500), 2_500),
        ("riding", Limits(crashes=1, most_states=1_000), 2_000),
        ("two-riding", Limits(crashes=1, most_states=400), 500),
    ],
    ids=["award-without-crash", "award", "taking", "leaving", "boarding", "riding", "two-riding"],
)
def test_one_holder_and_no_trap(part: str, limits: Limits, at_least: int) -> None:
    found = engine_of(PARTS[part](), limits).run()
    print(found)
    assert not found.why
    assert found.is_complete or found.states >= limits.most_states, "all of it is seen that was to be"
    assert found.transitions > at_least


def test_a_winner_by_its_word_alone_is_asked_and_the_task_is_called_anew() -> None:
    engine = Engine(AwardPart(calls=2, nodes=PAIR, prelude=0), Limits(crashes=0))
    state, late = engine.begin(), TaskReport(CHEAP, TASK, TaskPhase.AWARDED, PLACE.number, Reason.NONE)
    heard = [after for after, step in engine.steps(engine.said(state, late)) if step[:2] == ("hears", 0)]
    believing = [one for one in heard if engine.machine(one, 0).behaviour.stewardship.winner_of(CAR, TASK)[0] == CHEAP]
    assert believing
    assert all(engine.ends_well(one) for one in believing), "the robot has no such task, and never says so"


@pytest.mark.parametrize(("part", "bug"), BUGS, ids=[f"{part}-{bug}".replace(" ", "-") for part, bug in BUGS])
def test_a_planted_bug_is_found(part: str, bug: str, monkeypatch: pytest.MonkeyPatch) -> None:
    one = PLANTED[part][bug]
    monkeypatch.setattr(one.owner, one.name, one.made(getattr(one.owner, one.name)))
    found = engine_of(PARTS[part](), Limits(crashes=1, most_states=20_000)).run()
    print(found)
    assert found.why == one.found
