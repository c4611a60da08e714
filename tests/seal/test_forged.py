"""No forged frame is accepted; the same for as many as one likes: ``python -m tests.seal.forge 100000000``."""

import pytest

from onboard.contract.codes import TokenKind
from onboard.contract.messages import TokenGrant
from onboard.core.frame import Frame
from onboard.seal import gate, heard, tags
from tests.seal.forge import Forger
from tests.seal.nodes import CODEC, wire_of


def test_none_of_two_thousand_forged_frames_is_accepted_and_their_sender_is_heard() -> None:
    forger = Forger(seed=1)
    assert forger.tries(2_000) == 0
    assert forger.missed == 0


def test_numbers_that_no_tag_is_over_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    tag_over = tags.tag_over

    def without_number(key: bytes, _number: int, said: bytes, taker: int = 0, nonce: int = 0) -> int:
        return tag_over(key, 0, said, taker, nonce)

    for module in (tags, gate):
        monkeypatch.setattr(module, "tag_over", without_number)
    assert Forger(seed=1).tries(200) > 0


@pytest.mark.parametrize("is_covered", [True, False])
def test_a_grant_that_its_taker_never_heard_is_not_turned_to_another(
    is_covered: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The forger lets nobody hear it, and says it again with another taker; planted: no tag is over the taker."""

    def without_last_byte(frame: Frame) -> bytes:
        return frame.data[:-1]

    if not is_covered:
        for module in (tags, heard):
            monkeypatch.setattr(module, "bytes_of", without_last_byte)
    wire = wire_of()
    giver, grant = wire.gates[1], TokenGrant(1, TokenKind.SEGMENT, 258, 7, 5)
    frame = CODEC.encode(grant)[0]
    first, *seals = [*giver.say(frame, wire.now_us), *giver.seal(wire.now_us)]
    wire.put([first._replace(data=first.data[:-1] + bytes([11])), *seals])
    assert bool(wire.heard[5]) is not is_covered
    # What node 11 is to act on takes the key that it has with node 1, too.
    assert not wire.heard[11]
