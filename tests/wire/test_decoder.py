"""What a wire can carry, whole, mixed, doubled, late or mad: judged frame by frame by cantools and by counting."""

import dataclasses
import random
from collections import Counter

import pytest
from cantools.database.can import Database
from hypothesis import given
from hypothesis import strategies as st

from dbc import announce_dbc_text, battery_dbc_text, change_dbc_text, device_dbc_text, fleet_dbc_text, seal_dbc_text
from onboard.contract.codes import Criterion, Grade, KindCode, LegAction, Operation, Reason, Side, TokenKind
from onboard.contract.messages import (
    CallForProposals,
    EmergencyStop,
    Go,
    Itinerary,
    Leg,
    Message,
    Reference,
    Stamp,
    SyncRequest,
    TokenHeld,
)
from onboard.core.frame import Frame
from onboard.wire.codec import Codec, device_codec, fleet_codec
from onboard.wire.dbc_file import MessageLayout, device_layouts, fleet_layouts
from onboard.wire.decoder import MAX_SETS, SET_TIMEOUT_US, Decoder
from tests.sites import one_floor
from tests.wire.samples import judge_of, message_of, random_frames, signal_values

FRAMES = 30_000


BUSES = {
    "fleet": (
        fleet_codec(),
        fleet_layouts(),
        judge_of(fleet_dbc_text(), seal_dbc_text(), battery_dbc_text(), change_dbc_text(), announce_dbc_text()),
    ),
    "device": (device_codec(), device_layouts(), judge_of(device_dbc_text(), announce_dbc_text())),
}


def judged(frame: Frame, database: Database) -> dict[str, int] | Reason:
    """What a frame means, or why it means nothing, by cantools and the range and value table of each signal."""
    known = {message.frame_id: message for message in database.messages}
    message = known.get(frame.arbitration_id & 0x1FFFFF00)
    if message is None or frame.arbitration_id & 0xFF == 0:
        return Reason.UNKNOWN_IDENTIFIER
    if len(frame.data) < message.length:
        return Reason.SHORT_FRAME
    decoded = message.decode(frame.data, decode_choices=False, scaling=True)
    assert isinstance(decoded, dict)
    values = {name: value for name, value in decoded.items() if isinstance(value, int)}
    assert values.keys() == decoded.keys()
    for signal in message.signals:
        assert signal.minimum is not None and signal.maximum is not None
        value = values[signal.name]
        if not signal.minimum <= value <= signal.maximum or (signal.choices and value not in signal.choices):
            return Reason.VALUE_OUT_OF_RANGE
    return values


def mutated(frame: Frame, chance: random.Random) -> Frame:
    """A frame that something happened to: a bit turned over, cut short, another identifier, or nothing."""
    match chance.randrange(5):
        case 0:
            word = int.from_bytes(frame.data, "little") ^ 1 << chance.randrange(64)
            return frame._replace(data=word.to_bytes(8, "little"))
        case 1:
            return frame._replace(data=frame.data[: chance.randrange(9)])
        case 2:
            return frame._replace(arbitration_id=frame.arbitration_id ^ 1 << chance.randrange(29))
        case 3:
            return frame._replace(data=chance.randbytes(8))
        case _:
            return frame


def mutants(codec: Codec, layouts: tuple[MessageLayout, ...], seed: int) -> list[Frame]:
    chance = random.Random(seed)
    names = {layout.name for layout in layouts}
    drawn = [message_of(one.name, node, values) for one, node, values in random_frames(100, seed) if one.name in names]
    valid = [frame for message in drawn for frame in codec.encode(message)]
    return [mutated(chance.choice(valid), chance) for _ in range(FRAMES)]


@pytest.mark.parametrize("bus", list(BUSES))
def test_every_mutated_frame_means_what_cantools_says_or_is_refused_for_the_right_reason(bus: str) -> None:
    codec, layouts, database = BUSES[bus]
    reasons: Counter[Reason] = Counter()
    for frame in mutants(codec, layouts, seed=3):
        expected, part = judged(frame, database), codec.decode_part(frame)
        if isinstance(part, Reason):
            reasons[part] += 1
            assert part == expected, frame
        else:
            assert signal_values(part) == expected, frame
    assert min(reasons[one] for one in (Reason.UNKNOWN_IDENTIFIER, Reason.SHORT_FRAME, Reason.VALUE_OUT_OF_RANGE)) > 100


