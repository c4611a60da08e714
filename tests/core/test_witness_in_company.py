"""Many machines are started one by one: each is answered in whole, and nothing is said more often than it has to be."""

import pytest

from onboard.contract.codes import KindCode, MachineState
from onboard.contract.messages import Heartbeat, SyncDone, SyncRequest, TokenGrant, TokenHeld, TokenSeen
from onboard.core.authority import segment_token
from onboard.core.site import Segment
from onboard.holon.witness import ANSWER_PERIOD_US, FLOOD, MOST_DOUBTS, MOST_FLOOD_US
from tests.core.test_witness import ALICE, BEAT_US, BOB, KEY, SITE, START_US, STEWARD, Machine, done, line
from tests.core.token_words import said

#: What stands for each in ``SyncDone.askers``: the steward has the lowest node-ID, and so the first bit.
ALICES, BOBS = 2, 4


def beat(node: int, state: MachineState = MachineState.IDLE, boot: int = 2) -> Heartbeat:
    kind = KindCode.COMPARTMENT if node == STEWARD else KindCode.ROBOT
    return Heartbeat(node, 0, 0, 0, boot, kind, state)


def hears_first(machine: Machine, word: Heartbeat, now_us: int = START_US) -> None:
    machine.mirror.on_heartbeat(word, now_us)
    machine.witness.on_heartbeat(word, now_us, is_fresh=True)


def flooded(machine: Machine, now_us: int, versions: int = FLOOD) -> None:
    for version in range(1, versions + 1):
        machine.hear(TokenHeld(BOB, KEY.kind, KEY.number, version), now_us)


def test_nobody_is_asked_while_answers_still_come() -> None:
    """With hundreds of cars inside the answers of all take a second: who asks in between makes all be said again."""
    alice = Machine(ALICE)
    alice.knows(BOB)
    alice.start()
    hears_first(alice, beat(STEWARD))
    due_us = alice.witness.next_wake()
    for _ in range(3):
        assert due_us is not None
        flooded(alice, due_us - 1)
        assert alice.wake(due_us) == []
        due_us = alice.witness.next_wake()
    assert due_us is not None
    assert alice.wake(due_us) == [SyncRequest(ALICE, STEWARD)], "nothing came for an answer's period"


