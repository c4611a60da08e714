"""What holds for all costs, latencies and losses: one winner, the best one, and nobody waits for ever."""

import itertools
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.contract.codes import CallResult, Criterion, Reason
from onboard.contract.messages import Bid, CallForProposals, Message
from onboard.core.negotiation import CallKey, SpeakingSlot, beats, cost_difference
from tests.core.negotiation.fleet import CALLER, START_US, TIMING, Bus, Costs, Machine, a_call, caller, fleet, terms

#: Costs in ms after the deadline: near the floor, where delays differ, and far from it, where they hardly do.
COSTS = st.one_of(st.integers(0, 3_000), st.integers(0, 200_000))
ROBOTS = st.dictionaries(st.integers(2, 250), COSTS, min_size=1, max_size=9)


def better(bid: Bid, other: Bid) -> bool:
    return beats(bid.cost, bid.sender, other.cost, other.sender, Criterion.FINISH_TIME)


@given(costs=ROBOTS, latency_us=st.integers(1, 3_000), slack_ms=st.integers(0, 20_000))
def test_p11_p17_without_loss_all_name_the_best_bidder(costs: dict[int, int], latency_us: int, slack_ms: int) -> None:
    bus = Bus(fleet(dict(costs), slack_ms=slack_ms), latency_us)
    bus.call(terms())
    bus.run(1.2)
    best = min(costs, key=lambda node: (costs[node], node))
    assert bus.assigned() == [best]
    assert [closed.winner for closed in bus.machines[CALLER].closed] == [best]
    call = bus.calls()[0]
    for node in costs:
        standing = bus.machines[node].negotiation.standing_bid(CallKey(CALLER, call.call))
        assert standing is not None
        assert standing[1] == best
        assert bus.machines[node].committed == set()


@given(costs=ROBOTS, latency_us=st.integers(0, 1_500), slack_ms=st.integers(0, 20_000))
def test_p08_bids_strictly_improve_on_the_wire(costs: dict[int, int], latency_us: int, slack_ms: int) -> None:
    """In slots as long as the latency no two bids are on their way at once, however equal the machines are."""
    robots = [
        Machine(node, Costs({1: cost}, slack_ms), slot=SpeakingSlot(number, len(costs), 1_500))
        for number, (node, cost) in enumerate(sorted(costs.items()))
    ]
    bus = Bus([caller(), *robots], latency_us)
    bus.call(terms())
    bus.run(1.2)
    assert bus.assigned() == [min(costs, key=lambda node: (costs[node], node))]
    assert all(better(later, earlier) for earlier, later in itertools.pairwise(bus.bids()))


@pytest.mark.parametrize(("before_us", "says"), [(10_000, True), (1_000, True), (0, False)])
def test_p08_a_better_bid_is_said_until_two_guards_before_the_deadline(before_us: int, says: bool) -> None:
    """Who can better what was heard does so until a bid might be heard behind the cut-off, and not from then on."""
    (call, last_us) = a_call(), START_US + TIMING.call_window_us - 2 * TIMING.deadline_guard_us
    machine, now_us = Machine(11, Costs({1: 0})), last_us - before_us
    said = machine.receive(call, now_us)
    due_us = machine.next_wake()
    if due_us is not None and due_us < last_us:
        said = machine.wake(due_us)
    assert [one.sender for one in said if isinstance(one, Bid)] == [11][:says]


def test_p08_without_slots_equal_bids_cross_on_the_wire() -> None:
    """Why there are slots: both are ready at one moment, and a queued frame cannot be recalled."""
    bus = Bus(fleet({11: 2_000, 12: 2_000}))
    bus.call(terms())
    bus.run(1.2)
    assert [bid.sender for bid in bus.bids()] == [11, 12]
    assert bus.assigned() == [11]


@given(costs=ROBOTS, latency_us=st.integers(1, 20_000), slack_ms=st.integers(0, 20_000))
def test_p07_nobody_releases_a_bid_that_is_no_better_than_one_it_has_heard(
    costs: dict[int, int], latency_us: int, slack_ms: int
) -> None:
    bus = Bus(fleet(dict(costs), slack_ms=slack_ms), latency_us)
    bus.call(terms())
    bus.run(1.2)
    for sent_us, message in bus.wire:
        if not isinstance(message, Bid):
            continue
        heard = [m for t, m in bus.machines[message.sender].heard if isinstance(m, Bid) and t < sent_us]
        assert all(better(message, other) for other in heard)
        assert [m.sender for m in bus.bids()].count(message.sender) == 1


