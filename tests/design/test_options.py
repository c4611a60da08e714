"""Sites of other sizes, made of a shipped one."""

import tomllib

import pytest

from bus_sim.demand import DemandError
from bus_sim.sites import find_site, layout_names, site_names, site_text
from bus_sim.systems.car_park.design.options import Size, SizeError, option_of, parse_range, size_of
from bus_sim.systems.car_park.design.toml_text import toml_text
from onboard.config.site import parse_site
from onboard.systems.car_park.site import CarPark


@pytest.mark.parametrize("name", [*site_names(), *layout_names()])
def test_a_site_file_says_the_same_when_its_values_are_written_again(name: str) -> None:
    values = tomllib.loads(site_text(name))
    assert tomllib.loads(toml_text(values)) == values


def test_what_needs_quotes_gets_them() -> None:
    values = {"a key": 'say "\\"', "on": True, "list": ["x\ny", 3], "in": {"of.it": {"n": -1}}, "rows": [{"a": 1}, {}]}
    assert tomllib.loads(toml_text(values)) == values


@pytest.mark.parametrize(
    ("name", "size"),
    [
        ("small", Size(1, 1, 1)),
        ("small", Size(5, 3, 3)),
        ("standard", Size(2, 1, 4)),
        ("ring", Size(4, 3, 4)),
        ("twin", Size(3, 1, 3)),
        ("inline", Size(1, 2, 3)),
        ("level1", Size(2, 0, 2)),
    ],
)
def test_a_site_of_the_size_that_was_asked_for(name: str, size: Size) -> None:
    option = option_of(site_text(name), f"{name}.toml", size)
    site = parse_site(option.text, "option.toml")
    assert isinstance(site, CarPark)
    assert size_of(site) == size == size_of(option.site)
    homes = [one.home for one in site.machines.values() if one.name.startswith("MR")]
    assert len(set(homes)) == size.robots


def test_what_the_template_has_stays_where_it_is() -> None:
    template, site = site_text("standard"), find_site("standard")
    assert option_of(template, "standard.toml", Size(4, 2, 3)).text == template, "its own size: the file itself"
    larger = option_of(template, "standard.toml", Size(5, 2, 4)).site
    kept = {one.name: (one.node_id, one.home) for one in larger.machines.values()}
    assert {one.name: (one.node_id, one.home) for one in site.machines.values()}.items() <= kept.items()


def test_more_robots_than_refuges_get_spurs() -> None:
    option = option_of(site_text("standard"), "standard.toml", Size(7, 2, 3))
    assert len(option.site.spurs) == 3, "five refuges there were"
    assert len(option.site.places) == 191 - 2, "each in the stead of a place"


def test_entries_and_exits_come_by_turns() -> None:
    uses = [use.value for use in option_of(site_text("twin"), "twin.toml", Size(2, 2, 4)).site.bay_uses.values()]
    assert sorted(uses) == ["entry", "entry", "exit", "exit"]


@pytest.mark.parametrize(
    ("name", "size", "why"),
    [
        ("twin", Size(2, 2, 1), "none for exit"),
        ("small", Size(2, 2, 40), "no room for a compartment beside"),
        ("level1", Size(1, 1, 1), "no room for a lift"),
        ("small", Size(90, 2, 1), "no room for another spur"),
        ("small", Size(1, 0, 1), "no way from floor 1 to floor 2"),
    ],
)
def test_a_size_that_cannot_be_built_is_told_why(name: str, size: Size, why: str) -> None:
    with pytest.raises(SizeError, match=why):
        option_of(site_text(name), f"{name}.toml", size)


def test_ranges() -> None:
    assert parse_range("--robots", "2-4", 1, 9) == range(2, 5)
    assert parse_range("--robots", "3", 1, 9) == range(3, 4)
    for text in ("0-3", "4-2", "a", "1-99", "-2", "1-"):
        with pytest.raises(DemandError, match="--robots"):
            parse_range("--robots", text, 1, 9)
