import random
from collections import Counter
from itertools import combinations

import pytest

from onboard.contract.codes import Grade, LegAction, Side
from onboard.contract.messages import Itinerary, Leg, Stamp
from onboard.core.serial import to_bus_ms
from onboard.core.site import Segment
from onboard.systems.car_park.site import CarPark
from onboard.ways import lift_uses as lifts_module
from onboard.ways.lift_uses import are_compatible
from onboard.ways.lifts import platform
from onboard.ways.occupancy import itinerary_windows, lift_uses
from onboard.ways.reservations import FOREVER, Reservations, SlotWindow, Use
from onboard.ways.sipp import NoRoute, Route, Visit, free_flow_us, plan_route
from onboard.ways.site import WaySite
from tests.thinned import some
from tests.ways.buildings import LEFT, RIGHT, building
from tests.ways.exhaustive import AXIS, BUSY, PITCH_MM, TICK_US, Place
from tests.ways.exhaustive_lifts import GATE, Building, ExhaustiveLifts, Ridden, empty_run

PROBLEMS = 800
CHUNKS = 8
MYSELF = 11
OTHERS = (12, 13, 14)
TRACKS = (LEFT, RIGHT)


@pytest.fixture(autouse=True)
def _quick_gate(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lifts_module, "GATE_US", GATE * TICK_US)


def draw_uses(rng: random.Random, floors: int, lifts: tuple[int, ...]) -> tuple[Ridden, ...]:
    """Uses of others, one after the other; some leave the lift too little time, as in a mirror that is wrong."""
    uses: list[Ridden] = []
    for lift in lifts:
        begin = rng.randrange(20)
        for _ in range(rng.choice((0, 0, 1, 1, 2))):
            board, leave = rng.randint(1, floors), rng.randint(1, floors)
            until = begin + empty_run(leave - board) + rng.randint(1, 8)
            uses.append(Ridden(lift, board, leave, begin, until))
            begin = until + rng.randrange(25)
    if rng.random() < 0.05 and uses:
        uses[-1] = uses[-1]._replace(until=None)
    return tuple(uses)


def draw(rng: random.Random) -> Building:
    floors, length = rng.choice(((2, 3), (2, 4), (3, 3), (3, 4), (2, 7)))
    lifts = rng.choice(((0,), (1,), (0, 1), (0, 1)))
    segments: list[Place] = [(f, i) for f in range(1, floors + 1) for i in range(1, length + 1)]
    standing = rng.randint(1, floors), rng.randint(1, floors)
    start = rng.choice(segments)
    if rng.random() < 0.15:
        lift = rng.choice(lifts)
        start = standing[lift], (0, length + 1)[lift]
    held: list[tuple[Place, int, int | None]] = []
    for _ in range(rng.choice((0, 0, 2, 4, 6))):
        place = rng.choice(segments)
        begin = rng.randrange(8 if place == start and rng.random() < 0.9 else 0, BUSY - 1)
        held.append((place, begin, min(BUSY, begin + rng.randint(1, 12))))
    if rng.random() < 0.1:
        held.append((rng.choice(segments), rng.randrange(BUSY), None))
    visits = tuple(
        (rng.choice(segments), rng.randrange(7), rng.choice((0, 0, rng.randrange(BUSY))))
        for _ in range(rng.choice((0, 1, 1, 2, 2)))
    )
    refuges = frozenset(rng.sample(segments, rng.randint(1, len(segments))))
    half_body = rng.choice((1, 1, 1, 2, 3))
    uses = draw_uses(rng, floors, lifts)
    return Building(
        floors, length, lifts, half_body, tuple(held), uses, standing, start, rng.randrange(4), visits, refuges
    )


def site_of(problem: Building) -> CarPark:
    return building(
        problem.floors,
        problem.length,
        AXIS,
        pitch_mm=PITCH_MM,
        floor_mm=PITCH_MM,
        carrier_length_mm=problem.half_body * PITCH_MM - 4,
        clearance_mm=2,
        ends=tuple(TRACKS[lift] for lift in problem.lifts),
    )


def reserved(problem: Building) -> Reservations:
    reservations = Reservations()
    for number, (place, begin, end) in enumerate(problem.held):
        to_us = FOREVER if end is None else end * TICK_US
        reservations.reserve(OTHERS[number % 3], [SlotWindow(Segment(*place), begin * TICK_US, to_us)])
    for number, use in enumerate(problem.uses):
        owner = OTHERS[number % 3]
        to_us = FOREVER if use.until is None else use.until * TICK_US
        taken = Use(TRACKS[use.lift], use.board, use.leave, use.begin * TICK_US, to_us, owner)
        reservations.reserve(owner, [SlotWindow(platform(taken.lift_track), taken.from_us, to_us)], [taken])
    # My own windows and uses are no obstacle to me.
    mine = Use(TRACKS[problem.lifts[0]], 1, 1, 0, FOREVER, MYSELF)
    reservations.reserve(MYSELF, [SlotWindow(Segment(1, 1), 0, FOREVER)], [mine])
    return reservations


