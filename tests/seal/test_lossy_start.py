"""Starts on a bus that loses frames: what is asked again is little, and of whom it was lost."""

from collections.abc import Callable

from onboard.contract.codes import TokenKind
from onboard.contract.messages import Message, TokenHeld
from onboard.contract.seal import SealAnswer, SealChallenge, SealTo
from onboard.core.frame import Frame
from tests.seal.nodes import CODEC, NODES, Wire, gate_of

Missed = Callable[[int, Message], bool]


class LossyWire(Wire):
    """Each node misses what ``missed`` says of node and frame."""

    missed: Missed = staticmethod(lambda _node, _word: False)

    def arrive(self, node: int, frame: Frame) -> None:
        word = CODEC.decode_part(frame)
        assert isinstance(word, Message)
        if not self.missed(node, word):
            super().arrive(node, frame)


def started(missed: Missed) -> LossyWire:
    wire = LossyWire({node: gate_of(node) for node in NODES})
    wire.missed = missed
    wire.begin()
    return wire


def challenges(wire: Wire) -> list[tuple[int, int]]:
    """Who challenged whom, but for what all ask at their start."""
    words = [CODEC.decode_part(frame) for frame in wire.log]
    return [(word.sender, word.whom) for word in words if isinstance(word, SealChallenge) and word.whom]


def nobody_misses(_node: int, _word: Message) -> bool:
    return False


def test_a_challenge_to_all_may_be_lost_once() -> None:
    lost: list[Message] = []

    def missed(node: int, word: Message) -> bool:
        is_lost = node == 1 and isinstance(word, SealChallenge) and word.sender == 11 and bool(is_again) and not lost
        lost.extend([word] if is_lost else [])
        return is_lost

    is_again: list[bool] = []
    wire = started(missed)
    is_again.append(True)
    wire.gates[11] = gate_of(11, life=2)
    wire.put(wire.gates[11].begin(wire.now_us), 11)
    # Less than half of the time that a start waits at most, after which it would ask again.
    wire.wait(200_000)
    assert lost and wire.gates[11].is_open


def test_an_answer_may_be_lost_before_its_seal_where_another_was_heard() -> None:
    def missed(node: int, word: Message) -> bool:
        is_answer = node == 11 and isinstance(word, SealAnswer) and word.sender == 1
        answers.extend([word] if is_answer else [])
        return is_answer and len(answers) > 1

    answers: list[Message] = []
    wire = started(missed)
    assert len(answers) > 1
    assert challenges(wire) == challenges(started(nobody_misses)), "nobody has to ask again"
    assert wire.gates[11].is_open
    held = TokenHeld(1, TokenKind.SEGMENT, 258, 7)
    wire.say(held)
    assert wire.heard[11] == [held]


def test_who_has_not_answered_in_time_is_asked_alone() -> None:
    wire = started(
        lambda node, word: node == 11 and isinstance(word, SealTo) and word.sender == 1 and word.counter <= 4
    )
    more = len(challenges(wire)) - len(challenges(started(nobody_misses)))
    assert (challenges(wire)[-1], more) == ((11, 1), 1)
    assert wire.gates[11].is_open


def test_seals_behind_lost_frames_do_not_make_a_receiver_ask() -> None:
    lost: list[Message] = []
    wire = started(lambda node, word: node == 11 and word in lost)
    before = challenges(wire)
    words = [TokenHeld(1, TokenKind.SEGMENT, 258, version) for version in range(8)]
    lost += words[:-1]
    for word in words:
        wire.say(word)
    assert challenges(wire) == before
    assert wire.heard[11] == words[-1:]
