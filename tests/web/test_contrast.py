"""Colours of the page: shapes at least 3:1 and text 4.5:1 on what they are drawn on (WCAG 2.2, 1.4.11 and 1.4.3)."""

import re
from pathlib import Path

import pytest

import onboard.web
from onboard.trace.chart.svg import COLOURS, SvgDrawing

PAGE = Path(onboard.web.__file__).parent / "page"
#: On these grounds everything is drawn: cards, the page itself, ways and floors.
GROUNDS = ("card", "back", "free", "ground")
#: Edges, marks and bodies; and what is written in a colour of its own.
SHAPES = ("line", "car", "robot", "lift", "bay", "plan", "hold", "wait", "good", "bad", "dim", "ink")
TEXTS = ("ink", "dim", "good", "bad", "bay")
#: Names are written on bodies in the colour of cards.
BODIES = ("car", "robot")
#: What only fills a shape that has an edge.
FILLS = {*GROUNDS}


def themes() -> list[dict[str, str]]:
    """Colours of the light and of the dark theme."""
    light, dark = re.findall(r":root \{(.*?)\}", (PAGE / "page.css").read_text(encoding="utf-8"), re.DOTALL)
    found = [dict(re.findall(r"--(\w+): (#[0-9a-f]{6});", block)) for block in (light, dark)]
    assert found[0].keys() == found[1].keys()
    return found


def contrast(one: str, other: str) -> float:
    """The ratio of WCAG 2.2 of two colours, 1 to 21."""
    brighter, darker = sorted((luminance(one), luminance(other)), reverse=True)
    return (brighter + 0.05) / (darker + 0.05)


def luminance(colour: str) -> float:
    parts = [int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5)]
    red, green, blue = (part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


@pytest.mark.parametrize("theme", themes(), ids=["light", "dark"])
def test_shapes_and_text_stand_out_from_every_ground(theme: dict[str, str]) -> None:
    assert contrast("#ffffff", "#000000") == pytest.approx(21)
    pairs = {(shape, ground): 3.0 for shape in SHAPES for ground in GROUNDS}
    pairs |= {(text, ground): 4.5 for text in TEXTS for ground in GROUNDS}
    pairs |= {("card", body): 4.5 for body in BODIES}
    weak = {
        pair: round(contrast(theme[pair[0]], theme[pair[1]]), 2)
        for pair, least in pairs.items()
        if contrast(theme[pair[0]], theme[pair[1]]) < least
    }
    assert weak == {}


def test_every_colour_that_is_drawn_is_one_that_is_judged() -> None:
    used = {
        name
        for file in ("draw.js", "building.js", "plan.js", "paint.js", "page.css")
        for name in re.findall(r"--(\w+)", (PAGE / file).read_text(encoding="utf-8"))
    }
    assert used <= {*SHAPES, *TEXTS, *FILLS}


@pytest.mark.parametrize("number", range(len(COLOURS)))
def test_the_line_of_each_machine_in_a_chart_stands_out_from_its_panel(number: int) -> None:
    """By itself, or by a rim of the same dashes below it; the rim stands out from the line, too."""
    drawing = SvgDrawing(100, 100, "chart")
    drawing.way([(0, 0), (90, 90)], number + len(COLOURS), width=2)
    lines = re.findall(r'stroke="(#\w+)" stroke-width="([\d.]+)" stroke-dasharray="6 3"', str(drawing))
    assert max(contrast(stroke, "#f3f3f3") for stroke, _ in lines) >= 3
    assert [stroke for stroke, _ in lines][-1] == COLOURS[number]
    assert [float(width) for _, width in lines] == sorted((float(width) for _, width in lines), reverse=True)
    assert len(lines) == 1 or contrast(lines[0][0], COLOURS[number]) >= 2.5
