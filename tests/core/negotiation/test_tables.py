"""The two transition tables as data, and what each of their rarer entries does."""

from collections.abc import Iterable
from dataclasses import replace
from enum import Enum
from itertools import pairwise

import pytest

from onboard.contract.codes import CallResult, Criterion, Grade, Reason, TaskPhase
from onboard.contract.constants import NOBODY
from onboard.contract.messages import Award, Bid, CallForProposals, Itinerary, LeftOut, Reference, Stamp, TaskReport
from onboard.core.negotiation import CallKey, delay_us, initiator, participant
from onboard.core.negotiation.bidding import SpeakingSlot, in_slot, slot_of
from onboard.core.negotiation.negotiation import FORGET_US, MAX_CALLS
from tests.core.negotiation.fleet import CALLER, START_US, TIMING, Bus, Costs, Machine, a_call, caller, fleet, terms
from tests.sites import one_floor

P, PE = participant.ParticipantState, participant.ParticipantEvent
IS = initiator.InitiatorState


def reachable(start: Enum, steps: Iterable[tuple[Enum, Enum]]) -> set[Enum]:
    found, edges = {start}, list(steps)
    while new := {after for before, after in edges if before in found and after not in found}:
        found |= new
    return found


def test_every_state_is_reached_and_only_the_last_ones_end() -> None:
    participant_steps = [(before, after) for (before, _), (after, _) in participant.TABLE.items()]
    assert reachable(P.WAITING_BOUND, participant_steps) == set(P)
    # Who is assigned answers an award that is said again, and stays so.
    assert set(P) - {before for before, after in participant_steps if after is not before} == {P.ASSIGNED, P.LOST}
    initiator_steps = [(before, after) for (before, _), (after, _) in initiator.TABLE.items()]
    assert reachable(IS.OPEN, initiator_steps) == set(IS)
    assert set(IS) - {before for before, _ in initiator_steps} == {IS.CLOSED}


def test_time_alone_ends_every_wait_and_every_reservation() -> None:
    """Row P14: whoever waits, or keeps reservations, stops by the clock; silent and lapsed machines keep nothing."""
    by_time = {PE.DUE, PE.DEADLINE, PE.LAPSE}
    waits = {P.WAITING_BOUND, P.WAITING_COST, P.ASKING, P.PRE_ASSIGNED, P.BELIEVING, P.OPTION}
    assert {before for before, event in participant.TABLE if event in by_time} == waits


def test_every_state_takes_the_initiators_last_word() -> None:
    open_states = set(P) - {P.ASSIGNED, P.LOST}
    for event in (PE.AWARD_OTHER, PE.SUPERSEDED):
        assert {before for before, what in participant.TABLE if what is event} == open_states
    assert {state for (_, event), (state, _) in participant.TABLE.items() if event is PE.AWARD_ME} == {P.ASSIGNED}


def bidder(cost: int = 1_000) -> Machine:
    """A robot whose bid for call 1 stands."""
    robot = Machine(11, Costs(dict.fromkeys(range(1, MAX_CALLS + 9), cost)))
    robot.receive(a_call(), START_US)
    robot.wake(START_US + 100_000)
    assert robot.committed == {CallKey(CALLER, 1)}
    return robot


def award(winner: int, result: CallResult = CallResult.AWARDED, reason: Reason = Reason.NONE) -> Award:
    return Award(CALLER, 1, winner, Reference(CALLER, 1), 1, result, reason)


@pytest.mark.parametrize(
    ("closing", "reason"),
    [
        (award(12), Reason.BEATEN),
        (award(NOBODY, CallResult.REOPENED, Reason.NO_BID), Reason.NO_BID),
        (award(NOBODY, CallResult.WITHDRAWN, Reason.CANCELLED), Reason.CANCELLED),
    ],
    ids=["another won", "opened again", "withdrawn"],
)
def test_a_closed_call_frees_the_bidder_and_tells_why(closing: Award, reason: Reason) -> None:
    robot = bidder()
    robot.receive(closing, START_US + 200_000)
    assert robot.committed == set()
    assert robot.released == [reason]


def test_an_award_heard_many_times_assigns_once() -> None:
    robot = bidder()
    for number in range(5):
        robot.receive(award(11), START_US + 1_000_000 + number)
    assert len(robot.assigned) == 1
    robot.receive(award(12), START_US + 2_000_000)
    assert len(robot.assigned) == 1
    assert robot.released == []


def test_an_award_counts_before_the_deadline_has_passed_here() -> None:
    robot = bidder()
    robot.receive(award(11), START_US + 900_000)
    assert len(robot.assigned) == 1


def test_an_award_for_a_call_in_which_nothing_was_bid_is_not_taken() -> None:
    robot = Machine(11, Costs({1: 60_000}, slack_ms=60_000))
    robot.receive(a_call(), START_US)
    robot.wake(START_US)
    assert robot.negotiation.counters.searches == 1
    robot.receive(Bid(12, CALLER, 1, a_call().deadline_ms, 0), START_US + 1)
    robot.receive(award(11), START_US + 2)
    assert robot.assigned == [], "it searched, but it never bid"


