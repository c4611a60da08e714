"""``dbc/graph.dbc`` is complete, and every message survives the wire (rows G14, G15)."""

from collections.abc import Mapping
from dataclasses import fields

import pytest
from cantools.database.can import Message as DbcMessage

from dbc import system_dbc_text
from onboard.core.messages import Message
from onboard.systems.graph.messages import MESSAGES, NodeVerdict, VisitList, five, stops_of
from onboard.wire.codec import codecs
from onboard.wire.dbc_file import system_layouts
from onboard.wire.decoder import Decoder
from tests.wire.samples import judge_of

TYPES = (range(0x70, 0x80), range(0xC8, 0xD0))


def test_g15_the_dbc_is_complete_and_has_the_three_answers() -> None:
    text = system_dbc_text("graph")
    assert text is not None
    for message in judge_of(text).messages:
        assert isinstance(message, DbcMessage)
        assert message.is_extended_frame and message.length == 8 and message.comment and message.senders
        for signal in message.signals:
            assert signal.comment and signal.receivers and signal.minimum is not None, f"{message.name}.{signal.name}"
    for layouts, types in zip(system_layouts("graph"), TYPES, strict=True):
        found = [layout.frame_id >> 16 & 0xFF for layout in layouts]
        assert len(set(found)) == len(found) and set(found) <= set(types)
    answers = judge_of(text).get_message_by_name("NodeAnswer").get_signal_by_name("node_verdict").choices
    assert answers is not None
    assert {value: str(name) for value, name in answers.items()} == {one.value: one.name for one in NodeVerdict}


@pytest.mark.parametrize("end", ["minimum", "maximum"])
def test_every_message_survives_the_wire(end: str) -> None:
    both = codecs("graph", MESSAGES)
    layouts = {layout.name: layout for one in system_layouts("graph") for layout in one}
    for kind in MESSAGES:
        signals = {signal.name: signal for signal in layouts[kind.__name__].signals}
        values = [_value(field.name, str(field.type), signals, end) for field in fields(kind)[1:]]
        message: Message = kind(7, *values)
        codec = both.fleet if any(kind.__name__ == one.name for one in system_layouts("graph")[0]) else both.device
        (frame,) = codec.encode(message)
        assert Decoder(codec).feed(frame, 0) == message


def _value(name: str, kind: str, signals: Mapping[str, object], end: str) -> object:
    value = int(getattr(signals[name], end))
    return bool(value) if kind in ("bool", "<class 'bool'>") else value


def test_stops_fill_a_frame_and_no_more() -> None:
    assert stops_of(VisitList(9, 1, 21, *five((4, 0, 6)))) == (4, 0, 6)
    with pytest.raises(ValueError, match="6 stops"):
        five((1, 2, 3, 4, 5, 6))
