"""A way back yields to work, a move that makes room does not, and what is begun is told again."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from onboard.config.site import parse_site
from onboard.contract.codes import Criterion, Grade, KindCode, LegAction, Operation, Side
from onboard.contract.messages import CallForProposals, Itinerary, Progress, Reference, Stamp
from onboard.core.serial import BUS_MS_MODULUS
from onboard.core.site import Segment, Station
from onboard.systems.car_park.generation import CarParkGeneration
from onboard.systems.car_park.giving_way import YieldDecision
from onboard.systems.car_park.program import (
    CarHandling,
    CarStep,
    Program,
    StationWork,
    standing_itinerary,
    to_itinerary,
)
from onboard.systems.car_park.site import CarPark, car_park
from onboard.ways.mirror import WayMirror
from onboard.ways.refuges import open_refuges
from onboard.ways.retreats import AGES_AFTER_MS
from onboard.ways.sipp import Route, Visit, plan_route
from onboard.ways.site import way_site
from tests.kinds.test_giving_way import FIRST, MS, QUICK, SECOND, THIRD, Robot, robot, stand, travel
from tests.ways.lines import ALLEY, line_site

LINE = line_site(12, 10, QUICK, 10)
CALL = CallForProposals(
    1, 3, Reference(1, 9), Operation.RETRIEVE, KindCode.ROBOT, Criterion.FINISH_TIME, 1, 0, 1_000, 0, 0,
    Reference(1, 7), 2_700,
)  # fmt: skip


def work(index: int, begin_ms: int, end_ms: int) -> CarStep:
    done = StationWork(CarHandling.LEAVE, Station(ALLEY, index, Side.NEAR), Reference(1, 7), 2_700, CALL)
    return CarStep(LegAction.WORK, ALLEY, index, index, begin_ms * MS, end_ms * MS, done)


def empty(award_ms: int = 1, node: int = FIRST) -> Robot:
    """It works at 10 until 200 ms, then goes back to 3."""
    return robot(LINE, node, [work(10, 0, 200), travel(10, 3, 200, 290)], award_ms=award_ms)


def carrier(award_ms: int = 90, node: int = SECOND) -> Robot:
    """It works at 6 while the other would come by, and ends at 5."""
    steps = [travel(4, 6, 150, 180), work(6, 180, 400), travel(6, 5, 400, 420)]
    return robot(LINE, node, steps, award_ms=award_ms)


def test_a_way_back_yields_to_work_under_a_younger_stamp() -> None:
    back, busy = empty(), carrier()
    assert busy.hears(back.told()) is YieldDecision.NOTHING
    assert back.hears(busy.told()) is YieldDecision.ANEW


def test_work_does_not_yield_to_work_under_a_younger_stamp() -> None:
    first = robot(LINE, FIRST, [travel(10, 6, 150, 200), work(6, 200, 300), travel(6, 8, 300, 340)], award_ms=1)
    busy = carrier()
    assert busy.hears(first.told()) is YieldDecision.ANEW
    assert first.hears(busy.told()) is YieldDecision.NOTHING


def behind(award_ms: int = 90) -> Robot:
    """It works at 5 until 245 ms, where the empty one comes by right after that, and goes back the same way."""
    return robot(LINE, SECOND, [work(5, 100, 245), travel(5, 1, 245, 285)], award_ms=award_ms)


def test_of_two_ways_back_that_of_the_younger_stamp_goes_first() -> None:
    # Work under the younger stamp may have been planned on that; without it, the car waits or goes elsewhere.
    back, younger = empty(), behind()
    assert younger.hears(back.told()) is YieldDecision.NOTHING
    assert back.hears(younger.told()) is YieldDecision.ANEW


def done(award_ms: int = 1) -> Robot:
    """It has no work: it leaves 10 for 3 at 200 ms."""
    return robot(LINE, FIRST, [stand(10, 0, 200), travel(10, 3, 200, 290)], award_ms=award_ms)


def mover(award_ms: int = 90) -> Robot:
    """It has no work: it leaves 5 for 1 at 245 ms, right after the other two would come by."""
    return robot(LINE, SECOND, [stand(5, 0, 245), travel(5, 1, 245, 285)], award_ms=award_ms)


@pytest.mark.parametrize("award_ms", [1, 95])
def test_of_two_ways_back_that_of_whoever_works_still_goes_first(award_ms: int) -> None:
    idle, busy = done(award_ms), behind()
    assert busy.hears(idle.told()) is YieldDecision.NOTHING
    assert idle.hears(busy.told()) is YieldDecision.ANEW


@pytest.mark.parametrize("award_ms", [1, 50, 90])
@pytest.mark.parametrize("one", [empty, done])
@pytest.mark.parametrize("two", [carrier, behind, mover])
def test_of_two_that_meet_without_an_order_exactly_one_turns(
    one: Callable[[int], Robot], two: Callable[[int], Robot], award_ms: int
) -> None:
    mine, theirs = one(award_ms), two(50)
    answers = [mine.hears(theirs.told()), theirs.hears(mine.told())]
    assert sorted(answer.name for answer in answers) == ["ANEW", "NOTHING"]


def test_of_two_moves_without_work_the_one_in_front_goes_first_whatever_its_stamp() -> None:
    one, two = done(), mover()
    assert two.hears(one.told()) is YieldDecision.NOTHING
    assert one.hears(two.told()) is YieldDecision.ANEW


def test_of_two_moves_without_work_the_lower_stamp_keeps_its_windows() -> None:
    # Neither stands in the other's run: it leaves 2 for 6 while the other comes to 3.
    one = done()
    two = robot(LINE, SECOND, [stand(2, 0, 205), travel(2, 6, 205, 255)], award_ms=90)
    assert two.hears(one.told()) is YieldDecision.ANEW
    assert one.hears(two.told()) is YieldDecision.NOTHING


@pytest.mark.parametrize(("waited_ms", "yields"), [(AGES_AFTER_MS, True), (AGES_AFTER_MS + 1, False)])
@pytest.mark.parametrize("early_ms", [1, BUS_MS_MODULUS - 1_000])
@pytest.mark.parametrize("younger", [carrier, behind])
def test_a_way_back_that_has_waited_for_long_yields_no_more(
    waited_ms: int, yields: bool, early_ms: int, younger: Callable[[int], Robot]
) -> None:
    # Also where bus time wraps in between.
    late_ms = (early_ms + waited_ms) % BUS_MS_MODULUS
    back, busy = empty(early_ms), younger(late_ms)
    now_us = (early_ms + waited_ms) * MS
    for one in (back, busy):
        one.program.shift(now_us)
        one.fleet.mirror.on_itinerary(one.told(now_us), now_us)
    assert (back.hears(busy.told(now_us), now_us) is YieldDecision.ANEW) is yields
    assert (busy.hears(back.told(now_us), now_us) is YieldDecision.NOTHING) is yields


def test_who_clears_the_way_takes_the_stamp_of_whom_it_clears_for() -> None:
    # The idle one is in a dead end: it has to come past 6, where a third machine plans to work.
    idle = robot(LINE, FIRST, [stand(10, 0, 1)], award_ms=1)
    comes = robot(LINE, SECOND, [travel(12, 9, 500, 560), work(9, 560, 700), travel(9, 11, 700, 740)], award_ms=60)
    assert idle.hears(comes.told()) is YieldDecision.ANEW
    stamp = idle.giving_way.stamp_for(SECOND, 0)
    assert stamp == comes.program.stamp
    idle.program.replace([stand(10, 0, 200), travel(10, 3, 200, 290)], stamp)
    older, younger = carrier(50, THIRD), carrier(70, THIRD)
    for other, goes_on in ((older, False), (younger, True)):
        other.fleet.mirror.on_itinerary(comes.told(), 0)
        idle.fleet.mirror.on_itinerary(idle.told(), 0)
        assert (other.hears(idle.told()) is YieldDecision.ANEW) is goes_on
        idle.fleet.mirror.on_itinerary(other.told(), 0)
        assert (idle.giving_way.heed(THIRD, 0) is YieldDecision.ANEW) is not goes_on
        idle.fleet.mirror.on_itinerary(standing_itinerary(THIRD, 2, Stamp(0, 0, 0), Segment(ALLEY, 1), 0), 0)


def test_a_way_back_that_is_begun_is_told_again_and_goes_on() -> None:
    back, busy = empty(), carrier()
    busy.fleet.mirror.on_itinerary(back.told(), 0)
    back.program.over()
    begun = Progress(FIRST, back.program.version, back.program.leg, ALLEY, 10, 0, 0)
    for one in (back, busy):
        one.fleet.mirror.on_progress(begun)
    version = back.program.version
    assert back.hears(busy.told(), 199 * MS) is YieldDecision.LATER
    assert back.program.version != version
    busy.program.shift(0)
    assert back.hears(busy.told(), 199 * MS) is YieldDecision.NOTHING, "once, or they would answer each other for ever"
    assert busy.hears(back.told(), 199 * MS) is YieldDecision.ANEW


# --- the plan itself --------------------------------------------------------------------------------------------------

#: Three floors, a lift at either end: an empty machine leaves p(1,8) and would go by p(1,3) to the left one.
TWO_LIFTS = """
[site]
name = "two-lifts"
[floors]
count = 3
positions = 10
[[lifts]]
name = "LA"
node = 3
end = "left"
[[lifts]]
name = "LB"
node = 4
end = "right"
floors = [1, 2]
[[compartments]]
name = "In"
node = 1
at = "p(1,3)"
[[compartments]]
name = "Out"
node = 2
at = "p(1,8)"
[[robots]]
name = "RA"
node = 11
home = "p(2,3)"
[[robots]]
name = "RB"
node = 12
home = "p(3,4)"
"""
CARRIER, EMPTY = 11, 12
BESIDE = Segment(1, 2)


def two_lifts() -> CarPark:
    return car_park(parse_site(TWO_LIFTS, "two_lifts.toml"))


def way_back(site: CarPark, award_ms: int = 0, works_s: int = 30) -> Itinerary:
    """It works at p(1,8) for 30 s, then goes by the left lift to the third floor."""
    mirror = WayMirror(way_site(site), EMPTY)
    refuges = open_refuges(site, [Segment(2, 3)])
    visit = (Visit(Segment(1, 8), works_s * 1_000_000),)
    route = plan_route(site, mirror.reservations, EMPTY, Segment(1, 8), 0, visit, refuges, 4_000)
    assert isinstance(route, Route)
    steps = [CarStep(*leg[:4], leg.begin_us, leg.end_us) for leg in route.legs]
    return to_itinerary(EMPTY, 1, Grade.FIRM, Stamp(award_ms, 2, 1), steps)


def carrier_at(site: CarPark, plan: Itinerary, here: Segment = BESIDE) -> CarParkGeneration:
    """It stands at p(1,2), beside the car that is wanted one position away."""
    mirror = WayMirror(way_site(site), CARRIER)
    mirror.on_itinerary(standing_itinerary(CARRIER, 1, Stamp(0, 0, 0), here, 0), 0)
    mirror.on_itinerary(plan, 0)
    return CarParkGeneration(site, site.machines[CARRIER], mirror, Program(site, standing=here))


def fetch(deadline_ms: int = 1_000) -> CallForProposals:
    source, sink = Station(1, 2, Side.FAR), Station(1, 3, Side.NEAR)
    return replace(CALL, from_station=source.number, to_station=sink.number, deadline_ms=deadline_ms)


def test_a_car_beside_its_compartment_is_not_carried_around_an_empty_machine() -> None:
    site = two_lifts()
    plan = way_back(site)
    assert any(leg.action is LegAction.RIDE for leg in plan.legs)
    solution, _ = carrier_at(site, plan).solve(fetch(), 0, behind_bids=False)
    assert solution is not None
    works = [number for number, step in enumerate(solution.steps) if step.work is not None]
    carried = solution.steps[works[0] : works[1]]
    assert all(step.action is not LegAction.RIDE for step in carried)
    # 19.4 s to take the car, one position, 22.6 s to leave it.
    assert solution.finish_us < 1_150_000 + 50_000_000
    bid, _ = carrier_at(site, plan).solve(fetch(), 0)
    assert bid is not None and bid.finish_us > solution.finish_us, "who wins is found without that"


def test_a_car_is_not_parked_a_minute_later_because_two_ways_back_meet() -> None:
    # It stands at p(1,3)F at 64 s; the other's way back would come by as this one goes back, to the same lift.
    site = two_lifts()
    source, sink = Station(1, 3, Side.NEAR), Station(1, 3, Side.FAR)
    park = replace(fetch(), operation=Operation.PARK, from_station=source.number, to_station=sink.number)
    for works_s in (55, 60, 66, 70):
        carrier = carrier_at(site, way_back(site, works_s=works_s), Segment(2, 3))
        solution, _ = carrier.solve(park, 0, behind_bids=False)
        assert solution is not None and solution.finish_us // 1_000_000 == 64, works_s


def test_a_plan_counts_on_no_way_back_that_is_begun_or_has_aged() -> None:
    site = two_lifts()
    aged = way_back(site, award_ms=(1_000 - AGES_AFTER_MS - 1) % BUS_MS_MODULUS)
    solution, _ = carrier_at(site, aged).solve(fetch(), 0, behind_bids=False)
    free, _ = carrier_at(site, way_back(site)).solve(fetch(), 0, behind_bids=False)
    assert solution is not None and free is not None
    assert solution.finish_us > free.finish_us + 10_000_000
    begun = carrier_at(site, way_back(site))
    begun.mirror.on_progress(Progress(EMPTY, 1, 1, 1, 8, 0, 0))
    solution, _ = begun.solve(fetch(), 0, behind_bids=False)
    assert solution is not None and solution.finish_us > free.finish_us + 10_000_000


@pytest.mark.parametrize(("works_s", "finish_s"), [(25, 87), (40, 67)])
def test_a_way_back_is_not_asked_to_lose_far_more_than_the_work_gains(works_s: int, finish_s: int) -> None:
    # From floor 2: it would gain 21 s where the other loses 50 s, and gains 36 s where that loses 35 s.
    site = two_lifts()
    solution, _ = carrier_at(site, way_back(site, works_s=works_s), Segment(2, 3)).solve(fetch(), 0, behind_bids=False)
    assert solution is not None and solution.finish_us // 1_000_000 == finish_s
