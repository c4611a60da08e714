"""Who has lost a task, by the one rule that all initiators share."""

from onboard.contract.codes import CallResult, Criterion, KindCode, Operation, Reason
from onboard.contract.constants import NOBODY
from onboard.contract.messages import Award, Bid, LeftOut, Message, Reference
from onboard.core.effects import Effect, Send
from onboard.core.mirror import Obstacle
from onboard.core.negotiation import Negotiation, RequestedTerms
from onboard.core.negotiation.initiator import ACCEPT_WITHIN_US
from onboard.core.negotiation.winners import LOST_AFTER_US, STANDS_AFTER_US, Winners
from onboard.work.plain import NoEstimator
from tests.sites import one_floor

SITE = one_floor(robots=2)
DESK, ALICE, BOB = 1, 11, 12
TASK = Reference(DESK, 7)
TERMS = RequestedTerms(TASK, Operation.TRANSPORT, KindCode.ROBOT, Criterion.LENGTH, 1, 2, TASK, 0)
SECOND = 1_000_000


def said(effects: list[Effect]) -> list[Message]:
    return [one.message for one in effects if isinstance(one, Send)]


class Desk:
    """An initiator and its winners."""

    def __init__(self) -> None:
        self.negotiation = Negotiation(DESK, KindCode.DESK, SITE.timing, NoEstimator())
        self.obstacles: dict[int, Obstacle] = {}
        self.winners = Winners(DESK, self.negotiation, self.obstacles)

    def award(self, node: int) -> int:
        """A call that ``node`` wins; the number of the call."""
        call = said(self.negotiation.open(TERMS, 0))[-1].call  # type: ignore[attr-defined]  # the last word is the call
        self.negotiation.receive(Bid(node, DESK, call, 5, 0), SECOND // 2)
        due_us = self.negotiation.next_wake()
        assert due_us is not None
        self.negotiation.wake(due_us)
        return int(call)


def test_a_winner_that_tells_nothing_new_stands_after_a_while_whatever_it_repeats() -> None:
    desk = Desk()
    desk.winners.takes(TASK, ALICE, 0)
    for second in range(100):
        desk.winners.works(ALICE, "here", second * SECOND)
    assert desk.winners.lost(TASK, STANDS_AFTER_US - 1) is Reason.NONE
    assert desk.winners.lost(TASK, STANDS_AFTER_US) is Reason.FALSE_STATEMENT
    desk.winners.works(ALICE, "there", STANDS_AFTER_US)
    assert desk.winners.lost(TASK, STANDS_AFTER_US) is Reason.NONE


def test_a_winner_that_is_an_obstacle_has_the_time_of_a_restart() -> None:
    desk = Desk()
    desk.winners.takes(TASK, ALICE, 0)
    desk.obstacles[ALICE] = Obstacle(frozenset(), SECOND, Reason.NODE_SILENT)
    assert desk.winners.lost(TASK, SECOND + LOST_AFTER_US - 1) is Reason.NONE
    assert desk.winners.lost(TASK, SECOND + LOST_AFTER_US) is Reason.NODE_SILENT
    desk.obstacles[ALICE] = Obstacle(frozenset(), SECOND, Reason.FALSE_STATEMENT)
    assert desk.winners.lost(TASK, SECOND) is Reason.FALSE_STATEMENT, "it restarts nothing"


def test_who_lost_a_task_hears_it_and_is_left_out_of_the_next_call() -> None:
    desk = Desk()
    call = desk.award(ALICE)
    now_us = 20 * SECOND
    assert desk.winners.lost(TASK, now_us) is Reason.NODE_SILENT, "awarded, and not heard"
    (rejected,) = said(desk.winners.take_back(TASK, Reason.NODE_SILENT, now_us))
    assert rejected == Award(DESK, call, NOBODY, TASK, 1, CallResult.REJECTED, Reason.NODE_SILENT)
    words = said(desk.negotiation.open(TERMS, now_us))
    left_out = next(word for word in words if isinstance(word, LeftOut))
    assert left_out.node_a == ALICE
    assert not desk.winners.may_claim(TASK, ALICE, now_us), "its word that it has it counts no more"
    assert desk.winners.may_claim(TASK, BOB, now_us)


def test_who_comes_back_for_what_is_anothers_is_reminded() -> None:
    desk = Desk()
    desk.winners.takes(TASK, BOB, 0, call=9)
    assert said(desk.winners.remind(TASK, ALICE)) == [
        Award(DESK, 9, BOB, TASK, 1, CallResult.AWARDED, Reason.NONE),
    ]
    assert desk.winners.remind(TASK, BOB) == []


def test_a_winner_that_keeps_a_task_and_stands_needs_a_person_until_it_moves() -> None:
    desk = Desk()
    desk.winners.takes(TASK, ALICE, 0)
    desk.winners.keeps(TASK)
    assert desk.winners.stuck(SECOND) == []
    desk.winners.keeps(TASK)
    assert desk.winners.stuck(STANDS_AFTER_US) == [ALICE]
    desk.winners.works(ALICE, "there", STANDS_AFTER_US)
    assert desk.winners.stuck(STANDS_AFTER_US + SECOND) == []


def test_who_was_held_itself_counts_nobody_as_lost_by_that_time() -> None:
    desk = Desk()
    desk.winners.takes(TASK, ALICE, 0)
    desk.obstacles[ALICE] = Obstacle(frozenset(), SECOND, Reason.EMERGENCY_STOP)
    desk.winners.begin_anew(40 * SECOND)
    assert desk.winners.lost(TASK, 40 * SECOND + LOST_AFTER_US - 1) is Reason.NONE
    assert desk.winners.lost(TASK, 40 * SECOND + LOST_AFTER_US) is Reason.EMERGENCY_STOP


def test_who_has_a_task_that_nobody_needs_any_more_hears_so_and_is_not_left_out() -> None:
    desk = Desk()
    call = desk.award(ALICE)
    desk.winners.takes(TASK, ALICE, SECOND, call)
    (word,) = said(desk.winners.let_go(TASK))
    assert isinstance(word, Award)
    assert (word.task, word.call, word.winner, word.result) == (TASK, call, NOBODY, CallResult.REJECTED)
    assert not desk.negotiation.trust.left_out(TASK, SECOND, last_attempt=False)


def test_an_award_that_was_not_heard_while_its_initiator_was_held_is_no_loss() -> None:
    desk = Desk()
    desk.award(ALICE)
    assert desk.winners.lost(TASK, 40 * SECOND) is Reason.NODE_SILENT
    desk.winners.begin_anew(40 * SECOND)
    assert desk.winners.lost(TASK, 40 * SECOND + ACCEPT_WITHIN_US - 1) is Reason.NONE
    assert desk.winners.lost(TASK, 40 * SECOND + ACCEPT_WITHIN_US) is Reason.NODE_SILENT
