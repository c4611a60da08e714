"""Sub-calls as options (design, section 4; rows P03, P04): nesting, confirmation, lapse, and no act on an option."""

from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.contract.codes import CallResult, Reason, TaskPhase
from onboard.contract.messages import Award, Bid, CallForProposals, Message, Reference, TaskReport
from onboard.core.negotiation import CallKey
from onboard.core.negotiation.sub_calls import HOLD_REPEATS, MAX_DEPTH
from onboard.core.serial import from_bus_ms
from tests.core.negotiation.fleet import CALLER, START_US, TIMING, Bus, Machine, fleet, terms
from tests.core.negotiation.makers import Maker, Recipe, made_by, own_calls, wanted, works

CAR, BODY, ENGINE, PISTON, BOLT = 0x101, 0x102, 0x103, 0x104, 0x105
WINDOW_S = TIMING.call_window_us / 1e6
PATIENCE_S = HOLD_REPEATS * TIMING.award_repeat_us / 1e6

#: Two that can build a car, of a body and an engine; two bodies' makers, one of engines.
TWO_LEVELS: dict[int, dict[int, Recipe]] = {
    11: {CAR: (500, (BODY, ENGINE))},
    12: {CAR: (5_000, (BODY, ENGINE))},
    21: {BODY: (3_000, ())},
    22: {BODY: (1_000, ())},
    23: {ENGINE: (2_000, ())},
}
#: The engine is made of pistons, and nobody has them lying about.
THREE_LEVELS: dict[int, dict[int, Recipe]] = TWO_LEVELS | {
    23: {ENGINE: (2_000, (PISTON,))},
    31: {PISTON: (700, ())},
    32: {PISTON: (300, ())},
}


def sent_at(bus: Bus, message: Message) -> int:
    return next(time_us for time_us, said in bus.wire if said is message)


def deadline_of(bus: Bus, call: CallForProposals) -> int:
    return from_bus_ms(call.deadline_ms, sent_at(bus, call))


def awards_of(bus: Bus, call: CallForProposals) -> list[Award]:
    return [award for award in bus.awards() if (award.sender, award.call) == (call.sender, call.call)]


def assert_nested(bus: Bus) -> None:
    """Every sub-call is opened and ends inside its parent's time for bids, and its options outlast the parent."""
    by_key = {CallKey(call.sender, call.call): call for call in bus.calls()}
    for call in bus.calls():
        if not call.depth:
            continue
        parent = by_key[CallKey(call.parent.origin, call.parent.number)]
        assert call.depth == parent.depth + 1 <= MAX_DEPTH
        assert sent_at(bus, parent) < sent_at(bus, call)
        last_bid_us = deadline_of(bus, parent) - 2 * TIMING.deadline_guard_us
        assert deadline_of(bus, call) < last_bid_us
        hold_us = deadline_of(bus, call) + call.hold_ms * 1000
        assert hold_us >= deadline_of(bus, parent) + parent.hold_ms * 1000 + HOLD_REPEATS * TIMING.award_repeat_us


def assert_never_acted_upon_early(bus: Bus) -> None:
    """Nobody takes on a part before its initiator has taken on the whole."""
    taken = {}
    for machine in bus.machines.values():
        for call in machine.assigned:
            key = CallKey(call.sender, call.call)
            taken[key] = min(
                time_us
                for time_us, heard in machine.heard
                if isinstance(heard, Award)
                and (heard.sender, heard.call, heard.result, heard.winner)
                == (*key, CallResult.AWARDED, machine.node_id)
            )
            if call.depth:
                whole = CallKey(call.parent.origin, call.parent.number)
                initiator = bus.machines[call.sender]
                assert whole in {CallKey(one.sender, one.call) for one in initiator.assigned}
                if whole in taken:
                    assert taken[whole] <= taken[key]


