"""Calls that stand: nobody looks at one when it is heard, and bids for it count round by round."""

from dataclasses import dataclass, field, replace

from onboard.contract.codes import CallResult, Criterion, KindCode, Reason, TaskPhase
from onboard.contract.messages import Award, Bid, CallForProposals, Message, Reference, TaskReport
from onboard.core.effects import Send
from onboard.core.negotiation import Negotiation, NegotiationEvent, Proposal, Released
from onboard.core.negotiation.negotiation import Outcome
from onboard.work.plain import NoEstimator
from tests.core.negotiation.fleet import CALLER, START_US, TIMING, a_call, terms

ME, OTHER = 11, 12
ROUND_US = (START_US, START_US + 400_000)
CALL = replace(a_call(5), criterion=Criterion.LENGTH)
MARK = 77


@dataclass
class Fixed(NoEstimator):
    """Every task costs as much."""

    cost: int = 500
    asked: list[int] = field(default_factory=list)

    def lower_bound(self, call: CallForProposals, now_us: int) -> int:
        self.asked.append(call.call)
        return self.cost

    def estimate(self, call: CallForProposals, now_us: int) -> Proposal:
        return Proposal(self.cost, None, (), (), version=MARK)


def bidder() -> Negotiation:
    one = Negotiation(ME, KindCode.ROBOT, TIMING, Fixed())
    one.stands = lambda call: call.sender == CALLER
    return one


def caller() -> Negotiation:
    one = Negotiation(CALLER, KindCode.DESK, TIMING, NoEstimator())
    one.begin_round({5: replace(terms(), criterion=Criterion.LENGTH)}, ROUND_US[1])
    return one


def said(outcome: Outcome) -> list[Message]:
    return [item.message for item in outcome if isinstance(item, Send)]


def events(outcome: Outcome) -> list[type[NegotiationEvent]]:
    return [type(item) for item in outcome if isinstance(item, NegotiationEvent)]


def bid(cost: int, node: int = OTHER, call: int = 5) -> Bid:
    return Bid(node, CALLER, call, cost, MARK)


def test_a_call_that_stands_is_looked_at_in_a_round_and_not_when_it_is_heard() -> None:
    one = bidder()
    assert one.receive(CALL, START_US) == [] and one.next_wake() is None
    one.look(CALL, ROUND_US, [], START_US)
    due_us = one.next_wake()
    assert due_us is not None and START_US < due_us < ROUND_US[1]
    assert said(one.wake(due_us)) == [Bid(ME, CALLER, 5, 500, MARK)]


def test_who_takes_part_late_in_a_round_bids_when_it_would_have_from_its_begin() -> None:
    prompt, late = bidder(), bidder()
    prompt.look(CALL, ROUND_US, [], START_US)
    late.look(CALL, ROUND_US, [], START_US + 1000)
    assert late.next_wake() == prompt.next_wake()


def test_a_better_bid_of_the_round_heard_before_or_after_keeps_it_silent_or_beats_it() -> None:
    one = bidder()
    one.look(CALL, ROUND_US, [bid(499)], START_US)
    assert said(one.wake(ROUND_US[1])) == []
    one.leave_round(CALLER)
    one.look(CALL, ROUND_US, [bid(501)], START_US)
    assert len(said(one.wake(one.next_wake() or 0))) == 1
    assert events(one.receive(bid(499), START_US + 200_000)) == [Released]


def test_a_round_that_is_over_leaves_nothing_to_do() -> None:
    one = bidder()
    one.look(CALL, ROUND_US, [], START_US)
    one.leave_round(CALLER)
    assert one.next_wake() is None and one.wake(ROUND_US[1]) == []


def test_the_best_bid_of_a_round_is_awarded_where_that_is_news_and_nothing_is_said_else() -> None:
    desk = caller()
    for offered in (bid(700), bid(600, ME)):
        assert desk.receive(offered, START_US + 100_000) == []
    assert desk.best_of_round() == {5: (600, ME)}
    assert desk.next_wake() is None and desk.wake(ROUND_US[1]) == []
    (award,) = said(list(desk.award_in_round(5, ROUND_US[1])))
    assert award == Award(CALLER, 5, ME, Reference(CALLER, 1), 1, CallResult.AWARDED, Reason.NONE)
    again_us = desk.next_wake()
    assert again_us is not None and said(desk.wake(again_us)) == [award], "until its winner is heard"
    desk.receive(TaskReport(ME, Reference(CALLER, 1), TaskPhase.AWARDED, 0, Reason.NONE), again_us)
    assert desk.next_wake() is None


def test_bids_after_the_cut_off_or_for_what_does_not_stand_do_not_count() -> None:
    desk = caller()
    desk.receive(bid(500), ROUND_US[1] - TIMING.deadline_guard_us + 1)
    desk.receive(bid(500, call=6), START_US)
    assert desk.best_of_round() == {} and desk.award_in_round(5, ROUND_US[1]) == []
    assert desk.counters.late_bids_ignored == 2


def test_another_round_begins_without_the_bids_and_awards_of_the_one_before() -> None:
    desk = caller()
    desk.receive(bid(500), START_US)
    desk.award_in_round(5, ROUND_US[1])
    desk.begin_round({5: replace(terms(), criterion=Criterion.LENGTH)}, ROUND_US[1] + 400_000)
    assert desk.next_wake() is None and desk.best_of_round() == {}
    desk.receive(bid(900), ROUND_US[1] + 1)
    assert desk.best_of_round() == {5: (900, OTHER)}
