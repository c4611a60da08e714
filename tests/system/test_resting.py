"""Where robots with nothing to do wait: in the nearest refuge, or where the next call is likely (``rest_at``)."""

from dataclasses import replace
from functools import cache

from onboard.config.site import parse_site
from onboard.contract.codes import Grade, LegAction, TaskPhase
from onboard.contract.messages import Itinerary, Progress, TaskReport
from onboard.core.site import Segment
from onboard.systems.car_park.site import CarPark, RestAt, car_park
from onboard.trace.indicators import FleetIndicators, Indicators
from onboard.ways.occupancy import final_position
from tests.system.scene import Scene, play, stays

MR1, MR2 = 11, 12
SPUR = Segment(192, 1)

TEXT = """
[site]
name = "resting"
[floors]
count = 3
positions = 10
[[compartments]]
name = "IOC1"
node = 1
at = "p(1,4)"
[[lifts]]
name = "ER1"
node = 5
end = "left"
[[spurs]]
at = "p(1,6)"
[[robots]]
name = "MR1"
node = 11
home = "p(2,8)"
[[robots]]
name = "MR2"
node = 12
home = "p(3,8)"
"""


@cache
def site(rest_at: RestAt) -> CarPark:
    return replace(car_park(parse_site(TEXT, "resting.toml")), rest_at=rest_at)


@cache
def scene(rest_at: RestAt, *times_s: tuple[float, float | None]) -> Scene:
    found = play(site(rest_at), stays(*times_s), limit_s=900)
    found.assert_sound()
    return found


def plans(found: Scene, node: int) -> list[tuple[int, Itinerary]]:
    """A robot's firm itineraries that lead anywhere."""
    told = [(us, one) for us, one in found.all(Itinerary, "fleet") if (one.sender, one.grade) == (node, Grade.FIRM)]
    return [(us, one) for us, one in told if any(leg.action is not LegAction.STAND for leg in one.legs)]


def ends(found: Scene, node: int, before_us: int) -> list[Segment | None]:
    """Where its plans end, in order, those told before a time."""
    return [final_position(car_park(found.simulation.site), one) for us, one in plans(found, node) if us < before_us]


def test_a_robot_goes_where_the_first_call_is_likely_and_the_next_one_where_the_second_is() -> None:
    found = scene(RestAt.DEMAND, (120, None))
    assert ends(found, MR1, 100_000_000) == [SPUR], "the lower node-ID chooses first, once"
    assert ends(found, MR2, 100_000_000) == [Segment(2, 2)], "of what is left the refuge nearest to the compartment"
    assert all(one.stamp.initiator == one.sender for us, one in plans(found, MR1) if us < 100_000_000)
    assert next(one for _, one in plans(scene(RestAt.NEAREST, (120, None)), MR1)).stamp.initiator == 1, "only for work"


def loaded_us(found: Scene) -> int:
    """When the first car was taken."""
    return min(us for us, one in found.all(TaskReport, "fleet") if one.phase is TaskPhase.LOADED)


def indicators(found: Scene) -> FleetIndicators:
    """What the summary says of the robots."""
    told = Indicators(found.simulation.site)
    for said in found.said:
        if said.bus == "fleet":
            told.feed(said.message, said.time_us)
    return told.figures(found.said[-1].time_us)


def test_whoever_comes_first_is_served_sooner_and_the_way_there_is_counted_apart() -> None:
    near, far = scene(RestAt.DEMAND, (120, None)), scene(RestAt.NEAREST, (120, None))
    assert loaded_us(near) < loaded_us(far)
    # Eight positions to the platform, six from there to the mouth, the spur; eight to the other's platform, two off it.
    ways_m = indicators(near).robots_resting_mm / 1000
    assert ways_m == (8 + 6 + 1 + 8 + 2) * 2.4
    assert f"{ways_m:,.0f} m to wait elsewhere" in "\n".join(indicators(near).lines())
    assert indicators(far).robots_resting_mm == 0
    assert "elsewhere" not in "\n".join(indicators(far).lines())


def test_a_robot_on_its_way_to_wait_elsewhere_takes_a_call_and_drops_the_move() -> None:
    found = scene(RestAt.DEMAND, (4, None))
    (idle_us, idle), (work_us, work) = plans(found, MR1)[:2]
    assert final_position(car_park(found.simulation.site), idle) == SPUR
    assert not any(leg.action is LegAction.WORK for leg in idle.legs)
    assert any(leg.action is LegAction.WORK for leg in work.legs)
    assert work_us < idle_us + (idle.legs[-1].end_ms - idle.stamp.award_ms) * 1000, "before it would have been there"
    on_the_way = [one for us, one in found.all(Progress, "fleet") if one.sender == MR1 and us < loaded_us(found)]
    assert on_the_way and all(one.track != SPUR.track for one in on_the_way)
