"""Which site file may follow another while the site works: one with more machines, and nothing else."""

import pytest

from bus_sim.sites import find_site, site_text
from onboard.config.problems import ConfigError
from onboard.config.site import parse_site
from onboard.config.site_change import added_machines
from onboard.core.site import Site

#: The last machine of each, in the words of its file.
LAST = {
    "standard": '[[robots]]\nname = "MR1"\nnode = 11\nhome = "p(2,2)"\n',
    "terminal": '[[vehicles]]\nname = "R4"\nnode = 14\nhome = "A4"\n',
}


def changed(name: str, old: str, new: str) -> Site:
    text = site_text(name)
    assert text.count(old) == 1
    return parse_site(text.replace(old, new), f"{name}.toml")


@pytest.mark.parametrize(("name", "node"), [("standard", 11), ("terminal", 14)])
def test_a_machine_may_be_added(name: str, node: int) -> None:
    without = changed(name, LAST[name], "")
    assert added_machines(without, find_site(name), "new.toml") == (node,)


def problems(old: Site, new: Site) -> str:
    with pytest.raises(ConfigError) as refused:
        added_machines(old, new, "new.toml")
    return str(refused.value)


def test_none_may_be_left_out() -> None:
    error = problems(find_site("standard"), changed("standard", LAST["standard"], ""))
    assert (
        "new.toml: machines[11]: left out; while a site works machines may be added to its file and nothing else"
        in error
    )


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("positions = 10", "positions = 11", "tracks[1].length: 10 before, 11 here"),
        ('3 = "ER2"', "", "stewards[3]: 6 before, 5 here"),
        ("bitrate = 500_000", "bitrate = 250_000", "bitrate: 500000 before, 250000 here"),
        ('home = "p(3,8)"', 'home = "p(3,9)"', "machines[12].home: p(3,8) before, p(3,9) here"),
    ],
)
def test_all_else_stays_as_it_is(old: str, new: str, told: str) -> None:
    assert told in problems(find_site("small"), changed("small", old, new))


def test_the_same_site_follows_nothing() -> None:
    error = problems(find_site("small"), changed("small", 'time_zone = "America/Los_Angeles"', ""))
    assert error == "new.toml: no machine is added; name the site file that is to come"
