"""Rules of the negotiation, of tasks and cars."""

from dataclasses import replace
from operator import itemgetter

import pytest

from onboard.contract.codes import (
    CallResult,
    Grade,
    KindCode,
    LegAction,
    MachineState,
    Reason,
    RegenerationPhase,
    Side,
    TaskPhase,
)
from onboard.contract.constants import ANY_STATION, OUTSIDE
from onboard.contract.messages import (
    BusTime,
    Halted,
    Heartbeat,
    Itinerary,
    Leg,
    Message,
    Progress,
    Reference,
    Regeneration,
    Stamp,
    SyncRequest,
)
from tests.sites import one_floor
from tests.trace.checking import (
    ER1,
    MR1,
    MR2,
    Tape,
    award,
    bid,
    call,
    car_at,
    car_grant,
    one_alley,
    power_up,
    report,
    two_floors,
)

BAY, PLACE, OTHER_PLACE = 0x0104, 0x0106, 0x0107
#: A whole task, step by step: second, messages.
STORY: list[tuple[float, list[Message]]] = [
    (1, [car_at(1, BAY, 1), call(1, 2)]),
    (1.5, [bid(MR2, 60_000)]),
    (1.8, [bid(MR1, 50_000)]),
    (2, [award(MR1), award(MR1), report(MR1, TaskPhase.AWARDED)]),
    (20, [report(MR1, TaskPhase.STARTED), car_grant(2, 1, MR1)]),
    (30, [car_at(MR1, ANY_STATION, 2), report(MR1, TaskPhase.LOADED)]),
    (50, [report(MR1, TaskPhase.DONE, PLACE), car_at(MR1, PLACE, 2), car_grant(3, MR1, 1), car_at(1, PLACE, 3)]),
]


def tell(story: list[tuple[float, list[Message]]], *, disturbed: bool = False) -> Tape:
    tape = Tape(one_floor(3), disturbed=disturbed)
    for at_s, messages in story:
        tape.say(at_s, *messages)
    return tape


def told(step: int, messages: list[Message], at_s: float | None = None) -> list[tuple[float, list[Message]]]:
    """The story up to a step, and that step told in another way."""
    return [*STORY[:step], (STORY[step][0] if at_s is None else at_s, messages)]


def test_a_task_as_it_should_be_breaks_nothing() -> None:
    assert tell(STORY).broken(60) == {}


WRONG: dict[str, tuple[int, list[Message], dict[str, int]]] = {
    "awarded to two": (3, [award(MR1), award(MR2)], {"calls-closed": 1, "one-owner": 1}),
    "awarded, then refused": (3, [award(MR1), award(0, CallResult.REFUSED)], {"calls-closed": 1}),
    "awarded to the worse bid": (3, [award(MR2)], {"bids-go-down": 1}),
    "a worse bid after a better one": (2, [bid(13, 70_000)], {"bids-go-down": 1}),
    "an equal bid of a higher node": (2, [bid(13, 60_000)], {"bids-go-down": 1}),
    "awarded to one that never bid": (3, [award(13)], {"bids-in-time": 1}),
    "taken without an award": (3, [report(MR1, TaskPhase.AWARDED)], {"one-owner": 1}),
    "carried out by another": (4, [report(MR2, TaskPhase.STARTED)], {"one-owner": 1}),
    "the car stated by another": (5, [car_at(MR2, ANY_STATION, 2)], {"one-custodian": 1}),
    "the car stated under a version that nobody gave": (5, [car_at(MR1, ANY_STATION, 3)], {"one-custodian": 1}),
    "the car put down unsaid": (6, [report(MR1, TaskPhase.DONE, PLACE)], {"one-custodian": 1}),
    "the car leaves from the shuttle": (6, [car_at(MR1, OUTSIDE, 2)], {"cars-conserved": 1}),
    "refused without why": (3, [report(1, TaskPhase.REFUSED)], {"tasks-served": 1}),
}


@pytest.mark.parametrize(("step", "messages", "broken"), WRONG.values(), ids=WRONG.keys())
def test_what_is_wrong_is_found_by_its_rule(step: int, messages: list[Message], broken: dict[str, int]) -> None:
    found = tell(told(step, messages)).broken(STORY[step][0] + 1.5)
    assert found == broken


