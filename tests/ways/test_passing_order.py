"""Who comes first on a segment, from plans and from what machines tell of where they are."""

from collections.abc import Sequence

import pytest

from onboard.contract.codes import Grade, LegAction, Reason, Side
from onboard.contract.constants import NOBODY
from onboard.contract.messages import Itinerary, Leg, Progress, Stamp
from onboard.core.site import Segment
from onboard.ways.occupancy import leg_windows
from onboard.ways.passing_order import PassingOrder
from onboard.ways.told_way import next_plan
from tests.sites import one_floor

SITE = one_floor(robots=2)
ALICE, BOB = 11, 12


def order_of(*plans: Itinerary) -> PassingOrder:
    order = PassingOrder(SITE)
    for itinerary in plans:
        tell(order, itinerary)
    return order


def tell(order: PassingOrder, itinerary: Itinerary, now_us: int = 0) -> None:
    order.on_plan(itinerary, leg_windows(SITE, itinerary, now_us), now_us)


def plan(node: int, way: Sequence[tuple[int, int, int]], version: int = 1, begin_s: int = 0) -> Itinerary:
    """Legs on the one alley as (from, to, end in s); equal ends of a leg mean a wait."""
    legs = tuple(
        Leg(LegAction.STAND if one == other else LegAction.TRAVEL, 1, one, other, Side.NEAR, end_s * 1000)
        for one, other, end_s in way
    )
    return Itinerary(node, version, Grade.FIRM, Stamp(begin_s * 1000, node, 0), legs)


def progress(node: int, leg: int, index: int, version: int = 1, offset_mm: int = 0) -> Progress:
    return Progress(node, version, leg, 1, index, offset_mm, 0)


def passing() -> PassingOrder:
    """Alice goes from 2 to 8 and back to 4; Bob then comes from 12 to 6."""
    there_and_back = plan(ALICE, [(2, 8, 20), (8, 4, 40)])
    return order_of(there_and_back, plan(BOB, [(12, 12, 60), (12, 6, 80)]))


def test_the_plans_times_give_the_order() -> None:
    order = passing()
    assert order.predecessor(BOB, Segment(1, 7)) == ALICE
    assert order.predecessor(ALICE, Segment(1, 7)) == NOBODY
    assert order.predecessor(BOB, Segment(1, 11)) == NOBODY
    assert order.predecessor(BOB, Segment(1, 3)) is None


def test_who_is_to_go_on_elsewhere_keeps_its_place_in_the_order_on_the_way_in_hand() -> None:
    """Both are late, and Alice wins one more task: by the times alone she would be first now."""
    order = order_of(plan(BOB, [(6, 2, 20)]), plan(ALICE, [(10, 10, 25), (10, 4, 40)]))
    assert order.predecessor(ALICE, Segment(1, 5)) == BOB
    tell(order, plan(BOB, [(6, 2, 60)], version=2, begin_s=45))
    assert order.predecessor(ALICE, Segment(1, 5)) == BOB
    tell(order, plan(ALICE, [(10, 10, 25), (10, 4, 55), (4, 12, 90)], version=2))
    assert order.predecessor(ALICE, Segment(1, 5)) == BOB
    assert order.predecessor(BOB, Segment(1, 5)) == NOBODY


def test_only_its_own_word_or_token_ends_a_machines_turn() -> None:
    order = passing()
    order.on_progress(progress(ALICE, 0, 8))
    assert order.predecessor(BOB, Segment(1, 7)) == ALICE, "it comes once more, on its way back"
    order.on_progress(progress(ALICE, 1, 7, offset_mm=1_200))
    assert order.predecessor(BOB, Segment(1, 8)) == ALICE, "its rear is not over the border yet"
    order.on_return(ALICE, Segment(1, 8))
    assert order.predecessor(BOB, Segment(1, 8)) == NOBODY
    order.on_progress(progress(ALICE, 1, 5))
    assert [order.predecessor(BOB, Segment(1, index)) for index in (6, 7)] == [NOBODY, NOBODY]


def test_a_token_given_back_on_the_way_there_is_not_taken_for_the_way_back() -> None:
    """The grant was lost and is said again only now, when the machine has turned round."""
    order = passing()
    order.on_progress(progress(ALICE, 1, 8))
    order.on_return(ALICE, Segment(1, 6))
    assert order.predecessor(BOB, Segment(1, 6)) == ALICE


def test_progress_of_another_version_tells_nothing() -> None:
    order = passing()
    order.on_progress(progress(ALICE, 1, 4, version=9))
    assert order.predecessor(BOB, Segment(1, 7)) == ALICE


