"""The parts of docs/protocol.md that are made from the code, each between two marks; all else is written by hand."""

import re
from collections.abc import Mapping
from pathlib import Path

from tests.project.rows import ROOT
from tests.protocol import charts, examples, times

PAGE = ROOT / "docs" / "protocol.md"
#: A part of a kind and name; a blank line goes before and behind what is in it.
PART = re.compile(
    r"<!-- (?P<kind>chart|times|example|made) (?P<name>[a-z-]+) -->\n(?P<text>.*?)<!-- end -->", re.DOTALL
)


def parts(text: str) -> dict[tuple[str, str], str]:
    """What stands in each part of a page."""
    return {(one["kind"], one["name"]): one["text"].strip("\n") for one in PART.finditer(text)}


def of_code() -> dict[tuple[str, str], str]:
    """All parts that need no run."""
    return {
        **{("chart", name): charts.drawn(chart) for name, chart in charts.charts().items()},
        **{("times", name): times.drawn(rows) for name, rows in times.TIMES.items()},
        **{("made", name): examples.drawn(map(examples.made, wanted)) for name, wanted in examples.MADE.items()},
    }


def written(text: str, made: Mapping[tuple[str, str], str]) -> str:
    """A page with these parts in their places; a part that is not made anew stays."""

    def part(one: re.Match[str]) -> str:
        key = one["kind"], one["name"]
        return f"<!-- {key[0]} {key[1]} -->\n\n{made.get(key, one['text'].strip(chr(10)))}\n\n<!-- end -->"

    return PART.sub(part, text)


def write(log: Path | None = None) -> None:
    """Write the page anew; its examples too, where the log of their run is given."""
    runs = {} if log is None else {("example", name): text for name, text in examples.blocks(log).items()}
    PAGE.write_text(written(PAGE.read_text(encoding="utf-8"), {**of_code(), **runs}), encoding="utf-8")
