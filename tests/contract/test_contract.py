"""Every DBC file in ``dbc/`` is complete, what is generated of it is current, and its bytes are those of cantools."""

import random
import re
from pathlib import Path

import pytest
from cantools.database.can import Message as DbcMessage

import dbc
from dbc import (
    announce_dbc_text,
    battery_dbc_text,
    change_dbc_text,
    device_dbc_text,
    fleet_dbc_text,
    seal_dbc_text,
    system_dbc_text,
    systems,
)
from onboard.contract import constants
from onboard.contract.base import OutOfRangeError
from onboard.contract.codes import Reason
from onboard.contract.generate.model import ContractError, read_contract
from onboard.contract.generate.modules import contracts, generated
from onboard.core.frame import Frame
from onboard.wire.codec import codecs
from onboard.wire.dbc_file import SignalLayout, read_annotations, read_layouts
from tests.wire.samples import CODES, judge_of, message_of, random_value, signal_values

FOLDER = Path(__file__).parents[2] / "onboard" / "contract"
TEXTS = {"fleet": fleet_dbc_text(), "device": device_dbc_text(), "seal": seal_dbc_text()}
TEXTS |= {"battery": battery_dbc_text(), "change": change_dbc_text(), "announce": announce_dbc_text()}
OF_ALL = tuple(TEXTS)
TEXTS |= {name: text for name in systems() if (text := system_dbc_text(name)) is not None}
LAYOUTS = {(file, layout.name): layout for file, text in TEXTS.items() for layout in read_layouts(text)}
JUDGES = {file: judge_of(text) for file, text in TEXTS.items()}
#: Frames drawn at random for all messages together.
FRAMES = 100_000
#: What is written by hand.
BY_HAND = {"__init__.py", "base.py", "assignments.py", "constants.py", "runs.py", "packing/__init__.py"}


def test_what_is_generated_is_current_and_nothing_else_is_there() -> None:
    files = generated(contracts())
    stale = [name for name, text in files.items() if (FOLDER / name).read_text(encoding="utf-8") != text]
    assert not stale, "run: make docs"
    found = {path.relative_to(FOLDER).as_posix() for path in FOLDER.rglob("*.py")}
    assert {name for name in found if not name.startswith("generate/")} == {*files, *BY_HAND}


def test_every_dbc_file_has_its_functions() -> None:
    assert {path.stem.replace("_", "-") for path in Path(dbc.__file__).parent.glob("*.dbc")} == set(TEXTS)
    assert {name for _, name in LAYOUTS} == set(CODES)


@pytest.mark.parametrize("file", list(TEXTS))
def test_every_signal_has_range_comment_receivers_and_unit_and_every_message_senders(file: str) -> None:
    for message in JUDGES[file].messages:
        assert isinstance(message, DbcMessage)
        assert message.is_extended_frame and message.length == 8 and message.comment and message.senders
        for signal in message.signals:
            where = f"{message.name}.{signal.name}"
            assert signal.comment and signal.receivers, where
            assert signal.minimum is not None and signal.maximum is not None, where
            assert signal.byte_order == "little_endian", where
            assert (signal.unit or "") == _unit_in(signal.name), where


def _unit_in(name: str) -> str:
    """Units come last in a name."""
    endings = {
        "_mm_s": "mm/s", "_us": "us", "_ms": "ms", "_s": "s", "_mm": "mm", "_um": "um", "_kg": "kg", "_ct": "ct",
    }  # fmt: skip
    return next((unit for ending, unit in endings.items() if name.endswith(ending)), "")


@pytest.mark.parametrize("system", [file for file in TEXTS if file not in OF_ALL])
def test_no_two_messages_of_a_site_have_one_identifier(system: str) -> None:
    found = [layout.frame_id for (file, _), layout in LAYOUTS.items() if file in (*OF_ALL, system)]
    assert all(identifier & 0xFFFF == 0 for identifier in found)
    assert len(set(found)) == len(found), "fleet and device bus may share one wire"


