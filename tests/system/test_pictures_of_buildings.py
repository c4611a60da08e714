"""Buildings of more than an alley a floor: in the terminal, on the page, as a drawing; the highest floor first."""

import re
from datetime import UTC, datetime
from functools import cache
from typing import NamedTuple
from xml.etree import ElementTree

import pytest
from rich.text import Text

from bus_sim.cli import main
from bus_sim.sites import find_site, layout_names
from bus_sim.systems.car_park.show import DayClock, draw_floor
from bus_sim.systems.car_park.show import draw as draw_picture
from bus_sim.systems.car_park.show_plan import draw_plans
from onboard.config.site import parse_site
from onboard.contract.codes import DeskText, Grade, KindCode, LegAction, Side
from onboard.contract.messages import DeskOrder, Itinerary, Leg, Progress, Reference, Stamp
from onboard.core.site import Segment, Station
from onboard.history.places import Place
from onboard.systems.car_park.building import draw
from onboard.systems.car_park.diagram import TrackDiagram
from onboard.systems.car_park.diagram import draw as draw_diagram
from onboard.systems.car_park.outlines import Outlines
from onboard.systems.car_park.scene import CarParkScene
from onboard.systems.car_park.site import CarPark, car_park
from onboard.trace.view import SiteView
from tests.web.test_contrast import contrast


@cache
def site_of(name: str) -> CarPark:
    """A shipped site, read and proved once for all tests here."""
    return car_park(find_site(name))


def shown(site: CarPark, width: int, height: int | None = None, view: SiteView | None = None) -> list[str]:
    """The terminal's picture of a site, before anything has happened unless a view is given."""
    clock = DayClock(datetime(2026, 1, 1, tzinfo=UTC))
    rows = draw_picture(site, view or SiteView(site), clock, "figures", width, height).renderables
    return [row.plain for row in rows if isinstance(row, Text)]


def test_the_terminal_shows_each_floor_with_who_is_there() -> None:
    site = site_of("twin")
    lines = [row.plain for row in draw_plans(site, SiteView(site), 112)]
    starts = [number for number, line in enumerate(lines) if line[:2].strip()]
    assert [lines[number][:2].strip() for number in starts] == ["3", "2", "1"]
    floors = ["\n".join(lines[one:other]) for one, other in zip(starts, [*starts[1:], len(lines)], strict=True)]
    assert ["MR2" in floors[0], "MR1" in floors[1]] == [True, True]
    assert floors[2].count("I/O") == 2
    assert floors[2].count("=") == 2, "both lifts stand at the lowest floor"
    # A column of a floor is one slot: two alleys of fourteen, and between them two lobbies of each lift.
    assert [len(re.findall(r"(?<!\S)\.(?!\S)", floor)) for floor in floors] == [
        2 * 14 + 4 - 1,
        2 * 14 + 4 - 1,
        2 * 14 + 4,
    ]


def test_the_terminal_puts_a_shaft_in_one_column_and_tells_which_way_an_alley_goes() -> None:
    lines = [row.plain for row in draw_plans(site_of("inline"), SiteView(site_of("inline")), 112)]
    alleys = [line for line in lines if line.count(".") > 12]
    middle = alleys[-1].rindex("=")
    assert [line[middle] for line in alleys] == [":", ":", ":", "="]
    ring = "".join(row.plain for row in draw_plans(site_of("ring"), SiteView(site_of("ring")), 112))
    assert [ring.count(tip) for tip in ">^<v"] == [2 * 12, 2 * 8, 2 * 11, 2 * 7]


def planned(name: str, leg: tuple[int, int, int], at: int) -> SiteView:
    """A site whose MR1 said that it is at an index of the leg in hand: track, from, to."""
    site = site_of(name)
    robot = next(one.node_id for one in site.machines.values() if one.name == "MR1")
    view = SiteView(site)
    drive = Leg(LegAction.TRAVEL, *leg, Side.NEAR, 60_000)
    view.feed(Itinerary(robot, 1, Grade.FIRM, Stamp(0, robot, 1), (drive,)), 0)
    view.feed(Progress(robot, 1, 0, leg[0], at, 0, 1_500), 1)
    return view


def test_the_terminal_shows_a_plan_along_its_way_from_where_the_robot_is() -> None:
    _, alley, _ = draw_floor(site_of("small"), planned("small", (2, 1, 6), 3), 2)
    assert alley.plain.split() == [":", ".", ".", "MR1", "*", "*", "*", ".", ".", ".", ".", ":"]
    lines = [row.plain for row in draw_plans(site_of("ring"), planned("ring", (1, 2, 6), 4), 112)]
    (line,) = [line for line in lines if "*" in line]
    assert line.split()[:6] == [">", ">", ">", "MR1", "*", "*"], "on a one-way alley too"
    (line,) = [line for line in shown(site_of("small"), 80, 9, planned("small", (2, 1, 6), 3)) if "*" in line]
    assert line.split()[4:8] == ["MR1", "*", "*", "*"], "where a floor has one line too"