def test_an_outbid_machine_takes_an_award_all_the_same() -> None:
    """The initiator missed the better bid; its word decides."""
    robot = bidder()
    robot.receive(Bid(12, CALLER, 1, a_call().deadline_ms, 0), START_US + 200_000)
    assert robot.released == [Reason.BEATEN]
    robot.receive(award(11), START_US + 1_100_000)
    assert len(robot.assigned) == 1


def test_a_call_heard_twice_is_one_call() -> None:
    robot = bidder()
    assert robot.receive(a_call(), START_US + 200_000) == []
    assert robot.wake(START_US + 400_000) == []
    assert robot.negotiation.counters.calls_heard == 1


def test_a_stale_attempt_changes_nothing() -> None:
    robot = Machine(11, Costs({1: 1_000}))
    newer = a_call(2, START_US + 1_500_000, attempt=2)
    robot.receive(newer, START_US)
    robot.receive(a_call(1, START_US + 1_000_000), START_US + 10)
    robot.wake(START_US + 400_000)
    assert robot.committed == {CallKey(CALLER, 2)}
    assert robot.negotiation.counters.calls_stale == 1


def test_a_call_made_anew_after_a_withdrawal_may_end_sooner() -> None:
    robot = Machine(11, Costs({1: 1_000}))
    robot.receive(a_call(1, START_US + 3_000_000, attempt=4), START_US)
    robot.receive(award(NOBODY, CallResult.WITHDRAWN, Reason.CANCELLED), START_US + 1_000)
    robot.receive(a_call(2, START_US + 1_100_000), START_US + 2_000)
    robot.wake(START_US + 400_000)
    assert robot.committed == {CallKey(CALLER, 2)}


def test_calls_for_parts_of_one_task_stand_side_by_side() -> None:
    robot = bidder()
    robot.receive(a_call(2, START_US + 1_500_000, depth=1), START_US + 150_000)
    robot.wake(START_US + 400_000)
    assert robot.committed == {CallKey(CALLER, 1), CallKey(CALLER, 2)}


def test_a_call_number_used_anew_after_a_restart_is_a_new_call() -> None:
    robot = bidder()
    again = a_call(1, START_US + 3_000_000, task=Reference(CALLER, 2))
    robot.receive(again, START_US + 1_900_000)
    assert robot.released == [Reason.CANCELLED]
    robot.wake(START_US + 2_300_000)
    assert robot.committed == {CallKey(CALLER, 1)}


def test_p10_memory_is_bounded_and_what_is_reserved_for_goes_last() -> None:
    robot = bidder()
    for number in range(2, MAX_CALLS + 2):
        robot.receive(a_call(number, task=Reference(CALLER, number)), START_US + 200_000)
    assert len(robot.negotiation.participants) == MAX_CALLS
    assert robot.committed == {CallKey(CALLER, 1)}, "calls without a bid go first"
    robot.wake(START_US + 500_000)
    robot.receive(a_call(MAX_CALLS + 2, task=Reference(CALLER, MAX_CALLS + 2)), START_US + 500_001)
    assert len(robot.negotiation.participants) == MAX_CALLS
    assert robot.released == [Reason.CANCELLED], "where all are committed, the oldest is told"


def test_what_is_over_is_forgotten_and_an_open_promise_is_not() -> None:
    robot = bidder()
    robot.receive(a_call(2, task=Reference(CALLER, 2)), START_US + 200_000)
    robot.receive(Bid(12, CALLER, 2, a_call().deadline_ms, 0), START_US + 200_001)
    robot.wake(START_US + 1_000_000 + FORGET_US + 1)
    assert list(robot.negotiation.participants) == [CallKey(CALLER, 1)]
    robot.receive(award(11), START_US + 1_000_000 + 2 * FORGET_US)
    assert len(robot.assigned) == 1
    robot.wake(START_US + 1_000_000 + 2 * FORGET_US)
    assert robot.negotiation.participants == {}


def test_a_withdrawn_call_is_closed_for_nobody_and_can_be_opened_anew() -> None:
    machines = fleet({11: 1_000})
    bus = Bus(machines)
    bus.call(terms())
    bus.run(0.5)
    bus.post(machines[0].carry_out(machines[0].negotiation.withdraw(terms(), bus.now_us), bus.now_us))
    bus.run(0.1)
    assert machines[0].closed[0].result is CallResult.WITHDRAWN
    assert machines[1].released == [Reason.CANCELLED]
    bus.call(terms())
    bus.run(2)
    assert bus.assigned() == [11]


def test_an_award_under_way_is_not_withdrawn() -> None:
    machines = fleet({11: 1_000})
    bus = Bus(machines)
    bus.call(terms())
    bus.run(0.5)
    bus.lose = lambda message, receiver: message.sender == 11
    bus.run(1)
    assert machines[0].negotiation.withdraw(terms(), bus.now_us) == []
    bus.lose = lambda message, receiver: False
    bus.run(2)
    assert [(one.winner, one.result) for one in machines[0].closed] == [(11, CallResult.AWARDED)]


