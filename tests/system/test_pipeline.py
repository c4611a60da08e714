"""Compartments as pipelines: who comes in is called for while he drives, and the next car while the bay still works."""

import asyncio
from dataclasses import replace
from itertools import pairwise

import pytest

from bus_sim.sites import find_site
from bus_sim.systems.car_park.demand import Demand
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import CallResult, DeskInput, DoorPosition, LightColour, Operation, TaskPhase
from onboard.contract.messages import (
    Award,
    BayState,
    CallForProposals,
    CarAt,
    DeskEvent,
    DoorState,
    Message,
    TaskReport,
)
from onboard.systems.car_park.pipeline import MOST_OUT
from onboard.ways.site import BayUse, way_site
from tests.sites import at_arrival, at_the_key, one_floor
from tests.system.scene import Scene, play, stays
from tests.thinned import some


def calls(scene: Scene, operation: Operation) -> list[tuple[int, CallForProposals]]:
    return [(time_us, one) for time_us, one in scene.all(CallForProposals, "fleet") if one.operation is operation]


def assert_served(scene: Scene, parked: int, served: int) -> None:
    scene.assert_sound()
    street = scene.simulation.plant.street.summary()
    assert (street.parked, street.served, street.asking, street.queueing) == (parked, served, 0, 0)


@pytest.fixture(scope="module")
def two() -> Scene:
    """The first car is asked for while the second one is parked, by the same compartment."""
    scene = play(at_arrival(find_site("small")), stays((0, 305), (300, None)))
    assert_served(scene, 2, 1)
    return scene


def test_a_driver_is_called_for_while_he_drives_in_and_the_robot_is_there_when_the_bay_is_locked(two: Scene) -> None:
    coming_us, _ = two.first(BayState, lambda one: one.person_inside)
    call_us, call = calls(two, Operation.PARK)[0]
    key_us, _ = two.first(DeskEvent, lambda one: one.event is DeskInput.KEY)
    locked_us, _ = two.first(DoorState, lambda one: one.input_door is DoorPosition.LOCKED, after_us=key_us)
    opened_us, _ = two.first(DoorState, lambda one: one.output_door is DoorPosition.OPENING, after_us=call_us)
    assert coming_us <= call_us < coming_us + 100_000 < key_us and call.ready_ms > 0
    assert locked_us <= opened_us < locked_us + 1_000_000, "the robot waited for the door, not the door for the robot"


def test_a_ticket_is_called_for_at_once_with_the_time_from_which_the_bay_can_take_the_car(two: Scene) -> None:
    ticket_us, _ = two.first(DeskEvent, lambda one: one.event is DeskInput.TICKET)
    ((call_us, call),) = calls(two, Operation.RETRIEVE)
    loaded_us, _ = two.first(TaskReport, lambda one: one.phase is TaskPhase.LOADED, after_us=call_us)
    assert ticket_us < call_us < ticket_us + 5_000_000 < loaded_us, "the bay holds the other car still"
    assert call.ready_ms > 0
    # The bay stays locked for people from the second car's robot to the first car's.
    second = calls(two, Operation.PARK)[1][1].task
    begun_us, _ = two.first(TaskReport, lambda one: (one.task, one.phase) == (second, TaskPhase.LOADED))
    done_us = max(time_us for time_us, one in two.all(TaskReport, "fleet") if one.phase is TaskPhase.DONE)
    doors = [one for time_us, one in two.all(DoorState) if begun_us < time_us < done_us]
    assert doors and all(one.input_door is DoorPosition.LOCKED and one.light is LightColour.RED for one in doors)


def test_two_robots_fetch_at_the_same_time_for_one_bay() -> None:
    """On a drawn site four robots had nothing to do while cars came out one by one, a customer each 150 s."""
    uses = {1: BayUse.ENTRY, 2: BayUse.ENTRY, 3: BayUse.EXIT}
    scene = play(replace(at_arrival(find_site("standard")), bay_uses=uses), stays((0, 300), (1, 300)))
    assert_served(scene, 2, 2)
    first, second = (call.task for _, call in calls(scene, Operation.RETRIEVE))
    loaded_us, _ = scene.first(TaskReport, lambda one: (one.task, one.phase) == (second, TaskPhase.LOADED))
    done_us, _ = scene.first(TaskReport, lambda one: (one.task, one.phase) == (first, TaskPhase.DONE))
    assert loaded_us < done_us, "the second car is aboard before the first is in the bay"


def test_with_the_key_nothing_is_called_for_before_it_and_nobody_is_fetched_while_the_bay_works() -> None:
    scene = play(at_the_key(find_site("small")), stays((0, 305), (300, None)))
    assert_served(scene, 2, 1)
    keys = [time_us for time_us, one in scene.all(DeskEvent) if one.event is DeskInput.KEY]
    assert all(one.ready_ms == 0 for _, one in scene.all(CallForProposals))
    assert all(call_us > min(keys) for call_us, _ in calls(scene, Operation.PARK))
    ((fetch_us, _),) = calls(scene, Operation.RETRIEVE)
    done = [time_us for time_us, one in scene.all(TaskReport, "fleet") if one.phase is TaskPhase.LOADED]
    assert fetch_us > done[1], "the second car has left the bay"


def test_a_person_without_a_car_costs_one_call_that_is_taken_back() -> None:
    def walks_in(simulation: Simulation) -> None:
        world = simulation.plant.world
        simulation.loop.call_later(40.0, world.person_enters, 1)
        simulation.loop.call_later(70.0, world.person_leaves, 1)

    scene = play(at_arrival(one_floor()), stays((200, None)), before=walks_in)
    assert_served(scene, 1, 0)
    first, *_ = calls(scene, Operation.PARK)
    assert first[0] == pytest.approx(40e6, abs=1e6)
    taken_back = [time_us for time_us, one in scene.all(Award) if one.result is CallResult.WITHDRAWN]
    assert taken_back and taken_back[0] == pytest.approx(70e6, abs=1e6)


