"""Tokens are granted in the order of the plans, whoever asks first and whatever the bus loses (design, section 5)."""

from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.contract.codes import Reason
from onboard.contract.messages import SyncRequest, TokenRefusal
from onboard.ways.mirror import way_mirror
from tests.core.walkers import Alley
from tests.thinned import is_long

LEFT, RIGHT = 11, 12


def test_who_asks_first_does_not_pass_first() -> None:
    """The right walker comes second by the plans, is ready at once, and would meet the left one head-on."""
    alley = Alley({LEFT: [9], RIGHT: [3]}, {LEFT: [1], RIGHT: [2]}, seed=1)
    alley.run(30)
    alley.assert_in_order()
    assert alley.walker(LEFT).is_home and alley.walker(RIGHT).is_home
    early = next(request for request in alley.requests() if request.sender == RIGHT and request.token & 0xFF == 9)
    assert early.predecessor == LEFT and early.itinerary_version == alley.walker(RIGHT).version


def test_a_machine_that_is_late_keeps_its_place_however_long() -> None:
    """The left walker never starts. Its windows are long over, and still nobody passes before it."""
    alley = Alley({LEFT: [9], RIGHT: [3]}, {LEFT: [1], RIGHT: [2]}, seed=1)
    alley.run(0.2)
    alley.walker(LEFT).may_move_at_us = 1 << 60
    alley.run(400)
    passed = [segment.index for segment, _, node in alley.log if node == RIGHT]
    assert passed == [11, 10], "as far as the way of the other does not come"
    alley.walker(LEFT).may_move_at_us = 0
    alley.run(30)
    alley.assert_in_order()
    assert alley.walker(LEFT).is_home and alley.walker(RIGHT).is_home


def test_a_delay_that_nobody_has_answered_yet_changes_no_order() -> None:
    """The first tells that it comes in the other's time; until the other tells its answer the old order holds."""
    alley = Alley({LEFT: [9], RIGHT: [3]}, {LEFT: [1], RIGHT: [2]}, seed=1)
    alley.walker(LEFT).may_move_at_us = 1 << 60
    alley.run(0.2)
    alley.carry_out(LEFT, alley.walker(LEFT).tell(later_us=70_000_000))
    alley.run(30)
    assert RIGHT not in {node for segment, _, node in alley.log if segment.index <= 9}
    alley.walker(LEFT).may_move_at_us = 0
    alley.run(30)
    alley.assert_in_order()


def test_a_plan_given_up_sets_its_segments_free() -> None:
    """The first machine tells that it stays where it is: the second need not wait for it any more."""
    alley = Alley({LEFT: [9], RIGHT: [5]}, {LEFT: [1], RIGHT: [2]}, seed=1)
    alley.run(0.2)
    left = alley.walker(LEFT)
    left.path, left.legs, left.done = [], left.legs[:1], 0
    alley.carry_out(LEFT, left.tell())
    alley.run(30)
    assert alley.walker(RIGHT).is_home


def test_differing_views_are_refused_and_mended_by_statements() -> None:
    """The right walker missed the other's plan: it claims to be first, is refused, hears the plan again, and waits."""
    alley = Alley({LEFT: [9], RIGHT: [3]}, {LEFT: [1], RIGHT: [2]}, seed=1)
    alley.run(0.2)
    alley.walker(LEFT).may_move_at_us = 1 << 60
    mirror = way_mirror(alley.holons[RIGHT].mirror)
    alley.run(1)
    del mirror.order._ways[LEFT], mirror.itineraries[LEFT], mirror.plans[LEFT]
    alley.holons[RIGHT].tokens.wanted.clear()
    alley.run(3)
    refusals = [message for message in alley.heard if isinstance(message, TokenRefusal)]
    assert any(one.requester == RIGHT and one.reason is Reason.MIRROR_BEHIND for one in refusals)
    assert any(isinstance(message, SyncRequest) and message.whom == LEFT for message in alley.heard[-400:])
    assert alley.requests()[-1].predecessor == LEFT
    alley.walker(LEFT).may_move_at_us = 0
    alley.run(30)
    alley.assert_in_order()


@settings(max_examples=25 if is_long() else 8)
@given(
    st.integers(0, 2**32 - 1),
    st.lists(st.integers(2, 11), min_size=4, max_size=4),
    st.floats(0.05, 0.4),
    st.lists(st.integers(0, 9), max_size=2),
)
def test_order_and_single_holders_survive_a_bad_bus_and_all_arrive_on_a_good_one(
    seed: int, turns: list[int], loss: float, delays_s: list[int]
) -> None:
    """Rounds take turns; frames are lost, doubled and reordered at single receivers; delays are told meanwhile.

    A round is over 20 s before the next begins, so these delays ask nobody to answer: the order is that of the rounds.
    """
    alley = Alley({LEFT: turns[:2], RIGHT: turns[2:]}, {LEFT: [1, 3], RIGHT: [2, 4]}, seed)
    alley.run(1)
    alley.loss = loss
    for delay_s in delays_s:
        alley.run(3)
        for walker in (alley.walker(LEFT), alley.walker(RIGHT)):
            if not walker.is_home:
                alley.carry_out(walker.fleet.node_id, walker.tell(later_us=delay_s * 1_000_000))
    alley.run(15)
    alley.loss = 0.0
    alley.run(90)
    alley.assert_in_order()
    assert alley.walker(LEFT).is_home and alley.walker(RIGHT).is_home