class Lossy:
    """Takes messages from single receivers at random, until it is made well."""

    def __init__(self, seed: int, share: float) -> None:
        self._random, self._share = random.Random(seed), share

    def __call__(self, message: Message, receiver: int) -> bool:
        return self._random.random() < self._share


@settings(max_examples=150)
@given(
    costs=st.dictionaries(st.integers(2, 250), st.integers(0, 30_000), min_size=1, max_size=6),
    seed=st.integers(0, 2**32 - 1),
    share=st.sampled_from((0.02, 0.1, 0.3, 0.6, 0.9)),
    lossy_s=st.floats(0.1, 12.0),
)
def test_p14_whatever_is_lost_one_machine_at_most_is_assigned_and_nobody_waits_for_ever(
    costs: dict[int, int], seed: int, share: float, lossy_s: float
) -> None:
    machines = [caller(), *(Machine(node, Costs({1: cost, 2: 30_000 - cost})) for node, cost in costs.items())]
    bus = Bus(machines, lose=Lossy(seed, share))
    bus.call(terms(1))
    bus.run(0.2)
    bus.call(terms(2))
    bus.run(lossy_s)
    bus.lose = lambda message, receiver: False
    bus.run(30)
    closed = {one.call.task.number: one for one in machines[0].closed}
    for task in (1, 2):
        assigned = bus.assigned(task)
        assert len(assigned) <= 1
        assert (closed[task].result is CallResult.AWARDED) == (len(assigned) == 1)
        assert assigned in ([], [closed[task].winner])
    for machine in machines:
        assert machine.committed == set()
        assert machine.negotiation.next_wake() is None


def missing_the_better_bid(message: Message, receiver: int) -> bool:
    """One inconsistent omission: node 12 does not hear the bid of node 11."""
    return isinstance(message, Bid) and message.sender == 11 and receiver == 12


def test_with_one_omission_the_silent_form_assigns_one_task_twice() -> None:
    bus = Bus(fleet({11: 1_000, 12: 9_000}, silent=True), lose=missing_the_better_bid)
    bus.call(terms())
    bus.run(2)
    assert bus.assigned() == [11, 12]


def test_with_the_same_omission_the_award_decides() -> None:
    machines = fleet({11: 1_000, 12: 9_000})
    bus = Bus(machines, lose=missing_the_better_bid)
    bus.call(terms())
    bus.run(0.999)
    assert machines[2].committed, "it believes, and prepares"
    bus.run(1)
    assert bus.assigned() == [11]
    assert machines[2].released == [Reason.BEATEN]


def test_a_bid_that_the_initiator_never_heard_costs_one_attempt() -> None:
    """The bidder misses the closing of the first call as well: the second call frees it."""
    machines = fleet({11: 1_000})
    closings = iter((True,))

    def lose(message: Message, receiver: int) -> bool:
        if isinstance(message, Bid):
            return message.call == 1
        return type(message).__name__ == "Award" and receiver == 11 and next(closings, False)

    bus = Bus(machines, lose=lose)
    bus.call(terms())
    bus.run(4)
    assert bus.assigned() == [11]
    assert machines[1].released == [Reason.CANCELLED]
    assert machines[0].closed[0].attempts == 2


@given(st.integers(0, 2**32 - 1), st.integers(-(2**31) + 1, 2**31 - 1))
def test_finishing_times_compare_across_the_wrap(time_ms: int, difference: int) -> None:
    later = (time_ms + difference) % 2**32
    assert cost_difference(later, time_ms, Criterion.FINISH_TIME) == difference
    assert beats(later, 1, time_ms, 2, Criterion.FINISH_TIME) == (difference <= 0)


def test_the_runs_cross_the_wrap_of_bus_time() -> None:
    bus = Bus(fleet({11: 1_000}))
    bus.call(terms())
    bus.run(0.5)
    (bid,) = bus.bids()
    (call,) = (message for _, message in bus.wire if isinstance(message, CallForProposals))
    assert bid.cost < 2_000 < 2**32 - 2_000 < (call.deadline_ms - 1_500) % 2**32
    assert TIMING.call_window_us == 1_000_000
