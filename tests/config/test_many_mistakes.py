"""Files with several mistakes: one reading names all of them, and none that only follows from another."""

import pytest

from bus_sim.sites import site_text
from tests.config.support import problems_of
from tests.config.test_building_errors import BRANCHED
from tests.graph.test_site import GOOD as GRAPH
from tests.mapd.sites import site_text as mapd_text

_MORE_ROBOTS = "".join(
    f'[[robots]]\nname = "MR{number}"\nnode = {10 + number}\nhome = "p(2,{number + 6})"\n' for number in range(2, 6)
)
_MORE_ALLEYS = (
    'positions = 9\n\n[[alleys]]\nname = "C"\nfrom = "p(*,B,1)"\npositions = 5\n\n'
    '[[alleys]]\nname = "D"\nfrom = "p(*,4)"\npositions = 5\n'
)

#: What is changed in the file of an alley that branches, and the lines with their keys that are told.
MANY = {
    "overlap beside a lift of no node-ID, a robot without home and a use that is none": (
        {"positions = 9\n": _MORE_ALLEYS, "node = 5": "node = 500", 'home = "p(192,2)"\n': "", '"exit"': '"out"'},
        ["8 alleys", "25 lifts[0].node", "47 compartments[1].use", "54 robots[0].home"],
    ),
    "overlap beside an alley without positions, a class of none and a spur that is too long": (
        {
            "positions = 9\n": _MORE_ALLEYS + '\n[[alleys]]\nname = "E"\nfrom = "p(*,13)"\n',
            'places = ["p(2,*,*)"]': 'places = ["p(2,22)"]',
            "length = 2": "length = 200",
        },
        ["8 alleys", "23 alleys[3].positions", "39 spurs[0].length", "56 classes[0].places[0]"],
    ),
    "compartment on a spur, a name twice, a limit of a class and a wrong word of the negotiation": (
        {
            'at = "p(*,12)"\nlength = 2': 'at = "p(*,10)"\nlength = 8',
            'name = "Out"': 'name = "In"',
            "max_length_mm = 4_300": "max_length_mm = 43",
            'home = "p(192,2)"': 'home = "p(192,2)"\n[negotiation]\nrides = "never"\nofers = "told"',
        },
        [
            "8 alleys",
            "34 compartments[1].name",
            "41 classes[0].max_length_mm",
            "49 negotiation.rides",
            "50 negotiation.ofers",
        ],
    ),
    "shaft that is not upright beside a mistaken spur, a home and a word of an alley": (
        {
            'doors = ["p(*,2)N"]': 'doors = ["p(1,2)N", "p(2,3)N"]',
            'at = "p(*,12)"': 'at = "p(*,32)"',
            "node = 11": "node = 0",
            "positions = 9": 'positions = 9\none_way = "up"',
        },
        ["12 alleys[0].one_way", "22 lifts[1].doors", "25 spurs[0].at", "47 robots[0].node"],
    ),
    "ring that does not close, a door in mid-alley, two homes at one place": (
        {
            "positions = 9\n": 'positions = 9\n\n[[alleys]]\nname = "C"\nfrom = "p(*,B,8)"\npositions = 4\n\n'
            '[[alleys]]\nname = "D"\nfrom = "p(*,C,4)"\npositions = 6\nto = "p(*,3)"\n',
            'doors = ["p(*,2)N"]': 'doors = ["p(*,3)"]',
            'home = "p(192,2)"': 'home = "p(192,2)"\n[[robots]]\nname = "MR2"\nnode = 12\nhome = "p(192,2)"',
        },
        ["22 alleys[2].to", "32 lifts[1].doors[0]", "62 robots[1].home"],
    ),
    "too many robots beside a class without places, a robot's name and a class of a negative limit": (
        {
            'home = "p(192,2)"\n': f'home = "p(192,2)"\n{_MORE_ROBOTS}',
            'name = "MR1"': 'name = "VERSION"',
            'places = ["p(2,*,*)"]': "places = []",
            "max_length_mm = 4_300": "max_length_mm = -1",
        },
        ["41 classes[0].max_length_mm", "42 classes[0].places", "44 robots", "45 robots[0].name"],
    ),
    "places that none can leave beside a mistaken node-ID, a class and a home": (
        {
            "positions = 9": 'positions = 9\none_way = "rising"',
            "node = 11": "node = 5",
            "max_length_mm = 4_300": "max_length_mm = true",
            'home = "p(192,2)"': 'home = "p(1,55)"',
        },
        ["4 floors", "42 classes[0].max_length_mm", "47 robots[0].node", "48 robots[0].home"],
    ),
    "alley that nothing joins beside a spur into nothing and a class's word": (
        {
            "positions = 9\n": 'positions = 9\n\n[[alleys]]\nname = "C"\npositions = 3\n',
            'at = "p(*,12)"': 'at = "p(*,77)"',
            "max_length_mm = 4_300": 'charging = "yes"',
        },
        ["17 lifts", "28 spurs[0].at", "45 classes[0].charging"],
    ),
    "number of floors, and positions that no floor has": (
        {
            "count = 2": 'count = "two"',
            'at = "p(1,5)"': 'at = "p(1,55)"',
            'doors = ["p(*,2)N"]': 'doors = ["p(*,22)N"]',
            'home = "p(192,2)"': 'home = "p(2,99)"',
            'at = "p(*,12)"': 'at = "p(*,13-14)"',
        },
        ["5 floors.count", "21 lifts[1].doors[0]", "24 spurs[0].at", "30 compartments[0].at", "47 robots[0].home"],
    ),
    "length of all floors, a floor that is not there and two things at one place": (
        {
            "positions = 14": "positions = 1_400",
            'at = "p(1,5)"': 'at = "p(1,2)"',
            'at = "p(1,B,6)"': 'at = "p(7,B,6)"',
            'places = ["p(2,*,*)"]': 'places = ["p(4,*,*)"]',
        },
        ["6 floors.positions", "30 compartments[0].at", "36 compartments[1].at", "42 classes[0].places[0]"],
    ),
    "pitch, a place taken twice, a side and no exit": (
        {
            "positions = 14": "positions = 14\npitch_mm = 500",
            'at = "p(1,5)"': 'at = "p(1,2)"',
            "positions = 9": 'positions = 9\nsides = ["left"]',
            '"exit"': '"entry"',
        },
        ["7 floors.pitch_mm", "13 alleys[0].sides[0]", "29 compartments", "32 compartments[0].at"],
    ),
    "alley of no name: where it goes off is judged, what may mean it is not": (
        {
            'name = "B"\n': "",
            'from = "p(*,7)"': 'from = "p(*,17)"',
            'use = "entry"': 'use = "in"',
            'places = ["p(2,*,*)"]': 'places = ["p(1,5)N"]',
        },
        ["8 alleys[0].name", "9 alleys[0].from", "30 compartments[0].use", "41 classes[0].places[0]"],
    ),
    "tables and keys by other words: each once, and nothing is missing": (
        {
            "[[alleys]]": "[[alley]]",
            "[[spurs]]": "[[spur]]",
            "positions = 9": "positons = 9",
            "node = 5": "nod = 5",
            "[[robots]]": "[[robot]]",
            'at = "p(1,5)"': 'at = "p(1,55)"',
        },
        ["8 alley", "11 alley[0].positons", "15 lifts[0].nod", "23 spur", "30 compartments[0].at", "44 robot"],
    ),
    "floors by another word, a lift's end that is none and speeds": (
        {
            "[floors]": "[floor]",
            'doors = ["p(*,2)N"]': 'end = "up"',
            'home = "p(192,2)"': 'home = "p(192,2)"\n[carrier]\nspeed_mm_s = 0\nlenght_mm = 2_000\n[timing]\ndoor_ms=1',
        },
        ["4 floor", "21 lifts[1].end", "49 carrier.speed_mm_s", "50 carrier.lenght_mm", "52 timing.door_ms"],
    ),
    "list of floors that falls, an alley of two names, a lift to one floor": (
        {
            "positions = 9": "positions = 9\nfloors = [2, 1]",
            'doors = ["p(*,2)N"]': 'doors = ["p(*,2)N"]\nfloors = [1]',
            'at = "p(1,B,6)"': 'at = "p(1,B,16)"',
            "max_length_mm = 4_300": "max_length_mm = 9_000",
        },
        ["12 alleys[0].floors", "22 lifts[1].doors", "38 compartments[1].at", "43 classes[0].max_length_mm"],
    ),
    "joints: along another alley, from a floor that is not there; and a height": (
        {
            "positions = 9\n": 'positions = 9\n\n[[alleys]]\nname = "C"\nfrom = "p(*,B,4)"\npositions = 3\n'
            'to = "p(*,1)"\n\n[[alleys]]\nname = "D"\nfrom = "p(3,4)"\npositions = 4\nfloors = [2]\n',
            "positions = 14": "positions = 14\n2.height_mm = 1_500",
            "node = 1\n": "node = 251\n",
        },
        ["7 floors.2.height_mm", "18 alleys[1].to", "22 alleys[2].from", "42 compartments[0].node"],
    ),
}


