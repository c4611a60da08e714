"""More customers than the park can take at once: the queue before a compartment, and "full" told at the desk."""

from itertools import pairwise

import pytest

from bus_sim.systems.car_park.plant.customer import CustomerState, VisitOutcome
from bus_sim.systems.car_park.simulation import Simulation
from onboard.config.site import parse_site
from onboard.contract.codes import DeskText, Operation, TaskPhase
from onboard.contract.messages import CallForProposals, CarAt, DeskOrder, TaskReport
from onboard.core.site import Site
from onboard.systems.car_park.site import CarPark, car_park
from onboard.ways.site import way_site
from tests.sites import one_floor
from tests.system.scene import ORIGIN_US, Scene, play, stays

TWO_PLACES = """
[site]
name = "two"
[floors]
count = 1
positions = 3
sides = ["near"]
[[compartments]]
name = "IOC1"
node = 1
at = "p(1,2)"
[[robots]]
name = "MR1"
node = 11
home = "p(1,3)"
"""


@pytest.fixture(scope="module")
def two_places() -> CarPark:
    site = car_park(parse_site(TWO_PLACES, "two.toml", crowded=True))
    assert len(site.places) == 2
    return site


@pytest.mark.parametrize("gap_s", [0.0, 400.0])
def test_p53_the_third_car_of_a_park_with_two_places_is_told_full(two_places: Site, gap_s: float) -> None:
    """Whether it comes at once with the others, while the second is still on its way, or much later."""
    scene = play(two_places, stays((0, None), (0, None), (gap_s, None)), extra_s=120)
    scene.assert_sound()
    customers = scene.simulation.plant.street.customers
    assert [customer.visit.outcome for customer in customers] == [
        VisitOutcome.STAYING,
        VisitOutcome.STAYING,
        VisitOutcome.FULL,
    ]
    told_us, _ = scene.first(DeskOrder, lambda order: order.text is DeskText.FULL)
    assert customers[2].visit.gone_us is not None and customers[2].visit.gone_us > told_us, "told before driving out"
    summary = scene.simulation.plant.street.summary()
    assert (summary.parked, summary.inside, summary.refused_full, summary.queueing) == (2, 2, 1, 0)
    done = [report for _, report in scene.all(TaskReport) if report.phase is TaskPhase.DONE]
    assert len(done) == 2 and {report.station for report in done} == {
        place.number for place in way_site(two_places).places
    }
    assert scene.simulation.plant.world.cars_at(way_site(two_places).compartments[1]) == []


def test_a_full_park_has_room_again_once_a_car_has_left(two_places: Site) -> None:
    scene = play(two_places, stays((0, 600), (0, None), (300, None), (900, None)), extra_s=120)
    scene.assert_sound()
    outcomes = [customer.visit.outcome for customer in scene.simulation.plant.street.customers]
    assert outcomes == [VisitOutcome.SERVED, VisitOutcome.STAYING, VisitOutcome.FULL, VisitOutcome.STAYING]
    assert scene.simulation.plant.street.summary().inside == 2


@pytest.fixture(scope="module")
def burst() -> tuple[Scene, list[int]]:
    """Six cars at one compartment within a second, and how many queued each ten seconds."""
    queues: list[int] = []

    def look(simulation: Simulation) -> None:
        queues.append(simulation.plant.street.summary().queueing)
        simulation.loop.call_later(10.0, look, simulation)

    def watch(simulation: Simulation) -> None:
        simulation.loop.call_at(ORIGIN_US / 1e6 + 1.5, look, simulation)

    scene = play(one_floor(), stays(*[(0.2 * number, None) for number in range(6)]), before=watch, limit_s=1_800)
    scene.assert_sound()
    return scene, queues


def test_p53_a_burst_queues_before_the_busy_compartment_and_is_served_in_its_order(
    burst: tuple[Scene, list[int]],
) -> None:
    scene, queues = burst
    assert queues[0] >= 5, "one drives in, all others wait on the street"
    falling = [after - before for before, after in pairwise(queues)]
    assert set(falling) == {0, -1} and queues[-1] == 0, "one after the other"
    customers = scene.simulation.plant.street.customers
    assert {customer.state for customer in customers} == {CustomerState.PARKED}
    tickets = [customer.ticket.car.number for customer in customers if customer.ticket is not None]
    assert tickets == sorted(tickets) and len(tickets) == 6, "first come, first served"
    waits = [customer.visit.in_wait_us or 0 for customer in customers]
    assert waits == sorted(waits) and waits[-1] > waits[0] + 5 * 30_000_000


def test_p53_the_bay_takes_the_next_car_only_when_the_robot_has_taken_the_last(
    burst: tuple[Scene, list[int]],
) -> None:
    scene, _ = burst
    bay = way_site(scene.simulation.site).compartments[1].number
    calls = [time_us for time_us, call in scene.all(CallForProposals) if call.operation is Operation.PARK]
    loaded = [time_us for time_us, report in scene.all(TaskReport) if report.phase is TaskPhase.LOADED]
    assert len(calls) == len(loaded) == 6
    assert all(taken < following for taken, following in zip(loaded, calls[1:], strict=False))
    in_bay = [(time_us, said.car) for time_us, said in scene.all(CarAt, "fleet") if said.station == bay]
    assert len({car for _, car in in_bay}) == 6