def test_a_bidder_asks_first_and_its_options_are_confirmed_by_the_award() -> None:
    bus = works(TWO_LEVELS)
    bus.call(wanted(CAR))
    bus.run(WINDOW_S - 0.001)
    assert [made_by(bus, good) for good in (CAR, BODY, ENGINE)] == [[], [], []], "options are held, nothing is won"
    assert bus.machines[22].committed and bus.machines[23].committed
    assert not bus.machines[21].committed
    (bid,) = (bid for bid in bus.bids() if bid.initiator == CALLER)
    assert bid.sender == 11
    (call,) = own_calls(bus)
    cost_us = from_bus_ms(bid.cost, bus.now_us) - deadline_of(bus, call)
    assert 2_500_000 <= cost_us < 2_600_000, "the engine is there last; its begin was asked for in steps of 100 ms"
    bus.run(1)
    assert [made_by(bus, good) for good in (CAR, BODY, ENGINE)] == [[11], [22], [23]]
    assert [sorted((one.winner, one.terms.from_station) for one in parts) for parts in bus.machines[11].parts] == [
        [(22, BODY), (23, ENGINE)]
    ]
    assert_nested(bus)
    assert_never_acted_upon_early(bus)
    bus.run(20)
    assert all(not machine.committed for machine in bus.machines.values())
    assert all(machine.next_wake() is None or machine.assigned for machine in bus.machines.values())


def test_each_part_hears_option_then_award_and_nothing_else() -> None:
    bus = works(TWO_LEVELS)
    bus.call(wanted(CAR))
    bus.run(3)
    for call in bus.calls():
        said = [award.result for award in awards_of(bus, call)]
        if call.depth and call.sender == 11:
            assert said == [CallResult.OPTION, CallResult.AWARDED]
        elif call.depth:
            assert said in ([CallResult.WITHDRAWN], [CallResult.OPTION, CallResult.WITHDRAWN])


def test_three_levels_nest_and_are_confirmed_from_the_top() -> None:
    bus = works(THREE_LEVELS)
    bus.call(wanted(CAR))
    bus.run(3)
    assert [made_by(bus, good) for good in (CAR, BODY, ENGINE, PISTON)] == [[11], [22], [23], [32]]
    assert {call.depth for call in bus.calls()} == {0, 1, 2}
    confirmed_us = [
        sent_at(bus, award)
        for depth in (0, 1, 2)
        for call in bus.calls()
        for award in awards_of(bus, call)
        if call.depth == depth and award.result is CallResult.AWARDED and call.from_station not in (BODY,)
    ]
    assert confirmed_us == sorted(confirmed_us)
    assert len(confirmed_us) == 3
    assert_nested(bus)
    assert_never_acted_upon_early(bus)


def test_what_cannot_win_asks_nobody() -> None:
    """A machine whose least cost is beaten before its delay has run out opens no sub-call."""
    makers = TWO_LEVELS | {13: {CAR: (100, ())}}
    bus = works(makers)
    bus.call(wanted(CAR))
    bus.run(3)
    assert made_by(bus, CAR) == [13]
    assert {call.depth for call in bus.calls()} == {0}
    assert bus.machines[11].negotiation.counters.searches_saved == 1


def test_who_hears_a_better_one_ask_waits_for_its_bid() -> None:
    """Node 12 would need 4.5 s more at least: it hears node 11 ask, then its bid, and never asks."""
    bus = works(TWO_LEVELS)
    bus.call(wanted(CAR))
    bus.run(3)
    assert {call.sender for call in bus.calls() if call.depth} == {11}
    assert bus.machines[12].negotiation.counters.bids_saved == 1


def test_who_waited_for_a_bid_that_never_comes_asks_then() -> None:
    bus = works(TWO_LEVELS)
    bus.lose = lambda message, receiver: message.sender == 11 and isinstance(message, Bid)
    bus.call(wanted(CAR))
    bus.run(3)
    askers = [call for call in bus.calls() if call.depth]
    assert [call.sender for call in askers] == [11, 11, 12, 12]
    assert sent_at(bus, askers[2]) > deadline_of(bus, askers[0])
    assert [made_by(bus, good) for good in (CAR, BODY, ENGINE)] == [[12], [22], [23]]
    assert_nested(bus)
    assert_never_acted_upon_early(bus)


def test_an_outbid_machine_gives_its_options_up() -> None:
    """It asked first, and somebody without need of others was better than its parts came out."""
    makers = TWO_LEVELS | {13: {CAR: (2_000, ())}}
    bus = works(makers)
    bus.call(wanted(CAR))
    bus.run(WINDOW_S)
    assert made_by(bus, CAR) == [13] or bus.machines[11].committed == set()
    bus.run(0.5)
    assert made_by(bus, CAR) == [13]
    given_up = [award for award in bus.awards() if award.result is CallResult.WITHDRAWN]
    assert {award.sender for award in given_up} >= {11}
    for node in (21, 22, 23):
        assert bus.machines[node].committed == set()
        assert bus.machines[node].assigned == []


