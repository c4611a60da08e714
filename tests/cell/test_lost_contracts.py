"""A contract that is taken back while its rest is called for, or was given to somebody: nobody keeps the rest."""

from collections.abc import Sequence

from onboard.contract.cell import ArmMode, GripMode
from onboard.contract.cell_device import ArmState, GripState
from onboard.contract.codes import CallResult, Reason, TaskPhase
from onboard.contract.constants import NOBODY
from onboard.contract.messages import Award, CallForProposals, Message, Reference, TaskReport
from onboard.core.effects import Effect, Send
from onboard.core.motion_authority import acts
from onboard.holon.holon import Holon
from onboard.systems.cell.geometry import Point
from onboard.systems.cell.records import ContractRecord, ContractStage, StageRecord
from onboard.systems.cell.robot import ArmRobot
from onboard.systems.registry import factory_for
from tests.cell.playing import cell

ARM, OTHER, MANAGER = 1, 2, 9
TASK, PART, REST = Reference(MANAGER, 1), Reference(MANAGER, 7), Reference(ARM, 5)
NOW_US = 10_000_000
#: To the end of its area, and the rest to somebody else.
CONTRACT = ContractRecord(
    TASK,
    PART,
    ARM,
    0,
    "10000,10000",
    "40000,30000",
    "10000,10000 20000,10000",
    "",
    (ARM,),
    1.0,
    1.0,
    (ARM,),
    REST.number,
)
TAKEN_BACK = Award(MANAGER, 0, NOBODY, TASK, 1, CallResult.REJECTED, Reason.LEFT_OUT)


def robot() -> ArmRobot:
    """One that was started again with that contract: somebody is to be found for the rest."""
    site = cell()
    entries = [CONTRACT.entry, StageRecord(TASK, ContractStage.WON, 0).entry]
    machine = site.machines[ARM]
    behaviour = Holon(site, machine, factory_for(site, machine.kind), boot=2, entries=entries).behaviour
    assert isinstance(behaviour, ArmRobot)
    behaviour.fleet.tokens.trust()
    behaviour.fleet.motion.why_still = acts
    here = Point(10_000, 10_000)
    behaviour.sense(ArmState(ARM, 0, *here, ArmMode.RESTING), NOW_US)
    behaviour.sense(GripState(ARM, behaviour.gripper.link.sequence, GripMode.OPEN, Reference(0, 0)), NOW_US)
    return behaviour


def said(effects: Sequence[Effect]) -> list[Message]:
    return [one.message for one in effects if isinstance(one, Send)]


def test_the_call_for_the_rest_of_a_contract_that_is_taken_back_is_withdrawn() -> None:
    """Whoever won it would wait for a part that nobody brings, and everybody behind it."""
    one = robot()
    calls = [word for word in said(one.advance(NOW_US)) if isinstance(word, CallForProposals)]
    assert [call.task for call in calls] == [REST]
    one.hear(TAKEN_BACK, NOW_US + 1)
    ends = [word for word in said(one.advance(NOW_US + 1)) if isinstance(word, Award)]
    assert [(end.call, end.winner, end.result) for end in ends] == [(calls[0].call, NOBODY, CallResult.WITHDRAWN)]


def test_who_has_the_rest_of_a_contract_that_is_no_more_hears_that_nobody_is_to_have_it() -> None:
    one = robot()
    one.advance(NOW_US)
    one.hear(TAKEN_BACK, NOW_US + 1)
    has_it = TaskReport(OTHER, REST, TaskPhase.AWARDED, 0, Reason.NONE)
    assert said(one.hear(has_it, NOW_US + 2)) == [Award(ARM, 0, NOBODY, REST, 1, CallResult.REJECTED, Reason.LEFT_OUT)]
    others = TaskReport(OTHER, Reference(3, 5), TaskPhase.AWARDED, 0, Reason.NONE)
    assert said(one.hear(others, NOW_US + 3)) == [], "that is its own manager's to say"
