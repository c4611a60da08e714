"""A compartment and a robot that asks for its bay with a car aboard; and a task whose car has left meanwhile."""

import pytest

from onboard.contract.codes import (
    DoorAction,
    DoorName,
    DoorPosition,
    Grade,
    LegAction,
    LightColour,
    Reason,
    TaskPhase,
)
from onboard.contract.constants import ANY_STATION, NOBODY, OUTSIDE
from onboard.contract.messages import (
    BayState,
    CarAt,
    DoorOrder,
    DoorState,
    Itinerary,
    Leg,
    Message,
    Reference,
    Stamp,
    TaskReport,
    TokenRequest,
)
from onboard.core.effects import Actuate, Effect
from onboard.core.site import Station
from onboard.core.token_keys import station_token
from onboard.systems.car_park.bay_memory import BEYOND_LOST
from tests.kinds.test_tickets import BAY, CAR, OTHER, ROBOT, SITE, WHEELBASE_MM, Desk

HERE = SITE.compartments[BAY]
OTHER_PLACE = SITE.places[5]


class Bay(Desk):
    """A compartment, and what it ordered of its doors since that was asked last."""

    def __init__(self) -> None:
        super().__init__()
        self._orders: list[DoorOrder] = []

    def sees(self, *messages: Message) -> None:
        """Its devices tell."""
        self._keep(self.sense(*messages))

    def hears(self, *messages: Message) -> None:
        """The others tell."""
        for one in messages:
            self._keep(self.holon.receive(one, self.now_us))

    def ordered(self, seconds: int) -> list[tuple[DoorName, DoorAction]]:
        """What was ordered, with so many seconds more in which nothing happens."""
        for _ in range(seconds):
            self.now_us += 1_000_000
            self._keep(self.holon.wake(self.now_us))
        orders, self._orders = self._orders, []
        return [(one.door, one.action) for one in orders]

    def _keep(self, effects: list[Effect]) -> None:
        found = [one.message for one in effects if isinstance(one, Actuate)]
        self._orders += [one for one in found if isinstance(one, DoorOrder)]


def asked_for_the_bay(works_at: Station) -> Bay:
    """The bay is empty and open; a robot with a car aboard asks for it, and has work ``works_at`` next."""
    bay = Bay()
    empty = BayState(BAY, 0, 0, 0, 0, False, False, 0)
    bay.sees(DoorState(BAY, DoorPosition.OPEN, DoorPosition.LOCKED, LightColour.GREEN), empty)
    bay.ordered(0)
    leg = Leg(LegAction.WORK, works_at.track, works_at.index, works_at.index, works_at.side, 60_000)
    bay.hears(Itinerary(ROBOT, 1, Grade.FIRM, Stamp(0, ROBOT, 0), (leg,)))
    key = station_token(HERE)
    bay.hears(CarAt(ROBOT, CAR, ANY_STATION, 3, WHEELBASE_MM), TokenRequest(ROBOT, key.kind, key.number, 0, 1, NOBODY))
    return bay


def test_a_bay_is_locked_for_a_robot_that_brings_a_car_for_a_task_that_was_forgotten() -> None:
    assert asked_for_the_bay(HERE).ordered(5) == [(DoorName.INPUT, DoorAction.CLOSE)]


def test_it_is_not_for_one_that_has_a_car_for_another_bay_aboard() -> None:
    # A robot that had asked for the bay as a winner was taken for this, and the bay waited for that car for ever.
    assert asked_for_the_bay(OTHER_PLACE).ordered(5) == []


@pytest.mark.parametrize("seconds", [0, 40], ids=["as the next", "as the one in hand"])
def test_a_task_whose_car_has_left_from_another_bay_holds_the_bay_up_no_longer(seconds: int) -> None:
    bay = asked_for_the_bay(HERE)
    assert bay.ordered(1) == [(DoorName.INPUT, DoorAction.CLOSE)]
    # The one after its two cars, and beyond the numbers that it may have lost.
    task = Reference(BAY, BEYOND_LOST + OTHER.number + 1)
    bay.hears(CarAt(ROBOT, CAR, OUTSIDE, 4, WHEELBASE_MM))
    bay.hears(TaskReport(ROBOT, task, TaskPhase.FORFEITED, 0, Reason.CANCELLED))
    assert bay.ordered(40 - seconds) == []
    bay.sees(DoorState(BAY, DoorPosition.LOCKED, DoorPosition.LOCKED, LightColour.RED))
    assert bay.ordered(seconds) == [(DoorName.INPUT, DoorAction.OPEN)]
