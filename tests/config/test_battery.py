"""``[battery]`` of a site file: what robots run on, and where they are charged."""

from dataclasses import replace
from pathlib import Path

import pytest

from onboard.config.problems import ConfigError
from onboard.config.site import parse_site, site_digest
from onboard.core.site import Segment
from onboard.systems.car_park.battery import Battery
from onboard.systems.car_park.site import CarPark, car_park

TEXT = (Path(__file__).parents[2] / "bus_sim" / "sites" / "small.toml").read_text(encoding="utf-8")
HOMES = (Segment(2, 3), Segment(3, 8))


def site(*lines: str) -> CarPark:
    return car_park(parse_site("\n".join([TEXT, "[battery]", *lines]), "small.toml"))


def test_without_the_table_robots_have_none_and_the_site_is_what_it_was() -> None:
    plain, empty = car_park(parse_site(TEXT, "small.toml")), site()
    assert plain.battery is empty.battery is None
    assert plain.digest == empty.digest


def test_one_key_is_enough_and_robots_are_charged_at_their_homes() -> None:
    assert site("capacity_wh = 700").battery == Battery(700, 600, 600, 400, 80, 500, 25, 50, 80, HOMES)


def test_machines_of_another_battery_are_strangers() -> None:
    one, other = site("capacity_wh = 700"), site("capacity_wh = 701")
    assert len({one.digest, other.digest, car_park(parse_site(TEXT, "small.toml")).digest}) == 3
    assert site_digest(replace(one, battery=None)) == car_park(parse_site(TEXT, "small.toml")).digest


def test_chargers_may_be_more_than_robots() -> None:
    battery = site('chargers = ["p(2,2)", "p(3,8)", "p(3,9)"]').battery
    assert battery is not None
    assert battery.chargers == (Segment(2, 2), Segment(3, 8), Segment(3, 9))


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("charge_w = 80", "battery.charge_w = 80: no more than what a robot draws at rest, rest_w 80; make it more"),
        (
            "floor_percent = 60\nready_percent = 60",
            "battery.ready_percent = 60: no more than floor_percent, 60; make it",
        ),
        ("seek_percent = 40", "battery.seek_percent = 40: less than ready_percent, 50; make it as much, or more"),
        ('chargers = ["here"]', 'battery.chargers[0] = "here": not a position; write a list of positions'),
        ('chargers = ["p(2,3)N"]', 'battery.chargers[0] = "p(2,3)N": not a position'),
        ('chargers = ["p(2,3)", "p(2,3)"]', 'battery.chargers[1] = "p(2,3)": named twice; name it once'),
        ('chargers = ["p(2,99)"]', 'battery.chargers[0] = "p(2,99)": no such segment'),
        (
            'chargers = ["p(1,5)", "p(3,8)"]',
            "battery.chargers: no robot may stand for ever at p(1,5); name positions such as robots' homes",
        ),
        (
            'chargers = ["p(2,2)", "p(2,9)"]',
            "battery.chargers: 2 robots, of which 1 can be charged at the same time; name one for each, each on an "
            "alley or spur of its own",
        ),
    ],
)
def test_a_mistake_is_told_in_one_line_with_its_remedy(line: str, said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        site(*line.splitlines())
    (problem,) = str(caught.value).splitlines()
    assert problem.startswith("small.toml:")
    assert said in problem
