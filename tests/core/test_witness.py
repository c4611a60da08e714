"""A machine that was started again asks before it uses a right; who knows better than its journal says so."""

from dataclasses import replace

import pytest

from onboard.contract.codes import Grade, KindCode, MachineState, Reason
from onboard.contract.messages import (
    Halted,
    Heartbeat,
    Itinerary,
    Message,
    Stamp,
    SyncDone,
    SyncRequest,
    TokenDispute,
    TokenGiven,
    TokenGrant,
    TokenHeld,
    TokenRequest,
    TokenSeen,
)
from onboard.core.authority import TokenBook, segment_token
from onboard.core.effects import Effect
from onboard.core.mirror import Mirror, Peer
from onboard.core.site import Segment
from onboard.holon.witness import ANSWER_PERIOD_US, Witness
from tests.core.token_words import said
from tests.sites import one_floor

SITE = one_floor(robots=2)
STEWARD, ALICE, BOB = 1, 11, 12
KEY = segment_token(Segment(1, 7))
BEAT_US = SITE.timing.heartbeat_us
START_US = 50 * BEAT_US
Line = dict[str, str | int]


def line(record: str, version: int, holder: int) -> Line:
    return {"record": record, "kind": int(KEY.kind), "number": KEY.number, "version": version, "holder": holder}


class Machine:
    """One machine's book and witness, and the bus about it."""

    def __init__(self, node: int, *journal: Line, boot: int = 2) -> None:
        self.tokens = TokenBook(SITE, node)
        self.tokens.replay(journal)
        self.mirror = Mirror(SITE, node)
        self.witness = Witness(self.tokens, self.mirror, boot, boot > 1, lambda _: self.tokens.statements())

    def knows(self, *nodes: int, at_us: int = START_US, boot: int = 2) -> None:
        """Those nodes are heard."""
        for node in nodes:
            kind = SITE.machines[node].kind
            self.mirror.peers[node] = Peer(kind, MachineState.IDLE, boot, 0, at_us, 0, 0, at_us)

    def start(self) -> list[Message]:
        return said(self.witness.begin(START_US))

    def hear(self, message: Message, now_us: int = START_US) -> list[Effect]:
        if isinstance(message, SyncRequest):
            return self.witness.on_request(message, now_us)
        if isinstance(message, SyncDone):
            return self.witness.on_done(message, now_us)
        if isinstance(message, TokenHeld | TokenGrant | TokenGiven | TokenSeen | TokenRequest):
            self.witness.hear(message, now_us)
        return []

    def wake(self, now_us: int) -> list[Message]:
        return said(self.witness.wake(now_us))


def done(node: int, whom: int = 0) -> SyncDone:
    return SyncDone(node, whom, 2, 0)


def test_no_right_is_used_before_every_live_machine_has_answered() -> None:
    alice = Machine(ALICE, line("token_held", 3, ALICE))
    words = alice.start()
    assert words == [TokenHeld(ALICE, KEY.kind, KEY.number, 3), SyncRequest(ALICE, 0)]
    alice.knows(STEWARD, BOB)
    alice.hear(done(STEWARD))
    assert alice.wake(START_US + BEAT_US) == [SyncRequest(ALICE, BOB)], "who has not answered is asked again"
    assert not alice.tokens.holds(KEY)
    alice.hear(done(BOB, ALICE), START_US + BEAT_US + 1)
    assert alice.tokens.holds(KEY)


def test_whoever_is_not_there_is_not_waited_for() -> None:
    alice = Machine(ALICE, line("token_held", 3, ALICE))
    alice.start()
    alice.knows(STEWARD)
    alice.hear(done(STEWARD))
    alice.wake(START_US + BEAT_US)
    assert alice.tokens.holds(KEY)


def test_a_machine_that_all_others_have_answered_waits_no_longer() -> None:
    alice = Machine(ALICE, line("token_held", 3, ALICE))
    alice.start()
    alice.knows(STEWARD, BOB)
    alice.hear(done(STEWARD))
    assert not alice.tokens.holds(KEY)
    alice.hear(done(BOB))
    assert alice.tokens.holds(KEY)


def test_a_first_life_listens_for_a_heartbeat_whoever_has_answered() -> None:
    """Nobody may have heard of an earlier life of it, and who has is not yet heard by all."""
    alice = Machine(ALICE, boot=1)
    alice.start()
    alice.knows(STEWARD, BOB, boot=1)
    alice.hear(done(STEWARD))
    alice.hear(done(BOB))
    assert not alice.witness.is_over
    alice.wake(START_US + BEAT_US)
    assert alice.witness.is_over


