"""Customers against a scripted car park: in, out, refused, cancelled, one after the other."""

import random

import pytest

from bus_sim.systems.car_park.demand import Demand, Stay
from bus_sim.systems.car_park.plant.bodies import CarBody, random_car
from bus_sim.systems.car_park.plant.customer import CustomerState, VisitOutcome
from onboard.contract.codes import DeskText
from onboard.contract.messages import DeskOrder, Reference
from onboard.systems.car_park.tickets import Ticket
from tests.plant.support import COMPARTMENT, SECOND, Bench
from tests.plant.valet import Valet

HOUR = 3600 * SECOND


def car(name: str, length_mm: int = 4300) -> CarBody:
    return CarBody(name, 2700, length_mm, 1500, 1400)


def test_a_customer_comes_parks_and_fetches_their_car() -> None:
    bench = Bench()
    Valet(bench)
    customer = bench.street.add(Stay(10 * SECOND, 600 * SECOND, car("blue")))
    bench.timers.run_until(300 * SECOND)
    assert customer.state is CustomerState.PARKED
    assert customer.ticket == Ticket(Reference(COMPARTMENT, 1), 0)
    # Reaction 1 s, driving 10 to 30 s, walking 4 to 8 s, and the script's tick.
    assert customer.visit.in_wait_us is not None
    assert 15 * SECOND <= customer.visit.in_wait_us <= 40 * SECOND
    parked_at = bench.world.where["blue"]
    assert parked_at in bench.site.places
    bench.timers.run_until(900 * SECOND)
    assert (customer.state, customer.visit.outcome) == (CustomerState.GONE, VisitOutcome.SERVED)
    assert customer.visit.asked_us == 600 * SECOND
    assert bench.world.where["blue"] is None
    assert bench.rules == []
    assert bench.street.is_over


def test_nobody_drives_in_on_red_or_through_a_shut_door() -> None:
    bench = Bench()
    customer = bench.street.add(Stay(0, None, car("blue")))
    bench.timers.run_until(HOUR)
    assert customer.state is CustomerState.QUEUEING
    assert bench.street.summary().queueing == 1
    assert bench.rules == []


def test_a_queue_is_served_in_the_order_of_arrival() -> None:
    bench = Bench()
    Valet(bench)
    names = ["a", "b", "c", "d"]
    customers = [bench.street.add(Stay(n * SECOND, None, car(name))) for n, name in enumerate(names)]
    bench.timers.run_until(HOUR)
    times = [customer.visit.parked_us for customer in customers]
    assert all(times)
    assert times == sorted(times, key=lambda time_us: time_us or 0)
    assert bench.rules == []


def test_who_finds_the_park_full_drives_out_again_and_is_counted() -> None:
    bench = Bench()
    Valet(bench, capacity=1)
    bench.street.add(Stay(0, None, car("first")))
    late = bench.street.add(Stay(SECOND, 2000 * SECOND, car("late")))
    bench.timers.run_until(HOUR)
    assert late.visit.outcome is VisitOutcome.FULL
    summary = bench.street.summary()
    assert (summary.refused_full, summary.parked, summary.inside) == (1, 1, 1)
    assert bench.compartments[COMPARTMENT].is_empty
    assert bench.rules == []


def test_a_car_too_large_drives_out_again_and_is_counted() -> None:
    bench = Bench()
    Valet(bench)
    long = bench.street.add(Stay(0, 2000 * SECOND, car("long", 5400)))
    bench.timers.run_until(HOUR)
    assert long.visit.outcome is VisitOutcome.TOO_LARGE
    assert bench.street.summary().refused_too_large == 1
    assert bench.street.is_over
    assert bench.rules == []


def test_told_full_after_walking_away_the_customer_comes_back_for_the_car() -> None:
    bench = Bench()
    valet = Valet(bench)
    customer = bench.street.add(Stay(0, None, car("blue")))
    bench.timers.run_until(SECOND)
    while customer.state is not CustomerState.PARKED:
        bench.timers.run_for(50_000)
    assert customer.ticket is not None
    valet.condition = lambda: False
    bench.links[COMPARTMENT].order(DeskOrder(COMPARTMENT, 200, DeskText.FULL, customer.ticket.car))
    bench.timers.run_for(60 * SECOND)
    assert customer.visit.outcome is VisitOutcome.FULL
    assert bench.world.where["blue"] is None


def test_who_was_called_and_is_told_to_wait_all_the_same_goes_to_the_desk_again() -> None:
    """A robot came for the car after all: its driver went to the next one that came out there (drawn, 8506)."""
    bench = Bench()
    valet = Valet(bench)
    customer = bench.street.add(Stay(0, 600 * SECOND, car("blue")))
    bench.timers.run_until(599 * SECOND)
    valet.condition = lambda: False
    bench.timers.run_until(601 * SECOND)
    assert customer.ticket is not None
    for sequence, text in ((200, DeskText.CAR_READY), (201, DeskText.PLEASE_WAIT)):
        bench.links[COMPARTMENT].order(DeskOrder(COMPARTMENT, sequence, text, customer.ticket.car))
    bench.timers.run_for(60 * SECOND)
    assert (customer.state, bench.rules) == (CustomerState.AT_DESK, [])


