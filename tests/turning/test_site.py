"""The turning cell's site file: every mistake is one line with place, value and remedy."""

from pathlib import Path

import pytest

import bus_sim.sites
from bus_sim.sites import find_site
from onboard.config.problems import ConfigError
from onboard.config.site import parse_site
from onboard.systems.turning.drawing import Shape
from onboard.systems.turning.lathe import LatheOperation
from onboard.systems.turning.site import Turning

TEXT = (Path(bus_sim.sites.__file__).parent / "turning.toml").read_text(encoding="utf-8")


def test_the_shipped_cell_is_read() -> None:
    site = find_site("turning")
    assert isinstance(site, Turning)
    assert sorted(site.lathes) == [1, 2, 3] and site.desks == (9,)
    lathe = site.lathes[1]
    assert (lathe.hourly_eur, lathe.has_tailstock, lathe.tools[0].works) == (
        85.0,
        True,
        (LatheOperation.FACE, LatheOperation.ROUGH),
    )
    shapes = [element.shape for element in site.drawings[2].elements]
    assert shapes == [
        *(Shape.FACE, Shape.ARC, Shape.CYLINDER, Shape.ARC, Shape.FACE, Shape.TAPER, Shape.CYLINDER),
    ]
    assert site.orders[3].at_ms == 60_000 and site.orders[3].job.batch == 5


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ("hourly_eur = 85", "hourly_eur = -1", "lathes[0].hourly_eur = -1.0: out of range; write a number from 0.01"),
        ("hourly_eur = 85\n", "", "lathes[0].hourly_eur: missing"),
        ('"facing", "roughing"', '"milling"', "lathes[0].tools[0].works[0]"),
        ("min_mm = 30", "min_mm = 300", "lathes[0].chucks[0].min_mm = 300.0: above max_mm 250"),
        ("number = 2\nworks", "number = 1\nworks", "lathes[0].tools: two tools with one number"),
        ("[1, 12], [30, 12]", "[1, 12], [30, 11]", "an undercut; let depth and diameter only grow"),
        ("[2, 20, 2]", "[2, 20, 1]", "an arc that does not reach from start to end"),
        ("[0, 0], [0, 10]", "[1, 0], [0, 10]", "drawings[0].contour_mm"),
        (
            "drawing = 3\nmaterial",
            "drawing = 7\nmaterial",
            "orders[2].drawing = 7: no drawing of this number; known here: 1, 2, 3",
        ),
        ("bar_mm = 190", "bar_mm = 100", "orders[2].bar_mm = 100: thinner than the drawing; write 180 or more"),
        ("[[desks]]", "[[counters]]", "desks: no desk"),
        ("power_kw = 22", 'power_kw = "22"', "lathes[0].power_kw"),
    ],
)
def test_a_mistake_is_one_line(old: str, new: str, line: str) -> None:
    assert old in TEXT
    with pytest.raises(ConfigError) as caught:
        parse_site(TEXT.replace(old, new, 1), "turning.toml")
    assert line in str(caught.value)
    assert all(";" in one for one in str(caught.value).splitlines())
