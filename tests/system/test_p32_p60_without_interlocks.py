"""Rows P32, P60 without the plant's help: home switches are not wired to the drives, and doors open when told to.

What the controllers order, and what they were told when they did, is read from the device buses.
"""

import dataclasses
from collections.abc import Sequence

import pytest

from bus_sim.sites import find_site
from bus_sim.systems.car_park.planted.tools import replace
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import DoorAction, DoorName, DoorPosition, DriveMode, ShuttleAction, ShuttleMode, Side
from onboard.contract.messages import (
    BayState,
    DoorOrder,
    DoorState,
    DriveOrder,
    DriveState,
    Message,
    ShuttleOrder,
    ShuttleState,
)
from tests.cut import Timed, shown_at
from tests.sites import at_the_key
from tests.system.scene import Scene, play, stays

BAY, ROBOT = 1, 11
#: When the shuttle is told to be out though nobody sent it: the robot is on its way then, s.
STRAYS_S, BACK_S = 30.0, 4.0
#: A person comes in through the wall when the input door is locked, before the robot is there, and goes, s.
ENTERS_S, LEAVES_S = 47.0, 75.0
SECOND = 1_000_000


def without_interlocks(simulation: Simulation) -> None:
    for carrier in simulation.plant.carriers.values():
        replace(carrier, "_shuttle_home", lambda _: lambda: True)
    for compartment in simulation.plant.compartments.values():
        replace(compartment.doors[DoorName.OUTPUT], "_may_open", lambda _: lambda: True)


def said(scene: Scene) -> list[Timed]:
    return [(one.time_us, one.message) for one in scene.said]


@pytest.fixture(scope="module")
def strays() -> Scene:
    """One car in and out; on its first way the robot's shuttle is said to be out for 4 s."""

    def before(simulation: Simulation) -> None:
        loop, link = simulation.loop, simulation.links[ROBOT]
        home = ShuttleState(ROBOT, 0, ShuttleMode.HOME, 0, Side.NEAR, 0, 0)

        def astray(message: Message) -> Message:
            is_then = STRAYS_S * SECOND <= loop.now_us() < (STRAYS_S + BACK_S) * SECOND
            if isinstance(message, ShuttleState) and is_then:
                return dataclasses.replace(message, mode=ShuttleMode.MOVING, extension_mm=300)
            return message

        link.outgoing.append(astray)
        for at_s in (STRAYS_S, STRAYS_S + BACK_S):
            loop.call_at(at_s, link.send, home)

    return play(at_the_key(find_site("small")), stays((0, 200)), plant=without_interlocks, before=before, extra_s=0)


def test_p32_no_carrier_is_sent_while_its_shuttle_is_said_to_be_out(strays: Scene) -> None:
    """Nor a shuttle from a carrier that moves."""
    assert strays.simulation.plant.street.summary().served == 1

    def check(heard: Sequence[Timed]) -> None:
        home: dict[int, bool] = {}
        drive: dict[int, DriveState] = {}
        out_us: dict[int, int] = {}
        sent, strayed, reached = 0, 0, 0
        for at_us, one in heard:
            match one:
                case ShuttleState():
                    if home.get(one.sender) is not (one.mode is ShuttleMode.HOME):
                        out_us[one.sender] = at_us
                    home[one.sender] = one.mode is ShuttleMode.HOME
                    speed = drive[one.sender].speed_mm_s if one.sender in drive else 0
                    strayed += one.mode is ShuttleMode.MOVING and speed != 0
                case DriveState():
                    drive[one.sender] = one
                case DriveOrder() if one.sender in home and one.sender in drive:
                    # What it is told twice, and what it is at, does not move it.
                    moves = abs(one.target_mm - drive[one.sender].position_mm) > 5 and one.speed_limit_mm_s > 0
                    assert home[one.sender] or not moves or at_us < out_us[one.sender] + 5_000, at_us
                    sent += moves
                case ShuttleOrder() if one.action is ShuttleAction.REACH:
                    assert (
                        one.sender in drive
                        and drive[one.sender].mode is DriveMode.STANDING
                        and not drive[one.sender].speed_mm_s
                    )
                    reached += 1
        assert sent > 20 and strayed and reached >= 4

    shown_at(check, said(strays), ShuttleState, DriveState, DriveOrder, ShuttleOrder)


def test_p60_the_output_door_is_not_told_to_open_while_the_curtain_sees_somebody() -> None:
    def before(simulation: Simulation) -> None:
        world = simulation.plant.world
        simulation.loop.call_at(ENTERS_S, world.person_enters, BAY)
        simulation.loop.call_at(LEAVES_S, world.person_leaves, BAY)

    site = at_the_key(find_site("small"))
    scene = play(site, stays((0, None)), plant=without_interlocks, before=before, extra_s=60)

    def check(heard: Sequence[Timed]) -> None:
        inside, input_door, waited, opened = False, DoorPosition.OPEN, False, 0
        for at_us, one in heard:
            match one:
                case BayState():
                    inside = one.person_inside
                    waited |= inside and one.carrier_in_front and input_door is DoorPosition.LOCKED
                case DoorState():
                    input_door = one.input_door
                case DoorOrder() if one.door is DoorName.OUTPUT and one.action is DoorAction.OPEN:
                    assert not inside and input_door is DoorPosition.LOCKED
                    opened = opened or at_us
        assert waited, "the robot stood before the bay while somebody was in it"
        assert LEAVES_S * SECOND < opened < (LEAVES_S + 1) * SECOND

    shown_at(check, said(scene), BayState, DoorState, DoorOrder)