def test_options_lapse_where_the_bidder_falls_silent_for_ever() -> None:
    """All that it says after its bid is lost: nobody waits longer than the options were to be held."""
    bus = works(THREE_LEVELS)
    bus.call(wanted(CAR))
    bus.run(0.75)
    bus.lose = lambda message, receiver: message.sender == 11 or receiver == 11
    held = [node for node in (21, 22, 23, 31, 32) if bus.machines[node].committed]
    assert {22, 23, 32} <= set(held)
    bus.run(WINDOW_S - 0.75 + 3 * PATIENCE_S + 0.5)
    for node in held:
        machine = bus.machines[node]
        assert machine.committed == set()
        assert machine.assigned == []
        assert set(machine.released) <= {Reason.LATE, Reason.CANCELLED, Reason.BEATEN}
        assert machine.negotiation.next_wake() is None


def test_an_option_survives_lost_words_and_is_confirmed_once() -> None:
    """The word that it is an option is lost, and the first confirmations too: a belief holds as long."""
    bus = works(TWO_LEVELS)
    seen = []

    def lose(message: Message, receiver: int) -> bool:
        if not isinstance(message, Award) or message.sender != 11 or receiver != 22:
            return False
        seen.append(message.result)
        return message.result is CallResult.OPTION or seen.count(CallResult.AWARDED) <= 3

    bus.lose = lose
    bus.call(wanted(CAR))
    bus.run(5)
    assert made_by(bus, BODY) == [22]
    assert seen.count(CallResult.AWARDED) == 4


def test_a_part_that_nobody_has_makes_no_bid_and_frees_the_others() -> None:
    bus = works({11: {CAR: (500, (BODY, ENGINE))}, 22: {BODY: (1_000, ())}})
    bus.call(wanted(CAR))
    bus.run(WINDOW_S - 0.05)
    assert [bid for bid in bus.bids() if bid.initiator == CALLER] == []
    assert bus.machines[22].committed == set()
    assert bus.machines[22].released == [Reason.CANCELLED]


def test_answers_can_lead_to_a_second_round_inside_the_outer_deadline() -> None:
    bus = works(TWO_LEVELS, one_by_one=True)
    bus.call(wanted(CAR))
    bus.run(3)
    assert [made_by(bus, good) for good in (CAR, BODY, ENGINE)] == [[11], [22], [23]]
    rounds = [sent_at(bus, call) for call in bus.calls() if call.sender == 11]
    first_deadline_us = deadline_of(bus, next(call for call in bus.calls() if call.sender == 11))
    assert rounds[0] < first_deadline_us <= rounds[1]
    assert_nested(bus)


def test_recursion_ends_at_the_deepest_level_in_silence() -> None:
    """Whoever needs the very thing that it is asked for finds no end; the depth does."""
    bus = works({11: {CAR: (10, (CAR,))}, 12: {CAR: (20, (CAR,))}})
    bus.call(wanted(CAR))
    bus.run(WINDOW_S)
    assert max(call.depth for call in bus.calls()) <= MAX_DEPTH
    assert bus.bids() == []
    assert_nested(bus)


def test_a_call_heard_late_leaves_no_time_for_sub_calls() -> None:
    robot = Machine(11, Maker(TWO_LEVELS[11]))
    bus = works({})
    bus.call(wanted(CAR))
    (call,) = own_calls(bus)
    late_us = START_US + TIMING.call_window_us - 3 * TIMING.deadline_guard_us
    robot.receive(call, late_us)
    assert robot.wake(late_us + 15_000) == []
    assert robot.next_wake() is None


def test_p03_a_machine_is_part_of_one_whole_and_maker_of_another_at_once() -> None:
    """Node 11 builds cars, makes bodies for others and calls for a bolt of its own, all in the same second."""
    makers: dict[int, dict[int, Recipe]] = {
        11: {CAR: (500, (ENGINE,)), BODY: (400, ())},
        12: {BOLT: (300, (BODY,))},
        23: {ENGINE: (2_000, ())},
        24: {PISTON: (50, ())},
    }
    bus = works(makers)
    bus.call(wanted(CAR, 1))
    bus.call(wanted(BOLT, 2))
    bus.call(replace(wanted(PISTON, 3), task=Reference(11, 3)), node=11)
    bus.run(3)
    assert [made_by(bus, good) for good in (CAR, BOLT, BODY, ENGINE, PISTON)] == [[11], [12], [11], [23], [24]]
    assert_nested(bus)
    assert_never_acted_upon_early(bus)


