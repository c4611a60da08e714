"""Which site file may follow another while the site works: a cell with more robots, and nothing else."""

from pathlib import Path

import pytest

from bus_sim.sites import find_site, site_text
from onboard.config.problems import ConfigError
from onboard.config.site import parse_site
from onboard.config.site_change import added_machines
from onboard.core.site import Site

CELL = site_text("cell")
R6 = '\n[[robots]]\nname = "R6"\nnode = 6\narea_mm = [30000, 20000, 48000, 36000]\nhome_mm = [46000, 34000]\n'


def cell(old: str = "", new: str = "", more: str = R6) -> Site:
    """The shipped cell with more at its end, and one thing in it otherwise."""
    assert CELL.count(old) >= 1
    return parse_site(CELL.replace(old, new, 1) + more, "cell.toml")


def problems(old: Site, new: Site) -> str:
    with pytest.raises(ConfigError) as refused:
        added_machines(old, new, "new.toml")
    return str(refused.value)


def test_a_robot_may_be_added() -> None:
    assert added_machines(find_site("cell"), cell(), "new.toml") == (6,)


def test_none_may_be_left_out() -> None:
    error = problems(cell(), find_site("cell"))
    assert "new.toml: machines[6]: left out; while a site works machines may be added to its file and nothing" in error
    assert "arms[6]: left out" in error


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("home_mm = [20000, 34000]", "home_mm = [21000, 34000]", "arms[5]: "),
        (
            'name = "MT1"',
            'name = "MT1"\narea_mm = [31000, 21000, 31500, 21500]\n[[obstacles]]\nname = "MT2"',
            "obstacles: ",
        ),
    ],
)
def test_all_else_stays_as_it_is(old: str, new: str, told: str) -> None:
    assert told in problems(find_site("cell"), cell(old, new))


def test_the_same_site_follows_nothing() -> None:
    error = problems(find_site("cell"), find_site("cell"))
    assert error == "new.toml: no machine is added; name the site file that is to come"


@pytest.mark.parametrize("name", ["standard", "terminal", "graph", "turning"])
def test_rights_that_begin_by_the_file_would_have_two_holders(name: str, tmp_path: Path) -> None:
    """A new robot's home is its own by the new file and its steward's by the old one."""
    assert "new.toml: rights of a site of system" in problems(find_site(name), find_site(name))
