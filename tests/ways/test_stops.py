"""What the search leaves out never costs anything: the same plans with and without, on alleys long enough to matter."""

import random

import pytest

from onboard.core.site import Segment
from onboard.systems.car_park.site import CarPark
from onboard.ways import stops
from onboard.ways.occupancy import itinerary_windows, lift_uses
from onboard.ways.reservations import Reservations
from onboard.ways.roads import roads_of
from onboard.ways.sipp import Route, Visit, plan_route
from onboard.ways.site import Axis, WaySite
from onboard.ways.stops import settling_segments
from tests.ways.buildings import building
from tests.ways.exhaustive import AXIS, PITCH_MM, TICK_US
from tests.ways.lines import ALLEY
from tests.ways.test_sipp_lifts import itinerary_of

FLOORS, LENGTH = 3, 14
BOUND = 100_000


def site_of(half_body: int = 1) -> CarPark:
    return building(
        FLOORS,
        LENGTH,
        AXIS,
        pitch_mm=PITCH_MM,
        floor_mm=PITCH_MM,
        carrier_length_mm=half_body * PITCH_MM,
    )


def somewhere(rng: random.Random) -> Segment:
    return Segment(rng.randint(1, FLOORS), rng.randint(1, LENGTH))


def problem(rng: random.Random, site: WaySite) -> tuple[Reservations, Segment, tuple[Visit, ...], frozenset[Segment]]:
    """Plans of up to three others, made one after the other, and a query."""
    reservations = Reservations()
    starts = [Segment(floor, rng.randint(2, LENGTH - 1)) for floor in rng.sample(range(1, FLOORS + 1), 3)]
    for node, start in enumerate(starts[: rng.randint(1, 2)], start=12):
        refuges = frozenset(Segment(start.track, index) for index in range(2, LENGTH))
        visits = tuple(Visit(somewhere(rng), rng.randrange(20) * TICK_US) for _ in range(2))
        begin_us = rng.randrange(20) * TICK_US
        route = plan_route(site, reservations, node, start, begin_us, visits, refuges, BOUND)
        if isinstance(route, Route):
            plan = itinerary_of(route, start, begin_us)
            windows, uses = itinerary_windows(site, plan, 0), lift_uses(site, plan, 0)
            reservations.reserve(node, windows, [use._replace(owner=node) for use in uses])
    visits = tuple(Visit(somewhere(rng), rng.randrange(20) * TICK_US) for _ in range(rng.randint(1, 2)))
    return reservations, starts[2], visits, frozenset(somewhere(rng) for _ in range(8))


@pytest.mark.parametrize("chunk", range(4))
def test_every_plan_ends_as_early_as_with_stops_everywhere(chunk: int, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = random.Random(f"stops {chunk}")
    shorter = delayed = 0
    for number in range(30):
        site = site_of(rng.choice((1, 1, 2)))
        reservations, start, visits, refuges = problem(rng, site)
        pruned = plan_route(site, reservations, 11, start, 0, visits, refuges, BOUND)
        with monkeypatch.context() as patch:
            patch.setattr(stops, "settling_segments", lambda roads, track: LENGTH + 2)
            reservations.kept.clear()
            whole = plan_route(site, reservations, 11, start, 0, visits, refuges, BOUND)
        shorter += pruned.expansions < whole.expansions
        if isinstance(whole, Route):
            assert isinstance(pruned, Route), number
            assert pruned.visit_ends_us[-1] == whole.visit_ends_us[-1], number
            assert pruned.legs[-1].end_us == whole.legs[-1].end_us, number
            delayed += any(leg.action.name == "STAND" for leg in whole.legs)
    assert shorter >= 3 and delayed >= 4, (shorter, delayed)


@pytest.mark.parametrize(
    ("axis", "half_body", "segments"),
    [
        (AXIS, 1, 2),  # 1/2 + 1/2 + 1
        (AXIS, 2, 3),  # 1/2 + 1 + 1, rounded up
        (Axis(2_000, 100_000), 1, 5),  # 1/2 + 1/2 + 4
    ],
)
def test_runs_settle_after_half_a_body_and_the_way_to_top_speed_and_back(
    axis: Axis, half_body: int, segments: int
) -> None:
    site = building(1, LENGTH, axis, pitch_mm=10, floor_mm=10, carrier_length_mm=half_body * 10, ends=())
    assert settling_segments(roads_of(site), ALLEY) == segments
