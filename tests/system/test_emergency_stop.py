"""An emergency stop holds everybody by name, from whomever it comes; an operator's Go, or half a minute, lifts it."""

from functools import partial

import pytest

from bus_sim.sites import find_site
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import MachineState, Reason
from onboard.contract.messages import (
    DoorOrder,
    DriveOrder,
    DriveState,
    EmergencyStop,
    Go,
    Halted,
    Heartbeat,
    Message,
    ShuttleOrder,
)
from onboard.wire.codec import fleet_codec
from tests.sites import at_the_key
from tests.system.scene import Scene, play, stays

SITE = at_the_key(find_site("small"))
GHOST, OPERATOR = 240, 251
#: The first robot is on its way with the car then, and is not after it has braked.
STOP_S, AT_REST_S = 45.0, 48.0
ORDERS = (DriveOrder, ShuttleOrder, DoorOrder)


def say(simulation: Simulation, message: Message) -> None:
    bus = simulation.fleet.attach(f"{message.sender} {simulation.loop.now_us()}", message.sender)
    for frame in fleet_codec().encode(message):
        bus.send(frame)


def stopped(*words: tuple[float, Message]) -> Scene:
    """One car in and out, with these words of strangers and operators at their times, s."""

    def before(simulation: Simulation) -> None:
        for at_s, word in words:
            simulation.loop.call_at(at_s, partial(say, simulation, word))

    return play(SITE, stays((0, 200)), before=before, limit_s=900)


def orders(scene: Scene, from_s: float, to_s: float) -> list[Message]:
    return [one for kind in ORDERS for t, one in scene.all(kind) if from_s * 1e6 < t < to_s * 1e6]


def moving(scene: Scene, from_s: float, to_s: float) -> list[DriveState]:
    """What drives told while they moved: robots say on the fleet bus only now and then where they are."""
    return [one for t, one in scene.all(DriveState) if from_s * 1e6 < t < to_s * 1e6 and one.speed_mm_s]


@pytest.mark.parametrize(
    ("words", "until_s"),
    [
        ([(STOP_S, EmergencyStop(GHOST, Reason.OPERATOR))], STOP_S + 30),
        ([(STOP_S, EmergencyStop(GHOST, Reason.OPERATOR)), (55.0, Go(OPERATOR, GHOST))], 55.0),
        ([(STOP_S, EmergencyStop(GHOST, Reason.OPERATOR)), (55.0, Go(OPERATOR, 0))], 55.0),
        ([(STOP_S, EmergencyStop(OPERATOR, Reason.OPERATOR)), (60.0, EmergencyStop(GHOST, Reason.OPERATOR))], 90.0),
        ([(STOP_S, EmergencyStop(GHOST, Reason.OPERATOR)), (55.0, Go(GHOST, 0))], STOP_S + 30),
    ],
    ids=["half a minute", "lifted by name", "all lifted", "two who stop", "no operator's word"],
)
def test_everybody_stands_says_why_and_goes_on(words: list[tuple[float, Message]], until_s: float) -> None:
    scene = stopped(*words)
    assert moving(scene, STOP_S - 5, STOP_S), "it strikes a robot on its way"
    assert not moving(scene, AT_REST_S, until_s)
    assert not orders(scene, STOP_S + 0.1, until_s), "no drive, shuttle or door is ordered"
    told = [(t, one) for t, one in scene.all(Halted) if one.reason is Reason.EMERGENCY_STOP]
    assert {one.sender for _, one in told} == {one.machine for _, one in told} == set(SITE.machines)
    assert {one.cause for _, one in told} == {word.sender for _, word in words if isinstance(word, EmergencyStop)}
    assert not any(one.needs_person for _, one in told)
    assert until_s * 1e6 - 3e6 < max(t for t, _ in told) < until_s * 1e6 + 1e6
    beats = [one.state for t, one in scene.all(Heartbeat) if AT_REST_S * 1e6 < t < until_s * 1e6]
    assert set(beats) == {MachineState.OBSTACLE}
    assert moving(scene, until_s, until_s + 20), "it goes on by itself"
    assert scene.simulation.plant.street.is_over
    scene.assert_sound()
