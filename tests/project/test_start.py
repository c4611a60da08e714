"""docs/start.md leads to files and names that exist."""

import re

from tests.project.test_layers import ROOT

PAGE = (ROOT / "docs" / "start.md").read_text(encoding="utf-8")


def test_every_file_of_the_way_exists() -> None:
    named = re.findall(r"`([a-z_]+(?:/[a-z_]+)*/?(?:\.\w+)?)`", PAGE.replace("`README.md`", ""))
    paths = [name for name in named if "/" in name]
    assert len(paths) > 12
    assert [path for path in paths if not (ROOT / path).exists()] == []


def test_what_is_to_be_looked_for_in_a_file_is_there() -> None:
    rows = [line for line in PAGE.splitlines() if line.startswith("|") and ": `" in line]
    wanted = [
        (file, name)
        for line in rows
        for file, names in re.findall(r"`([\w/]+\.\w+)`: ((?:`\w+`(?:, )?)+)", line)
        for name in re.findall(r"\w+", names)
    ]
    assert len(wanted) >= 9
    missing = [(file, name) for file, name in wanted if name not in (ROOT / file).read_text(encoding="utf-8")]
    assert missing == []


def test_glossary_words_stand_in_order_and_once() -> None:
    page = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
    words = [line.split("|")[1].strip() for line in page.splitlines() if line.startswith("| ")][1:]
    assert words == sorted(set(words), key=str.lower), "one word, one line"
