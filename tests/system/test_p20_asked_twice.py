"""Row P20: a task is worked out for the bid, and again for what is carried out; a call that comes meanwhile waits."""

from collections.abc import Sequence
from functools import cache

from bus_sim.faults.arm import arm
from bus_sim.faults.injection import parse_injection
from onboard.contract.codes import CallResult, Grade, LegAction, TaskPhase
from onboard.contract.messages import Award, Bid, CallForProposals, Itinerary, Message, TaskReport
from tests.cut import Timed, shown_at
from tests.sites import at_arrival, one_floor, telling
from tests.system.scene import play, stays
from tests.system.test_p35_p42_model import aims, narrow

BAY = '[[compartments]]\nname = "IOC2"\nnode = 2\nat = "p(1,6)"\n'
ROBOT = 11


@cache
def two_calls(factor: int, extra_s: float) -> tuple[Timed, ...]:
    """Two cars come 0.2 s apart before one robot whose board takes so many times as long to think; 0: no time."""
    faults = [parse_injection(f"slow:target=MR1,factor={factor}")] if factor else []
    site = telling(at_arrival(one_floor(extra=BAY)))
    cars = stays((0, None), (0.2, None))
    scene = play(site, cars, plant=lambda run: arm(run, faults), limit_s=60, extra_s=extra_s)
    return tuple((said.time_us, said.message) for said in scene.said if said.bus == "fleet")


def test_p20_a_call_that_comes_while_another_is_worked_out_is_answered_as_well() -> None:
    """The second request is heard while the search for the first runs, and both bids are those of a quick board."""
    quick = [one.cost for _, one in two_calls(0, 0) if isinstance(one, Bid)]

    def check(heard: Sequence[Timed]) -> None:
        calls = [(at, one) for at, one in heard if isinstance(one, CallForProposals)]
        bids = [(at, one) for at, one in heard if isinstance(one, Bid)]
        assert [one.sender for _, one in calls] == [1, 2] and len(bids) == 2
        (_, first), (second_us, second) = calls
        (said_us, mine), (behind_us, behind) = bids
        assert second_us + 250_000 < said_us < behind_us, "it was still working for the first"
        assert [(one.initiator, one.call) for one in (mine, behind)] == [(1, first.call), (2, second.call)]
        assert [mine.cost, behind.cost] == quick
        for call in (first, second):
            awards = [(one.winner, one.result) for _, one in heard if isinstance(one, Award) and one.task == call.task]
            reports = [one for _, one in heard if isinstance(one, TaskReport) and one.task == call.task]
            assert awards[:1] == [(ROBOT, CallResult.AWARDED)]
            assert [(one.sender, one.phase) for one in reports][-1:] == [(ROBOT, TaskPhase.DONE)]

    shown_at(check, two_calls(120, 110), CallForProposals, Bid, Award, TaskReport)


def number(plan: Itinerary) -> int | None:
    """That of the place at which a plan leaves its car."""
    place = aims(plan)
    return None if place is None else place.number


def test_p20_what_is_carried_out_is_worked_out_anew_with_the_award() -> None:
    """Two bid with one place: the later award finds it taken, and its robot says, and leaves its car at, another."""
    scene = play(telling(narrow()), stays((2.9, None), (0, None)), extra_s=200)

    def plans(heard: Sequence[Timed], grade: Grade) -> dict[int, Itinerary]:
        """The first of each robot that leaves a car."""
        found: dict[int, Itinerary] = {}
        for _, one in heard:
            if isinstance(one, Itinerary) and one.grade is grade and aims(one) is not None:
                found.setdefault(one.sender, one)
        return found

    def check(heard: Sequence[Timed]) -> None:
        bid, engaged = plans(heard, Grade.TENTATIVE), plans(heard, Grade.FIRM)
        assert bid.keys() == engaged.keys() and len(bid) == 2
        assert len({aims(one) for one in bid.values()}) == 1
        moved = [node for node in bid if aims(bid[node]) != aims(engaged[node])]
        assert len(moved) == 1
        costs = {one.sender: one for _, one in heard if isinstance(one, Bid)}
        awards = {one.winner: at for at, one in heard if isinstance(one, Award)}
        assert costs.keys() == awards.keys() == bid.keys()
        assert all(costs[node].itinerary_version == bid[node].version for node in bid)
        for node, plan in bid.items():
            works = [leg.end_ms for leg in plan.legs if leg.action is LegAction.WORK]
            assert works[-1] == costs[node].cost, "the bid is the end of what was worked out"
        left = [one for _, one in heard if isinstance(one, TaskReport) and one.phase is TaskPhase.DONE]
        assert {one.sender: one.station for one in left} == {node: number(plan) for node, plan in engaged.items()}

    said: list[tuple[int, Message]] = [(one.time_us, one.message) for one in scene.said if one.bus == "fleet"]
    shown_at(check, said, Bid, Award, Itinerary, TaskReport)
