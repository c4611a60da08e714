"""A compartment that wants a task done no more ends its call as well: nobody bids for it, and nobody wins it."""

import pytest

from onboard.contract.codes import CallResult, Operation
from onboard.contract.messages import Award, CallForProposals, Reference
from onboard.core.effects import Effect, Send
from onboard.systems.car_park.bay_task import BayPhase, BayTask
from onboard.systems.car_park.compartment import Compartment
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