def test_who_has_come_to_its_end_has_left_the_mouth_whoever_heard_it_give_that_back() -> None:
    """A steward that was started again kept a mouth for who stood in the spur for 3 minutes (drawn car parks, 4657)."""
    site = one_floor(2, extra='[[spurs]]\nat = "p(1,7)"\n')
    spur, mouth = Segment(192, 1), Segment(1, 7)
    legs = (Leg(LegAction.TRAVEL, 1, 2, 7, Side.NEAR, 20_000), Leg(LegAction.TRAVEL, 192, 1, 1, Side.NEAR, 30_000))
    order = PassingOrder(site)
    for told in (Itinerary(ALICE, 1, Grade.FIRM, Stamp(0, ALICE, 0), legs), plan(BOB, [(12, 12, 60), (12, 6, 80)])):
        order.on_plan(told, leg_windows(site, told, 0), 0)
    order.on_progress(Progress(ALICE, 1, 1, 192, 1, -1_200, 300))
    assert order.predecessor(BOB, mouth) == ALICE, "its body may be in both"
    order.on_progress(Progress(ALICE, 1, 2, 999, 1, 0, 0))
    assert order.predecessor(BOB, mouth) == ALICE, "there is no such track"
    order.on_progress(Progress(ALICE, 1, 2, 192, 1, 0, 0))
    assert order.predecessor(BOB, mouth) == NOBODY
    assert order.predecessor(ALICE, spur) == NOBODY, "there it stays"


def test_who_stands_in_a_spur_has_left_what_only_its_clearance_was_in_beside_the_mouth() -> None:
    """It never held that, so that it gives none back: whoever was to come by waited for ever (constants, 7002)."""
    site = one_floor(2, extra='[[spurs]]\nat = "p(1,7)"\n[carrier]\nclearance_mm = 300\n')
    legs = (Leg(LegAction.TRAVEL, 1, 2, 7, Side.NEAR, 20_000), Leg(LegAction.TRAVEL, 192, 1, 1, Side.NEAR, 30_000))
    order = PassingOrder(site)
    for told in (Itinerary(ALICE, 1, Grade.FIRM, Stamp(0, ALICE, 0), legs), plan(BOB, [(12, 12, 60), (12, 3, 80)])):
        order.on_plan(told, leg_windows(site, told, 0), 0)
    order.on_progress(Progress(ALICE, 1, 1, 1, 7, 0, 0))
    beside = [Segment(1, 8), Segment(1, 6)]
    assert [order.predecessor(BOB, one) for one in beside] == [ALICE, ALICE], "it turns"
    order.on_progress(Progress(ALICE, 1, 1, 192, 1, 0, 0))
    assert [order.predecessor(BOB, one) for one in beside] == [NOBODY, NOBODY]


def test_a_plan_told_anew_drops_what_is_over() -> None:
    order = passing()
    order.on_progress(progress(ALICE, 1, 7))
    tell(order, plan(ALICE, [(8, 4, 41)], version=2))
    order.on_progress(progress(ALICE, 0, 5, version=2))
    assert order.predecessor(BOB, Segment(1, 7)) == NOBODY


def test_who_makes_the_same_trip_once_more_is_at_its_begin_again() -> None:
    there_and_back = [(2, 8, 20), (8, 2, 40)]
    order = order_of(plan(ALICE, there_and_back))
    order.on_progress(progress(ALICE, 1, 2))
    tell(order, plan(ALICE, [(2, 8, 120), (8, 2, 140)], version=2, begin_s=100))
    tell(order, plan(BOB, [(12, 12, 160), (12, 6, 180)]))
    assert order.predecessor(ALICE, Segment(1, 7)) == NOBODY, "it comes here by its plan"
    assert order.predecessor(BOB, Segment(1, 7)) == ALICE


def test_the_same_trip_once_more_did_not_begin_with_the_first_one() -> None:
    order = PassingOrder(SITE)
    first = next_plan(None, 0, plan(ALICE, [(2, 8, 20), (8, 2, 40)]), 0)
    tell(order, first.itinerary)
    again = plan(ALICE, [(2, 8, 120), (8, 2, 140)], version=2, begin_s=100)
    assert next_plan(first, order.leg_in_hand(first), again, 0).first_begin_us == 0, "nobody has heard that it set off"
    order.on_progress(progress(ALICE, 1, 2))
    assert next_plan(first, order.leg_in_hand(first), again, 0).first_begin_us == 100_000_000


def test_a_released_plan_is_nobodys_predecessor() -> None:
    order = passing()
    tell(order, Itinerary(ALICE, 2, Grade.RELEASED, Stamp(0, ALICE, 0), ()))
    assert order.predecessor(BOB, Segment(1, 7)) == NOBODY


