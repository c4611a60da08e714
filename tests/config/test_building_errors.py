"""What a person reads who made a mistake in what a building has beyond one alley a floor: forty typical ones."""

import pytest

from bus_sim.sites import layout_names, site_text
from onboard.config.site import parse_site
from tests.config.support import problems_of

#: Two floors of an alley that branches; a lift at the end of the branch, one beside the alley; small cars above.
BRANCHED = """\
[site]
name = "forked"

[floors]
count = 2
positions = 14

[[alleys]]
name = "B"
from = "p(*,7)"
positions = 9

[[lifts]]
name = "L1"
node = 5
doors = ["p(*,B,9)"]

[[lifts]]
name = "L2"
node = 6
doors = ["p(*,2)N"]

[[spurs]]
at = "p(*,12)"
length = 2

[[compartments]]
name = "In"
node = 1
at = "p(1,5)"
use = "entry"

[[compartments]]
name = "Out"
node = 2
at = "p(1,B,6)"
use = "exit"

[[classes]]
name = "small"
max_length_mm = 4_300
places = ["p(2,*,*)"]

[[robots]]
name = "MR1"
node = 11
home = "p(192,2)"
"""

#: What is changed in it, into what, and the one line that is told.
ONE_MISTAKE = {
    "alley without a name": (
        'name = "B"\n',
        "",
        "s.toml:8: alleys[0].name: missing; write a text in quotes",
    ),
    "alley with a name that no position can have": (
        'name = "B"',
        'name = "4B"',
        's.toml:9: alleys[0].name = "4B": not usable in a position; write a letter, then up to 7 letters, digits or _',
    ),
    "two alleys of one name": (
        '[[lifts]]\nname = "L1"',
        '[[alleys]]\nname = "B"\npositions = 4\nfrom = "p(*,3)"\n\n[[lifts]]\nname = "L1"',
        's.toml:14: alleys[1].name = "B": used twice; give each alley a name of its own',
    ),
    "alley without positions": (
        "positions = 9\n",
        "",
        "s.toml:8: alleys[0].positions: missing; write a whole number from 1 to 127",
    ),
    "alley on a floor that is not there": (
        "positions = 9",
        "positions = 9\nfloors = [1, 2, 3]",
        "s.toml:12: alleys[0].floors[2] = 3: no such floor; floors here: 1 to 2",
    ),
    "alley from a position that is not there": (
        'from = "p(*,7)"',
        'from = "p(*,17)"',
        's.toml:10: alleys[0].from = "p(*,17)": no such segment; floor 1 has 1 to 14',
    ),
    "alley from an alley that is not there": (
        'from = "p(*,7)"',
        'from = "p(*,C,7)"',
        's.toml:10: alleys[0].from = "p(*,C,7)": no such segment; alleys of floor 1: its own, B',
    ),
    "alley from itself": (
        'from = "p(*,7)"',
        'from = "p(*,B,7)"',
        's.toml:10: alleys[0].from = "p(*,B,7)": beside itself; name another alley\'s position',
    ),
    "alley from another floor": (
        'from = "p(*,7)"',
        'from = "p(1,7)"',
        's.toml:10: alleys[0].from = "p(1,7)": not on floor 2; write "p(*,...)" for the same floor',
    ),
    "alley from several positions": (
        'from = "p(*,7)"',
        'from = "p(*,7-8)"',
        's.toml:10: alleys[0].from = "p(*,7-8)": not a position; write a position such as "p(*,4)", beside which '
        "the alley ends",
    ),
    "alley from one side": (
        'from = "p(*,7)"',
        'from = "p(*,7)F"',
        's.toml:10: alleys[0].from = "p(*,7)F": not a position; write a position such as "p(*,4)", beside which '
        "the alley ends",
    ),
    "alley whose end goes on along another": (
        "positions = 9\n",
        'positions = 9\n\n[[alleys]]\nname = "C"\nfrom = "p(*,B,4)"\npositions = 3\nto = "p(*,1)"\n',
        's.toml:17: alleys[1].to = "p(*,1)": would go on along floor 1, not across it; join alleys at right angles',
    ),
    "ring that does not close": (
        "positions = 9\n",
        'positions = 9\n\n[[alleys]]\nname = "C"\nfrom = "p(*,B,8)"\npositions = 4\n\n[[alleys]]\nname = "D"\nfrom '
        '= "p(*,C,4)"\npositions = 6\nto = "p(*,3)"\n',
        's.toml:22: alleys[2].to = "p(*,3)": the end of alley D of floor 1 is at (4800, 2400) mm, and p(1,3) at '
        "(4800, 0) mm; change positions, pitch_mm, or where it begins or ends",
    ),
    "alleys that lie on each other": (
        "positions = 9\n",
        'positions = 9\n\n[[alleys]]\nname = "C"\nfrom = "p(*,B,1)"\npositions = 5\n\n[[alleys]]\nname = "D"\nfrom '
        '= "p(*,4)"\npositions = 5\n',
        "s.toml:8: alleys: on floor 1 alley D lies on alley C; move one, or make what is between them longer",
    ),
    "two alleys from one side of a position": (
        "positions = 9\n",
        'positions = 9\n\n[[alleys]]\nname = "C"\nfrom = "p(*,7)"\npositions = 3\n',
        's.toml:15: alleys[1].from = "p(*,7)": alleys[0] is there already, on the far side; choose another side or '
        "position",
    ),
    "alley that nothing joins": (
        "positions = 9\n",
        'positions = 9\n\n[[alleys]]\nname = "C"\npositions = 3\n',
        "s.toml:17: lifts: no compartment and no robot can be reached from alley C of floor 1; join alley C of "
        "floor 1 to the others by a lift",
    ),
    "one-way alley of no direction": (
        "positions = 9",
        'positions = 9\none_way = "up"',
        's.toml:12: alleys[0].one_way = "up": unknown word; known here: both, falling, rising',
    ),
    "one-way alleys that lead nowhere": (
        "positions = 9",
        'positions = 9\none_way = "rising"',
        "s.toml:4: floors: no way to an exit from p(3,7)N, p(3,8)N, p(3,9)N and 15 more; join its alley by a lift "
        "or another end, or turn one_way",
    ),
    "compartment on an alley of no way out": (
        'doors = ["p(*,B,9)"]',
        'doors = ["p(*,B,9)"]\nfloors = [2]',
        's.toml:16: lifts[0].doors = ["p(*,B,9)"]: this lift would stop at floor 2 alone; a lift joins two floors '
        "or more",
    ),
    "lift with neither end nor doors": (
        'doors = ["p(*,B,9)"]\n',
        "",
        's.toml:13: lifts[0].end: missing; write "left" or "right"',
    ),
    "lift with end and doors": (
        'doors = ["p(*,B,9)"]',
        'doors = ["p(*,B,9)"]\nend = "left"',
        's.toml:17: lifts[0].end = "left": beside doors; write one of both',
    ),
    "door in the middle of an alley": (
        'doors = ["p(*,B,9)"]',
        'doors = ["p(*,B,8)"]',
        's.toml:16: lifts[0].doors[0] = "p(*,B,8)": in the middle of alley B of floor 1; write N or F behind it '
        "for a lift beside the alley, or end it there",
    ),
    "door where an alley is joined": (
        'doors = ["p(*,B,9)"]',
        'doors = ["p(*,B,1)"]',
        's.toml:16: lifts[0].doors[0] = "p(*,B,1)": alley B of floor 1 goes on there; choose the end of an alley '
        "that is joined to no other",
    ),
    "door that is none": (
        'doors = ["p(*,B,9)"]',
        'doors = ["B9"]',
        's.toml:16: lifts[0].doors[0] = "B9": not a door; write doors such as "p(*,1)" (at the end of an alley) or '
        '"p(*,7)F" (beside it)',
    ),
    "door where a compartment is": (
        'at = "p(1,5)"',
        'at = "p(1,2)"',
        's.toml:30: compartments[0].at = "p(1,2)": lifts[1] is there already, on the near side; choose another '
        "side or position",
    ),
    "two lifts at one end": (
        'doors = ["p(*,2)N"]',
        'doors = ["p(*,B,9)"]',
        's.toml:21: lifts[1].doors[0] = "p(*,B,9)": the sill of lifts[0] is at p(3,9) already; put one lift at '
        "each end of an alley",
    ),
    "three doors on a floor": (
        'doors = ["p(*,2)N"]',
        'doors = ["p(*,2)N", "p(*,1)", "p(*,14)"]',
        's.toml:21: lifts[1].doors = ["p(*,2)N", "p(*,1)", "p(*,14)"]: 3 doors on floor 1; a lift has one or two',
    ),
    "two doors at one alley": (
        'doors = ["p(*,2)N"]',
        'doors = ["p(*,1)", "p(*,14)"]',
        's.toml:21: lifts[1].doors = ["p(*,1)", "p(*,14)"]: two doors on one alley; a lift stops at an alley once',
    ),
    "doors on one floor alone": (
        'doors = ["p(*,2)N"]',
        'doors = ["p(1,2)N"]',
        's.toml:21: lifts[1].doors = ["p(1,2)N"]: this lift would stop at floor 1 alone; a lift joins two floors '
        "or more",
    ),
    "doors of a lift that do not lie above each other": (
        'doors = ["p(*,B,9)"]',
        'doors = ["p(1,B,9)", "p(2,14)"]',
        's.toml:16: lifts[0].doors = ["p(1,B,9)", "p(2,14)"]: the alleys there lie across each other, and a lift '
        "does not turn; choose doors of alleys in one direction",
    ),
    "doors beside one alley that do not lie above each other": (
        'doors = ["p(*,2)N"]',
        'doors = ["p(1,2)N", "p(2,3)N"]',
        's.toml:21: lifts[1].doors = ["p(1,2)N", "p(2,3)N"]: not one above the other: that of floor 2 is off by '
        "2400 mm along and 0 mm across; change doors, the lengths of alleys, or lobby_mm, or leave the floor out",
    ),
    "lobby shorter than a carrier": (
        'doors = ["p(*,2)N"]',
        'doors = ["p(*,2)N"]\nlobby_mm = 1_500',
        "s.toml:22: lifts[1].lobby_mm = 1500: shorter than a carrier (2300 mm); make it larger, or carrier.length_mm "
        "smaller",
    ),
    "lobby of no length, at a lift whose floors are mistaken": (
        'doors = ["p(*,2)N"]',
        'doors = ["p(*,2)N"]\nlobby_mm = 2_500\nfloors = [2, 1]',
        "s.toml:23: lifts[1].floors = [2, 1]: not from the lowest to the highest; write [1, 2]",
    ),
    "lift to one floor": (
        'doors = ["p(*,2)N"]',
        'doors = ["p(*,2)N"]\nfloors = [1]',
        's.toml:21: lifts[1].doors = ["p(*,2)N"]: this lift would stop at floor 1 alone; a lift joins two floors '
        "or more",
    ),
    "spur longer than any": (
        "length = 2",
        "length = 200",
        "s.toml:25: spurs[0].length = 200: out of range; write a whole number from 1 to 127",
    ),
    "spur where an alley goes off": (
        'at = "p(*,12)"\n',
        'at = "p(*,7)"\n',
        's.toml:24: spurs[0].at = "p(*,7)": alleys[0] is there already, on the far side; choose another side or '
        "position",
    ),
    "spur into a compartment": (
        'at = "p(*,12)"\nlength = 2',
        'at = "p(*,10)"\nlength = 8',
        "s.toml:8: alleys: on floor 1 compartment Out lies on spur 192; move one, or make what is between them longer",
    ),
    "use that is none": (
        'use = "entry"',
        'use = "in"',
        's.toml:31: compartments[0].use = "in": unknown word; known here: both, entry, exit',
    ),
    "no exit": (
        'use = "exit"',
        'use = "entry"',
        's.toml:27: compartments: none for exit; write use = "exit", or none, at one of them',
    ),
    "no entry": (
        'use = "entry"',
        'use = "exit"',
        's.toml:27: compartments: none for entry; write use = "entry", or none, at one of them',
    ),
    "class without places": (
        'places = ["p(2,*,*)"]\n',
        "",
        's.toml:39: classes[0].places: no place of this class; write places such as "p(*,1-4)F"',
    ),
    "class of places that are not there": (
        'places = ["p(2,*,*)"]',
        'places = ["p(3,*)"]',
        's.toml:42: classes[0].places[0] = "p(3,*)": no such place; floors here: 1 to 2, positions 1 to 14',
    ),
    "class of a place where a compartment is": (
        'places = ["p(2,*,*)"]',
        'places = ["p(2,*,*)", "p(1,5)N"]',
        's.toml:42: classes[0].places[1] = "p(1,5)N": compartments[0] is there; name other places, or take it '
        "out of the list",
    ),
    "class of a place that is left out": (
        'positions = 14\n\n[[alleys]]\nname = "B"\nfrom = "p(*,7)"\npositions = 9\n',
        'positions = 14\nwithout = ["p(2,*,*)"]\n\n[[alleys]]\nname = "B"\nfrom = "p(*,7)"\npositions = 9\n',
        's.toml:43: classes[0].places[0] = "p(2,*,*)": left out by floors.without; name other places, or take it '
        "out of the list",
    ),
    "class of cars that do not come in": (
        "max_length_mm = 4_300",
        "max_length_mm = 6_000",
        "s.toml:41: classes[0].max_length_mm = 6000: no such car comes in: cars.max_length_mm is 5300; make one of "
        "both fit",
    ),
    "class of wider cars than come in": (
        "[[classes]]\n",
        "[cars]\nmax_width_mm = 1_900\n\n[[classes]]\nmax_width_mm = 2_000\n",
        "s.toml:43: classes[0].max_width_mm = 2000: no such car comes in: cars.max_width_mm is 1900; make one of "
        "both fit",
    ),
    "cars wider than their carrier": (
        "max_length_mm = 4_300",
        "max_width_mm = 2_350",
        "s.toml:41: classes[0].max_width_mm = 2350: wider than a carrier is long along the alley (2300 mm); make it "
        "smaller, or carrier.length_mm and the pitches larger",
    ),
    "place of two classes": (
        'places = ["p(2,*,*)"]',
        'places = ["p(2,*,*)"]\n\n[[classes]]\nname = "low"\nmax_height_mm = 1_600\nplaces = ["p(2,3-4)F"]',
        's.toml:47: classes[1].places[0] = "p(2,3-4)F": p(2,3)F is of class small; name it once',
    ),
    "charging by a word": (
        "max_length_mm = 4_300",
        'max_length_mm = 4_300\ncharging = "yes"',
        's.toml:42: classes[0].charging = "yes": is a text; write true or false',
    ),
    "home in a lobby": (
        'home = "p(192,2)"',
        'home = "p(5,1)"',
        's.toml:47: robots[0].home = "p(5,1)": the sill of lifts[1] is there; choose a segment where a robot may '
        "stand for ever",
    ),
    "home in a mouth": (
        'home = "p(192,2)"',
        'home = "p(1,7)"',
        's.toml:47: robots[0].home = "p(1,7)": the mouth of alleys[0] is there; choose a segment where a robot may '
        "stand for ever",
    ),
    "home on an alley that the floor has not": (
        'home = "p(192,2)"',
        'home = "p(1,C,2)"',
        's.toml:47: robots[0].home = "p(1,C,2)": no such segment; alleys of floor 1: its own, B',
    ),
    "floor lower than its cars": (
        "positions = 14",
        "positions = 14\n2.height_mm = 1_500",
        "s.toml:7: floors.2.height_mm = 1500: cars up to 2100 mm high may be put into p(2,1)N; put its places into "
        "a class of lower cars, or make it higher",
    ),
}


