"""docs/protocol.md says what the code does: charts, times, examples, and duties that can be cited."""

import re
import zlib

import pytest

from onboard.core.frame import Frame
from onboard.wire.codec import fleet_codec
from tests.project.rows import ROOT
from tests.protocol import page
from tests.protocol.examples import EXAMPLES, LINE, MADE, contract, lines_of, said, told
from tests.protocol.times import TIMES

TEXT = page.PAGE.read_text(encoding="utf-8")
PARTS = page.parts(TEXT)
DUTY = re.compile(r"\[([A-Z])(\d+)\](?!\()")
#: Below a frame what it says.
SAID = re.compile(r"^(\(.+)\n    (.+)$", re.MULTILINE)


def test_charts_and_times_are_those_of_the_code() -> None:
    made = page.of_code()
    old = [key for key, text in made.items() if PARTS.get(key) != text]
    assert not old, f"docs/protocol.md is behind the code: run `make docs` (parts: {old})"
    examples = {("example", name) for name in EXAMPLES}
    assert set(PARTS) == {*made, *examples}, "each part of the page is made, and each that is made stands in it"


@pytest.mark.parametrize("name", [*EXAMPLES, *MADE])
def test_an_example_says_by_the_dbc_what_stands_below_it(name: str) -> None:
    text = PARTS["example" if name in EXAMPLES else "made", name]
    pairs = SAID.findall(text)
    assert len(pairs) == len(lines_of(text)) == len({**EXAMPLES, **MADE}[name])
    for line, words in pairs:
        found = told(line)
        assert found is not None and said(found) == words


@pytest.mark.parametrize("name", [*EXAMPLES, *MADE])
def test_the_shipped_codec_reads_and_writes_an_example_as_the_dbc_does(name: str) -> None:
    codec = fleet_codec()
    for line in lines_of(PARTS["example" if name in EXAMPLES else "made", name]):
        found = LINE.match(line)
        assert found is not None
        frame = Frame(int(found["id"], 16), bytes.fromhex(found["data"]))
        message = codec.decode_part(frame)
        assert type(message).__name__ == contract().get_message_by_frame_id(frame.arbitration_id & ~0xFF).name
        assert codec.encode(message)[0] == frame  # type: ignore[arg-type]  # a reason would have another name


def test_digest_and_contract_are_as_the_duties_tell() -> None:
    """J4 and chapter 16, word for word, give what the robot of the example says."""
    crc = 0xFFFF
    for bit in f"{11 << 8 | 1:032b}":
        crc = (crc << 1 & 0xFFFF) ^ (0x1021 if (crc >> 15) ^ int(bit) else 0)
    text = (ROOT / "dbc" / "fleet.dbc").read_text(encoding="utf-8")
    lines = [line for line in text.split("\n") if line.startswith(("BO_ ", " SG_ "))]
    beats = [one for line in lines_of(PARTS["example", "joining"]) if (one := told(line)) and one.name == "Heartbeat"]
    assert [one.signals["mirror_digest"] for one in beats] == [0xFFFF, crc]
    assert {one.signals["contract"] for one in beats} == {128 | zlib.crc32("\n".join(lines).encode()) & 0x7F}


def test_duties_are_numbered_one_by_one_and_those_that_are_cited_exist() -> None:
    at_begin = re.findall(r"^(?:- |\|.*\| )\[([A-Z])(\d+)\] ", TEXT, re.MULTILINE)
    numbers: dict[str, list[int]] = {}
    for letter, number in at_begin:
        numbers.setdefault(letter, []).append(int(number))
    for letter, of in numbers.items():
        assert of == list(range(1, len(of) + 1)), f"duties {letter}"
    known = {f"{letter}{number}" for letter, number in at_begin}
    cited = {f"{letter}{number}" for letter, number in DUTY.findall(TEXT)}
    assert cited == known
    assert len(known) >= 100


def test_each_time_is_in_a_table_and_in_a_duty() -> None:
    named = set(re.findall(r"`(T_[a-z_]+)`", page.PART.sub("", TEXT)))
    tables = {one.name for rows in TIMES.values() for one in rows if one.name.startswith("T_")}
    assert named == tables


def test_links_within_the_page_lead_somewhere() -> None:
    headings = re.findall(r"^## (.+)$", TEXT, re.MULTILINE)
    anchors = {re.sub(r"[^a-z0-9 -]", "", one.lower()).replace(" ", "-") for one in headings}
    assert set(re.findall(r"\]\(#([^)]+)\)", TEXT)) <= anchors
    files = re.findall(r"\]\(([^#)]+?)(?:#[^)]*)?\)", TEXT)
    assert not [file for file in files if not (page.PAGE.parent / file).exists()]
