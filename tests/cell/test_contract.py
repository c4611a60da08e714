"""``dbc/cell.dbc`` and ``dbc/turning.dbc`` are complete, and every message survives the wire."""

from collections.abc import Mapping
from dataclasses import fields
from math import inf, nan

import pytest
from cantools.database.can import Message as DbcMessage

from dbc import system_dbc_text
from onboard.core.messages import Message, Reference
from onboard.systems.cell import messages as cell_messages
from onboard.systems.cell.goal_frames import Hearsay
from onboard.systems.cell.messages import OfferHigh, OfferLow, OfferNodes, from_halves, halves
from onboard.systems.turning import messages as turning_messages
from onboard.wire.codec import codecs
from onboard.wire.dbc_file import system_layouts
from onboard.wire.decoder import Decoder
from tests.wire.samples import judge_of

SYSTEMS = {"cell": cell_messages.MESSAGES, "turning": turning_messages.MESSAGES}
#: Message types (bits 16 to 23 of the identifier) of each system, on the fleet bus and on device buses.
TYPES = {"cell": (range(0xA0, 0xB0), range(0xD0, 0xD8)), "turning": (range(0xB0, 0xB8), range(0xD8, 0xE0))}


@pytest.mark.parametrize("system", list(TYPES))
def test_the_dbc_is_complete(system: str) -> None:
    text = system_dbc_text(system)
    assert text is not None
    for message in judge_of(text).messages:
        assert isinstance(message, DbcMessage)
        assert message.is_extended_frame and message.length == 8 and message.comment and message.senders
        for signal in message.signals:
            assert signal.comment and signal.receivers and signal.minimum is not None, f"{message.name}.{signal.name}"
    for layouts, types in zip(system_layouts(system), TYPES[system], strict=True):
        found = [layout.frame_id >> 16 & 0xFF for layout in layouts]
        assert len(set(found)) == len(found) and set(found) <= set(types)
        assert all(layout.frame_id & 0xFFFF == 0 for layout in layouts)


@pytest.mark.parametrize("system", list(SYSTEMS))
@pytest.mark.parametrize("end", ["minimum", "maximum"])
def test_every_message_survives_the_wire(system: str, end: str) -> None:
    both = codecs(system, SYSTEMS[system])
    layouts = {layout.name: layout for one in system_layouts(system) for layout in one}
    for kind in SYSTEMS[system]:
        signals = {signal.name: signal for signal in layouts[kind.__name__].signals}
        values = [_value(field.name, str(field.type), signals, end) for field in fields(kind)[1:]]
        message: Message = kind(7, *values)
        codec = both.fleet if any(kind.__name__ == one.name for one in system_layouts(system)[0]) else both.device
        (frame,) = codec.encode(message)
        assert Decoder(codec).feed(frame, 0) == message


def _value(name: str, kind: str, signals: Mapping[str, object], end: str) -> object:
    def of(signal: str) -> int:
        return int(getattr(signals[signal], end))

    if "Reference" in kind:
        return Reference(of(f"{name}_origin"), of(f"{name}_number"))
    return bool(of(name)) if kind in ("bool", "<class 'bool'>") else of(name)


@pytest.mark.parametrize("value", [65.2119063886405, 0.1, 0.0, 1e300, 5e-324])
def test_a_cost_keeps_every_bit(value: float) -> None:
    assert from_halves(*halves(value)) == value


@pytest.mark.parametrize("value", [nan, inf, -inf, -1.0])
def test_what_is_no_cost_is_no_offer(value: float) -> None:
    hearsay, (high, low) = Hearsay(), halves(value)
    for message in (OfferHigh(1, 9, 1, high), OfferLow(1, 9, 1, low), OfferNodes(1, 9, 1, 1, 0, 0, 0, 0)):
        hearsay.hear(message)
    assert hearsay.offer(1, Reference(9, 1)) is None


def test_an_offer_with_a_frame_missing_is_none() -> None:
    hearsay, (high, low) = Hearsay(), halves(3.5)
    said = [OfferHigh(1, 9, 1, high), OfferLow(1, 9, 1, low), OfferNodes(1, 9, 1, 1, 2, 0, 0, 0)]
    for message in said[1:]:
        hearsay.hear(message)
    assert hearsay.offer(1, Reference(9, 1)) is None
    for message in said:
        hearsay.hear(message)
    offer = hearsay.offer(1, Reference(9, 1))
    assert offer is not None and (offer.cost, offer.nodes) == (3.5, (1, 2))
