"""The shipped award and custody, explored: one holder of the car at most, no trap; and each bug planted is found."""

from collections.abc import Callable, Mapping

import pytest

from tests.models import planted
from tests.models.award import BAY, CHEAP, AwardPart
from tests.models.custody import CustodyPart
from tests.models.engine import Engine, Limits, Part

#: The compartment and one robot: all that two robots add is who of them wins.
PAIR = (BAY, CHEAP)
PARTS: Mapping[str, Callable[[], Part]] = {
    "award": lambda: AwardPart(calls=1, nodes=PAIR),
    "taking": lambda: CustodyPart(calls=1, nodes=PAIR, laden=False),
    "leaving": lambda: CustodyPart(calls=1, nodes=PAIR),
}
BUGS = [("award", bug) for bug in planted.AWARD] + [("leaving", bug) for bug in planted.LEAVING]


@pytest.mark.parametrize(
    ("part", "limits", "at_least"),
    [
        ("award", Limits(crashes=0), 30_000),
        ("award", Limits(crashes=1, most_states=2_000), 2_500),
        ("taking", Limits(crashes=1, most_states=2_000), 2_500),
        ("leaving", Limits(crashes=1, most_states=2_000), 2_500),
    ],
    ids=["award-without-crash", "award", "taking", "leaving"],
)
def test_one_holder_and_no_trap(part: str, limits: Limits, at_least: int) -> None:
    found = Engine(PARTS[part](), limits).run()
    print(found)
    assert not found.why
    assert found.is_complete or limits.crashes, "without a crash all of it is seen"
    assert found.transitions > at_least


@pytest.mark.parametrize(("part", "bug"), BUGS, ids=[f"{part}-{bug}".replace(" ", "-") for part, bug in BUGS])
def test_a_planted_bug_is_found(part: str, bug: str, monkeypatch: pytest.MonkeyPatch) -> None:
    one = {"award": planted.AWARD, "leaving": planted.LEAVING}[part][bug]
    monkeypatch.setattr(one.owner, one.name, one.made(getattr(one.owner, one.name)))
    found = Engine(PARTS[part](), Limits(crashes=1, most_states=20_000)).run()
    print(found)
    assert found.why == one.found