def test_every_frame_becomes_one_message_or_one_count() -> None:
    codec, layouts, _ = BUSES["device"]
    decoder = Decoder(codec)
    heard = 0
    for number, frame in enumerate(mutants(codec, layouts, seed=4)):
        before = sum(decoder.drops.values())
        message = decoder.feed(frame, number)
        heard += message is not None
        assert sum(decoder.drops.values()) - before == (message is None)
    assert heard > FRAMES // 4


def test_what_is_no_extended_data_frame_is_unknown() -> None:
    decoder = Decoder(fleet_codec())
    heartbeat = Frame(0x12500001, bytes([1, 1, 0, 0, 0, 1, 1, 0]))
    assert decoder.feed(heartbeat, 0) is not None
    for other in (
        heartbeat._replace(is_remote=True, data=b"", remote_dlc=8),
        heartbeat._replace(is_error=True),
        heartbeat._replace(arbitration_id=0x123, is_extended=False),
        heartbeat._replace(arbitration_id=0x3250_0001),
    ):
        assert decoder.feed(other, 0) is None
    assert decoder.drops == {Reason.UNKNOWN_IDENTIFIER: 4}


# --- sets of frames --------------------------------------------------------------------------------------------


def a_call(sender: int, number: int) -> CallForProposals:
    return CallForProposals(
        sender, number, Reference(sender, number), Operation.RETRIEVE, KindCode.ROBOT, Criterion.FINISH_TIME, 1, 0,
        1_000 * number, 256 + number, 512 + number, Reference(1, number), 1_500 + 10 * number,
    )  # fmt: skip


def a_plan(sender: int, version: int, legs: int) -> Itinerary:
    return Itinerary(
        sender, version, Grade.FIRM, Stamp(0xFFFF_FF00 + version, sender, version),
        tuple(Leg(LegAction.TRAVEL, 1, leg + 1, version + 1, Side.NEAR, 1_000 * leg) for leg in range(legs)),
    )  # fmt: skip


@st.composite
def traffic(draw: st.DrawFn) -> tuple[list[Message], list[Frame]]:
    """Calls and plans of some nodes. Their frames come mixed, some of them twice, but each set's first frame first."""
    sent: list[Message] = []
    for sender in range(1, draw(st.integers(1, 3)) + 1):
        sent += [a_call(sender, number) for number in range(1, draw(st.integers(0, 2)) + 1)]
        sent += [a_plan(sender, number, draw(st.integers(0, 4))) for number in range(1, draw(st.integers(0, 2)) + 1)]
    queues = []
    for message in sent:
        first, *rest = fleet_codec().encode(message)
        doubled = [frame for frame in rest[:-1] for _ in range(draw(st.integers(1, 2)))]
        queues.append([first, *[first] * draw(st.integers(0, len(rest) and 1)), *doubled, *rest[-1:]])
    frames = []
    while any(queues):
        waiting = [queue for queue in queues if queue]
        frames.append(draw(st.sampled_from(waiting)).pop(0))
    return sent, frames


@given(traffic())
def test_mixed_sets_come_out_once_each_and_whole(said: tuple[list[Message], list[Frame]]) -> None:
    sent, frames = said
    decoder = Decoder(fleet_codec())
    heard = [message for frame in frames if (message := decoder.feed(frame, 0)) is not None]
    assert sorted(heard, key=repr) == sorted(sent, key=repr)
    assert not decoder.drops


