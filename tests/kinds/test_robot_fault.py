"""A robot that has failed waits for a person, and does nothing meanwhile but say what it gives back."""

from onboard.contract.codes import DriveMode, KindCode, MachineState, ShuttleMode, Side
from onboard.contract.messages import BusTime, DriveState, ShuttleState
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
