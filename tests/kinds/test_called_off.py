"""A compartment that wants a task done no more ends its call as well: nobody bids for it, and nobody wins it."""

from dataclasses import replace

import pytest

from bus_sim.sites import find_site
from onboard.contract.codes import CallResult, Operation
from onboard.contract.constants import OUTSIDE
from onboard.contract.messages import Award, CallForProposals, CarAt, Reference
from onboard.core.effects import Effect, Send
from onboard.holon.holon import Holon
from onboard.systems.car_park.bay_task import BayPhase, BayTask
from onboard.systems.car_park.compartment import Compartment
from onboard.systems.car_park.site import DeskPolicy, car_park
from onboard.systems.registry import factory_for
from tests.kinds.test_tickets import BAY, CAR, WHEELBASE_MM, Desk

TASK = Reference(BAY, 77)
#: Past the last attempt of any call, us.
LONG_US = 60_000_000


def words(effects: list[Effect]) -> list[Award | CallForProposals]:
    said = [one.message for one in effects if isinstance(one, Send)]
    return [one for one in said if isinstance(one, Award | CallForProposals)]


@pytest.mark.parametrize(
    "operation", [Operation.PARK, Operation.RETRIEVE], ids=["its driver leaves", "it goes to another bay"]
)
def test_a_task_that_is_over_before_its_call_is_called_for_no_more(operation: Operation) -> None:
    desk = Desk()
    behaviour, now_us = desk.holon.behaviour, desk.now_us
    assert isinstance(behaviour, Compartment)
    calls = behaviour.calls
    if operation is Operation.PARK:
        said = calls.call_for_who_comes(TASK, now_us, now_us)
        over = calls.not_come(now_us)
    else:
        calls.ahead = BayTask(TASK, operation, CAR, WHEELBASE_MM)
        said = calls.call_for(calls.ahead, now_us)
        over, _ = calls.give_up(CAR, BayPhase.SERVING, now_us)
    (call,) = [one for one in words(said) if isinstance(one, CallForProposals)]
    ended = [(one.call, one.result) for one in words(over) if isinstance(one, Award)]
    assert ended == [(call.call, CallResult.WITHDRAWN), (0, CallResult.WITHDRAWN)]
    later = words(desk.holon.wake(now_us + LONG_US))
    assert [one for one in later if one.task == TASK] == []


@pytest.mark.parametrize("is_job", [True, False], ids=["its bay waits for it", "it is the next"])
def test_nobody_waits_for_a_car_that_has_left_at_another_bay(is_job: bool) -> None:
    """No award was heard that told who takes it: its robot, which had no right to it any more, stood for minutes."""
    site, other, robot, now_us = replace(car_park(find_site("standard")), desk=DeskPolicy.NEAREST), 2, 11, 1_000
    holon = Holon(site, site.machines[BAY], factory_for(site, site.machines[BAY].kind), boot=1)
    holon.start(0)
    holon.tokens.trust()
    holon.receive(CarAt(other, CAR, site.places[0].number, 2, WHEELBASE_MM), now_us)
    behaviour = holon.behaviour
    assert isinstance(behaviour, Compartment)
    task = BayTask(TASK, Operation.RETRIEVE, CAR, WHEELBASE_MM, winner=robot)
    if is_job:
        behaviour.calls.job, behaviour.phase = task, BayPhase.AWAITING
    else:
        behaviour.calls.ahead = task
    said = words(holon.receive(CarAt(other, CAR, OUTSIDE, 4, WHEELBASE_MM), now_us))
    assert [(one.task, one.result) for one in said if isinstance(one, Award)] == [(TASK, CallResult.WITHDRAWN)]
    assert behaviour.calls.in_hand() == []
    assert behaviour.phase is not BayPhase.AWAITING
