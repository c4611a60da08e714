"""The protocol's rows P02 to P17, each shown on a bus without loss."""

from dataclasses import dataclass, replace
from itertools import pairwise

import pytest

from onboard.contract.codes import CallResult, KindCode, Reason
from onboard.contract.messages import Bid, CallForProposals, Message
from onboard.core.negotiation import CallKey, Negotiation, Proposal, RestartPolicy, RestartStep
from onboard.core.serial import BUS_MS_MODULUS, from_bus_ms
from tests.core.negotiation.fleet import CALLER, START_US, TIMING, Bus, Costs, Machine, a_call, caller, fleet, terms

WINDOW_S = TIMING.call_window_us / 1e6


def key_of(bus: Bus, number: int = 0) -> CallKey:
    call = bus.calls()[number]
    return CallKey(call.sender, call.call)


def test_p02_every_machine_calls_and_answers() -> None:
    first = Machine(11, Costs({2: 4_000}))
    second = Machine(12, Costs({1: 3_000}))
    bus = Bus([caller(), first, second])
    bus.call(terms(1), node=11)
    bus.call(terms(2), node=12)
    bus.run(2)
    assert (bus.assigned(1), bus.assigned(2)) == ([12], [11])


def test_p03_one_robot_calls_while_it_bids_in_three_foreign_calls() -> None:
    busy = Machine(11, Costs({1: 100, 2: 100, 3: 100}))
    other = Machine(12, Costs({1: 900, 2: 900, 3: 900, 4: 500}))
    callers = [Machine(node, Costs({}), kind=KindCode.COMPARTMENT) for node in (1, 2, 3)]
    bus = Bus([*callers, busy, other])
    for number in (1, 2, 3):
        bus.call(terms(number), node=number)
    bus.call(terms(4), node=11)
    bus.run(2)
    assert [bus.assigned(number) for number in (1, 2, 3, 4)] == [[11], [11], [11], [12]]
    assert [machine.closed[0].winner for machine in (*callers, busy)] == [11, 11, 11, 12]


@dataclass
class OneAfterTheOther(Costs):
    """What is bid for or won already is done first: 60 s each."""

    machine: Machine | None = None

    def lower_bound(self, call: CallForProposals, now_us: int) -> int | None:
        """Later by what comes before."""
        return self._later(super().lower_bound(call, now_us))

    def estimate(self, call: CallForProposals, now_us: int) -> Proposal | None:
        """Later by what comes before."""
        found = super().estimate(call, now_us)
        cost = self._later(found.cost if found is not None else None)
        return None if cost is None else Proposal(cost, None, (), ())

    def _later(self, cost: int | None) -> int | None:
        if cost is None or self.machine is None:
            return cost
        before = len(self.machine.committed) + len(self.machine.assigned)
        return (cost + 60_000 * before) % BUS_MS_MODULUS


@pytest.mark.parametrize("gap_s", [0.0, 0.001, 0.2])
def test_p04_bids_of_one_machine_for_calls_of_one_moment_come_one_behind_the_other(gap_s: float) -> None:
    costs = OneAfterTheOther({1: 5_000, 2: 5_000, 3: 5_000})
    robot = costs.machine = Machine(11, costs)
    callers = [Machine(node, Costs({}), kind=KindCode.COMPARTMENT) for node in (1, 2, 3)]
    bus = Bus([*callers, robot])
    for number in (1, 2, 3):
        bus.call(terms(number), node=number)
        bus.run(gap_s)
    bus.run(3)
    ends_us = sorted(from_bus_ms(bid.cost, START_US) for bid in bus.bids())
    assert len(ends_us) == 3
    assert all(later - earlier >= 60_000_000 for earlier, later in pairwise(ends_us)), "no two at one time"


def test_p04_ten_overlapping_calls_end_as_ten_calls_one_after_the_other() -> None:
    costs = {node: {n: 100 + (node * 37 + n * 53) % 997 for n in range(1, 11)} for node in range(11, 19)}

    def winners(gap_s: float) -> list[list[int]]:
        bus = Bus([caller(), *(Machine(node, Costs(dict(mine))) for node, mine in costs.items())])
        for number in range(1, 11):
            bus.call(terms(number))
            bus.run(gap_s)
        bus.run(3)
        return [bus.assigned(number) for number in range(1, 11)]

    together, serially = winners(0.05), winners(2.0)
    assert together == serially
    assert together == [[min(costs, key=lambda node: (costs[node][n], node))] for n in range(1, 11)]


def test_p05_nobody_answers_once_its_bid_would_come_too_late() -> None:
    slow = Machine(11, Costs({1: 5_000}))
    (call, last_us) = a_call(), START_US + TIMING.call_window_us - 2 * TIMING.deadline_guard_us
    slow.receive(call, last_us - 50_000)
    assert slow.negotiation.next_wake() == last_us
    assert slow.wake(last_us) == []
    assert slow.receive(a_call(2), last_us) == []
    assert slow.next_wake() is None
    assert slow.negotiation.counters.calls_too_late == 1


