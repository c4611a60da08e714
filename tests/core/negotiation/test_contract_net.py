"""The classic contract net as a measure: everybody answers, everybody is answered; and the MIP beside it (row P13)."""

import pytest

from bench.negotiation import PROTOCOLS, measure
from bus_sim.systems.car_park.baselines.contract_net import REFUSAL, ContractNetInitiator, ContractNetParticipant
from onboard.contract.codes import CallResult, KindCode
from onboard.contract.messages import Award, Bid, Message
from onboard.core.effects import Effect, Send
from onboard.core.negotiation import Awarded, Closed, NegotiationEvent, Released
from tests.core.negotiation.fleet import CALLER, START_US, TIMING, Costs, terms

CALLS = 60


def said(outcome: list[Effect | NegotiationEvent]) -> list[Message]:
    return [item.message for item in outcome if isinstance(item, Send)]


def participants(costs: dict[int, Costs], kind: KindCode = KindCode.ROBOT) -> dict[int, ContractNetParticipant]:
    return {node: ContractNetParticipant(node, kind, estimator) for node, estimator in costs.items()}


def test_every_participant_answers_and_every_proposer_is_answered() -> None:
    robots = participants({11: Costs({1: 3_000}), 12: Costs({1: 1_000}), 13: Costs({1: None}), 14: Costs({})})
    initiator = ContractNetInitiator(CALLER, TIMING, frozenset(robots))
    (call,) = said(list(initiator.open(terms(), START_US)))
    bids = [bid for robot in robots.values() for bid in said(robot.receive(call, START_US))]
    assert [bid.cost == REFUSAL for bid in bids if isinstance(bid, Bid)] == [False, False, True, True]
    outcome = [item for bid in bids for item in initiator.receive(bid, START_US + 1_000)]
    answers = [message for message in said(outcome) if isinstance(message, Award)]
    assert [(a.winner, a.result) for a in answers] == [(12, CallResult.AWARDED), (11, CallResult.REJECTED)]
    (closed,) = (item for item in outcome if isinstance(item, Closed))
    assert closed.winner == 12
    assert initiator.next_wake() is None, "all have answered: nobody waits for the deadline"
    events = [item for robot in robots.values() for a in answers for item in robot.receive(a, START_US + 2_000)]
    assert [type(event) for event in events] == [Released, Awarded]


def test_the_deadline_closes_a_call_that_not_all_have_answered() -> None:
    robots = participants({11: Costs({1: 3_000}), 12: Costs({1: 1_000})})
    initiator = ContractNetInitiator(CALLER, TIMING, frozenset(robots))
    (call,) = said(list(initiator.open(terms(), START_US)))
    (bid,) = said(robots[11].receive(call, START_US))
    assert initiator.receive(bid, START_US + 1_000) == []
    (late,) = said(robots[12].receive(call, START_US))
    deadline_us = START_US + TIMING.call_window_us
    assert initiator.next_wake() == deadline_us
    assert initiator.receive(late, deadline_us - 1) == [], "within the guard is too late"
    (accept,) = said(initiator.wake(deadline_us))
    assert isinstance(accept, Award)
    assert (accept.winner, accept.result) == (11, CallResult.AWARDED)


def test_where_all_refuse_nobody_is_answered() -> None:
    robots = participants({11: Costs({}), 12: Costs({})})
    initiator = ContractNetInitiator(CALLER, TIMING, frozenset(robots))
    (call,) = said(list(initiator.open(terms(), START_US)))
    bids = [bid for robot in robots.values() for bid in said(robot.receive(call, START_US))]
    outcome = [item for bid in bids for item in initiator.receive(bid, START_US + 1_000)]
    assert said(outcome) == []
    assert [item.result for item in outcome if isinstance(item, Closed)] == [CallResult.REFUSED]


def test_other_kinds_do_not_answer_and_a_second_call_waits() -> None:
    lifts = participants({21: Costs({1: 1_000})}, KindCode.LIFT)
    initiator = ContractNetInitiator(CALLER, TIMING, frozenset({11}))
    (call,) = said(list(initiator.open(terms(), START_US)))
    assert lifts[21].receive(call, START_US) == []
    with pytest.raises(ValueError, match="has call 1 open"):
        initiator.open(terms(2), START_US)


def test_p13_twenty_idle_robots_send_at_most_1_6_bids_a_call_and_twenty_in_a_contract_net() -> None:
    """On the simulated CAN bus at 500 kbit/s, with the times that a site file has by default."""
    mip = measure(PROTOCOLS["MIP"], 20, CALLS)
    classic = measure(PROTOCOLS["contract net"], 20, CALLS)
    assert mip.bids / CALLS <= 1.6
    assert classic.bids / CALLS == 20
    assert mip.messages / CALLS <= 2 + 2 * 1.6 + 1, "call, award, bids with their plans, the winner's plan"
    assert classic.messages / CALLS == 1 + 20 + 20 + 1
    assert mip.frames * 2 < classic.frames
    assert mip.best_won == classic.best_won == CALLS


def test_p08_bids_strictly_improve_on_the_can_bus() -> None:
    assert measure(PROTOCOLS["MIP"], 50, CALLS).crossed == 0


def test_p17_in_random_order_bids_follow_the_harmonic_number() -> None:
    """The systems list's arithmetic (2.5): a new best among n in random order comes H_n times; H_20 is 3.598."""
    tally = measure(PROTOCOLS["MIP, random order"], 20, CALLS)
    assert 3.1 < tally.bids / CALLS < 4.1
    assert tally.best_won == CALLS


def test_equal_seeds_give_equal_counts() -> None:
    assert measure(PROTOCOLS["MIP"], 10, 20, seed=3) == measure(PROTOCOLS["MIP"], 10, 20, seed=3)
    assert measure(PROTOCOLS["MIP"], 10, 20, seed=3) != measure(PROTOCOLS["MIP"], 10, 20, seed=4)
