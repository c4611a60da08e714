"""The terminal's site file: what it becomes, and one clear line for each mistake."""

import pytest

from bus_sim.sites import find_site, site_text
from onboard.config.problems import ConfigError
from onboard.config.site import parse_site
from onboard.systems.terminal.site import EntityKind
from onboard.systems.terminal.vehicle import terminal

TEXT = site_text("terminal")
SITE = terminal(find_site("terminal"))


def test_m01_lanes_crossings_areas_and_stations_within_areas() -> None:
    kinds = [entity.kind for entity in SITE.entities.values()]
    assert [kinds.count(kind) for kind in EntityKind] == [8, 2, 3, 6]
    area = SITE.by_name["A4"]
    assert [SITE.entities[one].name for one in SITE.stations_in(area.number)] == ["S2", "S3", "S5"]
    assert {SITE.entities[one].name for one in area.leads_to} == {"L11", "L8", "S2", "S3", "S5"}


def test_m14_a_lanes_duration_is_its_length_over_the_speed() -> None:
    assert (SITE.by_name["L11"].duration_us, SITE.by_name["L2"].duration_us) == (20_000_000, 12_000_000)
    assert SITE.by_name["C1"].duration_us == 5_000_000
    turn = SITE.by_name["C1"].crossing_us(SITE.by_name["L11"].number, SITE.by_name["A2"].number)
    assert turn == 6_000_000


def test_m20_a_crossing_holds_one_robot_unless_the_site_says_more() -> None:
    assert SITE.by_name["C1"].capacity == 1 and SITE.by_name["A1"].capacity == 0
    more = parse_site(TEXT.replace('name = "C1"\nduration_ms', 'name = "C1"\ncapacity = 2\nduration_ms'), "more.toml")
    assert terminal(more).by_name["C1"].capacity == 2


def test_m14_m20_a_lane_is_at_most_5_km_long_and_there_is_something_to_drive_on() -> None:
    longest = parse_site(TEXT.replace("length_mm = 100_000 ", "length_mm = 5_000_000 "), "long.toml")
    assert terminal(longest).by_name["L11"].duration_us == 1_000_000_000
    with pytest.raises(ConfigError, match=r"lanes\[2\].length_mm = 5000001: out of range"):
        parse_site(TEXT.replace("length_mm = 100_000 ", "length_mm = 5_000_001 "), "long.toml")
    nothing = TEXT[: TEXT.index("[[lanes]]")]
    with pytest.raises(ConfigError, match=r"areas: no entity; add \[\[lanes\]\]"):
        parse_site(nothing, "nothing.toml")


def test_m04_m05_m06_missions_as_operators_say_them() -> None:
    load, tranship, urgent = SITE.missions
    assert (load.count, load.type, SITE.entities[load.source].name, SITE.entities[load.target].name) == (
        4, "T1", "A4", "S10",
    )  # fmt: skip
    assert [SITE.boxes[one - 1].name for one in tranship.boxes] == ["B11", "B12", "B13"]
    assert tranship.before_us == 720_000_000, "4:12 pm, and the run begins at 16:00"
    assert urgent.urgent and not tranship.urgent


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('leads_to = ["A1"]', 'leads_to = ["A9"]', 'lanes[3].leads_to = "A9": no lane or crossing or area of'),
        ("capacity = 4", "capacity = 0", "lanes[2].capacity = 0: out of range"),
        ('area = "A2"', 'area = "L3"', 'stations[3].area = "L3": no area of this name'),
        ('home = "A4"', 'home = "S2"', 'vehicles[3].home = "S2": no area of this name'),
        ('names = ["B5", "B6", "B7"]', 'names = ["B5", "B5"]', 'boxes[1].names[1] = "B5": used twice'),
        ('tranship = ["B14"]', 'tranship = ["B99"]', 'missions[2].tranship[0] = "B99": no box of this name'),
        ('before = "4:12 pm"', 'before = "25:00"', 'missions[1].before = "25:00": not a time of day'),
        ('before = "4:12 pm"', 'before = "16:00"', "not after the mission's own time"),
        ('lane = "L11"\nat_s', 'lane = "C1"\nat_s', 'blockages[0].lane = "C1": no lane of this name'),
        ("load = 4", "load = 400", "missions[0].load = 400: out of range"),
        ('kind = "stacker"', 'kind = "pile"', 'stations[2].kind = "pile": unknown word'),
        ('leads_to = ["C1", "L5"]', 'leads_to = []', "areas[1].leads_to: leads nowhere"),
        ("room = 6", "rom = 6", "did you mean"),
    ],
)  # fmt: skip
def test_every_mistake_is_one_line_with_place_value_and_remedy(old: str, new: str, told: str) -> None:
    assert old in TEXT
    with pytest.raises(ConfigError) as caught:
        parse_site(TEXT.replace(old, new, 1), "wrong.toml")
    lines = str(caught.value).splitlines()
    assert any(told in line for line in lines), lines
    assert all(line.startswith("wrong.toml") and "; " in line for line in lines)