def test_p05_bids_received_after_the_cut_off_are_ignored_and_counted_by_all() -> None:
    machines = fleet({11: 5_000, 12: 9_000})
    bus = Bus(machines)
    bus.call(terms())
    bus.run(WINDOW_S - TIMING.deadline_guard_us / 1e6 - 0.000_1)
    call = bus.calls()[0]
    late = Bid(13, CALLER, call.call, call.deadline_ms, 0)
    bus.post([late])
    bus.run(2)
    bus.post([late])
    bus.run(1)
    assert bus.assigned() == [11]
    assert [machine.negotiation.counters.late_bids_ignored for machine in machines] == [2, 2, 2]


def test_p06_other_kinds_spend_no_planning_time() -> None:
    lift = Machine(21, Costs({1: 1}), kind=KindCode.LIFT)
    bus = Bus([*fleet({11: 5_000}), lift])
    bus.call(terms())
    bus.run(2)
    estimator = lift.negotiation.estimator
    assert isinstance(estimator, Costs)
    assert estimator.asked == []
    assert lift.negotiation.counters.calls_of_other_kind == 1
    assert bus.assigned() == [11]


def test_p07_p09_a_beaten_machine_neither_searches_nor_speaks() -> None:
    machines = fleet({11: 1_000, 12: 60_000, 13: 60_000})
    bus = Bus(machines)
    bus.call(terms())
    bus.run(2)
    assert [bid.sender for bid in bus.bids()] == [11]
    for loser in machines[2:]:
        estimator = loser.negotiation.estimator
        assert isinstance(estimator, Costs)
        assert "estimate" not in estimator.asked
        assert loser.negotiation.counters.searches_saved == 1


def test_p07_a_machine_that_searched_in_vain_keeps_its_bid_to_itself() -> None:
    """Its bound of 1 s lets it search early; its cost of 60 s owes a wait in which a better bid comes."""
    eager = Machine(12, Costs({1: 60_000}, slack_ms=59_000))
    bus = Bus([caller(), Machine(11, Costs({1: 5_000})), eager])
    bus.call(terms())
    bus.run(2)
    assert [bid.sender for bid in bus.bids()] == [11]
    assert eager.negotiation.counters.searches == 1
    assert eager.negotiation.counters.bids_saved == 1


@pytest.mark.parametrize("cost", [{}, {1: None}], ids=["cannot at all", "search finds nothing"])
def test_p09_who_cannot_do_it_is_silent(cost: dict[int, int | None]) -> None:
    unable = Machine(11, Costs(cost))
    bus = Bus([caller(), unable, Machine(12, Costs({1: 5_000}))])
    bus.call(terms())
    bus.run(2)
    assert {message.sender for _, message in bus.wire} == {CALLER, 12}
    assert unable.negotiation.counters.calls_impossible == 1


def test_p10_committed_from_the_bid_until_another_is_better() -> None:
    robot = Machine(11, Costs({1: 1_000}))
    bus = Bus([caller(), robot])
    bus.call(terms())
    bus.run(0.1)
    (bid,) = bus.bids()
    (call,) = bus.calls()
    assert bid == Bid(11, CALLER, call.call, (call.deadline_ms + 1_000) % BUS_MS_MODULUS, 0)
    assert robot.committed == {key_of(bus)}
    bus.post([replace(bid, sender=12)])
    bus.run(0.01)
    assert robot.committed == {key_of(bus)}, "an equal bid of a higher node-ID is not better"
    bus.post([replace(bid, sender=10)])
    bus.run(0.01)
    assert robot.committed == set()
    assert robot.released == [Reason.BEATEN]
    bus.run(2)
    assert [award.winner for award in bus.awards()][:1] == [10]
    assert bus.assigned() == []


def test_p10_the_deadline_makes_the_standing_bid_a_task() -> None:
    machines = fleet({11: 1_000, 12: 2_000})
    bus = Bus(machines)
    bus.call(terms())
    bus.run(WINDOW_S - 0.001)
    assert machines[1].committed == {key_of(bus)}
    bus.run(0.01)
    assert machines[1].committed == set()
    assert bus.assigned() == [11]


def test_p11_in_the_silent_form_all_know_the_winner_and_nothing_is_sent() -> None:
    machines = fleet({11: 3_000, 12: 1_000, 13: 2_000}, silent=True)
    bus = Bus(machines)
    bus.call(terms())
    bus.run(WINDOW_S - 0.001)
    said = len(bus.wire)
    bus.run(0.01)
    announced = [message for _, message in bus.wire[said:]]
    assert bus.awards() == []
    assert [(message.sender, type(message).__name__) for message in announced] == [(12, "Itinerary")]
    for robot in machines[1:]:
        standing = robot.negotiation.standing_bid(key_of(bus))
        assert standing is not None
        assert standing[1] == 12
    assert [closed.winner for closed in machines[0].closed] == [12]


