"""A controller that is killed at any moment and started again goes on, and the car still arrives."""

import asyncio

import pytest

from bus_sim.sites import find_site
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import TaskPhase
from onboard.contract.messages import TaskReport
from tests.system.scene import Scene, play, stays
from tests.thinned import some

#: The robot that wins both tasks of the scene on the small site, and the lift that it rides.
ROBOT, LIFT = "MR1", "ER1"
#: Powered off for so long, s.
DOWN_S = 3.0


def killed(name: str, at_s: float) -> Scene:
    """One car comes and goes; the machine loses its controller at ``at_s`` and gets it back with the same journal."""

    def plan(simulation: Simulation) -> None:
        machine = simulation.site.machine(name)

        async def outage() -> None:
            await asyncio.sleep(at_s)
            await simulation.controllers[machine.node_id].stop()
            await asyncio.sleep(DOWN_S)
            simulation.start_controller(machine)

        outages.append(simulation.loop.create_task(outage()))

    outages: list[asyncio.Task[None]] = []
    scene = play(find_site("small"), stays((0, 200)), before=plan, limit_s=900)
    assert all(outage.done() and outage.exception() is None for outage in outages)
    return scene


def assert_served(scene: Scene) -> None:
    scene.assert_sound()
    street = scene.simulation.plant.street.summary()
    assert (street.parked, street.served, street.asking, street.queueing) == (1, 1, 0, 0)


#: From the way to the lift, over each step of taking and leaving the car, to the refuge; then of the way back.
ENTRY_S = (22, 25, 27, 28, 29, 31, 33, 35, 38, 41, 44, 45, 47, 49, 51, 53, 55, 57, 59, 62, 65)
EXIT_S = (214, 218, 222, 226, 230, 235, 240, 245, 250, 255, 260, 268)


#: With the bay: the customer inside, the call, the doors, the robot at work, the hand-over.
BAY_S = (12, 18, 24, 26, 27, 28, 30, 34, 38, 42, 46, 50, 54, 205, 209, 213, 221, 229, 245, 261, 265, 273, 281)
RIDE_S = (27, 28, 30, 33, 36, 50, 54, 57, 214, 218, 222, 280)


@pytest.mark.parametrize("at_s", some(BAY_S, 6))
def test_p50_a_compartment_killed_at_any_step_goes_on_with_its_customer(at_s: int) -> None:
    assert_served(killed("IOC1", at_s))


@pytest.mark.parametrize("at_s", some(RIDE_S, 4))
def test_p50_a_lift_killed_with_a_carrier_aboard_ends_its_ride(at_s: int) -> None:
    assert_served(killed(LIFT, at_s))


@pytest.mark.parametrize("at_s", some(ENTRY_S + EXIT_S, 8))
def test_p50_a_robot_killed_at_any_step_finds_its_place_and_the_car_arrives(at_s: int) -> None:
    scene = killed(ROBOT, at_s)
    assert_served(scene)
    owners = {(m.task, m.sender) for _, m in scene.all(TaskReport, "fleet") if m.phase is TaskPhase.DONE}
    assert len(owners) == len({task for task, _ in owners}) == 2, "one owner a task, and each is done once"