@pytest.mark.parametrize(("until_s", "broken"), [(1.9, 1), (200, 0)])
def test_a_bid_that_its_bidder_cannot_keep_does_not_count(until_s: float, broken: int) -> None:
    """Who works until long after what it bids: another may bid more, and win."""
    work = Leg(LegAction.WORK, 1, 6, 6, Side.NEAR, round(until_s * 1000))
    plan = Itinerary(MR1, 1, Grade.FIRM, Stamp(0, 1, 1), (work,))
    tape = tell([(0.5, [Progress(MR1, 1, 0, 1, 6, 0, 0), plan]), *STORY[:1]])
    tape.say(1.5, bid(MR1, 50_000)).say(1.7, bid(MR2, 60_000)).say(2, award(MR2))
    assert tape.broken().get("bids-go-down", 0) == 2 * broken


@pytest.mark.parametrize(("again_s", "in_hand", "broken"), [(400, True, 1), (700, True, 0), (700, False, 1)])
def test_bids_of_who_waits_for_long_with_a_task_in_hand_need_not_count(
    again_s: int, in_hand: bool, broken: int
) -> None:
    """All may take it for one that stands: who has nothing in hand, or has just moved, is no such machine."""
    at = Progress(MR1, 1, 0, 1, 6, 0, 0)
    tape = tell([*STORY[:4], (21, [at]), *(() if in_hand else STORY[4:])])
    other = Reference(1, 2)
    tape.say(again_s, car_at(1, BAY, 1, other), call(2, again_s + 1, task=other))
    ends_ms = (again_s + 60) * 1000
    tape.say(again_s + 0.5, bid(MR1, ends_ms, 2)).say(again_s + 0.7, bid(MR2, ends_ms + 10_000, 2))
    assert tape.broken().get("bids-go-down", 0) == broken


def test_two_bids_may_cross_on_their_way() -> None:
    assert tell(told(2, [bid(13, 70_000)], at_s=1.51)).broken() == {}


def test_with_faults_a_bidder_may_not_have_heard_the_better_bid() -> None:
    verdict = tell(told(2, [bid(13, 70_000)]), disturbed=True).verdict()
    assert verdict.is_good and "bids-go-down" in verdict.left_out


def test_a_bid_after_the_deadline_does_not_win() -> None:
    tape = tell(STORY[:1]).say(2.1, bid(MR1, 50_000)).say(2.2, award(MR1))
    assert tape.broken() == {"bids-in-time": 1}


def test_an_initiators_own_bid_counts_however_late_its_frame_comes() -> None:
    """The bus was dead for a minute: it had bid, and closed its call, before anybody could hear of either."""
    tape = tell(STORY[:1]).say(2.1, bid(1, 50_000)).say(2.2, award(1))
    assert "bids-in-time" not in tape.broken()


def test_a_call_that_is_never_closed_is_found() -> None:
    assert tell(STORY[:3]).broken(13) == {}
    assert tell(STORY[:3]).broken(15) == {"calls-closed": 1}


@pytest.mark.parametrize(
    "waits",
    [
        Halted(1, 1, Reason.EMERGENCY_STOP, 240, needs_person=False, boot=1),
        SyncRequest(1, MR2),
        Halted(1, ER1, Reason.NODE_SILENT, 0, needs_person=False, boot=1),
        Halted(MR1, ER1, Reason.NODE_SILENT, 0, needs_person=False, boot=1),
    ],
    ids=["held", "asks in vain", "hears no bus time", "one that is cut off with it hears none"],
)
def test_a_call_whose_initiator_waits_is_closed_when_it_goes_on(waits: Message) -> None:
    """It asks in vain where its own words come to nobody (campaign terminal, outages, seed 44; cell, 60)."""
    tape = Tape(two_floors()).say(1, call(), BusTime(ER1, 1_000_000))
    for second in range(2, 33, 2):
        tape.say(second, power_up(), waits)
    assert tape.broken(36) == {}
    assert tape.broken(60) == {"calls-closed": 1}


def test_a_call_whose_initiator_has_slept_is_closed_when_it_has_listened() -> None:
    """A process that was stopped for minutes: it says that it is an obstacle first, and asks what it has missed."""
    slept = Heartbeat(1, 1, 1, 0, 1, KindCode.COMPARTMENT, MachineState.OBSTACLE)
    tape = tell(STORY[:3]).say(300, slept)
    awake = replace(slept, state=MachineState.WORKING)
    for second in range(302, 312, 2):
        tape.say(second, awake)
    assert "calls-closed" not in tape.broken(311)
    for second in range(312, 316, 2):
        tape.say(second, awake)
    assert "calls-closed" in tape.broken(316)


