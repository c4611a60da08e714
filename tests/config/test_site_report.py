"""What a person is told of a site."""

from onboard.config.site import load_site, parse_site
from onboard.config.site_report import site_report
from tests.config.support import ROOT, TWO_FLOORS, changed

SITES = ROOT / "bus_sim" / "sites"
RIGHT = '[[lifts]]\nname = "LR"\nnode = 3\nend = "right"\n'


def test_of_the_standard_site() -> None:
    assert site_report(load_site(SITES / "standard.toml")) == [
        "floors: 5 of 20 positions, 1 spur",
        "places: 191",
        "reached: every place from an entry, and from every place an exit (compartments: 3 in and out)",
        "machines: 3 compartments (IOC1, IOC2, IOC3), 2 lifts (ER1, ER2), 4 robots (MR1, MR2, MR3, MR4)",
        "refuges for 5 (floors 2 to 5, spur 192), 4 robots",
        "without ER1 (floors 1 to 5): all places can be reached; "
        "82 lie before or behind robots at home, which serve them or give way",
        "without ER2 (floors 1 to 5): all places can be reached; "
        "82 lie before or behind robots at home, which serve them or give way",
    ]


def test_of_one_alley() -> None:
    assert site_report(load_site(SITES / "level1.toml")) == [
        "floors: 1 of 12 positions",
        "places: 23",
        "reached: every place from an entry, and from every place an exit (compartments: 1 in and out)",
        "machines: 1 compartment (IOC1), 1 robot (MR1)",
        "refuges for 1 (floor 1), 1 robot",
    ]


def test_the_only_lift_strands_the_floor_above_and_the_robot_there() -> None:
    assert site_report(parse_site(changed(RIGHT, ""), "s.toml"))[-1] == (
        "without LL (floors 1, 2): 15 places on floor 2 cannot be reached, and MR1 cannot leave: "
        "no robot is left for the others"
    )


def test_a_robot_in_a_spur_of_the_street_is_left_and_its_places_are_others() -> None:
    text = changed(RIGHT, "").replace('at = "p(2,5)"', 'at = "p(1,7)"')
    text += '[[robots]]\nname = "MR2"\nnode = 12\nhome = "p(192,1)"\n'
    assert site_report(parse_site(text, "s.toml"))[-1] == (
        "without LL (floors 1, 2): 16 places on floor 2 cannot be reached, and MR1 cannot leave"
    )


def test_what_is_stranded_and_what_is_hidden_are_told_apart() -> None:
    text = TWO_FLOORS.replace("count = 2", "count = 4").replace('end = "right"', 'end = "right"\nfloors = [1, 2]')
    text += '[[robots]]\nname = "MR2"\nnode = 12\nhome = "p(4,3)"\n'
    lines = site_report(parse_site(text, "s.toml"))
    assert lines[-2:] == [
        "without LL (floors 1 to 4): 32 places on floors 3, 4 cannot be reached, and MR2 cannot leave; "
        "6 others lie before or behind robots at home, which serve them or give way",
        "without LR (floors 1, 2): all places can be reached; "
        "23 lie before or behind robots at home, which serve them or give way",
    ]


def test_floors_of_different_lengths() -> None:
    text = changed("count = 2\npositions = 8\n", "count = 3\npositions = 8\n3.positions = 6\n")
    text = changed('end = "right"', 'end = "right"\nfloors = [1, 2]', text)
    assert site_report(parse_site(text, "s.toml"))[0] == "floors: 3 of 6 to 8 positions, 1 spur"