@pytest.mark.parametrize(("name", "width", "height"), [("twin", 200, 40), ("vtc", 160, 50), ("hoboken", 80, 24)])
def test_floors_are_beside_each_other_where_that_shows_more_and_who_is_cut_has_its_number(
    name: str, width: int, height: int
) -> None:
    site = site_of(name)
    lines = shown(site, width, height)
    assert len(lines) == height
    assert all(len(line) <= width for line in lines[1:-3])
    robots = {one.name for one in site.machines.values() if one.kind is KindCode.ROBOT}
    picture = "\n".join(lines[1 : next(n for n, line in enumerate(lines) if "starting" in line or "bus" in line)])
    if height > 24:
        assert all(any(mark in picture for mark in (robot, robot[-2:])) for robot in robots), "all floors are there"
    assert lines[1][:5].strip().isdecimal()


def test_a_branch_goes_off_to_the_side_on_which_it_is_written() -> None:
    outlines = Outlines(site_of("branch"))
    stem, way = outlines.track(3), outlines.track(1)
    assert stem.low == way.high, "it begins at the alley's edge"
    assert stem.high - stem.low == 10 * 2_400
    place = outlines.station(Station(1, 1, Side.FAR))
    assert (place.low, place.high - place.low, place.right - place.left) == (way.high, 5_400, 2_400)


@pytest.mark.parametrize("name", layout_names())
def test_nothing_lies_on_anything(name: str) -> None:
    outlines = Outlines(site_of(name))
    site = outlines.site
    for level in outlines.levels:
        stations = [one for one in (*site.places, *site.compartments.values()) if site.level(one.track) == level]
        boxes = [*map(outlines.station, stations), *map(outlines.track, outlines.tracks_on(level))]
        boxes += [outlines.platform(lift) for lift in outlines.lifts_on(level)]
        for number, one in enumerate(boxes):
            assert not any(one.overlaps(other) for other in boxes[number + 1 :]), (name, level)


def test_the_page_is_told_where_everything_is() -> None:
    site = site_of("ring")
    building = CarParkScene(site, SiteView(site)).layout()["building"]
    assert [level for level, _, _ in building["floors"]] == [2, 1]
    right, up, left, down = (building["lines"][number][2:] for number in (1, 3, 5, 7))
    assert (right, up, left, down) == ([1, 0], [0, -1], [-1, 0], [0, 1]), "y grows downwards"
    # On each of two floors three more alleys, one with mouths at both ends, two lobbies and a spur.
    assert len(building["links"]) == 2 * (4 + 2 + 1)
    assert [7, 8, 1, 1] in building["links"], "D ends at the first position"
    small = site_of("small")
    layout = CarParkScene(small, SiteView(small)).layout()
    assert layout["building"] is None
    assert (layout["heights_mm"], set(layout["shifts"].values())) == ({1: 0, 2: 2_500, 3: 5_000}, {0})


RIGHT = """
[site]
name = "right"
[floors]
count = 2
positions = 9
[floors.1]
height_mm = 4000
[floors.2]
positions = 6
[[lifts]]
name = "LR"
node = 5
end = "right"
[[compartments]]
name = "IOC1"
node = 1
at = "p(1,4)"
use = "exit"
[[compartments]]
name = "IOC2"
node = 2
at = "p(1,5)"
[[robots]]
name = "MR1"
node = 11
home = "p(2,2)"
"""


def test_alleys_of_different_lengths_meet_at_the_shaft_that_joins_them() -> None:
    """On the page and in the terminal, where the shaft is at their right ends; floors as far apart as they are high."""
    site = car_park(parse_site(RIGHT, "r.toml"))
    layout = CarParkScene(site, SiteView(site)).layout()
    assert (layout["shifts"], layout["heights_mm"]) == ({1: 0, 2: 3}, {1: 0, 2: 4_000})
    assert layout["bay_uses"] == {1: "exit"}
    lines = shown(site, 100)
    low, high = (next(line for line in lines if mark in line) for mark in ("=", "MR1"))
    assert low.index("=") == high.rindex(":")


def test_a_place_is_told_by_the_lift_or_the_mouth_and_by_no_position_beyond_an_end() -> None:
    site = site_of("twin")
    view = SiteView(site)
    scene = CarParkScene(site, view)
    for at, where in ((Segment(7, 2), "in ER1"), (Segment(7, 0), "p(1,3)"), (Segment(1, 3), "p(1,3)")):
        view.history.places.by_node[11] = Place(at, 0, 0, 0)
        assert scene.machine(11, 0)["where"] == where


