"""What a person reads who made a mistake in a site file."""

from pathlib import Path

import pytest

from bus_sim.sites import site_text
from onboard.config.problems import ConfigError
from onboard.config.site import load_site, parse_site
from tests.config.support import TWO_FLOORS, changed, problems_of

BROKEN = Path(__file__).parent / "broken"


def test_all_mistakes_of_a_file_are_told_at_once_each_with_its_line() -> None:
    with pytest.raises(ConfigError) as caught:
        parse_site((BROKEN / "site.toml").read_text(encoding="utf-8"), "site.toml")
    assert str(caught.value) + "\n" == (BROKEN / "site.txt").read_text(encoding="utf-8")


ONE_MISTAKE = {
    "two lifts at one end": (
        'end = "right"',
        'end = "left"',
        's.toml:16: lifts[1].end = "left": the sill of lifts[0] is at p(1,1) already; '
        "put one lift at each end of an alley",
    ),
    "home before a compartment": (
        'home = "p(2,3)"',
        'home = "p(1,4)"',
        's.toml:29: robots[0].home = "p(1,4)": the front of compartments[0] is there; '
        "choose a segment where a robot may stand for ever",
    ),
    "home on a sill": (
        'home = "p(2,3)"',
        'home = "p(2,8)"',
        's.toml:29: robots[0].home = "p(2,8)": the sill of lifts[1] is there; '
        "choose a segment where a robot may stand for ever",
    ),
    "home at the mouth of a spur": (
        'home = "p(2,3)"',
        'home = "p(2,5)"',
        's.toml:29: robots[0].home = "p(2,5)": the mouth of spurs[0] is there; '
        "choose a segment where a robot may stand for ever",
    ),
    "home in a lift": (
        'home = "p(2,3)"',
        'home = "p(128,1)"',
        's.toml:29: robots[0].home = "p(128,1)": no such segment; floors here: 1 to 2',
    ),
    "home beyond the end of a spur": (
        'home = "p(2,3)"',
        'home = "p(192,2)"',
        's.toml:29: robots[0].home = "p(192,2)": no such segment; spur 192 has 1 to 1',
    ),
    "home of two robots": (
        'home = "p(2,3)"',
        'home = "p(2,3)"\n[[robots]]\nname = "MR2"\nnode = 12\nhome = "p(2, 3)"',
        's.toml:33: robots[1].home = "p(2, 3)": home of robots[0] already; give each robot a segment of its own',
    ),
    "spur where a compartment is": (
        'at = "p(2,5)"',
        'at = "p(1,4)"\nside = "near"',
        's.toml:25: compartments[0].at = "p(1,4)": spurs[0] is there already, on the near side; '
        "choose another side or position",
    ),
    "spur on a sill": (
        'at = "p(2,5)"',
        'at = "p(2,1)"',
        's.toml:19: spurs[0].at = "p(2,1)": the sill of lifts[0] is there; choose another position',
    ),
    "lift to a floor that is not there": (
        'end = "right"',
        'end = "right"\nfloors = [1, 2, 3]',
        "s.toml:17: lifts[1].floors[2] = 3: no such floor; floors here: 1 to 2",
    ),
    "lift to no floor": (
        'end = "right"',
        'end = "right"\nfloors = []',
        "s.toml:17: lifts[1].floors = []: no floor at all; write such as [1, 2]",
    ),
    "lift with its floors from the top": (
        'end = "right"',
        'end = "right"\nfloors = [2, 1]',
        "s.toml:17: lifts[1].floors = [2, 1]: not from the lowest to the highest; write [1, 2]",
    ),
    "number of floors with decimals, and a floor of its own": (
        "count = 2",
        "count = 2.0\n2.positions = 8",
        "s.toml:5: floors.count = 2.0: is a decimal number; write a whole number from 1 to 127",
    ),
    "no place": (
        "positions = 8",
        "positions = 8\nsides = []",
        "s.toml:4: floors: no place for a car; take entries out of floors.without or add positions",
    ),
    "no robot": (
        '[[robots]]\nname = "MR1"\nnode = 11\nhome = "p(2,3)"\n',
        "",
        "s.toml: robots: no robot; add at least one [[robots]] table",
    ),
    "word of the DBC language": (
        'name = "MR1"',
        'name = "FILTER"',
        's.toml:27: robots[0].name = "FILTER": not usable in a DBC; '
        "write a letter, then up to 15 letters, digits or _ (not last)",
    ),
    "name that is no file name": (
        'name = "two"',
        'name = "two/floors"',
        's.toml:2: site.name = "two/floors": not usable in a file name; write up to 32 letters, digits, dots, - or _',
    ),
    "table as one value": (
        "[[spurs]]\nat",
        "[spurs]\nat",
        's.toml:18: spurs = {"at" = "p(2,5)"}: not an array of tables; write [[spurs]]',
    ),
    "bids too late for a slow bus": (
        'name = "two"',
        'name = "two"\nbitrate = 10_000\n[timing]\nbid_delay_ms = 90',
        "s.toml:5: timing.bid_delay_ms = 90: shorter than 3 N times two frames at 10000 bit/s, N = 1 robots; "
        "write at least 96",
    ),
    "a window that is longer than a plan's stamp counts ahead": (
        'name = "two"',
        'name = "two"\n[timing]\ncall_window_ms = 15_001',
        "s.toml:4: timing.call_window_ms = 15001: out of range; write a whole number from 50 to 15000",
    ),
    "no room for the slots between the delay and the deadline": (
        'name = "two"',
        'name = "two"\n[timing]\ncall_window_ms = 346',
        "s.toml:4: timing.call_window_ms = 346: no room for bid_delay_ms 300, 6 ms of slots and twice "
        "deadline_guard_ms 20 in call_window_ms 346; write call_window_ms = 347 or more",
    ),
    "not TOML": (
        "count = 2",
        "count = two",
        "s.toml:5: not TOML: Invalid value; correct the syntax there (https://toml.io)",
    ),
    "key twice": (
        "count = 2",
        "count = 2\ncount = 3",
        "s.toml:6: not TOML: Cannot overwrite a value; it is there above already; write it once, or [[NAME]] each time",
    ),
    "value that would break the line": (
        'home = "p(2,3)"',
        'home = "a\\nb"',
        's.toml:29: robots[0].home = "a\\nb": not a position; '
        'write a position such as "p(1,4)", which is floor 1, index 4',
    ),
}


