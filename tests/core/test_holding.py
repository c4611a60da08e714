"""Holds of one machine: who brought them about, what ends them, and what a person must decide."""

import pytest

from onboard.contract.codes import Reason
from onboard.contract.constants import NOBODY
from onboard.holon.holding import QUIET_BEATS, STOP_LASTS_US, TWIN_BEATS, HoldResponse, HoldState, MachineHolds

ME, OTHER = 11, 12
BEAT_US = 1_000_000
BOOT = 7


def holding() -> MachineHolds:
    """A machine that acts and hears the bus."""
    held = MachineHolds(ME, BEAT_US)
    held.heard(0)
    return held


def listens(held: MachineHolds, since_us: int, until_us: int) -> list[HoldResponse]:
    """Others are heard once in each heartbeat period, and the machine looks at the time as often."""
    outcomes = []
    for now_us in range(since_us + BEAT_US, until_us + 1, BEAT_US):
        held.heard(now_us)
        outcomes.append(held.wake(now_us))
    return outcomes


def test_a_frame_under_its_own_number_holds_it_until_the_bus_was_heard_without_one() -> None:
    held = holding()
    assert held.own_frame(0, is_right=False) is HoldResponse.HOLDS
    word = held.word(BOOT)
    assert (word.machine, word.reason, word.cause, word.needs_person, word.boot) == (
        ME, Reason.DUPLICATE_NODE_ID, ME, False, BOOT
    )  # fmt: skip
    outcomes = listens(held, 0, QUIET_BEATS * BEAT_US)
    assert outcomes == [HoldResponse.NOTHING] * (QUIET_BEATS - 1) + [HoldResponse.COMES_BACK]
    assert not held.is_held


def test_silence_does_not_count_where_nobody_is_heard_or_nothing_of_it_is_taken() -> None:
    held = holding()
    held.own_frame(0, is_right=False)
    for now_us in range(BEAT_US, 20 * BEAT_US, BEAT_US):
        # Its receiver may be what is broken.
        assert held.wake(now_us) is HoldResponse.NOTHING
    for now_us in range(20 * BEAT_US, 40 * BEAT_US, BEAT_US):
        held.heard(now_us)
        # Or its transmitter: a twin on the other half of a cut bus is not heard either.
        assert held.wake(now_us, acknowledged=False) is HoldResponse.NOTHING
    assert listens(held, 39 * BEAT_US, 42 * BEAT_US)[-1] is HoldResponse.COMES_BACK


@pytest.mark.parametrize("is_right", [True, False])
def test_a_right_under_its_number_or_a_twin_needs_a_person(is_right: bool) -> None:
    held = holding()
    now_us = 0
    held.own_frame(now_us, is_right=is_right)
    while not is_right and now_us <= TWIN_BEATS * BEAT_US:
        now_us += BEAT_US
        held.own_frame(now_us, is_right=False)
    assert held.why == (Reason.DUPLICATE_NODE_ID, ME, True)
    assert set(listens(held, now_us, now_us + 100 * BEAT_US)) == {HoldResponse.NOTHING}
    assert held.go(OTHER) is HoldResponse.NOTHING
    assert held.go(NOBODY) is HoldResponse.NOTHING, "that lifts emergency stops"
    assert held.go(ME) is HoldResponse.COMES_BACK


def test_what_a_person_must_decide_outlives_the_process() -> None:
    held = holding()
    held.for_person(Reason.JOURNAL_SHORT, OTHER)
    entries = [held.record().entry]
    again = holding()
    again.replay(entries)
    assert again.why == (Reason.JOURNAL_SHORT, OTHER, True)
    again.go(ME)
    entries.append(again.record().entry)
    last = holding()
    last.replay(entries)
    assert not last.is_held


def test_an_emergency_stop_ends_by_the_persons_word_or_by_its_age() -> None:
    held = holding()
    assert held.stop(OTHER, 0) is HoldResponse.HOLDS
    assert held.stop(250, 1) is HoldResponse.NOTHING
    assert held.why == (Reason.EMERGENCY_STOP, 250, False)
    assert held.go(250) is HoldResponse.NOTHING, "the other's stop holds still"
    assert held.why.cause == OTHER
    assert held.wake(STOP_LASTS_US - 1) is HoldResponse.NOTHING
    assert held.wake(STOP_LASTS_US) is HoldResponse.GOES_ON
    held.stop(OTHER, 0)
    assert held.go(NOBODY) is HoldResponse.GOES_ON


def test_an_emergency_stop_goes_on_where_another_hold_ends() -> None:
    held = holding()
    held.own_frame(0, is_right=False)
    held.stop(OTHER, 0)
    assert held.why.reason is Reason.DUPLICATE_NODE_ID
    assert listens(held, 0, QUIET_BEATS * BEAT_US)[-1] is HoldResponse.COMES_BACK
    assert (held.hold, held.why.reason) == (HoldState.STOPPED, Reason.EMERGENCY_STOP)


def test_a_halted_machine_says_why_and_nothing_changes_that() -> None:
    held = holding()
    assert held.halt(Reason.INVARIANT_BROKEN) is HoldResponse.ENDS
    for outcome in (held.own_frame(1, is_right=True), held.stop(OTHER, 1), held.go(ME), held.wake(2)):
        assert outcome is HoldResponse.NOTHING
    assert held.why == (Reason.INVARIANT_BROKEN, NOBODY, True)


def test_the_last_word_says_who_brings_it_back_and_a_hold_for_a_person_stays_one() -> None:
    assert not holding().last_word(1, Reason.JOURNAL_LOST, needs_person=False).needs_person
    assert holding().last_word(1, Reason.NOT_AUTHORISED, needs_person=True).needs_person
    held = holding()
    held.for_person(Reason.OPERATOR, OTHER)
    word = held.last_word(1, Reason.JOURNAL_LOST, needs_person=False)
    assert (word.reason, word.cause, word.needs_person) == (Reason.OPERATOR, OTHER, True)