def test_p11_with_awards_one_frame_more_closes_the_call() -> None:
    machines = fleet({11: 3_000, 12: 1_000})
    bus = Bus(machines)
    bus.call(terms())
    bus.run(3)
    assert [(award.winner, award.result) for award in bus.awards()] == [(12, CallResult.AWARDED)]
    assert [closed.winner for closed in machines[0].closed] == [12]


def test_p12_an_unanswered_call_is_opened_again_changed_and_then_given_up() -> None:
    compartment = caller()
    compartment.negotiation.policy = RestartPolicy((RestartStep(100), RestartStep(150), RestartStep(200, 0x101, 0x102)))
    bus = Bus([compartment, Machine(11, Costs({}))])
    bus.call(terms())
    bus.run(20)
    calls = bus.calls()
    sent_us = [time_us for time_us, message in bus.wire if isinstance(message, CallForProposals)]
    windows = [from_bus_ms(call.deadline_ms, t) - t for call, t in zip(calls, sent_us, strict=True)]
    assert [call.attempt for call in calls] == [1, 2, 3, 4, 5]
    assert [round(window_us / 1e6, 2) for window_us in windows] == [1.0, 1.5, 2.0, 2.0, 2.0]
    assert [call.from_station for call in calls] == [0x104, 0x104, 0x101, 0x101, 0x101]
    assert len({call.call for call in calls}) == 5
    assert [award.result for award in bus.awards()] == [CallResult.REOPENED] * 4 + [CallResult.REFUSED]
    (closed,) = compartment.closed
    assert (closed.winner, closed.result, closed.reason, closed.attempts) == (0, CallResult.REFUSED, Reason.NO_BID, 5)


def test_p12_a_machine_that_becomes_able_wins_a_later_attempt() -> None:
    late = Machine(11, Costs({}))
    bus = Bus([caller(), late])
    bus.call(terms())
    bus.run(1.5)
    late.negotiation.estimator = Costs({1: 2_000})
    for participant in late.negotiation.participants.values():
        participant.estimator = late.negotiation.estimator
    bus.run(5)
    assert bus.assigned() == [11]
    assert bus.machines[CALLER].closed[0].attempts == 3


def test_p14_a_winner_that_is_never_heard_holds_nobody_else_up() -> None:
    """The winner is gone after its bid: the call stays with it, a person is told, other calls go on."""
    compartment = caller()
    bus = Bus([compartment, Machine(11, Costs({1: 1_000})), Machine(12, Costs({1: 9_000, 2: 1_000}))])
    bus.call(terms(1))
    bus.run(0.5)
    bus.lose = lambda message, receiver: receiver == 11 or message.sender == 11
    bus.run(5)
    bus.call(terms(2))
    bus.run(5)
    assert bus.assigned(1) == []
    assert bus.assigned(2) == [12]
    assert compartment.reports == ["node 11 was awarded task 1.1 and is not heard"]
    bus.lose = lambda message, receiver: False
    bus.run(5)
    assert bus.assigned(1) == [11], "the award is still being said, slowly, when the machine comes back"


def test_p14_a_belief_without_an_award_lapses_and_a_late_award_still_counts() -> None:
    deaf = Machine(11, Costs({1: 1_000}))
    bus = Bus([caller(), deaf])
    bus.call(terms())
    bus.run(0.5)
    bus.lose = lambda message, receiver: receiver == 11
    bus.run(15)
    assert deaf.committed == set()
    assert deaf.released == [Reason.LATE]
    assert deaf.negotiation.next_wake() is None
    bus.lose = lambda message, receiver: False
    bus.run(2)
    assert bus.assigned() == [11]


def test_p17_the_best_of_all_wins_whatever_the_order_of_readiness() -> None:
    for shift in range(6):
        costs: dict[int, int | None] = {11 + (i + shift) % 6: 1_000 + 400 * i for i in range(6)}
        bus = Bus(fleet(costs))
        bus.call(terms())
        bus.run(2)
        assert bus.assigned() == [11 + shift]


def test_p17_equal_bids_go_to_the_lower_node_id() -> None:
    bus = Bus(fleet({13: 2_000, 12: 2_000, 14: 2_000}))
    bus.call(terms())
    bus.run(2)
    assert bus.assigned() == [12]


def test_a_bid_is_followed_by_its_tentative_itinerary() -> None:
    robot = Machine(11, Costs({1: 1_000}, with_itinerary=True))
    bus = Bus([caller(), robot])
    bus.call(terms())
    bus.run(0.9)
    said: list[Message] = [message for _, message in bus.wire if message.sender == 11]
    assert [type(message).__name__ for message in said] == ["Bid", "Itinerary"]
    (bid,) = bus.bids()
    assert bid.itinerary_version == 7


def test_call_numbers_of_two_boots_differ() -> None:
    numbers = set()
    for boot in (1, 2):
        negotiation = Negotiation(CALLER, KindCode.COMPARTMENT, TIMING, Costs({}), boot=boot)
        for number in range(1, 101):
            (send,) = negotiation.open(terms(number), START_US)
            numbers.add(send.message.call)  # type: ignore[union-attr]  # opening a call sends the call
    assert len(numbers) == 200
