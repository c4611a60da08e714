"""Every decision says what would show it wrong, every part of the document is in its index, and lines stay readable."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

DOCUMENT = Path(__file__).parents[2] / "docs" / "decisions.md"
#: Longest line of prose; tables and code are as wide as they must be.
MOST_COLUMNS = 160
#: Bold words that begin a part of an entry and no entry.
PARTS = frozenset({"Checkers", "Choice", "Context", "Found on the way", "Left open", "Left out", "Limit", "Limits"}) | {
    "Measured",
    "Refused",
    "Wrong if",
}
_BOLD = re.compile(r"(?:- )?\*\*(?P<words>.+?)\*\*")
_SHOWN_WRONG = re.compile(r"wrong\s+if\b", re.IGNORECASE)


class Entry(NamedTuple):
    """One decision: its line, its heading or first bold words, and its text."""

    line: int
    title: str
    text: str


def anchor(heading: str) -> str:
    """What a link to a heading is called: lower case, hyphens for blanks, no other signs."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def entries(text: str) -> Iterator[Entry]:
    """Below each ``##``: what stands under a ``###``, else each paragraph or bullet that begins in bold."""
    found: list[tuple[int, str, list[str]]] = []
    is_inside = is_headed = False
    for number, line in enumerate(text.splitlines(), start=1):
        bold = _BOLD.match(line)
        if line.startswith("## "):
            is_inside, is_headed = False, False
        elif line.startswith("### "):
            is_inside = is_headed = True
            found.append((number, line[4:], []))
        elif bold is not None and not is_headed and begins_entry(bold["words"]):
            is_inside = True
            found.append((number, bold["words"], []))
        if is_inside:
            found[-1][2].append(line)
    return (Entry(number, title, " ".join(lines)) for number, title, lines in found)


def begins_entry(words: str) -> bool:
    """Whether bold words begin an entry of their own."""
    return words.rstrip(".:") not in PARTS


def sections(text: str) -> list[str]:
    """All headings of parts but the index."""
    return [one for one in re.findall(r"^## (.+)$", text, re.MULTILINE) if one != "Index"]


def test_every_decision_says_what_would_show_it_wrong() -> None:
    text = DOCUMENT.read_text(encoding="utf-8").split("## Index", 1)[1]
    without = [one.title for one in entries(text) if not _SHOWN_WRONG.search(one.text)]
    assert not without, 'add "Wrong if ...", what one would see, in docs/decisions.md to:\n' + "\n".join(without)


def test_no_decision_stands_twice() -> None:
    titles = [one.title for one in entries(DOCUMENT.read_text(encoding="utf-8").split("## Index", 1)[1])]
    twice = sorted({one for one in titles if titles.count(one) > 1})
    assert not twice, "docs/decisions.md has two entries of one name, or one twice:\n" + "\n".join(twice)


def test_the_index_names_every_part_in_order() -> None:
    text = DOCUMENT.read_text(encoding="utf-8")
    listed = re.findall(r"^- \[(.+)\]\(#(.+)\): \S", text, re.MULTILINE)
    wanted = [(heading, anchor(heading)) for heading in sections(text)]
    missing = [f"- [{heading}](#{link}): ..." for heading, link in wanted if (heading, link) not in listed]
    assert not missing, "add to the index of docs/decisions.md, with a line of what is in it:\n" + "\n".join(missing)
    assert listed == wanted, "the index of docs/decisions.md has another order, or parts that are no more"


def test_lines_can_be_read() -> None:
    lines = DOCUMENT.read_text(encoding="utf-8").splitlines()
    long = [n for n, line in enumerate(lines, start=1) if len(line) > MOST_COLUMNS and not line.startswith(("|", "#"))]
    assert not long, f"docs/decisions.md: break these lines at {MOST_COLUMNS} columns: {long}"


def test_no_reason_lies_where_a_reader_cannot_look() -> None:
    text = DOCUMENT.read_text(encoding="utf-8")
    closed = [match[0] for match in re.finditer(r"issue \d+|not (?:yet )?built(?: yet)?\b", text)]
    assert not closed, f"docs/decisions.md speaks of {closed}: give the reason itself, or what is so now"


def test_an_entry_without_a_sign_is_found() -> None:
    text = (
        "## Part\n\n### One\n**Choice.** This.\n**Wrong if** that.\n\n### Two\n**Choice.** This.\n\n"
        "## Other\n\n**Three.** This. Wrong\nif that.\n\n- **Four.** This.\n"
    )
    assert [one.title for one in entries(text)] == ["One", "Two", "Three.", "Four."]
    assert [one.title for one in entries(text) if not _SHOWN_WRONG.search(one.text)] == ["Two", "Four."]
