"""P56 on small cases: the exact optimum is below every policy, on the abstract problem and in the plant."""

import dataclasses

import pytest

from bus_sim.sites import find_site
from bus_sim.systems.car_park.compare.optimum import OptimumError, is_available, least_waiting_ms
from bus_sim.systems.car_park.compare.plays import POLICIES
from bus_sim.systems.car_park.compare.small_case import Case, Visitor, earliest_finish, play_case
from bus_sim.systems.car_park.compare.small_table import RULES, SmallTable, small_demand, solve_case
from tests.sites import at_the_key
from tests.thinned import is_long

SITE = at_the_key(find_site("small"))
needs_solver = pytest.mark.skipif(not is_available(), reason="OR-Tools is not installed (extra: optimum)")


def case(*visitors: Visitor) -> Case:
    """Two places 1 s and 5 s from the bay; one robot at the bay, one 10 s away; doors and handling 1 s each."""
    ways = ((0, 4, 1, 1, 11), (4, 0, 5, 5, 6), (1, 5, 0, 0, 10), (1, 5, 0, 0, 10), (11, 6, 10, 10, 0))
    way_ms = tuple(tuple(way * 1000 for way in row) for row in ways)
    return Case(visitors, tuple(SITE.places[:2]), 2, (3, 4), way_ms, 1000, 1000, 1000, 1000)


def test_a_single_visit_by_hand() -> None:
    """In: react 1, drive 10, walk 5. Out: lock, take, way, open, leave, lock, open, react 1 each, drive 20 s."""
    alone = case(Visitor(0, 100_000, 10_000, 5_000, 20_000))
    assert play_case(alone, earliest_finish) == 16_000 + 28_000


@needs_solver
def test_the_optimum_sends_a_robot_before_it_is_called() -> None:
    """Two cars come at once, both robots 10 s away, called when the first car has stood for 11 s.

    Called, a robot is there at 21, has opened and taken at 23, and the bay is free at 25: 16 and 41 s. Sent before, it
    only waits for the input door, locked at 17: the bay is free at 21, and the second customer waits 37 s.
    """
    comer = Visitor(0, None, 10_000, 5_000, 20_000)
    both = dataclasses.replace(case(comer, comer), homes=(4, 4))
    assert play_case(both, earliest_finish) == 16_000 + 41_000
    assert least_waiting_ms(both) == 16_000 + 37_000


@needs_solver
def test_places_hold_one_car() -> None:
    """Two cars that both stay cannot both have the near place, whatever that costs when they are fetched."""
    both = case(Visitor(0, 300_000, 10_000, 5_000, 20_000), Visitor(0, 301_000, 10_000, 5_000, 20_000))
    one_place = dataclasses.replace(
        both, places=both.places[:1], bay=1, homes=(2, 3), way_ms=tuple(row[1:] for row in both.way_ms[1:])
    )
    assert least_waiting_ms(both) > 2 * (16_000 + 28_000)
    with pytest.raises((OptimumError, ValueError)):
        least_waiting_ms(one_place)


@needs_solver
@pytest.mark.parametrize("seed", [1, 4] if is_long() else [1])
def test_p56_the_optimum_is_below_every_policy(seed: int) -> None:
    one = solve_case(SITE, seed)
    assert set(one.plant_s) == set(POLICIES)
    assert set(one.abstract_s) == set(RULES)
    assert all(one.optimum_s <= found for found in (*one.plant_s.values(), *one.abstract_s.values()))
    # The abstract problem leaves out whatever takes time beside ways, doors and handling.
    assert all(one.abstract_s[policy] <= one.plant_s[policy] for policy in RULES)
    assert "exact optimum" in "\n".join(SmallTable("small", (one,)).lines())


def test_a_small_case_has_one_compartment() -> None:
    with pytest.raises(ValueError, match="3 compartments"):
        Case.of(find_site("standard"), small_demand(1), 1)
