"""Buildings of more than an alley a floor: in the terminal, on the page, as a drawing; the highest floor first."""

import re
from xml.etree import ElementTree

import pytest

from bus_sim.cli import main
from bus_sim.sites import find_site, layout_names
from bus_sim.systems.car_park.show_plan import draw_plans
from onboard.config.site import parse_site
from onboard.contract.codes import DeskText, Side
from onboard.contract.messages import DeskOrder, Reference
from onboard.core.site import Station
from onboard.systems.car_park.building import draw
from onboard.systems.car_park.diagram import TrackDiagram
from onboard.systems.car_park.diagram import draw as draw_diagram
from onboard.systems.car_park.outlines import Outlines
from onboard.systems.car_park.scene import CarParkScene
from onboard.systems.car_park.site import car_park
from onboard.trace.view import SiteView


def test_the_terminal_shows_each_floor_with_who_is_there() -> None:
    site = car_park(find_site("twin"))
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


def test_a_branch_goes_off_to_the_side_on_which_it_is_written() -> None:
    outlines = Outlines(car_park(find_site("branch")))
    stem, way = outlines.track(3), outlines.track(1)
    assert stem.low == way.high, "it begins at the alley's edge"
    assert stem.high - stem.low == 10 * 2_400
    place = outlines.station(Station(1, 1, Side.FAR))
    assert (place.low, place.high - place.low, place.right - place.left) == (way.high, 5_400, 2_400)


@pytest.mark.parametrize("name", layout_names())
def test_nothing_lies_on_anything(name: str) -> None:
    outlines = Outlines(car_park(find_site(name)))
    site = outlines.site
    for level in outlines.levels:
        stations = [one for one in (*site.places, *site.compartments.values()) if site.level(one.track) == level]
        boxes = [*map(outlines.station, stations), *map(outlines.track, outlines.tracks_on(level))]
        boxes += [outlines.platform(lift) for lift in outlines.lifts_on(level)]
        for number, one in enumerate(boxes):
            assert not any(one.overlaps(other) for other in boxes[number + 1 :]), (name, level)


def test_the_page_is_told_where_everything_is() -> None:
    site = car_park(find_site("ring"))
    building = CarParkScene(site, SiteView(site)).layout()["building"]
    assert [level for level, _, _ in building["floors"]] == [2, 1]
    right, up, left, down = (building["lines"][number][2:] for number in (1, 3, 5, 7))
    assert (right, up, left, down) == ([1, 0], [0, -1], [-1, 0], [0, 1]), "y grows downwards"
    small = car_park(find_site("small"))
    assert CarParkScene(small, SiteView(small)).layout()["building"] is None


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


@pytest.mark.parametrize("name", ["level1", "standard"])
def test_a_straight_building_is_drawn_as_well(name: str) -> None:
    assert str(draw(car_park(find_site(name)))).endswith("</svg>\n")


def test_the_page_is_told_classes_places_to_charge_and_what_desks_show() -> None:
    site = car_park(find_site("sizes"))
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
    svg = str(draw_diagram(car_park(find_site("ring")), TrackDiagram(last_us=1_000_000), 0))
    floor = ["", ", alley B", ", alley C", ", alley D", ", lobby", ", lobby"]
    # Behind the panels of the floors come the lifts', which name their floors again.
    assert re.findall(r">((?:floor|lift) [^<]*)<", svg)[:15] == [
        *(f"floor 2{one}" for one in (*floor, ", spur 193")),
        *(f"floor 1{one}" for one in (*floor, ", spur 192")),
        "lift ER1",
    ]
