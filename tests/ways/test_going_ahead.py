"""Who stands in another's way and goes on as that does, from one alley to the next, passes first on all of it."""

import pytest

from onboard.contract.codes import Grade, LegAction, Side
from onboard.contract.constants import NOBODY
from onboard.contract.messages import Itinerary, Leg, Progress, Stamp
from onboard.core.site import Segment
from onboard.ways.occupancy import leg_windows
from onboard.ways.passing_order import PassingOrder
from tests.ways.networks import alley, at, network

#: Alley 2 leads from p(1,1), at its high end, to p(3,1).
SITE = network(alley(1, 7), alley(3, 7), alley(2, 4, low=at(3, 1), high=at(1, 1)))
ALICE, BOB = 20, 21
#: From alley to alley: a hop into the second, through it, and a hop into the third.
ONWARD = [(2, 4, 4), (2, 4, 1), (3, 1, 1), (3, 1, 6)]
ALICE_FIRST_S, BOB_LATE_S = 20, 9_000


def plan(node: int, way: list[tuple[int, int, int]], begin_s: int, action: LegAction = LegAction.TRAVEL) -> Itinerary:
    """Runs and hops (track, from, to), 10 s each; ``action`` is what is done in the first."""
    legs = tuple(
        Leg(LegAction.TRAVEL if number else action, track, one, two, Side.NEAR, (begin_s + 10 * (number + 1)) * 1000)
        for number, (track, one, two) in enumerate(way)
    )
    return Itinerary(node, 1, Grade.FIRM, Stamp(begin_s * 1000, node, 0), legs)


def order_of(*plans: Itinerary) -> PassingOrder:
    order = PassingOrder(SITE)
    for itinerary in plans:
        order.on_plan(itinerary, leg_windows(SITE, itinerary, 0), 0)
    return order


def firsts(order: PassingOrder, *segments: Segment) -> set[tuple[int | None, int | None]]:
    """Who passes right before Alice, and before Bob, on each of these."""
    return {(order.predecessor(ALICE, segment), order.predecessor(BOB, segment)) for segment in segments}


BEYOND = [at(2, 3), at(2, 2), at(2, 1), at(3, 1), at(3, 2), at(3, 5)]


@pytest.mark.parametrize(
    ("leg", "place"),
    [
        pytest.param(0, at(1, 1), id="before its hop, in the end of the other's run"),
        pytest.param(0, at(2, 4), id="at the end of its hop"),
        pytest.param(1, at(2, 4), id="before its run in the next alley"),
    ],
)
def test_who_stands_ahead_goes_first_on_the_way_that_both_go_on(leg: int, place: Segment) -> None:
    """By the times Alice would come through its body, and each would wait for the other (drawn lines, 571)."""
    order = order_of(plan(ALICE, [(1, 7, 1), *ONWARD], ALICE_FIRST_S), plan(BOB, ONWARD, BOB_LATE_S))
    order.on_progress(Progress(BOB, 1, leg, place.track, place.index, 0, 0))
    assert firsts(order, *BEYOND) == {(BOB, NOBODY)}


def test_who_hops_next_comes_behind_who_stands_where_that_leads() -> None:
    order = order_of(plan(ALICE, ONWARD, ALICE_FIRST_S), plan(BOB, ONWARD[1:], BOB_LATE_S))
    order.on_progress(Progress(ALICE, 1, 0, 1, 1, 0, 0))
    order.on_progress(Progress(BOB, 1, 0, 2, 4, 0, 0))
    assert firsts(order, *BEYOND) == {(BOB, NOBODY)}


def test_who_has_not_said_where_it_is_is_where_its_hop_begins() -> None:
    """Not where it ends: another that comes by there may be first, as the times tell."""
    order = order_of(plan(ALICE, [(1, 7, 1), *ONWARD], ALICE_FIRST_S), plan(BOB, ONWARD, BOB_LATE_S))
    assert order.place(BOB) == at(1, 1)
    assert firsts(order, *BEYOND) == {(BOB, NOBODY)}
    order = order_of(plan(ALICE, [(2, 1, 4), (1, 1, 1), (1, 1, 7)], BOB_LATE_S), plan(BOB, ONWARD, ALICE_FIRST_S))
    assert firsts(order, at(2, 1), at(2, 2)) == {(BOB, NOBODY)}


def test_beyond_where_their_ways_part_the_times_tell() -> None:
    order = order_of(
        plan(ALICE, [(1, 7, 1), *ONWARD, (3, 6, 1)], ALICE_FIRST_S), plan(BOB, [*ONWARD[:3], (3, 1, 3)], BOB_LATE_S)
    )
    order.on_progress(Progress(BOB, 1, 0, 1, 1, 0, 0))
    assert firsts(order, at(2, 2), at(3, 1), at(3, 2)) == {(BOB, NOBODY)}
    assert firsts(order, at(3, 5), at(3, 6)) == {(NOBODY, None)}


def test_where_one_works_first_or_goes_on_elsewhere_the_times_tell() -> None:
    works = plan(ALICE, [(1, 7, 7), (1, 7, 1), *ONWARD], ALICE_FIRST_S, LegAction.WORK)
    order = order_of(works, plan(BOB, ONWARD, BOB_LATE_S))
    order.on_progress(Progress(BOB, 1, 0, 1, 1, 0, 0))
    assert firsts(order, *BEYOND) == {(NOBODY, ALICE)}
    order = order_of(plan(ALICE, [(1, 7, 1), *ONWARD], ALICE_FIRST_S), plan(BOB, [(1, 1, 4), (1, 4, 1)], BOB_LATE_S))
    order.on_progress(Progress(BOB, 1, 0, 1, 1, 0, 0))
    assert firsts(order, at(2, 2), at(3, 5)) == {(NOBODY, None)}