def test_a_call_whose_initiator_started_anew_is_over() -> None:
    assert tell(STORY[:3]).say(3, power_up(2)).say(5, power_up(2)).broken() == {}


def test_while_bus_time_has_jumped_no_call_is_due() -> None:
    """Its machine waits for a second word of the new time before it decides anything."""
    jumped = tell(STORY[:3]).say(1.9, BusTime(1, 101_900_000))
    assert jumped.broken(9) == {}
    assert jumped.broken(40) == {"calls-closed": 1}


@pytest.mark.parametrize(("restarted", "broken"), [(False, {"one-owner": 1}), (True, {})])
def test_done_is_told_again_only_after_a_restart(restarted: bool, broken: dict[str, int]) -> None:
    tape = tell(STORY)
    if restarted:
        tape.say(51, Heartbeat(MR1, 1, 1, 0, 2, KindCode.ROBOT, MachineState.STARTING))
    assert tape.say(52, report(MR1, TaskPhase.DONE, PLACE)).broken(54) == broken


@pytest.mark.parametrize(
    ("asked", "answers", "broken"),
    [
        ([award(MR1)], [(52.1, MR1), (52.1, MR1)], {}),
        ([award(MR1, number=0)], [(52.1, MR1)], {}),
        ([award(MR1)], [(52.1, MR1), (60, MR1)], {"one-owner": 1}),
        ([award(MR1)], [(52.1, MR2)], {"one-owner": 1}),
        ([award(MR2)], [(52.1, MR1)], {"calls-closed": 1, "one-owner": 2}),
        ([], [(52.1, MR1)], {"one-owner": 1}),
    ],
    ids=["at once", "of a call forgotten", "later again", "another", "awarded to another", "unasked"],
)
def test_done_may_be_told_again_to_who_says_the_award_again_and_by_nobody_else(
    asked: list[Message], answers: list[tuple[float, int]], broken: dict[str, int]
) -> None:
    """A compartment without sensors does not see that its robot is done (small, all faults, 30150)."""
    tape = tell(STORY).say(52, *asked)
    for at_s, node in answers:
        tape.say(at_s, report(node, TaskPhase.DONE, PLACE))
    assert tape.broken(62) == broken


def test_who_was_off_together_with_all_others_may_say_again_that_a_car_was_put_down() -> None:
    """The log begins anew with the bus time: what was said before is not known."""
    tape = tell([(1, [call(1, 2)]), (1.5, [bid(MR1, 50_000)]), (2, [award(MR1)])])
    assert tape.say(5, report(MR1, TaskPhase.DONE, PLACE)).broken(8) == {}


@pytest.mark.parametrize(("heard_at_s", "broken"), [(0.5, {"one-owner": 2}), (4.0, {})])
def test_who_was_off_as_a_task_was_called_for_anew_may_have_won_it_before(
    heard_at_s: float, broken: dict[str, int]
) -> None:
    """All others were off together in between, so that the log begins anew (drawn faults, inline 213)."""
    beat = Heartbeat(MR1, 1, 1, 0, 2, KindCode.ROBOT, MachineState.IDLE)
    tape = Tape(one_floor(3), started=False)
    story = [(1.0, call(1, 2)), (2.0, award(0, CallResult.REFUSED)), (heard_at_s, beat)]
    for at_s, word in sorted(story, key=itemgetter(0)):
        tape.say(at_s, word)
    for at_s, phase in ((5, TaskPhase.AWARDED), (6, TaskPhase.STARTED)):
        tape.say(at_s, report(MR1, phase))
    assert {rule: count for rule, count in tape.broken(8).items() if rule == "one-owner"} == broken


def test_a_winner_may_give_the_task_back_before_it_was_heard() -> None:
    rejected = [award(MR1), report(MR1, TaskPhase.FORFEITED, reason=Reason.IMPOSSIBLE), award(0, CallResult.REJECTED)]
    tape = tell(told(3, [*rejected])).say(3, call(2, 4), bid(MR2, 70_000, 2)).say(4, award(MR2, number=2))
    assert tape.say(5, report(MR2, TaskPhase.AWARDED)).broken() == {}