def test_nobody_waits_for_ever_for_words_that_do_not_end() -> None:
    alice = Machine(ALICE)
    alice.knows(BOB)
    hears_first(alice, beat(STEWARD))
    asked_us = []
    for now_us in range(START_US, START_US + 2 * MOST_FLOOD_US, 20_000):
        flooded(alice, now_us, FLOOD // 10)
        asked_us += [now_us for word in alice.wake(now_us) if word == SyncRequest(ALICE, STEWARD)]
    assert len(asked_us) == 1
    assert MOST_FLOOD_US <= asked_us[0] - START_US <= MOST_FLOOD_US + 2 * ANSWER_PERIOD_US


def test_digests_are_not_compared_while_answers_still_come() -> None:
    alice = Machine(ALICE)
    alice.witness.heed([], START_US)
    other = Heartbeat(STEWARD, 0, 0, 77, 1, KindCode.COMPARTMENT, MachineState.IDLE)
    flooded(alice, START_US)
    alice.witness.on_heartbeat(other, START_US, is_fresh=False)
    assert alice.wake(START_US + BEAT_US // 2) == []
    alice.witness.on_heartbeat(other, START_US + BEAT_US, is_fresh=False)
    assert alice.wake(START_US + BEAT_US + BEAT_US // 2) == [SyncRequest(ALICE, STEWARD)]


def test_an_answer_to_those_who_asked_before_is_none_for_who_asks_now() -> None:
    """Of what the steward said to Bob Alice, who was started meanwhile, has heard the end."""
    alice = Machine(ALICE)
    alice.start()
    alice.knows(STEWARD, BOB)
    alice.hear(done(BOB, ALICE))
    alice.hear(SyncDone(STEWARD, 0, 2, BOBS))
    assert SyncRequest(ALICE, STEWARD) in alice.wake(START_US + BEAT_US)
    assert not alice.tokens.is_synced
    alice.hear(SyncDone(STEWARD, 0, 2, BOBS | ALICES), START_US + BEAT_US + 1)
    assert alice.tokens.is_synced


def test_who_starts_is_answered_with_those_who_asked() -> None:
    """It has asked before this machine was there, and would have to ask anew."""
    steward = Machine(STEWARD, line("token_held", 3, STEWARD))
    steward.start()
    hears_first(steward, beat(ALICE, MachineState.STARTING))
    hears_first(steward, beat(BOB))
    steward.hear(SyncRequest(BOB, STEWARD), START_US + 1)
    due_us = steward.witness.next_wake()
    assert due_us is not None
    assert steward.wake(due_us)[-1] == SyncDone(STEWARD, 0, 2, ALICES | BOBS)


def test_who_has_answered_before_its_first_heartbeat_was_not_started_since() -> None:
    """It need not say again what it holds."""
    alice = Machine(ALICE)
    alice.start()
    alice.tokens.on_held(TokenHeld(STEWARD, KEY.kind, KEY.number, 3), START_US)
    alice.hear(done(STEWARD, ALICE))
    hears_first(alice, beat(STEWARD))
    assert KEY not in alice.witness.doubted[STEWARD]


@pytest.mark.parametrize("boot", [2, 3])
def test_who_has_answered_and_starts_again_has_to_say_what_it_holds(boot: int) -> None:
    """Under the boot that it had where its journal was lost meanwhile, and with it how often it was started."""
    alice = Machine(ALICE)
    alice.start()
    alice.tokens.on_held(TokenHeld(STEWARD, KEY.kind, KEY.number, 3), START_US)
    alice.hear(done(STEWARD, ALICE))
    hears_first(alice, beat(STEWARD))
    alice.mirror.on_heartbeat(beat(STEWARD, MachineState.STARTING, boot), START_US + 5 * BEAT_US)
    alice.witness.on_heartbeat(beat(STEWARD, MachineState.STARTING, boot), START_US + 5 * BEAT_US, is_fresh=True)
    assert KEY in alice.witness.doubted[STEWARD]


def _robs(others: int, *, comes_back: bool = False) -> tuple[Machine, list[TokenSeen]]:
    """Alice heard Bob say that he holds some; he is started again, asks, and says nothing of them.

    The first of them went back to the steward and came again.
    """
    alice = Machine(ALICE)
    alice.knows(BOB, STEWARD)
    given = [(index + 1, 1, STEWARD, BOB) for index in range(others)]
    for index, version, giver, holder in [
        *given,
        *([(1, 2, BOB, STEWARD), (1, 3, STEWARD, BOB)] if comes_back else []),
    ]:
        key = segment_token(Segment(1, index))
        alice.tokens.on_grant(TokenGrant(giver, key.kind, key.number, version, holder), START_US)
        alice.tokens.on_held(TokenHeld(holder, key.kind, key.number, version), START_US)
    hears_first(alice, beat(BOB, MachineState.STARTING, 3))
    told = said(alice.hear(SyncRequest(BOB, 0), START_US + 1))
    return alice, [word for word in told if isinstance(word, TokenSeen)]


def test_of_many_things_that_it_held_before_a_machine_is_told_the_last_few() -> None:
    _, told = _robs(MOST_DOUBTS + 3)
    assert [word.token & 0xFF for word in told] == list(range(4, MOST_DOUBTS + 4))
    assert {(word.version, word.holder) for word in told} == {(1, BOB)}


def test_the_last_are_those_that_came_last() -> None:
    """What an old copy of a journal lacks is what was written last."""
    _, told = _robs(MOST_DOUBTS + 3, comes_back=True)
    assert [word.token & 0xFF for word in told] == [*range(5, MOST_DOUBTS + 4), 1]


def test_nobody_is_told_of_what_another_has_since() -> None:
    alice, told = _robs(2)
    assert len(told) == 2
    key = segment_token(Segment(1, 1))
    alice.tokens.asked.add(STEWARD)
    alice.tokens.on_held(TokenHeld(STEWARD, key.kind, key.number, 2), START_US + 2)
    again = said(alice.hear(SyncRequest(BOB, ALICE), START_US + BEAT_US))
    assert [word.token & 0xFF for word in again if isinstance(word, TokenSeen)] == [2]


@pytest.mark.parametrize("is_started", [False, True])
def test_who_hears_another_ask_waits_for_the_answer_unless_it_starts_itself(is_started: bool) -> None:
    alice = Machine(ALICE)
    if is_started:
        alice.start()
    hears_first(alice, beat(STEWARD))
    due_us = alice.witness.next_wake()
    assert due_us is not None
    alice.witness.on_other_request(STEWARD, due_us - 1)
    assert (alice.wake(due_us) == [SyncRequest(ALICE, STEWARD)]) is is_started
    alice.hear(done(STEWARD, BOB), due_us + 1)
    assert is_started or alice.witness.next_wake() is None, "what the steward told Bob, Alice has heard"


def test_who_has_not_answered_may_stand_behind_the_answers_of_others() -> None:
    alice = Machine(ALICE)
    alice.knows(STEWARD, BOB)
    alice.start()
    flooded(alice, START_US + BEAT_US - 1)
    assert alice.wake(START_US + BEAT_US) == []
    due_us = alice.witness.next_wake()
    assert due_us is not None
    assert alice.wake(due_us) == [SyncRequest(ALICE, STEWARD), SyncRequest(ALICE, BOB)]


def test_who_asks_while_answers_come_is_answered_behind_them_once() -> None:
    steward = Machine(STEWARD)
    steward.knows(ALICE, BOB)
    flooded(steward, START_US)
    assert said(steward.hear(SyncRequest(ALICE, STEWARD), START_US + 1)) == []
    assert said(steward.hear(SyncRequest(BOB, STEWARD), START_US + 200_000)) == []
    due_us = steward.witness.next_wake()
    assert due_us == START_US + 1 + ANSWER_PERIOD_US, "another question does not put it off"
    assert steward.wake(due_us)[-1] == SyncDone(STEWARD, 0, 2, ALICES | BOBS)


def test_an_answer_is_shared_for_as_long_as_all_take_to_tell_what_is_known() -> None:
    """Of a thousand rights each is told of by its holder, and by who has the load at its place."""
    steward = Machine(STEWARD)
    steward.knows(ALICE, BOB)
    for index in range(1_000):
        steward.tokens.beliefs.take_up((KEY.kind, index), 1, BOB, confirmed=True)
    steward.hear(SyncRequest(ALICE, STEWARD), START_US)
    steward.hear(SyncRequest(BOB, STEWARD), START_US + 1)
    due_us = steward.witness.next_wake()
    assert due_us is not None
    assert due_us - START_US >= 1_000 * 2 * 140 * 1_000_000 // SITE.bitrate
