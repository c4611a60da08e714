"""The fast model of a car park beside the plant, and its servers alone."""

from dataclasses import replace

import pytest

from bus_sim.sites import find_site, site_text
from bus_sim.systems.car_park.demand import Demand
from bus_sim.systems.car_park.design.days import DayPlan, fill_and_empty, overload
from bus_sim.systems.car_park.design.fleet import FleetModel
from bus_sim.systems.car_park.design.measure import Mean, Outcome, Trial, fill_trial, modelled, played
from bus_sim.systems.car_park.design.model import DayModel
from bus_sim.systems.car_park.design.offers import Offers
from bus_sim.systems.car_park.design.options import Size, option_of, size_of
from bus_sim.systems.car_park.design.retreats import Retreats
from bus_sim.systems.car_park.design.robots import Work
from bus_sim.systems.car_park.design.servers import AlleyServer, LiftServer, Stretch
from bus_sim.systems.car_park.design.times import AWARD_US, REACH_US
from bus_sim.systems.car_park.design.ways import ModelTraffic, arrival_us
from onboard.config.site import parse_site
from onboard.contract.messages import Reference
from onboard.core.site import Segment
from onboard.systems.car_park.fetching import to_fetch_from
from onboard.systems.car_park.pipeline import ENTERED_US
from onboard.systems.car_park.site import CallAt, CarPark, DeskPolicy, car_park
from onboard.ways.reservations import FOREVER

#: When who wins a call that is made at 0 sets off.
START_US = 1_000_000 + AWARD_US
CAR = Reference(1, 1)
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


@pytest.mark.parametrize("line", ['call_at = "key"', 'place = "random"', 'place = "balanced"', 'place = "cost"'])
def test_whatever_the_file_says_of_turns_and_places_all_wait_as_in_the_plant(line: str) -> None:
    """By the key cars go in and out by turns (P50); a place that is not the nearest has a longer way."""
    text = site_text("small")
    assert "[negotiation]" not in text
    text += f"\n[negotiation]\n{line}\n"
    site = car_park(parse_site(text, "small.toml"))
    close = Trial(size_of(site), text, DayPlan("day", Demand.by_mean(40, 15, 1, count=12), 1))
    model, plant = modelled(close), played(close)
    assert model.wait_in.mean_s == pytest.approx(plant.wait_in.mean_s, rel=WITHIN)
    assert model.wait_out.mean_s == pytest.approx(plant.wait_out.mean_s, rel=WITHIN)


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
    first = traffic.plan(Segment(1, 7), 0, frozenset((Segment(1, 2),)), 11)
    assert first is not None
    traffic.take(first)
    second = traffic.plan(Segment(1, 8), 0, frozenset((Segment(1, 3),)), 12)
    assert second is not None
    assert 0 < second[0].begin_us < first[0].end_us < second[0].end_us, "it follows, and does not wait for the end"
    assert (1, Stretch(0, second[0].begin_us, 8, 8, 12)) in second[0].turns, "meanwhile it is in the way"
    for track, mine in second[0].turns:
        for other, his in first[0].turns:
            is_apart = mine.high < his.low or his.high < mine.low
            assert track != other or is_apart or mine.begin_us >= his.end_us or his.begin_us >= mine.end_us
    assert arrival_us([], 7) == 7


def test_who_works_or_rests_in_the_way_is_waited_for() -> None:
    traffic = ModelTraffic(park("level1"))
    traffic.stands(Segment(1, 4), 0, 100 * S, 11)
    goal = frozenset((Segment(1, 2),))
    past = traffic.plan(Segment(1, 6), 0, goal, 12, lambda there_us: there_us)
    assert past is not None and past[-1].end_us > 100 * S
    traffic.stands(Segment(1, 4), 100 * S, FOREVER, 11)
    assert traffic.plan(Segment(1, 6), 0, goal, 12, lambda there_us: there_us) is None


def test_nobody_works_where_another_comes_by_meanwhile() -> None:
    traffic = ModelTraffic(park("level1"))
    comes_by = traffic.plan(Segment(1, 8), 20 * S, frozenset((Segment(1, 2),)), 11)
    assert comes_by is not None
    traffic.take(comes_by)
    goal = frozenset((Segment(1, 4),))
    short = traffic.plan(Segment(1, 7), 0, goal, 12, lambda there_us: there_us + S)
    long = traffic.plan(Segment(1, 7), 0, goal, 12, lambda there_us: there_us + 20 * S)
    assert short is not None and short[-1].end_us < 20 * S
    assert long is None, "whoever comes by ends behind it, and has to pass where it stands"


