"""Rows C01 and C23, from the bus: ways round what stands in the plane, and the picture that a person sees of it."""

from collections.abc import Sequence
from itertools import pairwise
from math import hypot
from statistics import median

import pytest

from bus_sim.systems.cell.show import plan
from onboard.contract.cell import ArmPhase, ArmProgress, PartAt
from onboard.contract.codes import CallResult
from onboard.contract.messages import Award, Bid, CallForProposals, Message
from onboard.systems.cell.geometry import Area, Point
from onboard.web.picture import LivePicture
from tests.cell.playing import Scene, cell, goal_demand
from tests.cell.witness import HOMES, arm, metres
from tests.cut import Timed, shown, shown_at
from tests.web.pictures import at

#: One robot, which carries a part from (4, 10) to (14, 10); a machine tool stands between, open below, or a wall.
ALONE, GOAL = (arm(1, (0, 0, 20, 20), (2, 10)),), goal_demand((4, 10), (14, 10))
TOOL, WALL = Area(6_000, 4_000, 10_000, 20_000), Area(6_000, -1_000, 10_000, 21_000)


def played(*obstacles: Area) -> list[Message]:
    scene = Scene(cell(GOAL, arms=ALONE, obstacles=obstacles), limit_s=120)
    assert scene.plant.violations == [] and scene.played.halted == []
    return [one for _, one in scene.played.messages]


def carried(said: Sequence[Message]) -> list[tuple[float, float]]:
    """Where the robot says that it is with the part, in turn; it goes straight from each word to the next, m."""
    words = [one for one in said if isinstance(one, ArmProgress) and one.arm_phase is ArmPhase.CARRYING]
    return list(dict.fromkeys((one.x_mm / 1000, one.y_mm / 1000) for one in words))


def is_through(way: Sequence[tuple[float, float]], tool: Area) -> bool:
    """Whether any of so many points on a way is inside a rectangle by more than 10 mm."""
    x0, y0, x1, y1 = (value / 1000 for value in tool)
    points = [
        (one[0] + (other[0] - one[0]) * part / 200, one[1] + (other[1] - one[1]) * part / 200)
        for one, other in pairwise(way)
        for part in range(201)
    ]
    return any(x0 + 0.01 < x < x1 - 0.01 and y0 + 0.01 < y < y1 - 0.01 for x, y in points)


def test_c01_c04_a_robot_goes_round_what_stands_in_its_plane_and_bids_for_that_way() -> None:
    """Straight where nothing stands there, round by the two corners where something does, not at all where none is."""
    straight = carried(played())
    assert is_through(straight, TOOL) and {y for _, y in straight} == {10}

    def check(said: Sequence[Message]) -> None:
        way = carried(said)
        assert way[:1] == [(4, 10)] and way[-1:] == [(14, 10)]
        assert {(6, 4), (10, 4)} <= set(way) and not is_through(way, TOOL)
        assert all(ALONE[0].area.contains(Point(round(1000 * x), round(1000 * y))) for x, y in way), "and in its area"
        cost = [one.cost for one in said if isinstance(one, Bid)]
        assert cost == [round(1000 * (2 + hypot(2, 6) + 4 + hypot(4, 6)))]
        put = [(one.x_mm, one.y_mm) for one in said if isinstance(one, PartAt) and not one.aboard]
        assert put[-1:] == [metres(14, 10)]

    shown(check, played(TOOL), ArmProgress, Bid, PartAt)

    def refused(said: Sequence[Message]) -> None:
        assert [one for one in said if isinstance(one, CallForProposals)]
        assert [one for one in said if isinstance(one, Award)][-1:] != []
        assert {one.result for one in said if isinstance(one, Award)} <= {CallResult.REOPENED, CallResult.REFUSED}
        assert not [one for one in said if isinstance(one, Bid)] and not carried(said)

    shown(refused, played(WALL), CallForProposals, Award)


def test_an_obstacle_that_reaches_beyond_all_areas_is_drawn() -> None:
    scene = Scene(cell(GOAL, arms=ALONE, obstacles=(WALL,)), limit_s=1)
    assert plan(scene.plant, scene.view).count("#") > 50


# --- what a person sees ----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def paper() -> Scene:
    """The paper's goal, once."""
    return Scene(cell())


def test_c23_the_page_shows_from_the_bus_alone_where_robots_and_part_are(paper: Scene) -> None:
    """A page fed with the frames so far, before and after each word of a robot: where it draws it, and the part."""
    site, truth = paper.site, paper.played.messages
    assert set(HOMES) == set(site.arms)

    def check(said: Sequence[Timed]) -> None:
        picture, heard = LivePicture(site), set(map(id, (one for _, one in said)))
        corners = {one["id"]: one["points"] for one in picture.layout()["plan"]["shapes"]}
        assert len(corners) == len(site.arms)
        (left, top), (right, _) = corners["a1"]
        area = site.arms[1].area
        unit = (area.x1_mm - area.x0_mm) / (right - left)

        def off_mm(word: ArmProgress, time_us: int) -> float:
            """How far from a robot's word it is drawn."""
            x, y = at(picture.snapshot()["machines"][word.sender]["path"], time_us)
            return hypot(area.x0_mm + (x - left) * unit - word.x_mm, area.y1_mm - (y - top) * unit - word.y_mm)

        lately: dict[int, list[ArmPhase]] = {}
        ahead_mm: list[float] = []
        for time_us, one in truth:
            if isinstance(one, ArmProgress):
                phases = lately.setdefault(one.sender, [])
                phases.append(one.arm_phase)
                if phases[-4:] == [ArmPhase.CARRYING] * 4:
                    ahead_mm.append(off_mm(one, time_us))
            if id(one) in heard:
                picture.feed(one, time_us)
            if isinstance(one, ArmProgress):
                assert off_mm(one, time_us) < 60
        # On the way it is drawn as going on: half a second beside its next word, as a rule.
        assert len(ahead_mm) > 10 and median(ahead_mm) < 600
        lines = [text for _, text in picture.snapshot()["events"]]
        for node in (1, 2, 3):
            assert f"R{node} has taken up part 1" in lines and f"R{node} has put down part 1" in lines
        ((part, spot),) = [(one["name"], one["at"]) for one in picture.snapshot()["things"] if one["kind"] == "part"]
        end = hypot(area.x0_mm + (spot[0] - left) * unit - 40_000, area.y1_mm - (spot[1] - top) * unit - 30_000)
        assert part == "1" and end < 60

    shown_at(check, truth, ArmProgress, PartAt)