def awarding() -> tuple[Bus, Machine]:
    """A compartment that says its award to node 11 again and again."""
    compartment = caller()
    bus = Bus([compartment, Machine(11, Costs({1: 1_000}))])
    bus.call(terms())
    bus.run(0.5)
    bus.lose = lambda message, receiver: True
    bus.run(1)
    assert bus.awards()
    return bus, compartment


def test_an_award_that_is_not_heard_is_said_ten_times_quickly_then_ever_more_slowly() -> None:
    bus, _ = awarding()
    bus.run(20)
    sent_us = [time_us for time_us, message in bus.wire if isinstance(message, Award)]
    gaps = [later - earlier for earlier, later in pairwise(sent_us)]
    assert gaps[:10] == [TIMING.award_repeat_us] * 10
    assert gaps[10:] == [10 * TIMING.award_repeat_us, *[20 * TIMING.award_repeat_us], *gaps[12:]]
    assert set(gaps[12:]) == {40 * TIMING.award_repeat_us}


def test_only_the_winners_firm_plan_for_this_call_ends_the_award() -> None:
    bus, compartment = awarding()
    (call,) = bus.calls()
    stamp = Stamp(call.deadline_ms, CALLER, call.call)
    right = Itinerary(11, 8, Grade.FIRM, stamp, ())
    wrong = [
        replace(right, sender=12),
        replace(right, grade=Grade.TENTATIVE),
        replace(right, stamp=stamp._replace(initiator=2)),
        replace(right, stamp=stamp._replace(call=call.call + 1)),
    ]
    for itinerary in wrong:
        compartment.receive(itinerary, bus.now_us)
        assert compartment.closed == []
    compartment.receive(right, bus.now_us)
    assert [one.winner for one in compartment.closed] == [11]


def test_a_report_of_the_winner_on_the_task_ends_the_award() -> None:
    bus, compartment = awarding()
    report = TaskReport(12, terms().task, TaskPhase.STARTED, 0x104, Reason.NONE)
    compartment.receive(report, bus.now_us)
    compartment.receive(replace(report, sender=11, task=Reference(CALLER, 9)), bus.now_us)
    assert compartment.closed == [], "another machine, another task"
    compartment.receive(replace(report, sender=11), bus.now_us)
    assert [one.winner for one in compartment.closed] == [11]


@pytest.mark.parametrize("criterion", list(Criterion))
def test_better_bids_speak_sooner_and_all_within_w(criterion: Criterion) -> None:
    delays = [delay_us(1_000 + above, 1_000, criterion, TIMING) for above in (0, 1, 100, 10_000, 1_000_000, 10**9)]
    assert delays[0] == 0
    assert delays[3] == TIMING.bid_delay_us // 2, "h is 10 s, 100 in money, 10 m"
    assert delays == sorted(delays)
    assert delays[-1] < TIMING.bid_delay_us
    assert delay_us(900, 1_000, criterion, TIMING) == 0


def test_slots_keep_machines_a_bus_latency_apart() -> None:
    site = one_floor(robots=3)
    slots = [slot_of(site, node) for node in sorted(site.machines)]
    assert [slot.number for slot in slots] == [0, 1, 2, 3]
    (length_us,) = {slot.length_us for slot in slots}
    assert length_us == 1_460, "three frames of 160 bits at 500 kbit/s, and 500 us to read them"
    for delay in (0, 5_000, 123_456):
        moments = [in_slot(delay, slot) for slot in slots]
        assert [later - earlier for earlier, later in pairwise(moments)] == [length_us] * 3
    assert in_slot(123_456, SpeakingSlot(0, 1, 0)) == 123_456
    with pytest.raises(ValueError, match="99"):
        slot_of(site, 99)


def test_whose_bid_does_not_count_is_named_so_that_those_whom_it_beats_bid() -> None:
    compartment, *robots = fleet({11: 1_000, 12: 5_000})
    compartment.negotiation.is_obstacle = lambda node: node == 11
    bus = Bus([compartment, *robots])
    bus.call(terms())
    bus.run(4)
    assert bus.assigned() == [12], "it was silent, as by its own belief 11 does better"
    assert [(word.call, word.node_a) for _, word in bus.wire if isinstance(word, LeftOut)] == [(2, 11)]


@pytest.mark.parametrize("after_s", [0.5, 1.5], ids=["open", "awarded and not heard"])
def test_a_task_that_nobody_is_to_do_any_more_is_called_for_no_more(after_s: float) -> None:
    machines = fleet({11: 1_000} if after_s > 1 else {})
    bus = Bus(machines)
    bus.call(terms())
    bus.run(0.5)
    bus.lose = lambda message, receiver: True
    bus.run(after_s - 0.5)
    machines[0].carry_out(machines[0].negotiation.call_off(terms().task, Reason.CANCELLED, bus.now_us), bus.now_us)
    calls = sum(isinstance(word, CallForProposals | Award) for _, word in bus.wire)
    bus.run(30)
    assert sum(isinstance(word, CallForProposals | Award) for _, word in bus.wire) == calls