@pytest.mark.parametrize(("file", "name"), list(LAYOUTS))
def test_any_frame_is_read_and_written_as_by_cantools(file: str, name: str) -> None:
    layout, code, judge = LAYOUTS[file, name], CODES[name], JUDGES[file].get_message_by_name(name)
    chance = random.Random(name)
    read = 0
    for number in range(FRAMES // len(LAYOUTS) + 1):
        drawn = {signal.name: random_value(signal, chance) for signal in layout.signals}
        # Every other frame holds what the contract allows: of any bytes some messages take hardly one.
        data = bytes(judge.encode(drawn, padding=False)) if number % 2 else chance.randbytes(8)
        message = code.unpack(7, data)
        decoded = judge.decode(data, decode_choices=False)
        assert isinstance(decoded, dict)
        values = {key: value for key, value in decoded.items() if isinstance(value, int)}
        if message is None:
            assert any(not _holds(signal, values[signal.name]) for signal in layout.signals), data.hex()
            continue
        assert signal_values(message) == values and message.sender == 7
        assert code.pack(message) == judge.encode(values, padding=False), data.hex()
        read += 1
    assert read >= FRAMES // len(LAYOUTS) // 2


def _holds(signal: SignalLayout, value: int) -> bool:
    return signal.minimum <= value <= signal.maximum


@pytest.mark.parametrize(("file", "name"), list(LAYOUTS))
def test_a_value_beyond_either_end_names_its_signal(file: str, name: str) -> None:
    """What has a value table is an enumeration in the code, and a type checker's business."""
    layout = LAYOUTS[file, name]
    inside = {signal.name: signal.minimum for signal in layout.signals}
    for signal in layout.signals:
        for value in (signal.minimum - 1, signal.maximum + 1):
            if not signal.choices:
                with pytest.raises(OutOfRangeError, match=rf"^{name}\.{signal.name} = {value}: outside"):
                    CODES[name].pack(message_of(name, 7, {**inside, signal.name: value}))


def test_whatever_comes_from_the_wire_nothing_raises() -> None:
    chance = random.Random(3)
    every = codecs(tuple(CODES.values()))
    identifiers = [code.identifier for code in CODES.values()]
    for _ in range(20_000):
        identifier = chance.choice(identifiers) | chance.randrange(256)
        if chance.random() < 0.2:
            identifier ^= 1 << chance.randrange(29)
        frame = Frame(identifier, chance.randbytes(chance.choice((0, 3, 7, 8, 8, 8))))
        for codec in every:
            found = codec.decode_part(frame)
            if isinstance(found, Reason):
                assert found in (Reason.UNKNOWN_IDENTIFIER, Reason.SHORT_FRAME, Reason.VALUE_OUT_OF_RANGE)
            else:
                assert found.sender == identifier & 0xFF


def test_what_is_written_by_hand_is_what_the_dbc_says() -> None:
    bits = {name: {signal.name: signal.bits for signal in layout.signals} for (_, name), layout in LAYOUTS.items()}
    assert bits["Award"]["task_version"] == constants.TASK_VERSION_BITS
    assert bits["TokenRequest"]["version_seen"] == bits["TokenRefusal"]["version"] == constants.SEEN_VERSION_BITS


TINY = """VERSION ""
BU_: R Controller
VAL_TABLE_ Colour 1 "RED" 0 "GREEN" ;
BO_ 2147549184 Lamp: 8 R
 SG_ colour : 0|4@1+ (1,0) [0|1] "" R
CM_ BO_ 2147549184 "A lamp says its colour.";
CM_ SG_ 2147549184 colour "Its colour.";
BA_DEF_ SG_  "TableComment" STRING ;
BA_DEF_  "ContractVersion" INT 1 255;
BA_DEF_DEF_  "TableComment" "";
BA_DEF_DEF_  "ContractVersion" 1;
BA_ "ContractVersion" 1;
BA_ "TableComment" SG_ 2147549184 colour "Colours.";
VAL_ 2147549184 colour 1 "RED" 0 "GREEN" ;
"""


@pytest.mark.parametrize(
    ("line", "instead", "told"),
    [
        ('VAL_ 2147549184 colour 1 "RED"', 'VAL_ 2147549184 colour 1 "BLUE"', "Lamp.colour: no VAL_TABLE_ has these"),
        ('1 "RED"', '2 "RED"', "Lamp.colour: values must count from 0 without a gap"),
        ("[0|1]", "[0|3]", "Lamp.colour: its range must be that of its values, 0 to 1"),
        (r'BA_ "TableComment".*\n', "", "value table Colour: no signal that has it has a TableComment"),
    ],
)
def test_a_dbc_that_is_not_fit_for_code_is_refused_with_its_place(line: str, instead: str, told: str) -> None:
    assert read_contract("tiny", TINY, "tiny", ()).frames[0].fields[0].kind == "Colour"
    text = re.sub(line if line.endswith("\\n") else re.escape(line), instead, TINY)
    with pytest.raises(ContractError, match=re.escape(told)):
        read_contract("tiny", text, "tiny", ())


def test_annotations_keep_the_order_of_the_file() -> None:
    order = read_annotations(TEXTS["device"]).order["ShuttleState"]
    assert order == ("sequence", "mode", "extension_mm", "side", "load_kg", "wheelbase_mm")


def test_a_table_that_two_systems_name_alike_is_one_and_must_be_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    tables = [one for contract in contracts() for one in contract.tables if one.name == "OrderResult"]
    assert len(tables) == 4 and {one.module for one in tables} == {"codes"}
    texts = {name: system_dbc_text(name) or "" for name in systems()}
    texts["cell"] = texts["cell"].replace('2 "DONE" 1 "IN_HAND"', '2 "ENDED" 1 "IN_HAND"')
    monkeypatch.setattr("onboard.contract.generate.modules.system_dbc_text", texts.get)
    with pytest.raises(ContractError, match=re.escape("value table OrderResult is another than that of cell.dbc")):
        contracts()


def test_words_that_are_kept_for_later_are_free_and_fit_a_frame() -> None:
    """``docs/protocol.md`` promises identifiers that nothing else takes, to words of at most 64 bits."""
    page = (FOLDER.parents[1] / "docs" / "protocol.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)` \| `([0-9A-F]{6})nn` \| [^|]+ \| ([^|]+) \|", page, re.MULTILINE)
    assert len(rows) == 3
    taken = {layout.frame_id >> 8 for layout in LAYOUTS.values()}
    assert not {name for name, _, _ in rows} & {name for _, name in LAYOUTS}
    assert len({number for _, number, _ in rows}) == len(rows)
    for name, number, fields in rows:
        assert int(number, 16) not in taken, name
        assert sum(int(width) for width in re.findall(r" (\d+)\b", fields)) <= 64, name
