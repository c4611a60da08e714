"""The DBC files are complete: another team could build a machine from them alone."""

from pathlib import Path

import cantools
import pytest
from cantools.database.can import Message

from dbc import device_dbc_text, fleet_dbc_text
from onboard.core import codes, messages
from onboard.wire.dbc_file import device_layouts, fleet_layouts
from onboard.wire.network_doc import network_page
from onboard.wire.site_dbc import site_dbc
from tests.sites import one_floor
from tests.wire.samples import layouts

TEXTS = {"fleet": fleet_dbc_text(), "device": device_dbc_text()}
#: One message of each class of priority, in the order of the design.
ORDER = [
    "EmergencyStop", "TokenGrant", "BusTime", "Call", "Award", "Bid", "ItineraryHead", "Progress", "Heartbeat",
    "DriveOrder", "DriveState", "Diagnostic",
]  # fmt: skip


@pytest.mark.parametrize("name", list(TEXTS))
def test_every_signal_has_range_comment_receivers_and_every_message_senders(name: str) -> None:
    database = cantools.database.load_string(TEXTS[name], "dbc", strict=True)
    for message in database.messages:
        assert isinstance(message, Message)
        assert message.is_extended_frame and message.length == 8 and message.comment and message.senders
        for signal in message.signals:
            where = f"{message.name}.{signal.name}"
            assert signal.comment and signal.receivers, where
            assert signal.minimum is not None and signal.maximum is not None, where
            assert signal.byte_order == "little_endian", where
            assert (signal.unit or "") == _unit_in(signal.name), where


def _unit_in(name: str) -> str:
    """Units come last in a name."""
    endings = {"_mm_s": "mm/s", "_us": "us", "_ms": "ms", "_mm": "mm", "_kg": "kg"}
    return next((unit for ending, unit in endings.items() if name.endswith(ending)), "")


def test_identifiers_hold_priority_type_and_a_free_lowest_byte() -> None:
    found = layouts()
    assert all(layout.frame_id & 0xFFFF == 0 for layout in found)
    types = [layout.frame_id >> 16 & 0xFF for layout in found]
    assert len(set(types)) == len(types), "fleet and device bus may share one wire"
    ids = {layout.name: layout.frame_id for layout in found}
    assert [ids[name] for name in ORDER] == sorted(ids[name] for name in ORDER)


def test_value_tables_are_the_codes() -> None:
    enums = {
        "reason": codes.Reason, "operation": codes.Operation, "kind": codes.KindCode, "criterion": codes.Criterion,
        "result": codes.CallResult, "grade": codes.Grade, "token_kind": codes.TokenKind, "phase": codes.TaskPhase,
        "state": codes.MachineState, "side": codes.Side, "door": codes.DoorName, "text": codes.DeskText,
        "event": codes.DeskInput, "colour": codes.LightColour, "light": codes.LightColour,
        "input_door": codes.DoorPosition, "output_door": codes.DoorPosition,
    }  # fmt: skip
    seen = set()
    for layout in layouts():
        for signal in layout.signals:
            if signal.name in enums:
                seen.add(signal.name)
                table = tuple(sorted((int(code), code.name) for code in enums[signal.name]))
                assert signal.choices == table, f"{layout.name}.{signal.name}"
    assert seen == set(enums)


def test_every_message_class_travels_and_nothing_else() -> None:
    classes = {
        name for name, kind in vars(messages).items() if isinstance(kind, type) and issubclass(kind, messages.Message)
    }
    parts = {"Call", "CallTerms", "CallLoad", "ItineraryHead", "ItineraryLeg"}
    expected = (classes - {"Message", "CallForProposals", "Itinerary"}) | parts
    assert {layout.name for layout in (*fleet_layouts(), *device_layouts())} == expected


def test_the_sites_dbc_has_one_message_for_each_machine() -> None:
    database = cantools.database.load_string(site_dbc(one_floor(robots=2)), "dbc", strict=True)
    bids = {message.name: message.frame_id for message in database.messages if message.name.endswith("_Bid")}
    assert bids == {"IOC1_Bid": 0x09390001, "MR1_Bid": 0x0939000B, "MR2_Bid": 0x0939000C}
    names = {message.name for message in database.messages}
    assert {"MR1_DriveState", "IOC1_DoorState"} <= names
    assert not {"MR1_DoorState", "IOC1_DriveState", "IOC1_Progress", "MR1_BusTime"} & names


def test_the_network_page_is_current() -> None:
    page = Path(__file__).parents[2] / "docs" / "network.md"
    assert page.read_text(encoding="utf-8") == network_page(), "run: make docs"
