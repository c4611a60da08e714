"""The DBC files are complete: another team could build a machine from them alone."""

import re
import zlib
from pathlib import Path

import pytest

from dbc import device_dbc_text, fleet_dbc_text
from onboard.config.site import parse_site
from onboard.contract.codes import CONTRACT, CONTRACT_VERSION, OperatorAction
from onboard.contract.constants import MAX_NODE_ID
from onboard.contract.messages import OperatorOrder, Reference
from onboard.wire import network_doc
from onboard.wire.codec import fleet_codec
from onboard.wire.dbc_file import device_layouts, fleet_layouts, read_layouts
from onboard.wire.network_doc import network_page
from onboard.wire.site_dbc import site_dbc
from tests.sites import ONE_FLOOR, one_floor
from tests.wire.samples import judge_of, layouts

TEXTS = {"fleet": fleet_dbc_text(), "device": device_dbc_text()}
#: One message of each class of priority, in the order of the design.
ORDER = [
    "EmergencyStop", "TokenGrant", "BusTime", "Call", "Award", "Bid", "ItineraryHead", "Progress", "Heartbeat",
    "DriveOrder", "DriveState", "Diagnostic",
]  # fmt: skip


def test_identifiers_hold_priority_type_and_a_free_lowest_byte() -> None:
    found = layouts()
    assert all(layout.frame_id & 0xFFFF == 0 for layout in found)
    types = [layout.frame_id >> 16 & 0xFF for layout in found]
    assert len(set(types)) == len(types), "fleet and device bus may share one wire"
    ids = {layout.name: layout.frame_id for layout in found}
    assert [ids[name] for name in ORDER] == sorted(ids[name] for name in ORDER)


def test_ranges_fit_into_the_bits() -> None:
    for layout in layouts():
        for signal in layout.signals:
            for end in (signal.minimum, signal.maximum):
                raw, rest = divmod(end - signal.offset, signal.scale)
                low = -(1 << signal.bits - 1) if signal.signed else 0
                assert rest == 0 and low <= raw < low + (1 << signal.bits), f"{layout.name}.{signal.name}"


def test_periods_and_version_are_those_of_a_site_that_sets_none() -> None:
    timing = one_floor().timing
    cycles = {layout.name: layout.cycle_ms * 1000 for layout in layouts() if not layout.on_events}
    assert cycles == {"Heartbeat": timing.heartbeat_us, "BusTime": timing.bus_time_us}
    (order,) = (layout for layout in layouts() if layout.timeout_ms)
    assert (order.name, order.cycle_ms * 1000) == ("DriveOrder", timing.drive_refresh_us)
    assert order.timeout_ms > 2 * order.cycle_ms, "one lost order stops no drive"
    for text in TEXTS.values():
        assert f'BA_ "ContractVersion" {CONTRACT};' in text
    lines = [line for line in TEXTS["fleet"].splitlines() if line.startswith(("BO_ ", " SG_ "))]
    assert zlib.crc32("\n".join(lines).encode()) & 0x7F | 0x80 == CONTRACT_VERSION, "as docs/protocol.md says"


def test_the_sites_dbc_has_one_message_for_each_machine() -> None:
    database = judge_of(site_dbc(one_floor(robots=2)))
    bids = {message.name: message.frame_id for message in database.messages if message.name.endswith("_Bid")}
    assert bids == {"IOC1_Bid": 0x09390001, "MR1_Bid": 0x0939000B, "MR2_Bid": 0x0939000C}
    names = {message.name for message in database.messages}
    assert {"MR1_DriveState", "IOC1_DoorState"} <= names
    assert not {"MR1_DoorState", "IOC1_DriveState", "IOC1_Progress", "MR1_BusTime"} & names


