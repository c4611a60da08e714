"""The drawn files of the small warehouse: as those that ship, and usable as they are."""

from pathlib import Path

import pytest

import bus_sim
from bus_sim.systems.mapd.importers.draft import site_text
from bus_sim.systems.mapd.importers.mapf import DrawnDemand, import_map
from bus_sim.systems.mapd.warehouse import RATES, ROBOTS, great_floor, map_text, task_text
from onboard.config.site import parse_site
from onboard.systems.mapd.site import Mapd

DATA = Path(bus_sim.__file__).parent / "data" / "mapd"


def words(text: str) -> list[list[str]]:
    return [line.split() for line in text.splitlines()]


def test_what_ships_is_drawn_as_it_ships() -> None:
    for robots in (10, 30):
        assert words(map_text(robots)) == words((DATA / f"kiva-{robots}-500-5.map").read_text())
    for rate in ("0.5", "2", "10"):
        assert words(task_text(rate)) == words((DATA / f"kiva-{rate}.task").read_text())


@pytest.mark.parametrize("robots", [20, 50])
def test_a_drawn_map_is_one_that_a_site_can_be_made_of(robots: int) -> None:
    tasks = (Path("drawn.task"), task_text("0.2", seed=7, count=9))
    draft = import_map(Path("drawn.map"), map_text(robots), tasks, DrawnDemand())
    site = parse_site(site_text(draft), "drawn.toml")
    assert isinstance(site, Mapd)
    assert (len(site.homes), len(site.endpoints), len(site.tasks)) == (robots, 302, 9)
    assert set(site.homes.values()) <= site.rests, "no home shuts others in"
    assert [task.release for task in site.tasks] == list(range(0, 45, 5))


def test_every_rate_has_the_same_pairs_and_another_seed_others() -> None:
    assert len(ROBOTS) * len(RATES) == 35
    pairs = {rate: [line[1:] for line in words(task_text(rate))] for rate in RATES}
    assert all(one == pairs["0.5"] for one in pairs.values())
    assert [line[1:] for line in words(task_text("0.5", seed=1))] != pairs["0.5"]
    assert {line[0] for line in words(task_text("500"))} == {"0"}


def test_what_cannot_be_drawn_is_said() -> None:
    with pytest.raises(ValueError, match="no room for 400 robots"):
        map_text(400)
    with pytest.raises(ValueError, match="write a number above 0"):
        task_text("0")


def test_the_great_floor_is_a_site_in_which_all_homes_can_be_taken_for_ever() -> None:
    site = parse_site(site_text(great_floor(120, 30)), "great")
    assert isinstance(site, Mapd)
    assert len(site.robots) == 120 and len(site.tasks) == 30 and set(site.homes.values()) <= site.rests
    assert site_text(great_floor(3, 5)) == site_text(great_floor(3, 5)) != site_text(great_floor(3, 5, seed=2))
    with pytest.raises(ValueError, match="121 robots: there are 120 homes"):
        great_floor(121, 1)
