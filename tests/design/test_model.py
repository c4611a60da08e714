"""The fast model of a car park beside the plant, and its servers alone."""

from dataclasses import replace

import pytest

from bus_sim.sites import find_site, site_text
from bus_sim.systems.car_park.demand import Demand
from bus_sim.systems.car_park.design.days import DayPlan, fill_and_empty, overload
from bus_sim.systems.car_park.design.measure import Mean, Outcome, Trial, fill_trial, modelled, played
from bus_sim.systems.car_park.design.model import DayModel
from bus_sim.systems.car_park.design.options import Size, size_of
from bus_sim.systems.car_park.design.servers import AlleyServer, LiftServer, Stretch
from bus_sim.systems.car_park.design.ways import ModelTraffic, arrival_us
from onboard.core.site import Segment
from onboard.systems.car_park.site import CallAt, CarPark, DeskPolicy, car_park

#: The model is to be within this of the plant (issue of the tool).
WITHIN = 0.15
S = 1_000_000


def park(name: str) -> CarPark:
    return car_park(find_site(name))


def trial(name: str, demand: Demand, seed: int = 1) -> Trial:
    return Trial(size_of(park(name)), site_text(name), DayPlan("day", demand, seed))


@pytest.fixture(scope="module")
def cheap() -> Trial:
    """Four cars so close that two robots are busy, fetched five minutes later."""
    return trial("small", Demand.by_mean(45, 15, 3, count=4))


@pytest.fixture(scope="module")
def both(cheap: Trial) -> tuple[Outcome, Outcome]:
    return modelled(cheap), played(cheap)


def test_the_model_waits_as_long_as_the_plant(both: tuple[Outcome, Outcome]) -> None:
    model, plant = both
    assert model.wait_in.count == plant.wait_in.count == 4
    assert model.wait_out.count == plant.wait_out.count == 4
    assert model.wait_in.mean_s == pytest.approx(plant.wait_in.mean_s, rel=WITHIN)
    assert model.wait_out.mean_s == pytest.approx(plant.wait_out.mean_s, rel=WITHIN)
    assert model.p95_s == pytest.approx(plant.p95_s, rel=WITHIN)
    assert not plant.faults and not plant.left


def test_the_same_day_comes_to_the_same_again(cheap: Trial, both: tuple[Outcome, Outcome]) -> None:
    assert modelled(cheap) == both[0]


def test_more_machines_of_the_kind_that_lacks_serve_more_cars() -> None:
    site = park("standard")
    few = replace(site, machines={node: one for node, one in site.machines.items() if one.name not in ("IOC2", "IOC3")})
    demand = overload(site, 1).demand
    assert len(few.compartments) == 1
    found = [DayModel(one, demand, 1).play() for one in (few, site)]
    assert max(found[0].gone_us) > 1.5 * max(found[1].gone_us)


def test_a_call_with_the_key_waits_longer() -> None:
    site, demand = park("small"), Demand.by_mean(60, 20, 1, count=6)
    by_key = DayModel(replace(site, call_at=CallAt.KEY), demand, 1).play()
    on_arrival = DayModel(site, demand, 1).play()
    assert sum(by_key.in_us) + sum(by_key.out_us) > sum(on_arrival.in_us) + sum(on_arrival.out_us)


def test_a_car_comes_to_the_bay_beside_it_where_the_site_says_so() -> None:
    site, demand = park("standard"), Demand.by_mean(30, 15, 1, count=12)
    nearest, anywhere = (
        DayModel(replace(site, desk=one), demand, 1).play() for one in (DeskPolicy.NEAREST, DeskPolicy.ANY)
    )
    assert sum(nearest.out_us) < 0.9 * sum(anywhere.out_us)


def test_who_asks_while_no_bay_has_room_is_served_when_one_has() -> None:
    site, demand = park("standard"), Demand.by_mean(5, 1, 1, count=12)
    found = DayModel(replace(site, desk=DeskPolicy.NEAREST), demand, 1).play()
    assert len(found.gone_us) == len(demand.stays)


def test_nobody_is_lost_where_a_park_is_filled_and_emptied() -> None:
    size = Size(1, 0, 1)
    found = modelled(fill_trial(size, site_text("level1")))
    assert found.wait_in.count == found.wait_out.count == len(park("level1").places)
    assert 0 < found.fill_h < 1 and 0 < found.empty_h < 1


def test_who_comes_to_a_full_park_is_refused() -> None:
    site = park("level1")
    full = fill_and_empty(site, None).demand
    more = replace(full, stays=(*full.stays, replace(full.stays[0], arrival_us=full.stays[-1].arrival_us + S)))
    found = DayModel(site, more, 1).play()
    assert (len(found.in_us), found.refused) == (len(site.places), 1)


def test_a_stretch_is_free_once_others_have_left_it() -> None:
    alley = AlleyServer()
    alley.take(Stretch(10, 20, 3, 5, 1))
    alley.take(Stretch(22, 30, 5, 9, 2))
    assert alley.free_from(0, 5, 4, 6, 3) == 0, "before the first"
    assert alley.free_from(8, 5, 4, 6, 3) == 30, "the gap between both is too short"
    assert alley.free_from(8, 5, 6, 9, 3) == 8, "beside the first, and over before the second"
    assert alley.free_from(12, 5, 3, 4, 1) == 12, "nobody waits for himself"
    alley.give_back(Stretch(22, 30, 5, 9, 2))
    assert alley.free_from(8, 5, 4, 6, 3) == 20


def test_a_lift_comes_empty_and_misses_nobody_who_has_asked_before() -> None:
    lift = LiftServer(park("small"), 128)
    at_once = lift.boards_at(0, 1, 3)
    far = lift.boards_at(0, 3, 1)
    assert far > at_once, "it stands below at first"
    later_us = 30 * S
    lift.take(lift.use(later_us, 1, 2))
    assert lift.boards_at(0, 1, 3) == at_once, "there and back before it"
    begin_us = lift.boards_at(later_us - 2 * S, 1, 3)
    assert begin_us > later_us + lift.ride_us(1, 2), "not in time: behind it"


def test_two_robots_do_not_meet_in_an_alley() -> None:
    traffic = ModelTraffic(park("small"))
    goal = frozenset((Segment(1, 2),))
    first = traffic.plan(Segment(1, 9), 0, goal, 11)
    assert first is not None
    traffic.take(first)
    second = traffic.plan(Segment(1, 8), 0, frozenset((Segment(1, 3),)), 12)
    assert second is not None
    assert second[0].begin_us >= first[0].end_us
    assert arrival_us([], 7) == 7


def test_a_mean_has_students_interval() -> None:
    """Of 1, 2, 3: mean 2, deviation 1, and 4.30 / sqrt(3) on either side."""
    found = Mean.of([1.0, 2.0, 3.0])
    assert (found.value, found.count) == (2.0, 3)
    assert found.half == pytest.approx(4.30 / 3**0.5)
    assert Mean.of([5.0]) == Mean(5.0, 0.0, 1)