@pytest.mark.parametrize(("old", "new", "line"), ONE_MISTAKE.values(), ids=ONE_MISTAKE.keys())
def test_one_mistake_gives_one_line_and_no_other(old: str, new: str, line: str) -> None:
    assert BRANCHED.count(old) == 1
    assert problems_of(BRANCHED.replace(old, new)) == [line]


def test_the_base_of_these_tests_is_in_order() -> None:
    assert parse_site(BRANCHED, "s.toml").name == "forked"


def test_there_are_forty() -> None:
    assert len(ONE_MISTAKE) >= 40


def test_several_mistakes_are_told_at_once() -> None:
    text = BRANCHED.replace('from = "p(*,7)"', 'from = "p(*,70)"').replace('use = "entry"', 'use = "in"')
    text = text.replace("length = 2", "length = 0").replace('places = ["p(2,*,*)"]', 'places = ["p(9,*)"]')
    assert [line.split(":")[1] for line in problems_of(text)] == ["10", "25", "31", "42"]


def test_an_alley_that_is_mistaken_hides_only_what_is_said_of_it() -> None:
    """What names alley B is not judged, neither are tracks by number; all else is."""
    text = BRANCHED.replace("positions = 9", "positions = 900").replace('at = "p(1,5)"', 'at = "p(1,55)"')
    text = text.replace('doors = ["p(*,2)N"]', 'doors = ["p(*,22)N"]').replace('at = "p(*,12)"', 'at = "p(*,32)"')
    text = text.replace('places = ["p(2,*,*)"]', 'places = ["p(2,B,77)", "p(9,*)"]')
    assert [line.split(":")[1] for line in problems_of(text)] == ["11", "21", "24", "30", "42"]