@pytest.mark.parametrize(("old", "new", "line"), ONE_MISTAKE.values(), ids=ONE_MISTAKE.keys())
def test_one_mistake_gives_one_line_and_no_other(old: str, new: str, line: str) -> None:
    assert problems_of(changed(old, new)) == [line]


def test_a_floor_that_no_lift_reaches() -> None:
    text = changed("count = 2", "count = 3").replace("end =", "floors = [1, 2]\nend =")
    assert problems_of(text) == [
        "s.toml:8: lifts: no compartment and no robot can be reached from floor 3; join floor 3 to the others by a lift"
    ]


def test_a_mistaken_floor_is_not_told_again_by_all_that_refers_to_it() -> None:
    assert problems_of(changed("positions = 8", 'positions = "8"')) == [
        's.toml:6: floors.positions = "8": is a text; write a whole number from 2 to 127'
    ]


def test_an_empty_file_is_told_what_it_lacks() -> None:
    assert problems_of("") == [
        "s.toml: site: missing; add a table [site]",
        "s.toml: site.name: missing; write a text in quotes",
        "s.toml: floors: missing; add a table [floors]",
        "s.toml: floors.count: missing; write a whole number from 1 to 127",
        "s.toml: floors.positions: missing; write a whole number from 2 to 127",
        "s.toml: compartments: no compartment; add at least one [[compartments]] table",
        "s.toml: robots: no robot; add at least one [[robots]] table",
    ]


def test_a_file_that_is_not_there_and_one_that_is_no_text(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        load_site(tmp_path / "none.toml")
    assert str(caught.value) == f"{tmp_path / 'none.toml'}: does not exist; name an existing site file"
    (tmp_path / "latin.toml").write_bytes("[site]\nname = 'Café'".encode("latin-1"))
    with pytest.raises(ConfigError) as caught:
        load_site(tmp_path / "latin.toml")
    assert str(caught.value) == f"{tmp_path / 'latin.toml'}: is not UTF-8 text; name an existing site file"
    with pytest.raises(ConfigError, match="cannot be read"):
        load_site(tmp_path)


def test_the_base_of_these_tests_is_in_order() -> None:
    assert parse_site(TWO_FLOORS, "s.toml").name == "two"


def test_which_stewards_there_are_is_not_judged_where_the_floors_are_mistaken() -> None:
    text = site_text("small").replace("count = 3", "count = 3.0")
    with pytest.raises(ConfigError) as raised:
        parse_site(text, "s.toml")
    assert [problem.key for problem in raised.value.problems] == ["floors.count"]