def test_a_machine_that_says_that_it_is_held_apart_is_not_waited_for() -> None:
    alice = Machine(ALICE, line("token_held", 3, ALICE))
    alice.witness.halts = {BOB: Halted(BOB, BOB, Reason.DUPLICATE_NODE_ID, BOB, True, 2)}
    alice.start()
    alice.knows(STEWARD, BOB)
    alice.hear(done(STEWARD))
    alice.wake(START_US + BEAT_US)
    assert alice.tokens.holds(KEY)


def test_a_machine_that_has_stopped_itself_answers_and_is_waited_for() -> None:
    alice = Machine(ALICE, line("token_held", 3, ALICE))
    alice.witness.halts = {BOB: Halted(BOB, BOB, Reason.ACTUATOR_FAULT, 0, True, 2)}
    alice.start()
    alice.knows(STEWARD, BOB)
    alice.mirror.peers[BOB] = replace(alice.mirror.peers[BOB], state=MachineState.STOPPED)
    alice.hear(done(STEWARD))
    alice.wake(START_US + BEAT_US)
    assert not alice.tokens.holds(KEY)
    alice.hear(done(BOB, ALICE), START_US + BEAT_US + 1)
    assert alice.tokens.holds(KEY)


def test_an_answer_to_another_is_none_to_me() -> None:
    alice = Machine(ALICE, line("token_held", 3, ALICE))
    alice.start()
    alice.knows(BOB)
    alice.hear(done(BOB, STEWARD))
    alice.wake(START_US + BEAT_US)
    assert not alice.tokens.holds(KEY)


def test_a_grant_is_said_again_only_after_all_have_answered() -> None:
    alice = Machine(ALICE, line("token_held", 3, ALICE), line("token_given", 4, BOB))
    assert TokenGiven(ALICE, KEY.kind, KEY.number, 4, BOB) in alice.start()
    alice.knows(BOB)
    assert said(alice.tokens.wake(1 << 40)) == [] and alice.tokens.next_wake() is None
    alice.hear(done(BOB), START_US + BEAT_US)
    assert said(alice.tokens.wake(1 << 40)) == [TokenGrant(ALICE, KEY.kind, KEY.number, 4, BOB)]


def test_nothing_is_taken_before_all_have_answered() -> None:
    alice = Machine(ALICE, line("token_held", 3, ALICE), line("token_given", 4, BOB), line("token_gone", 4, BOB))
    alice.start()
    alice.knows(BOB)
    assert alice.tokens.on_grant(TokenGrant(BOB, KEY.kind, KEY.number, 5, ALICE), START_US) == []
    assert not alice.tokens.held


@pytest.mark.parametrize(
    "word",
    [
        TokenHeld(BOB, KEY.kind, KEY.number, 4),
        TokenSeen(STEWARD, KEY.kind, KEY.number, 4, BOB),
        TokenGiven(BOB, KEY.kind, KEY.number, 5, STEWARD),
        TokenGrant(BOB, KEY.kind, KEY.number, 5, STEWARD),
        TokenRequest(BOB, KEY.kind, KEY.number, 4, 0, 0),
    ],
)
def test_who_knows_newer_than_the_journal_takes_its_rights_away_and_is_named(word: Message) -> None:
    """Alice gave it to Bob under version 4, and her journal is a copy from before that."""
    alice = Machine(ALICE, line("token_held", 3, ALICE))
    alice.start()
    alice.knows(STEWARD, BOB)
    alice.hear(word)
    alice.hear(done(BOB), START_US + BEAT_US)
    alice.hear(done(STEWARD), START_US + BEAT_US)
    assert not alice.tokens.holds(KEY)
    assert alice.witness.doubt is not None
    assert (alice.witness.doubt.reason, alice.witness.doubt.cause) == (Reason.JOURNAL_SHORT, word.sender)


def test_a_right_that_was_taken_and_forgotten_is_missed_by_who_gave_it() -> None:
    steward = Machine(STEWARD, line("token_given", 1, ALICE), line("token_gone", 1, ALICE))
    steward.start()
    steward.knows(ALICE)
    (missed,) = said(steward.hear(done(ALICE), START_US + 1))
    assert missed == TokenSeen(STEWARD, KEY.kind, KEY.number, 1, ALICE)
    alice = Machine(ALICE)
    alice.start()
    alice.hear(missed)
    assert alice.witness.doubt is not None


def test_what_is_said_again_is_not_missed() -> None:
    steward = Machine(STEWARD, line("token_given", 1, ALICE), line("token_gone", 1, ALICE))
    steward.start()
    steward.knows(ALICE)
    steward.hear(TokenHeld(ALICE, KEY.kind, KEY.number, 1))
    assert said(steward.hear(done(ALICE), START_US + 1)) == []