def test_where_no_alley_hangs_on_a_sound_one_nothing_is_proved() -> None:
    """The only alley left hung by its lifts on a mistaken one: a traceback, and none of what was wrong."""
    twin = site_text("twin")
    assert [line.split(":")[2].strip() for line in problems_of(twin.replace("positions = 14", "positions = 0", 1))] == [
        "floors.positions = 0"
    ]


def test_what_is_proved_of_the_whole_is_told_beside_mistakes_that_say_nothing_of_the_ways() -> None:
    text = BRANCHED.replace("positions = 9", 'positions = 9\none_way = "rising"')
    text = text.replace("max_length_mm = 4_300", "max_length_mm = 43")
    text += '[[robots]]\nname = "MR2"\nnode = 12\nhome = "p(1,7)"\n[timing]\ncall_window_ms = 1\n'
    assert [line.split(":")[1] for line in problems_of(text)] == ["4", "42", "52", "54"]


STRAIGHT = """\
[site]
name = "straight"
[floors]
count = 2
positions = 12
[[lifts]]
name = "L"
node = 5
end = "left"
[[lifts]]
name = "R"
node = 6
end = "right"
[[compartments]]
name = "A"
node = 1
at = "p(1,4)"
[[robots]]
name = "MR1"
node = 11
home = "p(2,10)"
"""


def test_one_alley_a_floor_is_proved_too() -> None:
    parse_site(STRAIGHT, "s.toml")
    remedy = "join its alley by a lift or another end, or turn one_way"
    assert problems_of(STRAIGHT.replace("positions = 12", 'positions = 12\none_way = "rising"')) == [
        f"s.toml:3: floors: no way from an entry to p(1,1)N, p(1,2)N, p(1,3)N and 27 more; {remedy}",
        f"s.toml:3: floors: no way to an exit from p(1,5)N, p(1,6)N, p(1,7)N and 13 more; {remedy}",
    ]
    assert problems_of(STRAIGHT.replace("positions = 12", "positions = 12\n2.positions = 11")) == [
        's.toml:14: lifts[1].end = "right": not one above the other: that of floor 2 is off by '
        "2400 mm along and 0 mm across; change doors, the lengths of alleys, or lobby_mm, or leave the floor out"
    ]


@pytest.mark.parametrize("name", layout_names())
def test_a_layout_is_at_most_eighty_lines(name: str) -> None:
    lines = site_text(name).splitlines()
    assert len(lines) <= 80, f"{name}: {len(lines)} lines"