def test_a_drawing_is_svg_with_the_highest_floor_first(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sites", "inline", "--draw", "-"]) == 0
    root = ElementTree.fromstring(capsys.readouterr().out)
    words = [
        (element.text or "", float(element.get("y", "0"))) for element in root.iter() if element.tag.endswith("text")
    ]
    heads = sorted((y, text) for text, y in words if re.fullmatch(r"floor \d, .*", text))
    assert [text for _, text in heads] == ["floor 4, 8 m", "floor 3, 5.5 m", "floor 2, 2.5 m", "floor 1, 0 m"]
    assert {"Mid", "Fast", "Street", "Roof", "MR1", "MR2"} <= {text for text, _ in words}


SKIPPING = """
[site]
name = "skipping"
[floors]
count = 5
positions = 9
[floors.1]
height_mm = 4000
[floors.3]
height_mm = 2200
[[lifts]]
name = "Odd"
node = 5
end = "left"
floors = [1, 3, 5]
[[lifts]]
name = "Mid"
node = 6
doors = ["p(2-4,5)F"]
floors = [2, 3, 4]
[[compartments]]
name = "IOC1"
node = 1
at = "p(1,4)"
[[robots]]
name = "MR1"
node = 11
home = "p(2,2)"
"""


def test_floors_lie_as_high_as_the_file_says_though_no_lift_joins_one_to_the_next() -> None:
    svg = str(draw(car_park(parse_site(SKIPPING, "s.toml"))))
    heads = re.findall(r"floor \d, [^<]*", svg)
    assert heads == ["floor 5, 11.2 m", "floor 4, 8.7 m", "floor 3, 6.5 m", "floor 2, 4 m", "floor 1, 0 m"]
    # What is written on an alley is written over the way to its lift.
    assert svg.index(">p(5,1)<") > svg.index("floor 5, 11.2 m")
    assert 'fill="#e4e4e4"' not in svg[svg.index(">p(5,1)<") : svg.index("floor 4, 8.7 m")]


class Words(NamedTuple):
    """What is written in a drawing, and where: left, top, right, bottom, px."""

    words: str
    fill: str
    box: tuple[float, float, float, float]


def written(root: ElementTree.Element) -> list[Words]:
    """All texts of a drawing; a letter is 0.58 of its height wide, as DejaVu Sans has it."""
    found = []
    for one in root.iter("{http://www.w3.org/2000/svg}text"):
        x, y, size = float(one.get("x", "0")), float(one.get("y", "0")), float(one.get("font-size", "11"))
        words, wide = one.text or "", 0.58 * size * len(one.text or "")
        before = {"start": 0.0, "middle": wide / 2, "end": wide}[one.get("text-anchor", "start")]
        box = (x - before, y - 0.75 * size, x - before + wide, y)
        if one.get("transform") is not None:
            box = (x - 0.75 * size, y - before, x, y - before + wide)
        found.append(Words(words, one.get("fill", ""), box))
    return found


def areas(root: ElementTree.Element, fill: str) -> list[tuple[float, float, float, float]]:
    """Rectangles of one colour."""
    found = []
    for one in root.iter("{http://www.w3.org/2000/svg}polygon"):
        if one.get("fill") == fill:
            points = [[float(part) for part in point.split(",")] for point in one.get("points", "").split()]
            xs, ys = zip(*points, strict=True)
            found.append((min(xs), min(ys), max(xs), max(ys)))
    return found


def meet(one: tuple[float, ...], other: tuple[float, ...]) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]


def is_within(one: tuple[float, ...], other: tuple[float, ...]) -> bool:
    return one[0] >= other[0] and one[1] >= other[1] and one[2] <= other[2] and one[3] <= other[3]


#: Twenty machines with the longest names, narrow slots, a spur of one segment that is a home, a class by a long name.
NARROW = """
[site]
name = "narrow"
[floors]
count = 2
positions = 40
pitch_mm = 1200
[carrier]
length_mm = 1100
[[lifts]]
name = "Lift_by_the_wall"
node = 5
end = "left"
[[lifts]]
name = "Lift_by_the_tree"
node = 6
doors = ["p(*,2)F"]
[[spurs]]
at = "p(*,10)"
[[compartments]]
name = "Bay_to_the_south"
node = 1
at = "p(1,4)"
use = "exit"
[[compartments]]
name = "In"
node = 2
at = "p(1,5)"
[[classes]]
name = "small ones of the neighbours"
max_length_mm = 4000
charging = true
places = ["p(2,20-40)"]
[[robots]]
name = "Robot_number_one"
node = 11
home = "p(192,1)"
[[robots]]
name = "R2"
node = 12
home = "p(2,15)"
"""


