"""When a desk says that nobody comes, by what it has heard of the robot that has the task."""

import pytest

from onboard.contract.codes import (
    CONTRACT_VERSION,
    DeskText,
    DoorPosition,
    Grade,
    KindCode,
    LegAction,
    LightColour,
    MachineState,
    Operation,
    Reason,
)
from onboard.contract.messages import BayState, Blocked, DoorState, Heartbeat, Itinerary, Leg, Reference, Stamp
from onboard.core.site import Station
from onboard.systems.car_park.bay_task import BayPhase, BayTask
from onboard.systems.car_park.compartment import Compartment
from onboard.systems.car_park.outage import OUT_AFTER_US, READ_US
from tests.kinds.test_tickets import BAY, CAR, OTHER, ROBOT, SITE, WHEELBASE_MM, Desk, shown

OPERATOR = 251
SECOND_US = 1_000_000
LOCKED = (
    DoorState(BAY, DoorPosition.LOCKED, DoorPosition.LOCKED, LightColour.RED),
    BayState(BAY, 0, 0, 0, 0, False, False, 0),
)
BEAT = Heartbeat(ROBOT, CONTRACT_VERSION, SITE.digest, 0, 1, KindCode.ROBOT, MachineState.WAITING, 0)
#: Where the car stands that is to be fetched.
PLACE = SITE.places[0]


def work(at: Station, end_ms: int) -> Leg:
    return Leg(LegAction.WORK, at.track, at.index, at.index, at.side, end_ms)


def waiting(*legs: Leg, is_blocked: bool = True) -> tuple[Desk, Compartment]:
    """A bay that waits for the robot which has won its task, and whose plan is ``legs``."""
    desk = Desk()
    bay = desk.holon.behaviour
    assert isinstance(bay, Compartment)
    desk.holon.receive(Itinerary(ROBOT, 1, Grade.FIRM, Stamp(1_000, BAY, 1), legs), desk.now_us)
    if is_blocked:
        desk.holon.receive(Blocked(OPERATOR, 1, 1, Reason.OPERATOR), desk.now_us)
    bay.calls.job = BayTask(Reference(BAY, 9), Operation.RETRIEVE, CAR, WHEELBASE_MM, winner=ROBOT)
    bay.phase = BayPhase.AWAITING
    desk.sense(*LOCKED)
    return desk, bay


def read(desk: Desk, until_us: int) -> dict[DeskText, int]:
    """What is shown from now on, and when first, bus us; the robot says that it lives."""
    found: dict[DeskText, int] = {}
    while desk.now_us < until_us:
        desk.now_us += SECOND_US // 2
        for text in shown([*desk.holon.receive(BEAT, desk.now_us), *desk.holon.wake(desk.now_us)]):
            found.setdefault(text, desk.now_us)
    return found


def test_whose_plan_is_over_before_the_bay_while_something_is_out_does_not_come() -> None:
    """Drawn car park 5799: a robot had taken the car, and another, which a person held, stood before its refuges."""
    desk, _ = waiting(work(PLACE, 5_000))
    assert read(desk, 60 * SECOND_US)[DeskText.OUT_OF_ORDER] == pytest.approx(
        5 * SECOND_US + OUT_AFTER_US, abs=SECOND_US
    )


@pytest.mark.parametrize(("is_blocked", "leads_here"), [(False, False), (True, True)])
def test_who_has_a_way_or_is_only_late_may_come(is_blocked: bool, leads_here: bool) -> None:
    legs = work(PLACE, 5_000), work(SITE.compartments[BAY], 9_000)
    desk, _ = waiting(*(legs if leads_here else legs[:1]), is_blocked=is_blocked)
    assert DeskText.OUT_OF_ORDER not in read(desk, 60 * SECOND_US)


def test_that_nobody_comes_is_shown_again_when_somebody_else_has_been_sent_on() -> None:
    """Who came then saw where another was to go, and waited in front of a bay that waited for nobody."""
    desk, bay = waiting(work(PLACE, 5_000))
    read(desk, 60 * SECOND_US)
    bay.outputs.show(DeskText.GO_TO, OTHER, 2)
    said_us = desk.now_us
    assert read(desk, 120 * SECOND_US)[DeskText.OUT_OF_ORDER] == pytest.approx(said_us + READ_US, abs=SECOND_US)


def test_a_bay_that_has_sensed_nothing_yet_is_not_woken_to_tell_anybody() -> None:
    """Its sensors are off, and the only robot silent: it would have been woken at once, for ever."""
    desk = Desk()
    bay = desk.holon.behaviour
    assert isinstance(bay, Compartment)
    desk.holon.receive(BEAT, desk.now_us)
    bay.tickets.append(CAR)
    while desk.now_us < 90 * SECOND_US:
        desk.now_us += SECOND_US // 2
        desk.holon.wake(desk.now_us)
        due_us = bay.next_wake()
        assert due_us is None or due_us > desk.now_us
    assert ROBOT in bay.fleet.mirror.obstacles.machines