def test_cancelled_in_time_the_car_comes_out_at_once() -> None:
    bench = Bench()
    Valet(bench)
    probe = Bench()
    Valet(probe)
    stay = Stay(0, HOUR, car("blue"))
    parked = probe.street.add(stay)
    probe.timers.run_until(200 * SECOND)
    assert parked.visit.parked_us is not None
    customer = bench.street.add(Stay(0, HOUR, car("blue"), cancel_us=parked.visit.parked_us + 2 * SECOND))
    bench.timers.run_until(200 * SECOND)
    assert customer.visit.outcome is VisitOutcome.CANCELLED
    assert bench.street.summary().cancelled == 1
    assert bench.rules == []


@pytest.mark.parametrize("deaf", [False, True])
def test_cancelled_too_late_or_unheard_the_ticket_brings_the_car(deaf: bool) -> None:
    bench = Bench()
    Valet(bench, deaf_to_cancel=deaf)
    customer = bench.street.add(Stay(0, HOUR, car("blue"), cancel_us=(40 if deaf else 300) * SECOND))
    bench.timers.run_until(1200 * SECOND)
    assert customer.visit.outcome is VisitOutcome.SERVED
    assert bench.rules == []


def test_customers_queue_at_the_desk_and_each_gets_their_own_car() -> None:
    bench = Bench()
    Valet(bench)
    for number in range(5):
        bench.street.add(Stay(number * SECOND, 2000 * SECOND + number, car(f"car {number}")))
    bench.timers.run_until(2 * HOUR)
    summary = bench.street.summary()
    assert (summary.served, summary.asking, len(summary.out_wait_us)) == (5, 0, 5)
    assert sorted(summary.out_wait_us) == list(summary.out_wait_us)
    assert bench.rules == []


def test_another_car_in_the_bay_is_not_taken_but_reported() -> None:
    bench = Bench()
    valet = Valet(bench)
    for number in range(2):
        bench.street.add(Stay(number * SECOND, (2000 + 1000 * number) * SECOND, car(f"car {number}")))
    bench.timers.run_until(1500 * SECOND)
    one, two = list(valet.parked)
    valet.parked[one], valet.parked[two] = valet.parked[two], valet.parked[one]
    bench.timers.run_until(2500 * SECOND)
    assert bench.street.customers[0].visit.outcome is VisitOutcome.WRONG_CAR
    assert bench.rules == ["OWN_CAR"]


def test_an_unknown_ticket_is_tried_again_and_then_given_up() -> None:
    bench = Bench()
    valet = Valet(bench)
    customer = bench.street.add(Stay(0, 600 * SECOND, car("blue")))
    bench.timers.run_until(500 * SECOND)
    valet.parked.clear()
    bench.timers.run_until(HOUR)
    assert customer.visit.outcome is VisitOutcome.TICKET_UNKNOWN


def test_a_key_that_nobody_answered_is_pressed_again() -> None:
    bench = Bench()
    valet = Valet(bench)
    bench.street.add(Stay(0, None, car("blue")))
    hear = bench.links[COMPARTMENT].controllers.pop()
    bench.timers.run_until(SECOND)
    valet.hear = lambda message: None  # type: ignore[method-assign]  # a controller that went deaf
    bench.timers.run_until(45 * SECOND)
    bench.links[COMPARTMENT].controllers.append(hear)
    bench.timers.run_until(100 * SECOND)
    assert bench.street.summary().parked == 1


def test_a_car_by_hand_leaves_when_it_is_told_to() -> None:
    bench = Bench()
    Valet(bench)
    bench.street.add_all(Demand.one_car(car("blue")), origin_us=5 * SECOND)
    customer = bench.street.customers[0]
    bench.timers.run_until(HOUR)
    assert customer.state is CustomerState.PARKED
    assert bench.street.is_over
    customer.leave_now()
    bench.timers.run_until(2 * HOUR)
    assert customer.visit.outcome is VisitOutcome.SERVED


def test_the_same_seed_gives_the_same_day() -> None:
    days = []
    for _ in range(2):
        bench = Bench()
        Valet(bench)
        bench.street.add_all(Demand.by_mean(400, 100, 3, count=8))
        bench.timers.run_until(3 * HOUR)
        days.append(([c.visit for c in bench.street.customers], bench.links[COMPARTMENT].said))
        assert bench.rules == []
    assert days[0] == days[1]


def test_a_busy_random_day_conserves_cars_and_serves_everybody() -> None:
    bench = Bench()
    Valet(bench)
    chance = random.Random(11)
    arrivals = sorted(chance.randrange(3 * HOUR) for _ in range(40))
    for number, arrival_us in enumerate(arrivals):
        leaves_us = arrival_us + chance.randrange(60 * SECOND, HOUR)
        bench.street.add(Stay(arrival_us, leaves_us, random_car(f"car {number}", 1)))
    bench.timers.run_until(12 * HOUR)
    summary = bench.street.summary()
    assert bench.rules == []
    assert (summary.arrived, summary.served + summary.refused_full) == (40, 40)
    assert all(where is None for where in bench.world.where.values())