def plan(problem: Building, site: WaySite, reservations: Reservations) -> Route | NoRoute:
    visits = tuple(Visit(Segment(*place), dwell * TICK_US, early * TICK_US) for place, dwell, early in problem.visits)
    return plan_route(
        site,
        reservations,
        MYSELF,
        Segment(*problem.start),
        problem.start_tick * TICK_US,
        visits,
        frozenset(Segment(*place) for place in problem.refuges),
        100_000,
        {TRACKS[lift]: floor for lift, floor in enumerate(problem.standing)},
    )


def itinerary_of(route: Route, start: Segment, start_us: int) -> Itinerary:
    legs = [Leg(LegAction.STAND, start.track, start.index, start.index, Side.NEAR, to_bus_ms(start_us))]
    legs += [
        Leg(one.action, one.track, one.from_index, one.to_index, Side.NEAR, to_bus_ms(one.end_us)) for one in route.legs
    ]
    return Itinerary(MYSELF, 1, Grade.FIRM, Stamp(to_bus_ms(start_us), 1, 1), tuple(legs))


def check(problem: Building, site: WaySite, reservations: Reservations, route: Route) -> None:
    """What all other machines conclude from the itinerary conflicts with nothing; legs follow each other."""
    start, start_us = Segment(*problem.start), problem.start_tick * TICK_US
    itinerary = itinerary_of(route, start, start_us)
    windows, uses = itinerary_windows(site, itinerary, start_us), lift_uses(site, itinerary, start_us)
    assert reservations.conflicts(MYSELF, windows) == []
    for use in uses:
        others = [other for other in reservations.uses(use.lift_track, MYSELF) if other.to_us > start_us]
        # Where others leave each other too little time, it is not for me to mend that.
        if all(are_compatible(site, *pair) for pair in combinations(others, 2)):
            assert [other for other in others if not are_compatible(site, use, other)] == []
    for one, other in combinations(uses, 2):
        assert are_compatible(site, one, other)
    for lift in problem.lifts:
        occupied = [(w.from_us, w.to_us) for w in windows if w.segment == platform(TRACKS[lift])]
        ridden = [(use.from_us, use.to_us) for use in uses if use.lift_track == TRACKS[lift]]
        for from_us, to_us in occupied:
            assert any(begin <= from_us and to_us <= end for begin, end in ridden)
    here, now_us = start, start_us
    for leg in route.legs:
        assert leg.begin_us == now_us <= leg.end_us
        now_us = leg.end_us
        if leg.action is LegAction.RIDE:
            assert here == Segment(leg.from_index, 0 if leg.track == LEFT else problem.length + 1)
            here = Segment(leg.to_index, here.index)
        else:
            assert (leg.track, leg.from_index) == here
            here = Segment(leg.track, leg.to_index)
    assert here in problem.refuges


@pytest.mark.parametrize("chunk", some(range(CHUNKS), 3))
def test_no_plan_through_lifts_is_better(chunk: int) -> None:
    rng = random.Random(f"lifts {chunk}")
    outcomes: Counter[str] = Counter()
    for number in range(PROBLEMS // CHUNKS):
        problem = draw(rng)
        site, reservations = site_of(problem), reserved(problem)
        best = ExhaustiveLifts(problem).solve()
        route = plan(problem, site, reservations)
        if isinstance(route, NoRoute):
            assert best is None, (number, problem, best)
            outcomes["none"] += 1
            continue
        check(problem, site, reservations, route)
        rest_us = route.legs[-1].end_us if route.legs else problem.start_tick * TICK_US
        assert best is not None, (number, problem, route)
        assert (route.finish_us, rest_us) == (best[0] * TICK_US, best[1] * TICK_US), (number, problem, route)
        outcomes["rides" if any(leg.action is LegAction.RIDE for leg in route.legs) else "stays"] += 1
        if problem.visits:
            visits = tuple(Visit(Segment(*place), n * TICK_US, early * TICK_US) for place, n, early in problem.visits)
            bound_us = free_flow_us(site, Segment(*problem.start), problem.start_tick * TICK_US, visits)
            assert bound_us <= route.finish_us
            outcomes["delayed" if bound_us < route.finish_us else "free"] += 1
    least = min(outcomes[name] for name in ("none", "rides", "stays", "delayed", "free"))
    assert least >= PROBLEMS // CHUNKS // 25, outcomes
