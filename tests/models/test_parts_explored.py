"""Shipped award, custody and lift's gate, explored: one holder, a clear sill, no trap; planted bugs are found."""

from collections.abc import Callable, Mapping

import pytest

from onboard.contract.codes import Reason, TaskPhase
from onboard.contract.messages import CallForProposals, TaskReport
from onboard.systems.car_park import bay_calls, stewardship
from onboard.systems.car_park.bay_calls import BayCalls
from onboard.systems.car_park.robot import ParkingRobot
from tests.models import late, planted, robots
from tests.models.award import BAY, CAR, CHEAP, DEAR, PLACE, TASK, AwardPart
from tests.models.custody import CustodyPart
from tests.models.engine import Engine, Found, Limits, Part
from tests.models.gate import FIRST, LIFT, GatePart
from tests.models.late import LatePart
from tests.models.moving import engine_of
from tests.models.parking import ParkingPart
from tests.thinned import is_long

#: The compartment and one robot; two add who of them wins, and that one may have what the other waits for.
PAIR = (BAY, CHEAP)
PARTS: Mapping[str, Callable[[], Part]] = {
    "award": lambda: AwardPart(calls=1, nodes=PAIR),
    "award-of-two": lambda: AwardPart(calls=1),
    "taking": lambda: CustodyPart(calls=1, nodes=PAIR, laden=False),
    "leaving": lambda: CustodyPart(calls=1, nodes=PAIR),
    "parking": lambda: ParkingPart(calls=1, nodes=PAIR),
    "boarding": lambda: GatePart(nodes=(LIFT, FIRST)),
    "riding": lambda: GatePart(nodes=(LIFT, FIRST), aboard=True),
    "two-riding": lambda: GatePart(aboard=True),
}
PLANTED = {
    "award": planted.AWARD,
    "leaving": planted.LEAVING,
    "parking": planted.PARKING,
    "boarding": planted.BOARDING,
    "riding": planted.RIDING,
}
#: Found in two other parts within seconds; of a car that is aboard it takes 18 s.
FOUND_ELSEWHERE = ("leaving", "a grant is said before it is written")
BUGS = [(part, bug) for part, bugs in PLANTED.items() for bug in bugs if is_long() or (part, bug) != FOUND_ELSEWHERE]


def _of(count: int) -> int:
    """Half of them, or all where all is tried."""
    return count if is_long() else count // 2


@pytest.mark.parametrize(
    ("part", "limits", "at_least"),
    [
        ("award", Limits(crashes=0), 30_000),
        ("award-of-two", Limits(crashes=0, most_states=_of(4_000)), _of(5_000)),
        ("award", Limits(crashes=1, most_states=_of(2_000)), _of(2_500)),
        ("taking", Limits(crashes=0, most_states=_of(2_000)), _of(2_500)),
        ("taking", Limits(crashes=1, most_states=_of(2_000)), _of(2_500)),
        ("leaving", Limits(crashes=1, most_states=_of(2_000)), _of(2_500)),
        ("parking", Limits(crashes=1, most_states=_of(2_000)), _of(2_500)),
        ("boarding", Limits(crashes=0, most_states=_of(1_500)), _of(2_500)),
        ("riding", Limits(crashes=1, most_states=1_000), 2_000),
        ("two-riding", Limits(crashes=1, most_states=400), 500),
    ],
    ids=[
        *("award-without-crash", "award-of-two", "award", "taking-without-crash", "taking", "leaving", "parking"),
        *("boarding", "riding", "two-riding"),
    ],
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


def _late(*, forgot: bool, most_states: int) -> Found:
    found = Engine(LatePart(forgot=forgot), Limits(crashes=0, most_states=most_states)).run(late.WORDS)
    print(found)
    return found


def _twice_awarded(most_states: int) -> Found:
    """One robot has won, its compartment failed before it noted that, and another may win."""
    part = LatePart(nodes=(BAY, CHEAP, DEAR), noted=False)
    found = Engine(part, Limits(crashes=0, most_states=most_states)).run()
    print(found)
    return found


@pytest.mark.parametrize("forgot", [False, True], ids=["known", "forgotten"])
def test_whatever_comes_late_both_agree_in_the_end_whose_the_task_is(forgot: bool) -> None:
    found = _late(forgot=forgot, most_states=800)
    assert not found.why
    assert found.transitions > 1_200


@pytest.mark.parametrize("forgot", [False, True], ids=["known", "forgotten"])
def test_who_waits_and_says_nothing_waits_for_ever(forgot: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(BayCalls, "_ask", lambda *_: [])
    assert _late(forgot=forgot, most_states=1_500).why == planted.TRAP


def test_who_keeps_the_place_of_a_task_that_is_anothers_waits_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    """And so does who has the task, and the car: each has what the other needs."""
    bug = planted.KEEPS_THE_PLACE
    monkeypatch.setattr(bug.owner, bug.name, bug.made(getattr(bug.owner, bug.name)))
    assert engine_of(PARTS["award-of-two"](), Limits(crashes=0, most_states=2_000)).run().why == bug.found


def test_no_robot_keeps_a_task_that_was_given_to_another_after_a_restart() -> None:
    assert not _twice_awarded(800).why


def test_an_award_after_a_restart_that_is_no_newer_leaves_two_with_the_task(monkeypatch: pytest.MonkeyPatch) -> None:
    def same(version: int, bits: int) -> int:
        return version

    for module in (bay_calls, stewardship):
        monkeypatch.setattr(module, "successor", same)
    assert _twice_awarded(1_000).why == planted.TRAP


def _asleep(monkeypatch: pytest.MonkeyPatch) -> Found:
    """Nobody else can do the task, and who has it does not bid for it anew; any machine may sleep for a while."""
    bound = robots.PricedGeneration.lower_bound

    def not_again(generation: robots.PricedGeneration, call: CallForProposals, now_us: int) -> int | None:
        has_it = any(work.call.task == call.task for work in generation.program.works())
        return None if has_it else bound(generation, call, now_us)

    monkeypatch.setattr(robots.PricedGeneration, "lower_bound", not_again)
    found = Engine(AwardPart(nodes=PAIR), Limits(crashes=1, most_states=400, sleeps=True)).run()
    print(found)
    return found


def test_who_slept_does_not_cling_to_a_task_that_was_called_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    assert not _asleep(monkeypatch).why


def test_who_slept_and_heeds_no_newer_version_clings_to_its_task(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ParkingRobot, "_yield_task", lambda *_: [])
    assert _asleep(monkeypatch).why == planted.TRAP


@pytest.mark.parametrize(("part", "bug"), BUGS, ids=[f"{part}-{bug}".replace(" ", "-") for part, bug in BUGS])
def test_a_planted_bug_is_found(part: str, bug: str, monkeypatch: pytest.MonkeyPatch) -> None:
    one = PLANTED[part][bug]
    monkeypatch.setattr(one.owner, one.name, one.made(getattr(one.owner, one.name)))
    found = engine_of(PARTS[part](), Limits(crashes=1, most_states=20_000)).run()
    print(found)
    assert found.why == one.found
