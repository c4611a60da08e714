"""A car that nobody can take now: its driver waits while robots are at work, and has it back where none is."""

import pytest

from onboard.contract.codes import (
    CONTRACT_VERSION,
    DoorPosition,
    Grade,
    KindCode,
    LegAction,
    LightColour,
    MachineState,
    Operation,
)
from onboard.contract.messages import BayState, DoorState, Heartbeat, Itinerary, Leg, Reference, Stamp
from onboard.systems.car_park.bay_calls import MOST_PUT_OFF
from onboard.systems.car_park.bay_task import BayPhase, BayTask
from onboard.systems.car_park.compartment import Compartment
from tests.kinds.test_tickets import BAY, ROBOT, SITE, WHEELBASE_MM, Desk

COMES = Reference(BAY, 77)
SECOND_US = 1_000_000
LOCKED_AND_FULL = (
    DoorState(BAY, DoorPosition.LOCKED, DoorPosition.LOCKED, LightColour.RED),
    BayState(BAY, 1_500, 4_300, 1_500, WHEELBASE_MM, True, False, 0),
)
BEAT = Heartbeat(ROBOT, CONTRACT_VERSION, SITE.digest, 0, 1, KindCode.ROBOT, MachineState.WORKING, 0)


@pytest.mark.parametrize(("is_at_work", "refusals"), [(False, 1), (True, MOST_PUT_OFF + 1)])
def test_a_driver_waits_while_robots_are_at_work(is_at_work: bool, refusals: int) -> None:
    """In a rush robots whose plans were full bid for nothing, and drivers drove off again after eight seconds."""
    desk = Desk()
    bay = desk.holon.behaviour
    assert isinstance(bay, Compartment)
    here = bay.station
    legs = (Leg(LegAction.WORK, here.track, here.index, here.index, here.side, 600_000),) if is_at_work else ()
    desk.holon.receive(Itinerary(ROBOT, 1, Grade.FIRM, Stamp(1_000, BAY, 1), legs), desk.now_us)
    bay.calls.job = job = BayTask(COMES, Operation.PARK, COMES, WHEELBASE_MM)
    bay.phase = BayPhase.AWAITING
    bay.calls.call_for(job, desk.now_us)
    desk.sense(*LOCKED_AND_FULL)
    while bay.phase is BayPhase.AWAITING:
        desk.now_us += SECOND_US // 4
        desk.holon.receive(BEAT, desk.now_us)
        desk.holon.wake(desk.now_us)
        assert desk.now_us < 300 * SECOND_US
    assert (bay.phase, job.refusals) == (BayPhase.HANDOVER, refusals)