def test_the_custodian_may_award_anew_under_a_raised_version() -> None:
    again = [call(2, 3.9), bid(MR2, 70_000, 2)]
    same = tell(STORY[:4]).say(3, *again).say(4, award(MR2, number=2))
    assert same.broken() == {"one-owner": 1}
    raised = tell(STORY[:4]).say(3, *again).say(4, award(MR2, number=2, version=2))
    assert raised.broken() == {}


CARS: dict[str, tuple[list[Message], str]] = {
    "two cars in one place": ([car_at(1, PLACE, 3), car_at(1, PLACE, 5, Reference(1, 9))], "cars-conserved"),
    "a car that jumps": ([car_at(1, PLACE, 3), car_at(1, OTHER_PLACE, 3)], "cars-conserved"),
    "a car that comes back": ([car_at(1, BAY, 3), car_at(1, OUTSIDE, 3), car_at(1, BAY, 3)], "cars-conserved"),
    "two cars on one shuttle": (
        [car_at(MR1, ANY_STATION, 3), car_at(MR1, ANY_STATION, 3, Reference(1, 9))],
        "cars-conserved",
    ),
    "a car that changes shuttles": ([car_at(MR1, ANY_STATION, 3), car_at(MR2, ANY_STATION, 4)], "cars-conserved"),
}


@pytest.mark.parametrize(("messages", "rule"), CARS.values(), ids=CARS.keys())
def test_cars_are_conserved(messages: list[Message], rule: str) -> None:
    assert Tape(one_alley(), started=False).say(1, *messages).broken() == {rule: 1}


def test_who_remembers_a_lost_machines_car_does_not_say_to_have_it() -> None:
    """While rights are made anew all say where they remember it: not a car that goes from shuttle to shuttle."""
    freeze = Regeneration(251, RegenerationPhase.FREEZE, 1, MR1, 0, 0, 0)
    tape = Tape(one_alley(), started=False).say(1, car_at(MR1, ANY_STATION, 3), freeze)
    assert tape.say(1.1, car_at(MR2, ANY_STATION, 3), car_at(1, ANY_STATION, 3)).broken() == {}


def test_a_car_that_never_came_in_is_found_where_the_log_has_the_beginning() -> None:
    assert Tape(one_alley()).say(1, car_at(1, PLACE, 1)).broken() == {"cars-conserved": 1}
    assert Tape(one_alley(), started=False).say(1, car_at(1, PLACE, 1)).broken() == {}


def test_a_car_may_have_come_and_gone_while_nobody_heard_its_compartment() -> None:
    """The only other machine was off for minutes, and then the compartment (campaign level1, outages, seed 50574)."""
    gone = car_at(1, OUTSIDE, 1, Reference(1, 3))
    again = Heartbeat(1, 1, 1, 0, 2, KindCode.COMPARTMENT, MachineState.STARTING)
    assert Tape(one_alley()).say(60, again, gone).broken() == {}
    assert Tape(one_alley()).say(60, gone).broken() == {"cars-conserved": 1}
    assert Tape(one_alley()).say(60, again, car_at(1, PLACE, 1)).broken() == {"cars-conserved": 1}


def test_a_task_that_stays_open_is_found() -> None:
    tape = tell(STORY[:4])
    assert tape.say(3_590, power_up()).broken(3_610)["tasks-served"] == 1


def test_the_finding_names_time_machines_and_frame() -> None:
    verdict = tell(told(4, [report(MR2, TaskPhase.STARTED)])).verdict()
    (finding,) = verdict.findings
    assert (finding.time_us, finding.rule, finding.machines) == (20_000_000, "one-owner", (MR2, MR1))
    assert "task 1.1" in finding.what and "TaskReport" in finding.evidence


@pytest.mark.parametrize(("rounds", "broken"), [(3, {}), (4, {"no-rounds": 1}), (8, {"no-rounds": 1})])
def test_a_task_that_one_machine_wins_and_gives_back_again_and_again_is_found(
    rounds: int, broken: dict[str, int]
) -> None:
    """As a machine did that only bids: 188 awards for one car, and every rule said held."""
    tape = tell(STORY[:1])
    at_s = 3.0
    for number in range(2, 2 + rounds):
        tape.say(at_s, call(number, at_s + 1)).say(at_s + 0.5, bid(MR1, 50_000, number))
        tape.say(at_s + 1, award(MR1, number=number), report(MR1, TaskPhase.FORFEITED))
        at_s += 2
    assert {rule: count for rule, count in tape.broken().items() if rule == "no-rounds"} == broken
