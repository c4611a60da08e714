"""``dbc/mapd.dbc`` is complete, and every message survives the wire (row P59)."""

from collections.abc import Mapping
from dataclasses import fields

import pytest
from cantools.database.can import Message as DbcMessage

from dbc import system_dbc_text
from onboard.core.messages import Message
from onboard.systems.mapd.messages import MESSAGES
from onboard.wire.codec import codecs
from onboard.wire.dbc_file import system_layouts
from onboard.wire.decoder import Decoder
from tests.wire.samples import judge_of

TYPES = (range(0xB8, 0xC0), range(0xE0, 0xE8))


def test_p59_the_dbc_is_complete() -> None:
    text = system_dbc_text("mapd")
    assert text is not None
    for message in judge_of(text).messages:
        assert isinstance(message, DbcMessage)
        assert message.is_extended_frame and message.length == 8 and message.comment and message.senders
        for signal in message.signals:
            assert signal.comment and signal.receivers and signal.minimum is not None, f"{message.name}.{signal.name}"
    for layouts, types in zip(system_layouts("mapd"), TYPES, strict=True):
        found = [layout.frame_id >> 16 & 0xFF for layout in layouts]
        assert len(set(found)) == len(found) and set(found) <= set(types)


@pytest.mark.parametrize("end", ["minimum", "maximum"])
def test_every_message_survives_the_wire(end: str) -> None:
    both = codecs("mapd", MESSAGES)
    layouts = {layout.name: layout for one in system_layouts("mapd") for layout in one}
    for kind in MESSAGES:
        signals = {signal.name: signal for signal in layouts[kind.__name__].signals}
        values = [_value(field.name, str(field.type), signals, end) for field in fields(kind)[1:]]
        message: Message = kind(7, *values)
        codec = both.fleet if any(kind.__name__ == one.name for one in system_layouts("mapd")[0]) else both.device
        (frame,) = codec.encode(message)
        assert Decoder(codec).feed(frame, 0) == message


def _value(name: str, kind: str, signals: Mapping[str, object], end: str) -> object:
    value = int(getattr(signals[name], end))
    return bool(value) if kind in ("bool", "<class 'bool'>") else value
