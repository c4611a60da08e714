"""The compiled codec against cantools, bit for bit; the decoder against everything that a wire can carry."""

import dataclasses
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dbc import announce_dbc_text, battery_dbc_text, change_dbc_text, device_dbc_text, fleet_dbc_text, seal_dbc_text
from onboard.contract.codes import (
    Criterion,
    Grade,
    KindCode,
    LegAction,
    MachineState,
    Operation,
    Reason,
    Side,
    TokenKind,
)
from onboard.contract.messages import CallForProposals, Heartbeat, Itinerary, Leg, Message, Reference, Stamp, TokenGrant
from onboard.core.frame import Frame
from onboard.wire.codec import Codec, device_codec, fleet_codec
from onboard.wire.dbc_file import fleet_layouts
from onboard.wire.decoder import MAX_SETS, SET_TIMEOUT_US, Decoder
from tests.wire.samples import judge_of, layouts, message_of, random_frames, signal_values

FLEET_NAMES = {layout.name for layout in fleet_layouts()}
JUDGES = {
    True: judge_of(fleet_dbc_text(), seal_dbc_text(), battery_dbc_text(), change_dbc_text(), announce_dbc_text()),
    False: judge_of(device_dbc_text(), announce_dbc_text()),
}

CALL = CallForProposals(
    1, 700, Reference(1, 40), Operation.PARK, KindCode.ROBOT, Criterion.FINISH_TIME, 2, 0, 0xFFFF_FF00, 0x0184, 0xFFFF,
    Reference(1, 40), 2710,
)  # fmt: skip
PLAN = Itinerary(
    11, 9, Grade.FIRM, Stamp(0xFFFF_FFF0, 1, 188),
    (Leg(LegAction.TRAVEL, 1, 3, 7, Side.NEAR, 0xFFFF_FFFF), Leg(LegAction.WORK, 1, 7, 7, Side.FAR, 9_000)),
)  # fmt: skip


def test_every_message_is_packed_and_read_as_cantools_does() -> None:
    for layout, node, values in random_frames(200, seed=7):
        fleet = layout.name in FLEET_NAMES
        codec: Codec = fleet_codec() if fleet else device_codec()
        judge = JUDGES[fleet].get_message_by_name(layout.name)
        data = judge.encode(values, scaling=True, padding=False, strict=True)
        (frame,) = codec.encode(message_of(layout.name, node, values))
        assert frame == Frame(layout.frame_id | node, bytes(data)), layout.name
        part = codec.decode_part(frame)
        assert isinstance(part, Message), (layout.name, part, values)
        assert (part.sender, codec.name_of(frame)) == (node, layout.name)
        decoded = judge.decode(frame.data, decode_choices=False, scaling=True)
        assert signal_values(part) == decoded == values
        assert codec.encode(part) == (frame,)


@pytest.mark.parametrize("message", [CALL, PLAN, dataclasses.replace(PLAN, grade=Grade.RELEASED, legs=())])
def test_a_set_of_frames_comes_back_whole(message: Message) -> None:
    decoder = Decoder(fleet_codec())
    heard = [decoder.feed(frame, 0) for frame in fleet_codec().encode(message)]
    assert heard[-1] == message and set(heard[:-1]) <= {None}
    assert not decoder.drops


def test_an_incomplete_set_is_inert_and_counted_after_a_while() -> None:
    decoder = Decoder(fleet_codec())
    for message in (CALL, PLAN):
        for frame in fleet_codec().encode(message)[:-1]:
            assert decoder.feed(frame, 0) is None
    later = fleet_codec().encode(dataclasses.replace(CALL, call=701))
    assert [decoder.feed(frame, SET_TIMEOUT_US + 1) for frame in later][-1] is not None
    assert decoder.drops == {Reason.INCOMPLETE_SET: 2}


def test_parts_in_any_order_and_twice_make_one_call() -> None:
    decoder = Decoder(fleet_codec())
    first, second, third = fleet_codec().encode(CALL)
    heard = [decoder.feed(frame, 0) for frame in (third, third, first, second)]
    assert [message for message in heard if message is not None] == [CALL]


def test_legs_of_an_older_itinerary_never_complete_a_newer_one() -> None:
    decoder = Decoder(fleet_codec())
    old = dataclasses.replace(PLAN, grade=Grade.TENTATIVE)
    head, leg, _ = fleet_codec().encode(old)
    decoder.feed(head, 0)
    decoder.feed(leg, 0)
    heard = [decoder.feed(frame, 0) for frame in fleet_codec().encode(PLAN)]
    assert heard == [None, None, PLAN]
    assert decoder.drops == {Reason.INCOMPLETE_SET: 1}


@pytest.mark.parametrize(
    ("frame", "reason"),
    [
        (Frame(0x12500001, b"\x01\x00"), Reason.SHORT_FRAME),
        (Frame(0x1FFFFFFF, bytes(8)), Reason.UNKNOWN_IDENTIFIER),
        (Frame(0x12500000, bytes(8)), Reason.UNKNOWN_IDENTIFIER),
        (Frame(0x123, bytes(8), is_extended=False), Reason.UNKNOWN_IDENTIFIER),
        (Frame(0x12500001, b"", is_remote=True, remote_dlc=8), Reason.UNKNOWN_IDENTIFIER),
        (Frame(0x12500001, bytes([1, 1, 0, 0, 0, 1, 0xFF, 0])), Reason.VALUE_OUT_OF_RANGE),
    ],
)
def test_bad_input_is_dropped_and_counted_with_its_reason(frame: Frame, reason: Reason) -> None:
    decoder = Decoder(fleet_codec())
    assert decoder.feed(frame, 0) is None
    assert decoder.drops == {reason: 1}


def test_any_hundred_thousand_frames_never_raise_and_take_bounded_memory() -> None:
    chance = random.Random(11)
    known = [layout.frame_id for layout in layouts()]
    fed = heard = 0
    decoder = Decoder(fleet_codec())
    for number in range(100_000):
        identifier = chance.choice(known) | chance.randrange(256) if chance.random() < 0.9 else chance.getrandbits(29)
        frame = Frame(identifier, chance.randbytes(8 if chance.random() < 0.9 else chance.randrange(8)))
        fed += 1
        heard += decoder.feed(frame, number * 100) is not None
        assert len(decoder._sets) <= MAX_SETS
    assert heard > 0
    assert decoder.drops[Reason.UNKNOWN_IDENTIFIER] > 0 and decoder.drops[Reason.VALUE_OUT_OF_RANGE] > 0
    assert heard + sum(decoder.drops.values()) <= fed


@given(st.binary(max_size=8), st.integers(0, 2**29 - 1), st.booleans(), st.booleans(), st.booleans())
def test_no_frame_raises(data: bytes, identifier: int, extended: bool, remote: bool, error: bool) -> None:
    Decoder(fleet_codec()).feed(Frame(identifier, data, extended, remote, error), 0)


def test_our_own_mistake_names_the_signal() -> None:
    with pytest.raises(ValueError, match=r"TokenGrant.holder = 256: outside 1 to 255"):
        fleet_codec().encode(TokenGrant(1, TokenKind.SEGMENT, 3, 1, 256))
    with pytest.raises(ValueError, match="no node-ID"):
        fleet_codec().encode(Heartbeat(0, 1, 1, 1, 1, KindCode.ROBOT, MachineState.IDLE))