def test_the_sites_dbc_keeps_signals_comments_tables_and_cycles() -> None:
    ours = {layout.name: layout for layout in (*fleet_layouts("car-park"), *device_layouts("car-park"))}
    for found in read_layouts(site_dbc(one_floor(robots=2))):
        name, _, kind = found.name.partition("_")
        original = ours[kind]
        gateway = name.startswith("Gateway")
        node_id = int(name.removeprefix("Gateway")) if gateway else one_floor(robots=2).machine(name).node_id
        assert found.senders == (name,)
        assert found.frame_id == original.frame_id | node_id
        assert (found.comment, found.cycle_ms, found.signals) == (original.comment, original.cycle_ms, original.signals)


def test_an_operators_orders_decode_with_the_sites_dbc() -> None:
    """The gateways' nodes, 251 to 255, are in no site file."""
    database = judge_of(site_dbc(one_floor(robots=2)))
    for node_id in range(MAX_NODE_ID + 1, 256):
        order = OperatorOrder(node_id, 1, OperatorAction.INSERT_TICKET, Reference(1, 7))
        (frame,) = fleet_codec().encode(order)
        found = database.get_message_by_frame_id(frame.arbitration_id)
        assert found.name == f"Gateway{node_id}_OperatorOrder"
        values = found.decode(frame.data)
        assert isinstance(values, dict)
        assert (values["compartment"], str(values["action"]), values["car_number"]) == (1, "INSERT_TICKET", 7)


def test_a_machine_that_is_called_like_a_gateway_keeps_its_name() -> None:
    floor = ONE_FLOOR.format(positions=12).replace("IOC1", "Gateway251")
    text = site_dbc(parse_site(floor + '[[robots]]\nname = "MR1"\nnode = 11\nhome = "p(1,12)"\n', "test.toml"))
    (nodes,) = (line for line in text.splitlines() if line.startswith("BU_:"))
    assert nodes.split()[1:4] == ["Gateway251", "MR1", "xGateway251"]
    assert judge_of(text).get_message_by_name("Gateway251_Bid").frame_id & 0xFF == 1


def test_the_sites_dbc_names_those_who_listen() -> None:
    found = {layout.name: layout.receivers for layout in read_layouts(site_dbc(one_floor(robots=2)))}
    assert found["MR1_Bid"] == ("IOC1", "MR2")
    assert found["MR1_DriveOrder"] == found["MR1_DriveState"] == ("MR1",)
    assert found["MR1_Diagnostic"] == ()


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ('SG_ n : 0|8@0+ (1,0) [0|1] "" R', "n must be little-endian"),
        ('SG_ n : 0|8@1+ (0.5,0) [0|1] "" R', "n must have a whole scale, offset and range"),
        ('SG_ n : 0|8@1+ (1,0) [0|0] "" R', "n must be little-endian and have a range"),
    ],
)
def test_a_signal_that_our_codec_cannot_take_is_refused(line: str, told: str) -> None:
    with pytest.raises(ValueError, match=told):
        read_layouts(f'VERSION ""\nBU_: R\nBO_ 2147549184 M: 8 R\n {line}\n')


def test_the_network_page_is_a_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["network_doc", str(tmp_path / "network.md")])
    network_doc.main()
    page = (tmp_path / "network.md").read_text(encoding="utf-8")
    titles = re.findall(r"^#{1,3} (.+)$", page, re.MULTILINE)
    assert len(titles) == len(set(titles))
    assert set(re.findall(r"\(#(\w+)\)", page)) <= {title.lower() for title in titles}
    assert {layout.name for layout in layouts()} <= set(titles)
    for table in re.findall(r"(?:^\|.*\n)+", page, re.MULTILINE):
        columns = {len(re.findall(r"(?<!\\)\|", row)) for row in table.splitlines()}
        assert len(columns) == 1, f"a pipe breaks a cell: {table}"


def test_the_network_page_is_current() -> None:
    page = Path(__file__).parents[2] / "docs" / "network.md"
    assert page.read_text(encoding="utf-8") == network_page(), "run: make docs"