@pytest.mark.parametrize("name", [*layout_names(), "level1", "small", "standard", "large", "narrow"])
def test_what_is_written_can_be_read(name: str) -> None:
    """Nothing is clipped or lies on other words; white names lie wholly on dark bodies."""
    site = parse_site(NARROW, "n.toml") if name == "narrow" else site_of(name)
    root = ElementTree.fromstring(str(draw(car_park(site))))
    whole = (0.0, 0.0, float(root.get("width", "0")), float(root.get("height", "0")))
    words, bodies = written(root), areas(root, "#404040")
    assert [one for one in words if not is_within(one.box, whole)] == []
    met = [
        (one.words, other.words)
        for number, one in enumerate(words)
        for other in words[number + 1 :]
        if meet(one.box, other.box)
    ]
    assert met == []
    white = [one for one in words if one.fill == "#ffffff"]
    assert all(any(is_within(one.box, body) for body in bodies) for one in white)
    assert not [one for one in words if one not in white and any(meet(one.box, body) for body in bodies)]
    assert {machine.name for machine in site.machines.values()} <= {one.words for one in words}


def test_a_drawing_has_the_contrast_that_its_readers_need() -> None:
    """Lines 3:1 on paper and on ways, words 4.5:1 (WCAG 2.2); thin ones only part what other lines bound."""
    for name in ("ring", "sizes"):
        root = ElementTree.fromstring(str(draw(site_of(name))))
        lines = {one.get("stroke", "") for one in root.iter() if float(one.get("stroke-width", "0")) >= 1} - {None}
        weak = {line for line in lines - {"#ffffff", "#e4e4e4", ""} if contrast(line, "#ffffff") < 3}
        inside = {"#7a7a7a", "#00835F", "#0072B2", "#000000"}
        assert weak | {line for line in inside & lines if contrast(line, "#e4e4e4") < 3} == set()
        fills = {one.fill for one in written(root)}
        assert {fill for fill in fills - {"#ffffff"} if contrast(fill, "#ffffff") < 4.5} == set()
        assert contrast("#444444", "#e4e4e4") >= 4.5
        assert contrast("#ffffff", "#404040") >= 4.5


def test_a_drawing_tells_alleys_doors_turns_uses_and_classes() -> None:
    twin, sizes = (str(draw(site_of(name))) for name in ("twin", "sizes"))
    # On three floors two lifts with a door to each alley, and a sign of it in the head.
    assert twin.count('stroke="#0072B2" stroke-width="6"') == 3 * 2 * 2
    assert twin.count(">B<") == 3, "the alley by the name that the file gives it"
    assert twin.count("<circle") == 3 * 4 + 1
    assert (twin.count(">in only<"), twin.count(">out only<")) == (1, 1)
    assert ">charging: to 5300 mm long, 1800 mm high, 2050 mm wide, 3000 kg, to charge<" in sizes
    # A place has the number of its class, whatever its colour.
    assert [sizes.count(f">{number}<") for number in (1, 2, 3)] == [24 + 1, 30 + 1, 6 + 1]


def test_the_page_is_told_classes_places_to_charge_and_what_desks_show() -> None:
    site = site_of("sizes")
    scene = CarParkScene(site, SiteView(site))
    layout = scene.layout()
    (plug,) = [number for number, one in enumerate(site.classes, start=1) if one.charging]
    assert set(layout["charging"]) == {place for place, number in site.place_class.items() if number == plug}
    assert {layout["classes"][place] for place in layout["charging"]} == {"charging"}
    assert set(layout["classes"]) == set(site.place_class)
    bay = next(iter(site.compartments))
    scene.feed_device(bay, DeskOrder(bay, 1, DeskText.NO_CHARGING, Reference(0, 0)), 0)
    assert scene.machine(bay, 0)["desk"] == "no charging"


def test_a_diagram_names_its_panels_as_the_site_file_does() -> None:
    svg = str(draw_diagram(site_of("ring"), TrackDiagram(last_us=1_000_000), 0))
    floor = ["", ", alley B", ", alley C", ", alley D", ", lobby", ", lobby"]
    # Behind the panels of the floors come the lifts', which name their floors again.
    assert re.findall(r">((?:floor|lift) [^<]*)<", svg)[:15] == [
        *(f"floor 2{one}" for one in (*floor, ", spur 193")),
        *(f"floor 1{one}" for one in (*floor, ", spur 192")),
        "lift ER1",
    ]
