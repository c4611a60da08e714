"""What counts behind a gate, and what does not: by a seal, by its number, by whose key it is."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.contract.codes import KindCode, MachineState, Reason, TokenKind
from onboard.contract.messages import (
    BusTime,
    CarAt,
    EmergencyStop,
    Heartbeat,
    Message,
    Reference,
    TokenGrant,
    TokenHeld,
)
from onboard.contract.seal import Seal, SealAnswer, SealChallenge, SealFault, SealTo, SealWord
from onboard.core.frame import Frame
from onboard.seal.heard import UNHEARD_US, WAITS_US
from onboard.seal.sender import MOST_SEALED
from onboard.seal.subjects import UNSEALED_FOR_US, frame_of
from tests.seal.nodes import CODEC, NODES, SECOND_US, Wire, gate_of, keys_of, wire_of

GRANT = TokenGrant(1, TokenKind.SEGMENT, 258, 7, 11)
HELD = TokenHeld(1, TokenKind.SEGMENT, 258, 7)


def beat(state: MachineState = MachineState.IDLE, digest: int = 0) -> Heartbeat:
    return Heartbeat(1, 2, 0x1234, digest, 1, KindCode.ROBOT, state)


def names(frames: list[Frame]) -> list[str | None]:
    return [CODEC.name_of(frame) for frame in frames]


def faults(wire: Wire, node: int) -> dict[tuple[int, SealWord], int]:
    return {key: count for key, count in wire.gates[node].faults.items() if count}


def test_all_hear_what_is_sealed_and_the_frame_stays_as_it_is() -> None:
    wire = wire_of()
    said = wire.say(HELD)
    assert names(said) == ["TokenHeld", "Seal"]
    assert said[0] == CODEC.encode(HELD)[0]
    assert wire.heard[5] == wire.heard[11] == [HELD]


def test_what_has_a_taker_is_sealed_for_the_taker_and_for_all() -> None:
    wire = wire_of()
    assert names(wire.say(GRANT)) == ["TokenGrant", "SealTo", "Seal"]
    assert wire.heard[5] == wire.heard[11] == [GRANT]


def test_who_has_the_group_key_grants_nothing_in_anothers_name() -> None:
    wire, insider = wire_of(), gate_of(1, life=2)
    # Node 5 knows all but what nodes 1 and 11 share: it makes of its own keys those of node 1.
    own = keys_of(5)
    insider._sender._keys = type(own)(1, own.group, {5: own.pairs[1], 11: own.pairs[11]})
    insider._sender.number = wire.gates[1]._sender.number
    wire.put([*insider.say(CODEC.encode(GRANT)[0], wire.now_us), *insider.seal(wire.now_us)])
    assert GRANT not in wire.heard[11]
    assert faults(wire, 11)[1, SealWord.FALSE_SEAL] == 1


def test_a_frame_without_a_seal_comes_to_nothing_and_is_told() -> None:
    wire = wire_of()
    wire.put(CODEC.encode(HELD))
    wire.wait(WAITS_US + SECOND_US)
    assert not wire.heard[5]
    assert faults(wire, 5) == {(1, SealWord.UNSEALED): 1}
    words = [CODEC.decode_part(frame) for frame in wire.log]
    assert SealFault(5, 1, SealWord.UNSEALED, 1) in words
    # Node 1 itself names what was said under its number.
    assert SealFault(1, 1, SealWord.UNSEALED, 1) in words


def test_a_site_that_watches_hears_all_and_tells_the_same() -> None:
    wire = wire_of(is_required=False)
    wire.put(CODEC.encode(HELD))
    wire.wait(WAITS_US + SECOND_US)
    assert wire.heard[5] == [HELD]
    assert faults(wire, 5) == {(1, SealWord.UNSEALED): 1}


@pytest.mark.parametrize("is_required", [True, False])
def test_seals_of_a_node_that_the_site_does_not_have_are_heard_like_all_that_it_says(is_required: bool) -> None:
    """The gate alone knows seals, but not who is of the site: nobody named a stranger that said nothing else."""
    wire = wire_of(is_required=is_required)
    words = [Seal(240, 3, 9), SealTo(240, 3, 9), SealChallenge(240, 0, 9), SealAnswer(240, 1, 9)]
    words.append(SealFault(240, 1, SealWord.FALSE_SEAL, 1))
    for word in words:
        wire.put(CODEC.encode(word))
    assert wire.heard[5] == wire.heard[11] == words
    assert not faults(wire, 5)
    # A tool of a person whose key nobody has here.
    wire.put(CODEC.encode(SealChallenge(254, 0, 9)))
    wire.wait(SECOND_US)
    assert wire.heard[5] == words
    assert faults(wire, 5) == {(254, SealWord.UNSEALED): 1}


def test_what_was_said_once_does_not_count_twice() -> None:
    wire = wire_of()
    said = wire.say(HELD)
    wire.say(TokenHeld(1, TokenKind.SEGMENT, 259, 8))
    wire.put(said)
    assert wire.heard[5] == [HELD, TokenHeld(1, TokenKind.SEGMENT, 259, 8)]
    assert faults(wire, 5) == {(1, SealWord.REPLAYED): 1}
    # Under its own number it is a replay, too, and never taken for a twin's.
    assert faults(wire, 1) == {(1, SealWord.REPLAYED): 1}
    assert not wire.heard[1]


def test_a_clone_with_the_same_keys_is_heard_by_whom_it_was_made_of() -> None:
    wire = wire_of()
    clone = gate_of(1)
    clone._sender.number = wire.gates[1]._sender.number  # copied, as the whole board is
    wire.put([*clone.say(CODEC.encode(HELD)[0], wire.now_us), *clone.seal(wire.now_us)])
    assert wire.heard[1] == [HELD]


def test_somebody_who_speaks_in_between_does_not_spoil_a_seal() -> None:
    wire = wire_of()
    frames = wire.gates[1].say(CODEC.encode(HELD)[0], wire.now_us)
    seal = wire.gates[1].seal(wire.now_us)
    forged = [frame for token in (997, 998) for frame in CODEC.encode(TokenHeld(1, TokenKind.SEGMENT, token, 9))]
    wire.put(frames, 1)
    wire.put(forged)
    wire.put(seal, 1)
    assert wire.heard[5] == [HELD]
    assert faults(wire, 5) == {(1, SealWord.UNSEALED): 2}


@pytest.mark.parametrize("at", [(0, 5), (1, 2), (3, 6)], ids=str)
def test_somebody_who_says_each_word_a_little_otherwise_does_not_spoil_a_seal(at: tuple[int, ...]) -> None:
    """A decision that is lost at all is no lost frame, which CAN would say again: nobody would ever hear of it."""
    decision = [HELD if place % 2 else CarAt(1, Reference(1, 1), 258, place, 2800) for place in range(MOST_SEALED)]
    wire = wire_of()
    gate = wire.gates[1]
    for place, word in enumerate(decision):
        (frame,) = CODEC.encode(word)
        said = gate.say(frame, wire.now_us)
        wire.put(said[:1], 1)
        if place in at:
            wire.put([frame._replace(data=frame.data[:-1] + bytes([frame.data[-1] ^ 1]))])
            # A false seal beside it spoils it no more than that.
            wire.put([frame_of(Seal(1, 0, 0))])
        wire.put(said[1:], 1)
    wire.put(gate.seal(wire.now_us), 1)
    assert wire.heard[5] == decision
    assert faults(wire, 5) == {(1, SealWord.UNSEALED): len(at), (1, SealWord.FALSE_SEAL): len(at)}


def test_signs_of_life_that_say_nothing_new_go_without_a_seal_for_a_while() -> None:
    wire = wire_of()
    said = [names(wire.say(beat(digest=number))) for number in range(4)]
    assert said == [["Heartbeat", "Seal"]] * 2 + [["Heartbeat"]] * 2
    assert len(wire.heard[5]) == 4
    wire.wait(UNSEALED_FOR_US)
    assert names(wire.say(beat())) == ["Heartbeat", "Seal"]
    assert len(wire.heard[5]) == 5
    # Another state is news, and counts with a seal only.
    wire.put(CODEC.encode(beat(MachineState.OBSTACLE)))
    assert len(wire.heard[5]) == 5
    # A dead machine is not kept alive by whoever repeats its last words.
    del wire.gates[1]
    wire.wait(UNHEARD_US + SECOND_US)
    wire.put(CODEC.encode(beat()))
    assert len(wire.heard[5]) == 5


def test_what_waits_for_a_seal_is_forgotten_in_time_though_a_fault_is_to_be_told_later() -> None:
    wire = wire_of()
    for _ in range(3):
        wire.put(CODEC.encode(HELD))
        wire.wait(WAITS_US + SECOND_US // 10)
    assert faults(wire, 5) == {(1, SealWord.UNSEALED): 3}


def test_idle_or_working_is_no_news_of_a_node() -> None:
    wire = wire_of()
    said = [names(wire.say(beat(state))) for state in (*[MachineState.IDLE] * 2, MachineState.WORKING)]
    assert said == [["Heartbeat", "Seal"]] * 2 + [["Heartbeat"]]
    assert wire.heard[5][-1] == beat(MachineState.WORKING)
    # Whoever waits for a person, or for a way, is asked for nothing: that needs proof.
    assert names(wire.say(beat(MachineState.WAITING))) == ["Heartbeat", "Seal"]


def test_a_seal_behind_nothing_is_told_to_nobody() -> None:
    wire = wire_of()
    wire.gates[11] = gate_of(11, life=2)
    wire.put([frame_of(Seal(1, 7, 7))])
    wire.wait(SECOND_US)
    assert (1, SealWord.NOT_FRESH) not in wire.gates[11].faults


def test_an_emergency_stop_holds_from_anybody() -> None:
    wire = wire_of()
    wire.put(CODEC.encode(EmergencyStop(1, Reason.OPERATOR)))
    wire.wait(WAITS_US + SECOND_US)
    assert wire.heard[5] == [EmergencyStop(1, Reason.OPERATOR)]
    # Named as what it is; and who is meant to have said it does not take itself for another's twin.
    assert faults(wire, 5) == {(1, SealWord.UNSEALED): 1}
    assert not wire.heard[1]


def test_a_receiver_that_was_started_again_accepts_nothing_old() -> None:
    wire = wire_of()
    old = wire.say(HELD)
    wire.gates[5] = gate_of(5, life=2)
    wire.heard[5].clear()
    wire.put(old)
    assert not wire.heard[5]
    wire.begin(5)
    assert wire.gates[5].is_open
    wire.put(old)
    assert not wire.heard[5]
    fresh = TokenHeld(1, TokenKind.SEGMENT, 258, 8)
    wire.say(fresh)
    assert wire.heard[5] == [fresh]


def test_an_answer_to_an_old_question_proves_nothing() -> None:
    wire = wire_of()
    recorded = [frame for frame in wire.log if CODEC.name_of(frame) in ("SealAnswer", "SealTo")]
    old = wire.say(HELD)
    dead = {node: wire.gates.pop(node) for node in (1, 11)}
    wire.gates[5] = gate_of(5, life=2)
    wire.begin(5)
    wire.put([*recorded, *old])
    assert HELD in wire.heard[5][:1]
    assert wire.heard[5].count(HELD) == 1
    assert dead


def test_a_sender_that_was_started_again_is_followed_at_once() -> None:
    wire = wire_of()
    wire.say(HELD)
    wire.gates[1] = gate_of(1, life=2)
    wire.begin(1)
    again = TokenHeld(1, TokenKind.SEGMENT, 258, 8)
    wire.say(again)
    assert wire.heard[5] == wire.heard[11] == [HELD, again]


def test_keys_of_old_that_begin_their_numbers_again_are_not_followed() -> None:
    wire = wire_of()
    wire.gates[1] = gate_of(1, life=3)
    wire.begin(1)
    newest = wire.say(HELD)
    wire.gates[1] = gate_of(1, life=2)
    wire.begin(1)
    wire.say(TokenHeld(1, TokenKind.SEGMENT, 258, 8))
    wire.put(newest)
    assert wire.heard[5] == [HELD]
    assert faults(wire, 5)[1, SealWord.REPLAYED]


def test_a_receiver_that_was_cut_off_for_long_asks_and_follows_again() -> None:
    wire = wire_of()
    deaf = wire.gates.pop(5)
    for number in range(70_000 // MOST_SEALED):
        wire.gates[1]._sender.number += MOST_SEALED  # as if so many had been said
        assert number < 70_000
    wire.gates[5] = deaf
    for version in range(1, 5):
        wire.say(TokenHeld(1, TokenKind.SEGMENT, 300, version))
        wire.wait(SECOND_US)
    assert wire.heard[5][-1] == TokenHeld(1, TokenKind.SEGMENT, 300, 4)


def test_the_grant_of_a_car_counts_only_with_the_place_that_its_giver_told() -> None:
    place = CarAt(1, Reference(1, 9), 258, 3, 2500)
    grant = TokenGrant(1, TokenKind.CAR, 1 << 16 | 9, 4, 11)
    wire = wire_of()
    wire.say(place)
    wire.say(grant)
    assert wire.heard[11] == [place, grant]
    # Whoever has the group key says in the giver's name that it stands elsewhere: the grant does not fit to that.
    other = wire_of()
    other.say(place)
    elsewhere = CODEC.encode(CarAt(1, Reference(1, 9), 300, 3, 2500))[0]
    other.gates[11]._nodes[1].places.note(CODEC.decode_part(elsewhere), elsewhere)
    other.say(grant)
    assert grant not in other.heard[11]
    assert grant in other.heard[5]


def test_a_restart_asks_all_and_nobody_waits_for_who_is_dead() -> None:
    wire = wire_of()
    del wire.gates[11]
    wire.gates[5] = gate_of(5, life=2)
    wire.put(wire.gates[5].begin(wire.now_us), 5)
    was_open = wire.gates[5].is_open
    wire.wait(SECOND_US)
    assert (was_open, wire.gates[5].is_open) == (False, True)
    wire.say(HELD)
    assert wire.heard[5][-1] == HELD


def test_bus_time_is_not_kept_waiting_for_its_seal() -> None:
    wire = wire_of()
    assert names(wire.gates[1].say(CODEC.encode(BusTime(1, 5))[0], 0)) == ["BusTime", "Seal"]


WORDS = st.one_of(
    st.builds(TokenHeld, st.sampled_from(NODES), st.just(TokenKind.SEGMENT), st.integers(0, 99), st.integers(1, 9)),
    st.builds(
        TokenGrant,
        *(st.sampled_from(NODES), st.just(TokenKind.SEGMENT), st.integers(0, 99), st.integers(1, 9)),
        st.sampled_from(NODES),
    ),
    st.builds(BusTime, st.sampled_from(NODES), st.integers(0, 1 << 40)),
)


@settings(max_examples=15, deadline=None)
@given(st.lists(WORDS, max_size=12), st.data())
def test_whatever_is_lost_doubled_or_changed_nothing_counts_that_was_not_said(
    words: list[Message], data: st.DataObject
) -> None:
    wire = wire_of()
    frames = [frame for word in words for frame in wire.say(word)]
    # Another receiver, which can follow all, hears the same frames by chance: some not, some twice, some changed.
    other = wire_of()
    hearer, heard = other.gates[5], list[Message]()
    order = data.draw(st.lists(st.integers(0, max(0, len(frames) - 1)), max_size=2 * len(frames)))
    for index in order if frames else ():
        frame = frames[index]
        if data.draw(st.booleans()) and frame.data:
            at = data.draw(st.integers(0, 8 * len(frame.data) - 1))
            changed = bytearray(frame.data)
            changed[at // 8] ^= 1 << at % 8
            frame = frame._replace(data=bytes(changed))
        if frame.arbitration_id & 0xFF != 5:
            handed, _ = hearer.hear(frame, other.now_us)
            heard += [word for one in handed if isinstance(word := CODEC.decode_part(one), Message)]
    for sender in NODES:
        mine = iter([word for word in words if word.sender == sender])
        assert all(any(word == one for one in mine) for word in heard if word.sender == sender), "each once, in order"


@pytest.mark.parametrize(
    "word", [SealChallenge(1, 0, 77), SealAnswer(1, 1, 9), SealTo(1, 3, 4711)], ids=lambda word: type(word).__name__
)
def test_who_asks_or_answers_in_my_name_is_named_by_me(word: Message) -> None:
    wire = wire_of()
    wire.put(CODEC.encode(word))
    wire.wait(3 * SECOND_US)
    assert faults(wire, 1) == {(1, SealWord.FALSE_SEAL): 1}
    assert CODEC.encode(SealFault(1, 1, SealWord.FALSE_SEAL, 1))[0] in wire.log