@given(traffic(), st.randoms(use_true_random=False))
def test_lost_and_reordered_frames_never_make_a_message_that_nobody_sent(
    said: tuple[list[Message], list[Frame]], chance: random.Random
) -> None:
    sent, frames = said
    kept = [frame for frame in frames if chance.random() < 0.8]
    chance.shuffle(kept)
    decoder = Decoder(fleet_codec())
    for number, frame in enumerate(kept):
        message = decoder.feed(frame, number * SET_TIMEOUT_US // 5)
        assert message is None or message in sent
    assert len(decoder._sets) <= len(sent)


@pytest.mark.parametrize("lost", [1, 2])
def test_a_number_used_again_never_takes_frames_of_the_call_before(lost: int) -> None:
    """A sender restarted at once without its journal: its first call was cut short, its second has the same number."""
    old, new = a_call(1, 5), dataclasses.replace(a_call(1, 6), call=5)
    decoder = Decoder(fleet_codec())
    remains = [frame for number, frame in enumerate(fleet_codec().encode(old)) if number != lost]
    heard = [decoder.feed(frame, 0) for frame in [*remains, *fleet_codec().encode(new)]]
    assert [message for message in heard if message is not None] == [new]
    assert decoder.drops == {Reason.INCOMPLETE_SET: 1}


def test_a_leg_that_contradicts_the_one_before_voids_the_set() -> None:
    plan = a_plan(11, 9, 3)
    other = dataclasses.replace(plan, legs=(plan.legs[0]._replace(to_index=99), *plan.legs[1:]))
    head, first, *rest = fleet_codec().encode(plan)
    contradicting = fleet_codec().encode(other)[1]
    decoder = Decoder(fleet_codec())
    assert [decoder.feed(frame, 0) for frame in (head, first, contradicting, *rest)] == [None] * 5
    assert decoder.drops[Reason.INCOMPLETE_SET] >= 1


def test_a_leg_without_its_head_is_inert_and_counted() -> None:
    decoder = Decoder(fleet_codec())
    for frame in fleet_codec().encode(a_plan(11, 9, 3))[1:]:
        assert decoder.feed(frame, 0) is None
    assert decoder.drops == {Reason.INCOMPLETE_SET: 3}


def test_legs_that_follow_each_other_slowly_make_one_itinerary() -> None:
    """As a sender beyond its budget tells them: the time-out is for the next frame, not for all of them."""
    decoder, heard = Decoder(fleet_codec()), []
    for number, frame in enumerate(fleet_codec().encode(a_plan(11, 9, 31))):
        heard.append(decoder.feed(frame, number * SET_TIMEOUT_US // 4))
    assert heard[-1] == a_plan(11, 9, 31)
    assert not decoder.drops


def test_a_set_ends_at_its_time_out_and_not_before() -> None:
    for late_us, whole in ((0, True), (1, False)):
        decoder = Decoder(fleet_codec())
        first, second, third = fleet_codec().encode(a_call(1, 5))
        decoder.feed(first, 100)
        decoder.feed(second, 100)
        assert (decoder.feed(third, 100 + SET_TIMEOUT_US + late_us) is not None) is whole
        assert decoder.drops[Reason.INCOMPLETE_SET] == (not whole)


def test_a_set_that_is_sent_again_has_its_whole_time_again() -> None:
    """Said at 0 with one leg lost, said again just before the time-out: the second telling must not be cut off."""
    head, first, second = fleet_codec().encode(a_plan(11, 9, 2))
    for lost in (first, second):
        decoder = Decoder(fleet_codec())
        for frame in (head, first, second):
            if frame is not lost:
                assert decoder.feed(frame, 0) is None
        again_us = SET_TIMEOUT_US - 10
        assert decoder.feed(head, again_us) is None
        heard = [decoder.feed(frame, again_us + 20) for frame in (first, second)]
        assert [message for message in heard if message is not None] == [a_plan(11, 9, 2)]
        assert not decoder.drops


def test_a_call_that_is_sent_again_has_its_whole_time_again() -> None:
    head, terms, load = fleet_codec().encode(a_call(1, 5))
    decoder = Decoder(fleet_codec())
    for frame, time_us in ((head, 0), (load, 0), (head, SET_TIMEOUT_US - 1)):
        assert decoder.feed(frame, time_us) is None
    assert decoder.feed(terms, SET_TIMEOUT_US + 1) == a_call(1, 5)
    assert decoder.feed(load, SET_TIMEOUT_US + 1) is None
    assert not decoder.drops


@pytest.mark.parametrize("message", [a_plan(11, 9, 3), a_call(1, 5)])
def test_a_frame_doubled_on_the_wire_after_its_set_was_whole_is_inert(message: Message) -> None:
    """The last frame of a set comes twice after an inconsistent omission (Rufino et al. 1998)."""
    frames = fleet_codec().encode(message)
    decoder = Decoder(fleet_codec())
    assert [decoder.feed(frame, 0) for frame in frames][-1] == message
    assert [decoder.feed(frame, 10) for frame in frames[1:]] == [None] * (len(frames) - 1)
    assert decoder.feed(frames[-1], 5 * SET_TIMEOUT_US // 4) is None
    assert decoder.feed(frames[0], 6 * SET_TIMEOUT_US) is None
    # A call's frame opens a set, which is dropped in time; a leg without its head comes to nothing at once.
    assert decoder.drops == {Reason.INCOMPLETE_SET: 1}, "only the one that came after the memory of the set had ended"
    assert [decoder.feed(frame, 6 * SET_TIMEOUT_US) for frame in frames[1:]][-1] == message, "said again is heard again"


def test_other_legs_after_a_whole_set_are_counted() -> None:
    plan = a_plan(11, 9, 2)
    other = dataclasses.replace(plan, legs=(plan.legs[0], plan.legs[1]._replace(to_index=99)))
    decoder = Decoder(fleet_codec())
    for frame in fleet_codec().encode(plan):
        decoder.feed(frame, 0)
    assert decoder.feed(fleet_codec().encode(other)[2], 0) is None
    assert decoder.drops == {Reason.INCOMPLETE_SET: 1}


def test_a_released_itinerary_with_legs_is_none_of_the_contract() -> None:
    plan = a_plan(11, 9, 2)
    with pytest.raises(ValueError, match=r"ItineraryHead\.legs = 2"):
        fleet_codec().encode(dataclasses.replace(plan, grade=Grade.RELEASED))
    head, *legs = fleet_codec().encode(plan)
    grade_bits = 0b11 << 8
    released = head._replace(data=(int.from_bytes(head.data, "little") & ~grade_bits).to_bytes(8, "little"))
    decoder = Decoder(fleet_codec())
    assert [decoder.feed(frame, 0) for frame in (released, *legs)] == [None] * 3
    assert decoder.drops == {Reason.VALUE_OUT_OF_RANGE: 1, Reason.INCOMPLETE_SET: 2}
    empty = dataclasses.replace(plan, grade=Grade.RELEASED, legs=())
    (frame,) = fleet_codec().encode(empty)
    assert decoder.feed(frame, 0) == empty


def test_no_car_stays_no_car_on_its_way_over_the_bus() -> None:
    call = dataclasses.replace(a_call(1, 5), wheelbase_mm=0)
    decoder = Decoder(fleet_codec())
    assert [decoder.feed(frame, 0) for frame in fleet_codec().encode(call)][-1] == call
    # What a babbling node says of a car must not stop whoever calls for it: as short as can be told, and still a car.
    frames = fleet_codec().encode(dataclasses.replace(call, wheelbase_mm=1500))
    assert [decoder.feed(frame, 0) for frame in frames][-1] == dataclasses.replace(call, wheelbase_mm=1510)


def test_memory_is_bounded_and_the_oldest_sets_are_counted_as_they_go() -> None:
    decoder = Decoder(fleet_codec())
    heads = [
        fleet_codec().encode(a_plan(sender, version, 2))[0] for sender in range(1, 251) for version in range(1, 41)
    ]
    for frame in heads:
        assert decoder.feed(frame, 0) is None
    assert len(decoder._sets) == MAX_SETS
    assert decoder.drops == {Reason.INCOMPLETE_SET: len(heads) - MAX_SETS}
    for sender in range(1, 251):
        for number in (1, 2):
            for frame in fleet_codec().encode(a_call(sender, number)):
                decoder.feed(frame, 0)
    assert len(decoder._sets) < MAX_SETS == len(decoder._whole)
    memory = fleet_codec().decode_part.cache_info()
    assert memory.maxsize is not None and memory.currsize <= memory.maxsize


def test_a_sender_who_opens_sets_without_end_drops_its_own() -> None:
    decoder = Decoder(fleet_codec())
    head, *legs = fleet_codec().encode(a_plan(11, 1, 2))
    decoder.feed(head, 0)
    for sender in (240, 241):
        for version in range(1, 250):
            decoder.feed(fleet_codec().encode(a_plan(sender, version, 2))[0], 0)
    found = [decoder.feed(leg, 0) for leg in legs]
    assert found[-1] == a_plan(11, 1, 2)


def test_who_watches_a_site_takes_up_what_its_machines_listen_to() -> None:
    site = one_floor()
    decoder = Decoder(fleet_codec(), site.machines)
    heard: list[Message] = [
        TokenHeld(11, TokenKind.SEGMENT, 1, 2),
        TokenHeld(240, TokenKind.SEGMENT, 1, 2),
        Go(11, 0),
        Go(251, 0),
    ]
    said = [decoder.feed(fleet_codec().encode(one)[0], 0) for one in (*heard, EmergencyStop(240, Reason.OPERATOR))]
    assert [one.sender for one in said if one is not None] == [11, 251, 240]
    assert decoder.drops == {Reason.NOT_OF_SITE: 1, Reason.NOT_OF_KIND: 1}


# --- our own mistakes ------------------------------------------------------------------------------------------


def test_a_message_of_several_frames_with_a_wrong_value_is_refused() -> None:
    with pytest.raises(ValueError, match=r"ItineraryHead\.legs = 32"):
        fleet_codec().encode(a_plan(11, 1, 32))
    with pytest.raises(ValueError, match=r"CallLoad\.wheelbase_mm = 4060"):
        fleet_codec().encode(dataclasses.replace(a_call(1, 1), wheelbase_mm=4_060))
    with pytest.raises(KeyError):
        device_codec().encode(SyncRequest(1, 0))