def test_a_car_can_be_taken_after_another_has_come_by_as_well() -> None:
    traffic = ModelTraffic(park("standard"))
    comes_by = traffic.plan(Segment(1, 2), 40 * S, frozenset((Segment(1, 18),)), 11)
    assert comes_by is not None
    traffic.take(comes_by)
    ways = traffic.plans(Segment(192, 1), 0, frozenset((Segment(1, 12),)), 12, lambda there_us: there_us + S)
    ends_us = [way[-1].end_us for way in ways]
    assert ends_us[0] < 40 * S < ends_us[1] < comes_by[-1].end_us


def test_nobody_waits_on_a_platform() -> None:
    """Somebody comes by meanwhile: the way out of it that would be nearest is a lift's platform."""
    traffic = ModelTraffic(park("standard"))
    comes_by = traffic.plan(Segment(1, 4), 55 * S, frozenset((Segment(192, 1),)), 11)
    assert comes_by is not None
    traffic.take(comes_by)
    goal = frozenset((Segment(1, 9),))
    legs = traffic.plan(Segment(1, 10), 56 * S, goal, 12, lambda there_us: there_us + 20 * S) or []
    for leg, then in zip(legs, [*legs[1:], None], strict=True):
        is_onto = leg.ride is None and traffic.roads.lift_at(leg.there) is not None
        assert not is_onto or (then is not None and then.ride is not None)


def test_a_platform_sets_off_for_nobody_before_he_is_called() -> None:
    site = park("small")
    lift = LiftServer(site, next(iter(site.lifts)))
    there_us = lift.boards_at(0, 3, 1)
    assert lift.boards_at(200 * S, 3, 1, 100 * S) == 200 * S, "it is there by then"
    assert lift.boards_at(200 * S, 3, 1, 200 * S) == 200 * S + there_us


def test_a_robot_rests_beside_the_lift_by_which_it_came() -> None:
    """Lifts beside the alley part a floor into stretches of refuges: nobody drives to the end of the floor."""
    site = park("changi")
    fleet, front = FleetModel(site), site.compartments[1].segment
    assert fleet.park(front, 0, 30 * S, CAR) is not None
    (robot,) = [one for one in fleet.robots if one.busy_us]
    assert (robot.node, robot.rests_at) == (11, Segment(2, 8)), "the lower one of two that are as near, as in the plant"


@pytest.mark.parametrize(("node", "bid_s"), [(11, 72.001), (20, 71.601)])
def test_bids_are_the_plants(node: int, bid_s: float) -> None:
    """What robots of ``large`` bid for the first car of the shipped day: plans allow for more than is taken."""
    site = park("large")
    fleet, front = FleetModel(site), site.compartments[1].segment
    fleet.traffic.now_us = START_US
    robots = [one for one in fleet.robots if one.node == node]
    offers = Offers(site, fleet.traffic, robots, Retreats(site, fleet.traffic, fleet.robots))
    ready_us, door_us = ENTERED_US + site.timing.door_us, site.timing.door_us + REACH_US
    best = offers.best(lambda: iter([Work(front, front, ready_us, 0, door_us, 0)]), START_US)
    assert best is not None and best[0].bid_us / S == pytest.approx(bid_s, abs=0.06)


