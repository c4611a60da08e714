"""A car that nobody can take now: its driver waits while robots are at work, and has it back where none is."""

from dataclasses import replace

import pytest

from onboard.contract.codes import (
    CONTRACT_VERSION,
    DeskInput,
    DeskText,
    DoorPosition,
    Grade,
    KindCode,
    LegAction,
    LightColour,
    MachineState,
    Operation,
)
from onboard.contract.messages import (
    BayState,
    CallForProposals,
    DeskEvent,
    DoorState,
    Heartbeat,
    Itinerary,
    Leg,
    Reference,
    Stamp,
)
from onboard.core.effects import Send
from onboard.systems.car_park.bay_task import BayPhase, BayTask
from onboard.systems.car_park.compartment import Compartment
from onboard.systems.car_park.in_vain import MOST_PUT_OFF
from tests.kinds.test_tickets import BAY, ROBOT, SITE, WHEELBASE_MM, Desk, printed, right, shown

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
    _, bay = refused(is_at_work=is_at_work)
    assert bay.job is not None
    assert (bay.phase, bay.job.refusals) == (BayPhase.HANDOVER, refusals)


def refused(*, is_at_work: bool) -> tuple[Desk, Compartment]:
    """A desk whose call for the car in its bay nobody could take, just after it has given the car back."""
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
    return desk, bay


@pytest.mark.parametrize("is_inside", [True, False])
def test_a_driver_who_is_inside_and_presses_again_gets_his_ticket_and_is_called_for(is_inside: bool) -> None:
    """Drawn car park 5767, devices: desk and doors heard no order as nobody could; he pressed for two hours in vain.

    Who stands at the desk outside gets nobody's ticket.
    """
    desk, _ = refused(is_at_work=False)
    bay = replace(LOCKED_AND_FULL[1], person_inside=is_inside)
    desk.sense(bay, replace(LOCKED_AND_FULL[0], input_door=DoorPosition.OPEN))
    effects = desk.sense(DeskEvent(BAY, 9, DeskInput.KEY, Reference(0, 0)))
    assert (shown(effects) == [DeskText.TAKE_TICKET]) is is_inside
    assert not is_inside or printed(effects) == right(COMES).code
    desk.now_us += SECOND_US
    called = desk.sense(replace(bay, person_inside=False), LOCKED_AND_FULL[0])
    called += desk.holon.wake(desk.now_us + SECOND_US)
    said = [one.message for one in called if isinstance(one, Send)]
    assert any(isinstance(one, CallForProposals) and one.car == COMES for one in said) is is_inside