_FLOOR = mapd_text(3, [(0, "1,2", "3,5"), (1, "2,4", "0,6")])
_TERMINAL = site_text("terminal")

#: The same of other systems: the file, what is changed in it, and what is told.
OF_OTHERS = {
    "graph: an edge, a node without host, an order's robot and a limit": (
        GRAPH,
        {"[0, 1, 6000]": "[0, 1, 60]", "6, 8]": "6]", 'robot = "R1"': 'robot = "R7"', "capacity = 3": "capacity = 99"},
        ["7 graph.capacity", "9 graph.edges[0]", "11 hosts", "42 orders[1].robot"],
    ),
    "graph: a robot's name, whom an order names; nodes of a host, a start and a stop": (
        GRAPH,
        {'name = "R1"': 'name = "R 1"', "4, 5]\n": "50]\n", "6, 8]": "6, 8, 80]", "at = 8": "at = 9"},
        ["14 hosts[0].nodes[5]", "26 robots[0].name", "33 robots[1].at", "43 orders[1].visit[1]"],
    ),
    "graph: nodes that nothing joins, a mistaken edge, a table by another word": (
        GRAPH,
        {
            "[0, 1, 6000]": "[0, 1, 6000], [20, 21, 9000], [21, 22, 9000], [20, 22, 9000], [30, 31]",
            "[[desks]]": "[[desk]]",
            "6, 8]": "6, 8, 20, 21, 22, 30]",
        },
        ["9 graph.edges[4]", "9 graph.edges", "21 desk"],
    ),
    "floor of cells: a step, a node-ID, a home, an endpoint of which a task begins and a word": (
        _FLOOR,
        {"step_ms = 1000": "step_ms = 1", '"0,9"': '"1,3"', '"0,6"]\n': '"0,66"]\nodd = 3\n', "node = 11": "node = 1"},
        ["6 steps.step_ms", "17 robots[0].node", "23 robots[1].home", "31 demand.endpoints[5]", "32 demand.odd"],
    ),
    "floor of cells: the site's name, a blocked endpoint that a task names, another task": (
        _FLOOR,
        {'["r........r"': '["r...@@@..r"', '[0, "1,2", "3,5"]': '[0, "1,2", "3,3"]', '"made"': '"ma de"'},
        ["3 site.name", "31 demand.endpoints[5]", "32 demand.tasks[0]"],
    ),
    "terminal: a desk's name, a lane's length, where one leads, a home and a word": (
        _TERMINAL,
        {
            'name = "Quay"\nnode = 2': 'name = "Quay"\nnode = 1',
            "length_mm = 60_000        # 12 s": "length_mm = 6",
            'home = "A4"': 'home = "A44"',
            "patience_s = 30 ": "patience = 30 ",
        },
        ["11 planning.patience", "22 desks[1].node", "42 vehicles[3].home", "52 lanes[1].length_mm"],
    ),
}


@pytest.mark.parametrize(("changes", "told"), MANY.values(), ids=MANY.keys())
def test_all_mistakes_are_told_at_once_and_no_other(changes: dict[str, str], told: list[str]) -> None:
    assert _told(BRANCHED, changes) == told


@pytest.mark.parametrize(("text", "changes", "told"), OF_OTHERS.values(), ids=OF_OTHERS.keys())
def test_those_of_other_systems_are_too(text: str, changes: dict[str, str], told: list[str]) -> None:
    assert _told(text, changes) == told


def _told(text: str, changes: dict[str, str]) -> list[str]:
    """Line and key of each mistake that is told of a text that is changed."""
    for old, new in changes.items():
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    lines = [line.removeprefix("s.toml:").split(" ", 2) for line in problems_of(text)]
    return [f"{place.rstrip(':')} {key.rstrip(':')}" for place, key, _ in lines]