def crossing(simulation: Simulation) -> None:
    """The robot that is to take the second car away loses its power at its home, once the bay's call is awarded."""
    awards: list[Award] = []

    def hear(message: Message, _time_us: int) -> None:
        if isinstance(message, Award) and message.result is CallResult.AWARDED and len(awards) < 2:
            awards.append(message)
            if len(awards) == 2:
                simulation.loop.call_later(0.5, simulation.crash, simulation.site.machines[message.winner])

    simulation.observers.append(hear)


def test_a_loaded_robot_before_a_bay_in_which_another_car_waits_does_not_block_it_for_ever() -> None:
    """The only robot that is left has the first car when the second is in its way: it leaves it at a place."""
    scene = play(at_arrival(find_site("small")), stays((0, 303), (300, None)), before=crossing, limit_s=1_500)
    assert_served(scene, 2, 1)
    bay = way_site(scene.simulation.site).compartments[1]
    fetched = [one for _, one in calls(scene, Operation.RETRIEVE)]
    done = [one for _, one in scene.all(TaskReport, "fleet") if one.phase is TaskPhase.DONE]
    stations = [one.station for one in done if one.task in {call.task for call in fetched}]
    assert len(stations) == 2 and stations[0] != bay.number == stations[1]


def test_drivers_who_cannot_be_seen_outside_are_let_in_between_the_cars_that_go_out() -> None:
    """All are asked for at once, and a driver comes meanwhile: he is passed over for three, not for all of them."""
    parked = [(75 * number, 340) for number in range(MOST_OUT + 1)]
    scene = play(at_arrival(one_floor()), stays(*parked, (350, None)), extra_s=30)
    assert_served(scene, len(parked) + 1, len(parked))
    *fetched, comes = (customer.visit for customer in scene.simulation.plant.street.customers)
    gone = [visit.gone_us for visit in fetched if visit.gone_us is not None]
    assert comes.parked_us is not None and sum(gone_us < comes.parked_us for gone_us in gone) == MOST_OUT


def test_where_the_key_calls_cars_go_in_and_out_by_turns() -> None:
    """Two are asked for while two drivers queue: neither side waits for both of the other."""
    scene = play(at_the_key(one_floor()), stays((0, 300), (100, 300), (300, None), (300, None)), extra_s=30)
    assert_served(scene, 4, 2)
    order = [one.operation for _, one in scene.all(CallForProposals, "fleet") if one.attempt == 1]
    assert order[:2] == [Operation.PARK, Operation.PARK]
    assert all(one is not other for one, other in pairwise(order[2:]))


def test_with_a_queue_outside_two_cars_come_in_and_up_to_three_go_out_by_turns() -> None:
    """Robots of those that go out fetch at the same time: by single turns the empty bay waited for each."""
    parked, comes = [(75 * number, 650) for number in range(4)], [(560 + number, None) for number in range(6)]
    scene = play(at_arrival(one_floor()), stays(*parked, *comes), limit_s=3_000, extra_s=30)
    assert_served(scene, 10, 4)
    order = [one.operation.name[0] for _, one in scene.all(CallForProposals, "fleet") if one.attempt == 1]
    assert "".join(order) == "PPPP" + "PP" + "RRR" + "PP" + "R" + "PP"


def restarted(at_s: float, demand: Demand, name: str = "IOC1") -> Scene:
    """A machine loses its controller at ``at_s`` and gets it back with the same journal 3 s later."""

    def plan(simulation: Simulation) -> None:
        machine = simulation.site.machine(name)

        async def outage() -> None:
            await asyncio.sleep(at_s)
            await simulation.controllers[machine.node_id].stop()
            await asyncio.sleep(3.0)
            simulation.start_controller(machine)

        outages.append(simulation.loop.create_task(outage()))

    outages: list[asyncio.Task[None]] = []
    scene = play(at_arrival(find_site("small")), demand, before=plan, limit_s=1_500)
    assert all(outage.done() and outage.exception() is None for outage in outages)
    return scene


#: From the second car's coming over both calls, either robot at the bay, to the first car's leaving, s.
AHEAD_S = (311, 314, 316, 318, 320, 323, 327, 331, 336, 342, 350, 358, 366, 374, 382, 390, 398, 406, 420)


@pytest.mark.parametrize("at_s", some(AHEAD_S, 9))
def test_a_compartment_killed_while_it_looks_ahead_goes_on_with_both(at_s: int) -> None:
    assert_served(restarted(at_s, stays((0, 305), (300, None))), 2, 1)


def test_a_robot_killed_while_it_takes_a_car_that_was_called_for_unmeasured_knows_its_wheelbase() -> None:
    """It stated a wheelbase of 0, and stopped for good (`small`, two crashes, seed 7711)."""
    scene = play(at_arrival(find_site("small")), stays((0, None)))
    loaded_us, loaded = scene.first(TaskReport, lambda one: one.phase is TaskPhase.LOADED)
    robot = scene.simulation.site.machines[loaded.sender].name
    killed = restarted(loaded_us / 1e6 - 1.0, stays((0, None)), robot)
    assert_served(killed, 1, 0)
    assert {one.wheelbase_mm for _, one in killed.all(CarAt)} == {one.wheelbase_mm for _, one in scene.all(CarAt)}