def test_a_delay_into_anothers_time_keeps_the_order_and_a_new_way_does_not() -> None:
    order = order_of(
        plan(ALICE, [(2, 2, 10), (2, 8, 30), (8, 2, 50)]), plan(BOB, [(12, 12, 60), (12, 6, 80), (6, 12, 99)])
    )
    tell(order, plan(ALICE, [(2, 2, 70), (2, 8, 90), (8, 2, 110)], version=2))
    assert order.predecessor(BOB, Segment(1, 7)) == ALICE
    tell(order, plan(ALICE, [(2, 2, 70), (2, 9, 91), (9, 2, 112)], version=3))
    assert order.predecessor(BOB, Segment(1, 7)) == NOBODY, "it planned anew and has come behind"


@pytest.mark.parametrize(("apart_us", "first"), [(900_000, {None}), (5_000_000, {ALICE, BOB})])
def test_of_two_plans_told_at_one_time_nobody_has_the_other_first(apart_us: int, first: set[int | None]) -> None:
    """Each is made around the other's last one, and is behind it; both stood for minutes (drawn lines, 145)."""
    before = (
        plan(ALICE, [(2, 2, 10), (2, 8, 30), (8, 2, 50)]),
        plan(BOB, [(12, 12, 60), (12, 6, 80), (6, 12, 99)]),
    )
    anew = (
        plan(ALICE, [(2, 2, 100), (2, 8, 120), (8, 2, 140)], version=2),
        plan(BOB, [(12, 12, 90), (12, 6, 110), (6, 12, 130)], version=2),
    )
    found = set()
    for one, two in (anew, anew[::-1]):
        order = order_of(*before)
        tell(order, one)
        tell(order, two, apart_us)
        found |= {meeting.first for meeting in order.meetings(ALICE, BOB)}
    assert found == first


def test_a_request_of_a_plan_not_heard_yet_is_refused_as_behind() -> None:
    order = passing()
    assert order.verdict(BOB, Segment(1, 11), 2, NOBODY) is Reason.MIRROR_BEHIND
    assert order.verdict(BOB, Segment(1, 11), 1, NOBODY) is Reason.NONE
    assert order.verdict(99, Segment(1, 11), 1, NOBODY) is Reason.MIRROR_BEHIND


def test_another_predecessor_than_mine_is_refused_as_behind() -> None:
    order = passing()
    assert order.verdict(BOB, Segment(1, 7), 1, ALICE) is Reason.TOKEN_NOT_GRANTABLE_YET
    assert order.verdict(BOB, Segment(1, 7), 1, NOBODY) is Reason.MIRROR_BEHIND
    assert order.verdict(ALICE, Segment(1, 7), 1, BOB) is Reason.MIRROR_BEHIND, "Bob is still to come"


def test_a_predecessor_that_has_passed_settles_the_question() -> None:
    order = passing()
    order.on_progress(progress(ALICE, 1, 4))
    assert order.verdict(BOB, Segment(1, 7), 1, ALICE) is Reason.NONE


def test_a_predecessor_that_has_passed_and_comes_again_settles_it_too() -> None:
    """Its holder knows that it has left before others hear of that, and refused it for as long as it drove on."""
    there_and_back = plan(ALICE, [(9, 4, 20), (4, 4, 70), (4, 9, 90)])
    order = order_of(there_and_back, plan(BOB, [(11, 11, 30), (11, 7, 40), (7, 11, 55)]))
    assert order.verdict(BOB, Segment(1, 7), 1, ALICE) is Reason.TOKEN_NOT_GRANTABLE_YET
    order.on_progress(progress(ALICE, 0, 4))
    assert order.verdict(BOB, Segment(1, 7), 1, ALICE) is Reason.NONE


def test_who_stands_in_my_way_goes_first_wherever_i_come_after_it() -> None:
    """A clock that was set back has put Alice's way through Bob's body, and back again, before Bob goes on (41197)."""
    alice = plan(ALICE, [(2, 8, 20), (8, 2, 40)])
    bob = plan(BOB, [(5, 5, 60), (5, 12, 80)])
    order = order_of(alice, bob)
    assert [order.predecessor(ALICE, Segment(1, index)) for index in (5, 6, 7)] == [BOB, BOB, BOB]
    assert [order.predecessor(BOB, Segment(1, index)) for index in (5, 6, 7)] == [NOBODY, NOBODY, NOBODY]
    tell(order, plan(BOB, [(5, 5, 30), (5, 12, 80)], version=2))
    found = order.meetings(BOB, ALICE)
    assert {meeting.theirs.to_come for meeting in found} == {0, 1}
    assert {order.in_front(BOB, ALICE, meeting) for meeting in found} == {BOB}
