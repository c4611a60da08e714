"""How many robots a site takes, and where they may be at home."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.config.site import parse_site
from onboard.contract.codes import KindCode
from onboard.systems.car_park.site import car_park
from onboard.ways.refuges import open_refuges
from tests.config.support import problems_of

LIFTS = 'lifts = [{name = "LL", node = 5, end = "left"}, {name = "LR", node = 6, end = "right"}]\n'
CHAIN = (
    'lifts = [{name = "LL", node = 5, end = "left", floors = [1, 2, 3]}, '
    '{name = "LR", node = 6, end = "right", floors = [3, 4]}]\n'
)


def text_of(
    floors: int, homes: list[str], spurs: list[str] | None = None, lifts: str = LIFTS, at: str = "p(1,5)"
) -> str:
    """A site file of alleys of ten positions, a compartment at ``at``, robots MR1.. at ``homes``."""
    spur_tables = ", ".join(f'{{at = "{mouth}"}}' for mouth in spurs or [])
    robots = ", ".join(f'{{name = "MR{n}", node = {n + 10}, home = "{home}"}}' for n, home in enumerate(homes, start=1))
    return (
        'site = {name = "s"}\n'
        f"floors = {{count = {floors}, positions = 10}}\n"
        f"{lifts if floors > 1 else ''}"
        f"spurs = [{spur_tables}]\n"
        f'compartments = [{{name = "IOC1", node = 1, at = "{at}"}}]\n'
        f"robots = [{robots}]\n"
    )


TAKEN = "stands there already, and one may stand where another must pass"
NEEDED = "is needed by all, so nobody may stand there for ever"
REMEDY = "take robots away, or add floors or [[spurs]]: each takes one more"
REFUSED = {
    "as many robots as floors": (
        text_of(3, ["p(2,2)", "p(3,2)", "p(3,5)"]),
        f"s.toml:6: robots: 3 robots, but refuges for 2 (floors 2, 3); {REMEDY}",
    ),
    "more robots than alleys and spurs": (
        text_of(2, ["p(2,2)", "p(192,1)", "p(2,5)"], ["p(1,7)"]),
        f"s.toml:6: robots: 3 robots, but refuges for 2 (floor 2, spur 192); {REMEDY}",
    ),
    "two robots on one alley": (
        text_of(1, ["p(1,2)", "p(1,9)"]),
        f"s.toml:5: robots: 2 robots, but refuges for a lone one only; {REMEDY}",
    ),
    "two robots on one alley with a spur": (
        text_of(1, ["p(1,2)", "p(192,1)"], ["p(1,7)"]),
        f"s.toml:5: robots: 2 robots, but refuges for 1 (spur 192); {REMEDY}",
    ),
    "three robots, where one of three floors above is the way to the last": (
        text_of(4, ["p(2,2)", "p(3,2)", "p(4,2)"], lifts=CHAIN),
        f"s.toml:6: robots: 3 robots, but refuges for 2 (floors 2, 4); {REMEDY}",
    ),
    "home on the street": (
        text_of(3, ["p(1,2)", "p(3,2)"]),
        f's.toml:6: robots[0].home = "p(1,2)": the alley of floor 1 {NEEDED}; choose one of: floor 2',
    ),
    "home of a lone robot on the street": (
        text_of(2, ["p(1,2)"]),
        f's.toml:6: robots[0].home = "p(1,2)": the alley of floor 1 {NEEDED}; choose one of: floor 2',
    ),
    "homes in one alley": (
        text_of(6, ["p(2,2)", "p(4,2)", "p(2,9)"], ["p(1,7)"]),
        f's.toml:6: robots[2].home = "p(2,9)": MR1 {TAKEN}; choose one of: floors 3, 5, 6, spur 192',
    ),
    "home in the way to another floor": (
        text_of(4, ["p(3,2)", "p(4,2)"], lifts=CHAIN),
        f's.toml:6: robots[0].home = "p(3,2)": the alley of floor 3 {NEEDED}; choose one of: floor 2',
    ),
}


@pytest.mark.parametrize(("text", "line"), REFUSED.values(), ids=REFUSED.keys())
def test_too_little_room_gives_one_line(text: str, line: str) -> None:
    assert problems_of(text) == [line]


def test_nowhere_to_stand_is_told_beside_a_home_that_is_none() -> None:
    text = text_of(2, ["p(1,2)"], at="p(1,1)").replace("positions = 10", "positions = 2")
    assert problems_of(text) == [
        's.toml:6: robots[0].home = "p(1,2)": the sill of lifts[1] is there; choose a segment where a robot may stand '
        "for ever",
        f"s.toml:6: robots: 1 robot, but no refuge; {REMEDY}",
    ]


ROOM = {
    "a lone robot on one alley": text_of(1, ["p(1,2)"]),
    "one robot less than floors": text_of(3, ["p(2,2)", "p(3,9)"]),
    "a spur in addition": text_of(3, ["p(2,2)", "p(192,1)", "p(3,9)"], ["p(1,7)"]),
    "spurs for all on one alley": text_of(1, ["p(192,1)", "p(193,1)"], ["p(1,2)", "p(1,8)"]),
    "a street above": text_of(3, ["p(1,2)", "p(2,2)"], at="p(3,5)"),
    "a lone robot in the way to another floor": text_of(4, ["p(3,2)"], lifts=CHAIN),
}


@pytest.mark.parametrize("text", ROOM.values(), ids=ROOM.keys())
def test_enough_room_is_taken(text: str) -> None:
    assert car_park(parse_site(text, "s.toml")).machine("MR1").kind is KindCode.ROBOT


def test_a_study_of_crowds_may_ask_for_more_than_there_is_room_for() -> None:
    text = text_of(1, ["p(1,2)", "p(1,9)"])
    assert sorted(parse_site(text, "s.toml", crowded=True).machines) == [1, 11, 12]


@given(st.integers(1, 6), st.lists(st.tuples(st.integers(1, 6), st.integers(2, 9)), min_size=1, max_size=6))
def test_robots_are_taken_just_where_each_stands_in_a_refuge_that_the_others_leave_open(
    floors: int, homes: list[tuple[int, int]]
) -> None:
    alleys = [min(floor, floors) for floor, _ in homes]
    fits = len(set(alleys)) == len(alleys) and (1 not in alleys if floors > 1 else homes[0][1] != 5)
    text = text_of(floors, [f"p({alley},{index})" for alley, (_, index) in zip(alleys, homes, strict=True)])
    if not fits:
        assert problems_of(text)
        return
    site = car_park(parse_site(text, "s.toml"))
    stand = [machine.home for machine in site.machines.values() if machine.kind is KindCode.ROBOT]
    for home in stand:
        assert home in open_refuges(site, [other for other in stand if other != home])


UNJOINED = 'lifts = [{name = "LL", node = 5, end = "left", floors = [1, 2]}]\n'


def test_floors_that_no_lift_joins_are_two_sites() -> None:
    text = text_of(3, ["p(2,2)", "p(3,2)"], lifts=UNJOINED)
    text = text.replace("compartments = [", 'compartments = [{name = "IOC3", node = 3, at = "p(3,5)"}, ')
    assert problems_of(text) == [
        "s.toml:3: lifts: no way from floor 3 to floor 1; join them by a lift, or write a site file for each"
    ]


def test_a_lift_that_stops_at_one_floor_is_none() -> None:
    text = text_of(2, ["p(2,2)"], lifts=LIFTS.replace('end = "right"', 'end = "right", floors = [2]'))
    assert problems_of(text) == [
        "s.toml:3: lifts[1].floors = [2]: this lift would stop at floor 2 alone; a lift joins two floors or more"
    ]
    text = text_of(1, ["p(1,2)"]) + LIFTS
    assert problems_of(text)[0] == (
        's.toml:6: lifts[0].end = "left": this lift would stop at floor 1 alone; a lift joins two floors or more'
    )
