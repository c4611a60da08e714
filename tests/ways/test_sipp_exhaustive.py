import random
from collections import Counter

import pytest

from onboard.contract.codes import Grade, LegAction, Side
from onboard.contract.messages import Itinerary, Leg, Stamp
from onboard.core.serial import to_bus_ms
from onboard.core.site import Segment
from onboard.ways.occupancy import itinerary_windows
from onboard.ways.reservations import FOREVER, Reservations, SlotWindow
from onboard.ways.sipp import NoRoute, Route, Visit, free_flow_us, plan_route
from tests.thinned import some
from tests.ways.exhaustive import AXIS, BUSY, PITCH_MM, TICK_US, Exhaustive, Place, Problem
from tests.ways.lines import line_site

PROBLEMS = 4_000
CHUNKS = 8
MYSELF = 11
OTHERS = (12, 13, 14)


def draw(rng: random.Random) -> Problem:
    length = rng.randint(2, 6)
    spur_at = rng.randint(1, length) if rng.random() < 0.3 else None
    places: list[Place] = [(1, i) for i in range(1, length + 1)]
    if spur_at is not None:
        places += [(192, 1), (192, 2)]
    start = rng.choice(places)
    held: list[tuple[Place, int, int | None]] = []
    for _ in range(rng.choice((0, 2, 4, 6, 9))):
        place = rng.choice(places)
        # Mostly the start is left alone at first: a problem without a first step shows little.
        begin = rng.randrange(8 if place == start and rng.random() < 0.9 else 0, BUSY - 1)
        held.append((place, begin, min(BUSY, begin + rng.randint(1, 12))))
    if rng.random() < 0.2:
        held.append((rng.choice(places), rng.randrange(BUSY), None))
    visits = tuple(
        (rng.choice(places), rng.randrange(7), rng.choice((0, 0, rng.randrange(BUSY))))
        for _ in range(rng.choice((0, 1, 1, 2, 2, 2, 3)))
    )
    refuges = frozenset(rng.sample(places, rng.randint(min(2, len(places)), len(places))))
    half_body = rng.choice((1, 1, 1, 1, 2, 3))
    start_tick, turn = rng.randrange(4), rng.choice((0, 1, 4)) if spur_at is not None else 0
    return Problem(length, half_body, spur_at, tuple(held), start, start_tick, visits, refuges, turn)


def plan(problem: Problem) -> tuple[Route | NoRoute, int]:
    """The planner's answer, checked as a plan, and the free-flow bound."""
    body_mm = problem.half_body * PITCH_MM  # carrier and clearance share it, to have both in play
    site = line_site(problem.length, PITCH_MM, AXIS, body_mm - 4, 2, problem.spur_at, 2, problem.turn * TICK_US)
    reservations = Reservations()
    for number, (place, begin, end) in enumerate(problem.held):
        to_us = FOREVER if end is None else end * TICK_US
        reservations.reserve(OTHERS[number % 3], [SlotWindow(Segment(*place), begin * TICK_US, to_us)])
    # My own windows are no obstacle to me.
    reservations.reserve(MYSELF, [SlotWindow(Segment(*problem.start), 0, FOREVER)])
    start, start_us = Segment(*problem.start), problem.start_tick * TICK_US
    visits = tuple(Visit(Segment(*place), dwell * TICK_US, early * TICK_US) for place, dwell, early in problem.visits)
    refuges = frozenset(Segment(*place) for place in problem.refuges)
    route = plan_route(site, reservations, MYSELF, start, start_us, visits, refuges, 100_000)
    if isinstance(route, Route):
        check(problem, route)
        legs = tuple(
            Leg(one.action, one.track, one.from_index, one.to_index, Side.NEAR, to_bus_ms(one.end_us))
            for one in route.legs or ()
        )
        itinerary = Itinerary(MYSELF, 1, Grade.FIRM, Stamp(to_bus_ms(start_us), 1, 1), legs)
        assert reservations.conflicts(MYSELF, itinerary_windows(site, itinerary, start_us)) == []
    return route, free_flow_us(site, start, start_us, visits)


def check(problem: Problem, route: Route) -> None:
    """Legs follow each other in place and time, make the visits in order and end in a refuge."""
    here, now = problem.start, problem.start_tick * TICK_US
    due = list(problem.visits)
    for leg in route.legs:
        assert leg.begin_us == now and leg.end_us >= now
        now = leg.end_us
        if leg.action is LegAction.WORK:
            place, dwell, early = due.pop(0)
            assert place == here and leg.begin_us >= early * TICK_US and leg.end_us - leg.begin_us == dwell * TICK_US
            assert route.visit_ends_us[len(problem.visits) - len(due) - 1] == leg.end_us
        if leg.action is LegAction.TRAVEL and leg.track != here[0]:
            assert leg.from_index == leg.to_index
        else:
            assert (leg.track, leg.from_index) == here
        here = (leg.track, leg.to_index)
    assert not due
    assert here in problem.refuges


@pytest.mark.parametrize("chunk", some(range(CHUNKS), 3))
def test_no_plan_of_all_that_there_are_is_better(chunk: int) -> None:
    rng = random.Random(f"sipp {chunk}")
    outcomes: Counter[str] = Counter()
    for number in range(PROBLEMS // CHUNKS):
        problem = draw(rng)
        best = Exhaustive(problem).solve()
        route, bound_us = plan(problem)
        if isinstance(route, NoRoute):
            assert best is None, (number, problem, best)
            outcomes["none"] += 1
            continue
        rest_us = route.legs[-1].end_us if route.legs else problem.start_tick * TICK_US
        assert best is not None, (number, problem, route)
        assert (route.finish_us, rest_us) == (best[0] * TICK_US, best[1] * TICK_US), (number, problem, route)
        if problem.visits:
            assert bound_us <= route.finish_us
            assert problem.held or bound_us == route.finish_us
            outcomes["delayed" if route.finish_us > bound_us else "free"] += 1
    # A test that met only easy problems would prove nothing.
    assert min(outcomes["none"], outcomes["delayed"], outcomes["free"]) >= PROBLEMS // CHUNKS // 8, outcomes


def test_whoever_ends_the_last_visit_later_may_still_pass_the_first_on_the_way_to_the_refuge() -> None:
    # Who works at p(1,5) first has to flee to p(1,1), is back in the spur's mouth at 42 and too late: it closes at 45.
    # Who lets the others pass and works after them is in the mouth at 39.
    held = (((1, 6), 6, 16), ((1, 5), 14, 30), *(((1, i), 18, 30) for i in (2, 3, 4)), ((1, 6), 45, None))
    problem = Problem(7, 1, 6, held, (1, 7), 0, (((1, 5), 2, 0),), frozenset({(192, 1)}))
    assert Exhaustive(problem).solve() == (35, 43)
    route, _ = plan(problem)
    assert isinstance(route, Route)
    assert (route.finish_us, route.legs[-1].end_us) == (35 * TICK_US, 43 * TICK_US)
