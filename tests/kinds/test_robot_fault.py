"""A robot that has failed waits for a person, and does nothing meanwhile but say what it gives back."""

from onboard.contract.codes import DriveMode, KindCode, MachineState, ShuttleMode, Side
from onboard.contract.messages import BusTime, DriveState, ShuttleState, TokenRequest
from onboard.core.effects import Send
from onboard.core.site import Segment
from onboard.holon.holon import Holon
from onboard.systems.registry import factory_for
from tests.sites import one_floor

SITE = one_floor()
STEWARD, ROBOT = 1, 11
#: Looked at in these steps, us, for longer than the pause after a restart.
STEP_US = 1_000_000


def test_a_shuttle_that_fails_right_after_a_restart_does_not_keep_the_robot_awake() -> None:
    """Found by the fuzzer: the end of the pause stayed due for ever, and no wake changed that."""
    robot = Holon(
        SITE, SITE.machines[ROBOT], factory_for(SITE, KindCode.ROBOT), boot=2, entries=[{"record": "boot", "boot": 1}]
    )
    robot.start(0)
    robot.receive(BusTime(STEWARD, 0), 0)
    home_mm = (SITE.machines[ROBOT].home.index - 1) * SITE.tracks[1].pitch_mm
    robot.sense(DriveState(ROBOT, 0, home_mm, 0, DriveMode.STANDING, True), 10)
    assert [robot.behaviour.state] == [MachineState.STARTING], "a pause until the others have said what they plan"
    robot.sense(ShuttleState(ROBOT, 0, ShuttleMode.FAULT, 0, Side.NEAR, 0, 2_500), 20)
    for now_us in range(STEP_US, 10 * STEP_US, STEP_US):
        robot.wake(now_us)
        due_us = robot.next_wake()
        assert due_us is not None and due_us > now_us
    assert robot.behaviour.state is MachineState.STOPPED


def test_a_robot_that_was_pushed_as_it_failed_asks_for_the_slot_that_it_is_in() -> None:
    """Others were refused that slot by its word alone, which a steward that starts again has not heard."""
    robot = Holon(SITE, SITE.machines[ROBOT], factory_for(SITE, KindCode.ROBOT), boot=1)
    home = SITE.machines[ROBOT].home
    home_mm = (home.index - 1) * SITE.tracks[home.track].pitch_mm
    effects = robot.start(0) + robot.receive(BusTime(STEWARD, 0), 0)
    for position_mm, mode in ((home_mm, DriveMode.STANDING), (home_mm, DriveMode.MOVING)):
        effects += robot.sense(DriveState(ROBOT, 0, position_mm, 0, mode, True), STEP_US)
    effects += robot.sense(DriveState(ROBOT, 0, home_mm - 600, 0, DriveMode.STANDING, False), 2 * STEP_US)
    effects += robot.sense(ShuttleState(ROBOT, 0, ShuttleMode.FAULT, 0, Side.NEAR, 0, 2_500), 2 * STEP_US + 10)
    for now_us in range(3 * STEP_US, 20 * STEP_US, STEP_US):
        effects += robot.wake(now_us)
    assert robot.behaviour.state is MachineState.STOPPED
    asked = {one.message.token for one in effects if isinstance(one, Send) and isinstance(one.message, TokenRequest)}
    assert Segment(home.track, home.index - 1).number in asked