def test_p04_overlapping_wholes_come_out_as_one_after_the_other() -> None:
    makers: dict[int, dict[int, Recipe]] = {node: {CAR: (100 * node % 700, (BODY, ENGINE))} for node in (11, 12, 13)}
    parts: dict[int, dict[int, Recipe]] = {
        21: {BODY: (900, ())},
        22: {BODY: (300, ()), ENGINE: (800, ())},
        23: {ENGINE: (200, ())},
    }

    def owners(gap_s: float) -> list[tuple[int, int, int]]:
        bus = works(makers | parts)
        for number in range(1, 7):
            bus.call(wanted(CAR, number))
            bus.run(gap_s)
        bus.run(4)
        assert_nested(bus)
        assert_never_acted_upon_early(bus)
        return [
            (number, node, call.from_station)
            for number in range(1, 7)
            for node, machine in bus.machines.items()
            for call in machine.assigned
            if call.task.number == number
        ]

    together = owners(0.07)
    assert together == owners(2.5)
    assert len(together) == 18


def test_bids_of_a_sub_call_strictly_improve_and_end_early_enough() -> None:
    bus = works(THREE_LEVELS)
    bus.call(wanted(CAR))
    bus.run(3)
    for call in bus.calls():
        bids = [bid for bid in bus.bids() if (bid.initiator, bid.call) == (call.sender, call.call)]
        costs = [from_bus_ms(bid.cost, START_US) for bid in bids]
        assert all(later < earlier for earlier, later in pairwise(costs))
        for bid in bids:
            assert sent_at(bus, bid) < deadline_of(bus, call) - 2 * TIMING.deadline_guard_us


@given(
    own_ms=st.lists(st.integers(0, 8_000), min_size=8, max_size=8),
    latency_us=st.integers(100, 2_000),
    lost=st.sets(st.tuples(st.integers(0, 80), st.sampled_from([CALLER, 11, 12, 21, 22, 23, 31, 32])), max_size=12),
)
def test_whatever_is_lost_nothing_is_acted_on_early_nor_held_for_ever(
    own_ms: list[int], latency_us: int, lost: set[tuple[int, int]]
) -> None:
    """Random costs, latencies and lost receptions; the frame numbers are those of the order on the wire."""
    recipes = THREE_LEVELS.items()
    makers: dict[int, dict[int, Recipe]] = {
        node: {good: (ms, parts) for good, (_, parts) in made.items()}
        for (node, made), ms in zip(recipes, own_ms, strict=False)
    }
    bus = works(makers)
    bus.latency_us = latency_us
    numbers: dict[int, int] = {}

    def lose(message: Message, receiver: int) -> bool:
        number = numbers.setdefault(id(message), len(numbers))
        return (number, receiver) in lost

    bus.lose = lose
    bus.call(wanted(CAR))
    bus.run(25)
    assert_nested(bus)
    assert_never_acted_upon_early(bus)
    assert len(made_by(bus, CAR)) <= 1
    for machine in bus.machines.values():
        assert machine.committed == set(), "no reservation outlives its option"


def test_a_winner_that_gives_the_task_back_rejects_the_award() -> None:
    """A machine that failed between bid and award says so; the call does not count as awarded."""
    machines = fleet({11: 1_000})
    bus = Bus(machines)
    bus.call(terms())
    bus.run(WINDOW_S - 0.01)
    bus.lose = lambda message, receiver: receiver == 11
    bus.run(0.05)
    bus.post([TaskReport(11, Reference(CALLER, 1), TaskPhase.FORFEITED, 0, Reason.ACTUATOR_FAULT)])
    bus.run(5)
    (closed,) = machines[0].closed
    assert (closed.winner, closed.result, closed.reason) == (0, CallResult.REJECTED, Reason.ACTUATOR_FAULT)
    assert bus.awards()[-1].result is CallResult.REJECTED


@pytest.mark.parametrize("node", [21, 22])
def test_an_option_outbid_elsewhere_is_given_to_the_better(node: int) -> None:
    """Each sub-call goes to its best bid, whoever hears it last."""
    recipes: dict[int, dict[int, Recipe]] = {11: {CAR: (500, (BODY,))}, 21: {BODY: (900, ())}, 22: {BODY: (800, ())}}
    recipes[node] = {BODY: (100, ())}
    bus = works(recipes)
    bus.call(wanted(CAR))
    bus.run(3)
    assert made_by(bus, BODY) == [node]
    (bid,) = (bid for bid in bus.bids() if bid.initiator == CALLER)
    assert isinstance(bid, Bid)
