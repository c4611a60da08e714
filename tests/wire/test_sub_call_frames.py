"""A sub-call is a call of four frames; any three of them are none."""

import itertools

import pytest

from onboard.contract.codes import Criterion, KindCode, Operation, Reason
from onboard.contract.messages import CallForProposals, Reference
from onboard.wire.codec import fleet_codec
from onboard.wire.decoder import SET_TIMEOUT_US, Decoder

SUB_CALL = CallForProposals(
    11, 700, Reference(1, 40), Operation.RIDE, KindCode.LIFT, Criterion.FINISH_TIME, 1, 1, 90_000, 0x0101, 0x0301,
    Reference(1, 40), 2710, Reference(1, 0x1234), 2, 12_300, 1_250,
)  # fmt: skip


def test_a_sub_call_comes_through_in_any_order_of_its_frames() -> None:
    frames = fleet_codec().encode(SUB_CALL)
    assert [fleet_codec().name_of(frame) for frame in frames] == ["Call", "CallTerms", "CallLoad", "CallParent"]
    for order in itertools.permutations(frames):
        decoder = Decoder(fleet_codec())
        assert [decoder.feed(frame, 0) for frame in order] == [None, None, None, SUB_CALL]


@pytest.mark.parametrize("lost", range(4))
def test_a_sub_call_that_misses_a_frame_is_none(lost: int) -> None:
    decoder = Decoder(fleet_codec())
    frames = [frame for number, frame in enumerate(fleet_codec().encode(SUB_CALL)) if number != lost]
    assert [decoder.feed(frame, 0) for frame in frames] == [None, None, None]
    decoder.feed(frames[0]._replace(arbitration_id=frames[0].arbitration_id + 1), SET_TIMEOUT_US + 1)
    assert decoder.drops == {Reason.INCOMPLETE_SET: 1}


def test_durations_of_a_sub_call_travel_in_their_steps() -> None:
    (*_, parent) = fleet_codec().encode(SUB_CALL)
    word = int.from_bytes(parent.data, "little")
    assert (word >> 40 & 0x3FFF, word >> 54) == (123, 5)
