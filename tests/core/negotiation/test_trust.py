"""Who wins tasks and does not do them is left out, for longer each time."""

from onboard.contract.codes import Criterion, KindCode
from onboard.contract.messages import Reference
from onboard.core.negotiation.trust import OUT_OF_ALL_US, OUT_OF_TASK_US, Trust, left_out_words

GOOD, BAD = 12, 11
TIME = Criterion.FINISH_TIME


def fails(trust: Trust, number: int, now_us: int) -> None:
    task = Reference(1, number)
    trust.given(task, BAD, 0, TIME)
    trust.forfeited(task, now_us)


def out(trust: Trust, number: int, now_us: int, *, last: bool = False) -> frozenset[int]:
    return trust.left_out(Reference(1, number), now_us, last_attempt=last)


def test_one_forfeit_is_out_of_the_calls_for_that_task_only() -> None:
    trust = Trust()
    fails(trust, 1, 0)
    assert out(trust, 1, 1) == {BAD}
    assert out(trust, 2, 1) == frozenset()
    assert out(trust, 1, 1, last=True) == frozenset(), "before a customer is sent away anybody may try"
    assert out(trust, 1, OUT_OF_TASK_US) == frozenset()
    fails(trust, 1, OUT_OF_TASK_US)
    assert out(trust, 1, 3 * OUT_OF_TASK_US - 1) >= {BAD}, "twice as long"


def test_forfeits_in_a_row_are_out_of_all_calls_for_longer_each_time() -> None:
    trust = Trust()
    fails(trust, 1, -1)
    fails(trust, 2, 0)
    assert out(trust, 3, OUT_OF_ALL_US - 1, last=True) == {BAD}
    assert out(trust, 3, OUT_OF_ALL_US) == frozenset()
    fails(trust, 3, OUT_OF_ALL_US)
    assert out(trust, 4, 3 * OUT_OF_ALL_US - 1) == {BAD}


def test_what_is_lost_at_one_moment_counts_once() -> None:
    """A lathe whose cable was cut lost five orders with it, and was out of all calls for an hour once it was back."""
    trust = Trust()
    for number in range(5):
        fails(trust, number, 0)
    assert out(trust, 9, 1) == frozenset()
    fails(trust, 5, OUT_OF_TASK_US)
    assert out(trust, 9, OUT_OF_TASK_US + OUT_OF_ALL_US - 1) == {BAD}
    assert out(trust, 9, OUT_OF_TASK_US + OUT_OF_ALL_US) == frozenset()


def test_whoever_is_the_only_one_that_lives_is_left_out_of_nothing() -> None:
    trust, alive = Trust(), {GOOD, BAD}
    trust.able = lambda kind: frozenset(alive) if kind is KindCode.ROBOT else frozenset()
    fails(trust, 1, -1)
    fails(trust, 1, 0)
    task = Reference(1, 1)
    assert trust.left_out(task, 1, last_attempt=False, kind=KindCode.ROBOT) == {BAD}
    alive.remove(GOOD)
    assert trust.left_out(task, 1, last_attempt=False, kind=KindCode.ROBOT) == frozenset()
    assert trust.left_out(task, 1, last_attempt=False) == {BAD}, "what it claims of the task is as doubtful as before"


def test_a_task_that_is_done_ends_it() -> None:
    trust = Trust()
    fails(trust, 1, -1)
    fails(trust, 2, 0)
    trust.given(Reference(1, 3), BAD, 1_000, TIME)
    trust.done(Reference(1, 3), BAD, 1_000_000)
    assert out(trust, 4, 2_000_000) == frozenset()


def test_who_is_far_later_than_it_bid_where_others_keep_their_dates_fails_by_that() -> None:
    trust = Trust()
    for number, node, late_us in ((1, GOOD, 5_000_000), (2, BAD, 300_000_000), (3, BAD, 300_000_001)):
        trust.given(Reference(1, number), node, 0, TIME)
        trust.done(Reference(1, number), node, late_us)
    assert out(trust, 4, 300_000_002) == {BAD}


def test_where_all_are_late_nobody_is_a_liar() -> None:
    trust = Trust()
    for number, node in enumerate((GOOD, BAD, GOOD, BAD, BAD), start=1):
        trust.given(Reference(1, number), node, 0, TIME)
        trust.done(Reference(1, number), node, 300_000_000)
    assert out(trust, 9, 300_000_001) == frozenset()


def test_more_than_six_are_named_in_two_words() -> None:
    one, two = left_out_words(1, 7, frozenset(range(11, 18)))
    assert (one.call, one.node_a, one.node_f, two.node_a, two.node_b) == (7, 11, 16, 17, 0)