def test_a_sound_journal_is_not_doubted_whatever_comes_late() -> None:
    alice = Machine(ALICE, line("token_held", 3, ALICE), line("token_given", 4, BOB), line("token_gone", 4, BOB))
    alice.start()
    alice.knows(STEWARD, BOB)
    for word in (
        TokenHeld(BOB, KEY.kind, KEY.number, 4),
        TokenHeld(BOB, KEY.kind, KEY.number, 6),
        TokenSeen(STEWARD, KEY.kind, KEY.number, 4, BOB),
        TokenSeen(STEWARD, KEY.kind, KEY.number, 3, ALICE),
        TokenRequest(BOB, KEY.kind, KEY.number, 6, 0, 0),
    ):
        alice.hear(word)
    assert alice.witness.doubt is None


def test_nobody_but_a_machine_of_the_site_is_a_witness() -> None:
    alice = Machine(ALICE, line("token_held", 3, ALICE))
    alice.start()
    alice.hear(TokenHeld(240, KEY.kind, KEY.number, 900))
    alice.hear(TokenRequest(240, KEY.kind, KEY.number, 900, 0, 0))
    assert alice.witness.doubt is None


def test_who_has_answered_is_no_witness_afterwards() -> None:
    """What it says then is a claim, and my right leaves by my own hand only."""
    alice = Machine(ALICE, line("token_held", 3, ALICE))
    alice.start()
    alice.knows(BOB)
    alice.hear(done(BOB), START_US + BEAT_US)
    alice.hear(TokenHeld(BOB, KEY.kind, KEY.number, 900), START_US + BEAT_US + 1)
    assert alice.witness.doubt is None and alice.tokens.holds(KEY)


def test_a_machine_without_a_past_in_a_fleet_with_one_waits_for_all_and_says_so() -> None:
    alice = Machine(ALICE, boot=1)
    alice.start()
    alice.knows(STEWARD, boot=7)
    alice.hear(done(STEWARD))
    said_then = alice.wake(START_US + BEAT_US)
    assert [(word.reason, word.cause) for word in said_then if isinstance(word, Halted)] == [(Reason.JOURNAL_LOST, BOB)]
    home = segment_token(SITE.machines[ALICE].home)
    assert not alice.tokens.holds(home)
    alice.hear(done(BOB), START_US + BEAT_US + 1)
    assert alice.tokens.holds(home)


def test_a_new_fleet_begins_without_who_is_not_there() -> None:
    alice = Machine(ALICE, boot=1)
    alice.start()
    alice.knows(STEWARD, boot=1)
    alice.hear(done(STEWARD))
    alice.wake(START_US + BEAT_US)
    assert alice.tokens.holds(segment_token(SITE.machines[ALICE].home))


def test_many_who_ask_at_once_are_answered_once() -> None:
    """One answer at once, one more for all others."""
    steward = Machine(STEWARD, line("token_held", 3, STEWARD))
    steward.knows(ALICE, BOB)
    first = said(steward.hear(SyncRequest(ALICE, STEWARD)))
    assert first == [TokenHeld(STEWARD, KEY.kind, KEY.number, 3), SyncDone(STEWARD, ALICE, 2, 0)]
    for node in (ALICE, BOB, ALICE, BOB):
        assert said(steward.hear(SyncRequest(node, STEWARD), START_US + 5)) == []
    due_us = steward.witness.next_wake()
    assert due_us == START_US + ANSWER_PERIOD_US
    assert steward.wake(due_us) == [TokenHeld(STEWARD, KEY.kind, KEY.number, 3), SyncDone(STEWARD, 0, 2, 0b110)]
    assert steward.witness.next_wake() is None
    answered = said(steward.hear(SyncRequest(BOB, STEWARD), due_us + 10 * BEAT_US))
    assert answered[-1] == SyncDone(STEWARD, BOB, 2, 0), "one who has missed something is answered at once"


def test_who_is_new_is_asked_by_one_of_all_who_want_to_know() -> None:
    alice, bob = Machine(ALICE), Machine(BOB)
    for one in (alice, bob):
        beat = Heartbeat(STEWARD, 0, 0, 0, 1, KindCode.COMPARTMENT, MachineState.IDLE)
        one.mirror.on_heartbeat(beat, START_US)
        assert one.witness.on_heartbeat(beat, START_US, is_fresh=True) == []
    first_us, second_us = alice.witness.next_wake(), bob.witness.next_wake()
    assert first_us is not None and second_us is not None and first_us < second_us
    assert alice.wake(first_us) == [SyncRequest(ALICE, STEWARD)]
    bob.hear(done(STEWARD, ALICE), first_us + 1)
    assert bob.witness.next_wake() is None, "what the steward told Alice, Bob has heard"