def test_a_way_back_yields_to_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first robot would ride back just when the second one needs the lift: it comes behind it, as in the plant."""

    def second_done_us() -> int:
        site = park("inline")
        fleet, (first_bay, second_bay) = FleetModel(site), site.compartments.values()
        near, far = (next(one for one in site.places if one.segment == Segment(track, 2)) for track in (3, 5))
        fleet.retrieve(near, first_bay.segment, 0, 0)
        served = fleet.retrieve(far, second_bay.segment, 40 * S, 40 * S)
        rests = {one.rests_at.track for one in fleet.robots}
        assert len(rests) == len(fleet.robots), "both rest where nobody is in the way"
        return served.done_us

    soon_us = second_done_us()
    monkeypatch.setattr(Retreats, "may_yield", lambda *_: [])
    assert soon_us < second_done_us() - 30 * S


def test_a_robot_on_its_way_to_a_platform_rides_before_it_turns_back() -> None:
    site = park("small")
    fleet = FleetModel(site)
    place = next(one for one in site.places if one.track == 1)
    front = next(iter(site.compartments.values())).segment
    fleet.retrieve(place, front, 0, 0)
    robot = next(one for one in fleet.robots if one.retreat)
    to_platform = robot.retreat[0]
    assert fleet.traffic.roads.lift_at(to_platform.there) is not None
    here, ready_us, kept = robot.branch(to_platform.begin_us + S, fleet.traffic.roads)
    assert (here.track, kept) == (2, 3) and ready_us > to_platform.end_us + fleet.traffic.lifts[128].ride_us(1, 2)


def test_a_place_is_free_once_its_car_is_taken() -> None:
    site = park("small")
    fleet = FleetModel(site)
    front = next(iter(site.compartments.values())).segment
    parked = fleet.park(front, 0, 0, CAR)
    assert parked is not None and parked.place is not None
    call_us = parked.done_us + 100 * S
    taken = fleet.retrieve(parked.place, front, call_us, call_us)
    meanwhile = fleet.park(front, call_us + S, taken.at_bay_us, CAR)
    assert meanwhile is not None and meanwhile.place != parked.place
    later = fleet.park(front, meanwhile.done_us, meanwhile.done_us, CAR)
    assert later is not None and later.place == parked.place


@pytest.mark.parametrize("name", ["small", "standard"])
def test_one_car_waits_as_in_the_plant_to_a_tenth_of_a_second(name: str) -> None:
    """What machines take between motions (``times``) is what the plant takes: a day of such trifles is a queue."""
    alone = trial(name, Demand.by_mean(400, 10, 1, count=1))
    model, plant = modelled(alone), played(alone)
    assert model.wait_in.mean_s == pytest.approx(plant.wait_in.mean_s, abs=0.15)
    assert model.wait_out.mean_s == pytest.approx(plant.wait_out.mean_s, abs=0.15)


def test_one_way_round_all_wait_as_in_the_plant() -> None:
    """Three cars close one behind the other: a robot that goes round, and one that has too far to go for most tasks."""
    close = trial("ring", Demand.by_mean(40, 15, 3, count=3))
    model, plant = modelled(close), played(close)
    assert model.wait_in.count == plant.wait_out.count == 3
    assert model.wait_in.mean_s == pytest.approx(plant.wait_in.mean_s, rel=0.02)
    assert model.wait_out.mean_s == pytest.approx(plant.wait_out.mean_s, rel=0.02)
    assert model.p95_s == pytest.approx(plant.p95_s, rel=0.02)


def test_places_from_which_no_itinerary_leads_are_not_used() -> None:
    site = park("ring")
    fleet, front = FleetModel(site), next(iter(site.compartments.values())).segment
    assert [*fleet.free] == to_fetch_from(site, site.places) and len(fleet.free) < len(site.places)
    fleet.free.clear()
    assert fleet.park(front, 0, 0, CAR) is None


def test_whose_itinerary_would_be_too_long_does_not_bid() -> None:
    """One way round: the robot of the other floor would be there sooner, and home again in more legs than are told."""
    site = park("ring")
    fleet, front = FleetModel(site), next(iter(site.compartments.values())).segment
    near, far = fleet.robots
    fleet.free = {place: 0 for place in fleet.free if place.segment == Segment(3, 1)}
    assert fleet.park(front, 0, 0, CAR) is not None and near.busy_us > 0
    alone = FleetModel(site)
    alone.robots = alone.robots[1:]
    for one in (fleet, alone):
        one.free = {place: 0 for place in site.places if place.segment == Segment(5, 8)}
    served, sooner = (one.park(front, 60 * S, 100 * S, CAR) for one in (fleet, alone))
    assert served is not None and sooner is not None and served.done_us > sooner.done_us
    assert far.busy_us == 0


def test_a_second_robot_that_waits_for_the_first_one_gains_nothing() -> None:
    """One lift, close cars: the other robot would come behind the first one's way back (as in the plant)."""
    demand = Demand.by_mean(90, 30, 3, count=8)
    one, two = (option_of(site_text("small"), "small.toml", Size(robots, 1, 1)).site for robots in (1, 2))
    assert DayModel(two, demand, 3).play().out_us == DayModel(one, demand, 3).play().out_us


def test_a_mean_has_students_interval() -> None:
    """Of 1, 2, 3: mean 2, deviation 1, and 4.30 / sqrt(3) on either side."""
    found = Mean.of([1.0, 2.0, 3.0])
    assert (found.value, found.count) == (2.0, 3)
    assert found.half == pytest.approx(4.30 / 3**0.5)
    assert Mean.of([5.0]) == Mean(5.0, 0.0, 1)
