"""What a campaign counts of customers: each once, whatever befalls one of them at the same time."""

import pytest

from bus_sim.options import RunOptions
from bus_sim.session import play
from bus_sim.sites import find_site
from bus_sim.systems.car_park.day import ParkingDay
from bus_sim.systems.car_park.plant.customer import CustomerState
from bus_sim.systems.car_park.stage import CarParkStage


@pytest.mark.parametrize(
    ("has_lost_ticket", "is_told_off", "told_and_waiting"),
    [(False, False, (0, 1)), (True, False, (0, 0)), (False, True, (1, 0)), (True, True, (1, 0))],
    ids=["waits", "looks for the ticket", "has read why", "both"],
)
def test_who_stands_at_a_desk_counts_once(
    has_lost_ticket: bool, is_told_off: bool, told_and_waiting: tuple[int, int]
) -> None:
    """Drawn car park 5407: who had lost the ticket and then read OUT_OF_ORDER made -1 of those who wait."""
    stage = play(find_site("level1"), RunOptions(seed=1, demand=ParkingDay(random_s=(60, 15), cars=1)))
    assert isinstance(stage, CarParkStage)
    (customer,) = stage.customers
    customer.state = CustomerState.AT_DESK
    customer.has_lost_ticket, customer.is_told_off = has_lost_ticket, is_told_off
    tally = stage.tally()
    assert (tally.told, tally.waiting) == told_and_waiting