def differs(machine: Machine, digest: int, now_us: int) -> list[SyncRequest]:
    """What a machine asks soon after a peer's heartbeat with this digest."""
    beat = Heartbeat(STEWARD, 0, 0, digest, 1, KindCode.COMPARTMENT, MachineState.IDLE)
    machine.witness.on_heartbeat(beat, now_us, is_fresh=False)
    return [word for word in machine.wake(now_us + 100_000) if isinstance(word, SyncRequest)]


def test_one_heartbeat_tells_that_a_word_was_missed_and_its_sender_is_asked() -> None:
    alice = Machine(ALICE)
    alice.witness.heed([], START_US)
    assert differs(alice, alice.mirror.digest(), START_US) == []
    assert differs(alice, 77, START_US) == [SyncRequest(ALICE, STEWARD)]
    asked = [differs(alice, 77, START_US + number * BEAT_US) for number in range(1, 10)]
    assert sum(map(len, asked)) == 3, "whose answer does not make them equal is asked seldom"


def test_a_digest_that_was_mine_a_moment_ago_is_only_late() -> None:
    alice = Machine(ALICE)
    alice.witness.heed([], START_US)
    before = alice.mirror.digest()
    alice.mirror.on_itinerary(Itinerary(BOB, 1, Grade.FIRM, Stamp(0, BOB, 0), ()), START_US)
    alice.witness.heed([], START_US)
    assert differs(alice, before, START_US + 200_000) == []
    assert differs(alice, before, START_US + BEAT_US) == [SyncRequest(ALICE, STEWARD)]


def test_what_a_silent_machine_holds_is_told_by_who_knows() -> None:
    """Bob is away: his journal cannot tell that the steward gave it to him."""
    alice = Machine(ALICE)
    alice.knows(STEWARD)
    alice.tokens.beliefs.take_up(KEY, 4, BOB, confirmed=True)
    assert TokenSeen(ALICE, KEY.kind, KEY.number, 4, BOB) in said(alice.hear(SyncRequest(STEWARD, ALICE)))


def test_a_grant_that_nobody_confirmed_proves_nothing_about_its_receiver() -> None:
    """Bob was given it and may never have heard of it; that the steward had it and gave it away is sure."""
    alice = Machine(ALICE)
    alice.knows(STEWARD)
    alice.tokens.on_grant(TokenGrant(STEWARD, KEY.kind, KEY.number, 1, BOB), START_US)
    told = said(alice.hear(SyncRequest(STEWARD, ALICE)))
    assert TokenSeen(ALICE, KEY.kind, KEY.number, 1, STEWARD) in told
    bob = Machine(BOB)
    bob.start()
    for word in told:
        bob.hear(word)
    assert bob.witness.doubt is None
    forgetful = Machine(STEWARD)
    forgetful.start()
    for word in told:
        forgetful.hear(word)
    assert forgetful.witness.doubt is not None


def test_a_disputed_grant_ends_with_its_givers_life() -> None:
    alice = Machine(ALICE)
    given = TokenGrant(BOB, KEY.kind, KEY.number, 2, ALICE)
    assert said(alice.tokens.on_grant(given, START_US)) == [TokenDispute(ALICE, KEY.kind, KEY.number, 2, STEWARD)]
    alice.witness._was_started(BOB)
    alice.tokens.on_given(TokenGiven(STEWARD, KEY.kind, KEY.number, 1, BOB), START_US)
    assert not alice.tokens.holds(KEY)
    alice.tokens.on_grant(given, START_US)
    assert alice.tokens.holds(KEY)


def test_a_machine_of_the_site_stops_nobody_who_has_begun_long_ago() -> None:
    alice = Machine(ALICE)
    alice.knows(STEWARD, BOB)
    alice.start()
    for node in (STEWARD, BOB):
        alice.hear(SyncDone(node, ALICE, 2, 0), START_US + BEAT_US)
    later_us = START_US + 10 * BEAT_US
    alice.knows(STEWARD, BOB, at_us=later_us)
    assert alice.tokens.is_synced
    alice.hear(SyncRequest(BOB, ALICE, 7), later_us)
    assert alice.witness.doubt is None, "it was there when I began, and has said nothing of that kind"
    assert alice.tokens.is_synced


def test_who_was_away_when_a_machine_began_still_tells_it_of_a_life_that_it_forgot() -> None:
    alice = Machine(ALICE)
    alice.knows(STEWARD)
    alice.start()
    alice.hear(SyncDone(STEWARD, ALICE, 2, 0), START_US + BEAT_US)
    later_us = START_US + 10 * BEAT_US
    alice.hear(SyncRequest(BOB, ALICE, 7), later_us)
    assert alice.witness.doubt is not None
    assert alice.witness.doubt.cause == BOB
