"""The cell's site file: every mistake is one line with place, value and remedy."""

import pytest

from bus_sim.sites import find_site
from onboard.config.problems import ConfigError
from onboard.config.site import parse_site
from onboard.systems.cell.site import Area, Cell, Point

GOOD = """
[site]
system = "cell"
name = "test"
[[desks]]
name = "GM"
node = 9
[[robots]]
name = "R1"
node = 1
area_mm = [0, 0, 10000, 10000]
home_mm = [1000, 1000]
unit_cost = 1.5
[[goals]]
from_mm = [2000, 2000]
to_mm = [8000, 8000]
within_s = 60
[[obstacles]]
name = "MT1"
area_mm = [4000, 4000, 5000, 5000]
"""


def test_a_cell_is_read() -> None:
    site = parse_site(GOOD, "cell.toml")
    assert isinstance(site, Cell)
    arm = site.arms[1]
    assert (arm.area, arm.home, arm.unit_cost, arm.speed_mm_s) == (
        *(Area(0, 0, 10_000, 10_000), Point(1000, 1000), 1.5, 1000),
    )
    assert site.obstacles == (Area(4000, 4000, 5000, 5000),) and site.goals[0].within_ms == 60_000
    shipped = find_site("cell")
    assert isinstance(shipped, Cell) and len(shipped.arms) == 5 and shipped.digest != site.digest


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        (
            "[0, 0, 10000, 10000]",
            "[0, 0, 0, 10000]",
            "cell.toml:11: robots[0].area_mm = [0, 0, 0, 10000]: not a rectangle",
        ),
        ("[1000, 1000]", "[1000, 11000]", "cell.toml:12: robots[0].home_mm = [1000, 11000]: outside area_mm"),
        ("home_mm = [1000, 1000]", "", "robots[0].home_mm: missing"),
        ("[1000, 1000]", "[4500, 4500]", "home_mm = [4500, 4500]: inside an obstacle"),
        ("1.5", "0", "cell.toml:13: robots[0].unit_cost = 0.0: out of range"),
        ("[8000, 8000]", "[2000, 2000]", "goals[0].to_mm = [2000, 2000]: where the part lies already"),
        ("[8000, 8000]", "[18000, 8000]", "goals[0].to_mm = [18000, 8000]: in no robot's area"),
        ("[8000, 8000]", "[8000, 8000, 1]", "goals[0].to_mm = [8000, 8000, 1]: not a place"),
        ("= 60", "= 65", "cell.toml:17: goals[0].within_s = 65: not in steps of 10 s"),
        ("node = 9", "node = 1", "node-ID of"),
        ('name = "MT1"', 'name = "MT1"\ncolour = "red"', "obstacles[0].colour: unknown key"),
        ("[[desks]]", "[[managers]]", "desks: no goal manager"),
    ],
)
def test_a_mistake_is_one_line(old: str, new: str, line: str) -> None:
    with pytest.raises(ConfigError) as caught:
        parse_site(GOOD.replace(old, new, 1), "cell.toml")
    assert line in str(caught.value)
    assert all(";" in one for one in str(caught.value).splitlines())
