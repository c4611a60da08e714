"""What a gateway may put on the fleet bus: its own words, and nothing that is a machine's or an operator's to say."""

import pytest

from onboard.contract.codes import ManualMode, Reason, TokenKind
from onboard.contract.messages import EmergencyStop, ManualOrder, Message, SyncRequest, TokenGrant
from onboard.core.frame import Frame
from onboard.gateway.own_words import OwnWords
from onboard.wire.codec import fleet_codec
from tests.mqtt.ordered import NODE

ROBOT = 11


def said(message: Message) -> tuple[list[Frame], int]:
    """What came onto the bus, and how many messages were kept back."""
    frames: list[Frame] = []

    def send(frame: Frame) -> bool:
        frames.append(frame)
        return True

    words = OwnWords(fleet_codec(), NODE, send)
    words.say(message)
    return frames, words.kept_back


@pytest.mark.parametrize("message", [ManualOrder(NODE, ROBOT, 1, ManualMode.HELD), SyncRequest(NODE, 0)])
def test_its_own_words_are_sent(message: Message) -> None:
    assert said(message) == (list(fleet_codec().encode(message)), 0)


@pytest.mark.parametrize(
    "message",
    [
        TokenGrant(NODE, TokenKind.SEGMENT, 3, 7, ROBOT),
        EmergencyStop(NODE, Reason.OPERATOR),
        ManualOrder(NODE + 1, ROBOT, 1, ManualMode.HELD),
        SyncRequest(ROBOT, 0),
    ],
    ids=["a machine's word", "an operator's stop", "another gateway's number", "a machine's number"],
)
def test_what_is_not_its_own_goes_nowhere(message: Message) -> None:
    assert said(message) == ([], 1)
