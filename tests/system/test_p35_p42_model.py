"""What every machine knows of the park by listening alone (row P35), and whose a free place is (row P42)."""

import asyncio

import pytest

from bus_sim.sites import find_site
from bus_sim.systems.car_park.simulation import Simulation
from onboard.config.site import parse_site
from onboard.contract.codes import Grade, LegAction, MachineState, Operation, Side, TaskPhase
from onboard.contract.messages import CallForProposals, Heartbeat, Itinerary, TaskReport
from onboard.core.serial import from_bus_ms
from onboard.core.site import Station
from onboard.systems.car_park.site import CarPark, car_park
from onboard.ways.mirror import way_mirror
from tests.config.support import ROOT, changed
from tests.sites import at_the_key, telling
from tests.system.scene import Scene, play, stays

SMALL = car_park(find_site("small"))
#: MR2 stands idle when its controller loses its power, and has it back a little later, s.
OFF_S, ON_S = 150.0, 156.0


@pytest.fixture(scope="module")
def restarted() -> Scene:
    """Two cars are in the park when one robot's controller is started anew."""

    def plan(simulation: Simulation) -> None:
        machine = SMALL.machine("MR2")

        async def outage() -> None:
            await asyncio.sleep(OFF_S)
            await simulation.controllers[machine.node_id].stop()
            await asyncio.sleep(ON_S - OFF_S)
            simulation.start_controller(machine)

        kept.append(simulation.loop.create_task(outage()))

    kept: list[asyncio.Task[None]] = []
    scene = play(SMALL, stays((0, None), (40, None)), before=plan, extra_s=120)
    assert kept[0].done() and kept[0].exception() is None
    return scene


def test_p35_the_model_is_built_anew_from_the_bus_after_a_restart(restarted: Scene) -> None:
    """Heartbeats carry a digest of each machine's model: empty at first, then that of all others."""
    beats = [(t, beat) for t, beat in restarted.all(Heartbeat) if beat.sender == SMALL.machine("MR2").node_id]
    _, old = [(t, beat) for t, beat in beats if t < OFF_S * 1e6][-1]
    again = [(t, beat) for t, beat in beats if t > ON_S * 1e6]
    assert {beat.boot for _, beat in again} == {old.boot + 1}
    assert again[0][1].mirror_digest != old.mirror_digest and again[0][1].state is MachineState.STARTING
    last = {beat.sender: beat.mirror_digest for _, beat in restarted.all(Heartbeat)}
    assert set(last) == set(SMALL.machines) and len(set(last.values())) == 1
    others = [(t, beat.mirror_digest) for t, beat in restarted.all(Heartbeat) if beat.sender == 1]
    agreed_us = next(t for t, beat in again if beat.mirror_digest == [digest for at, digest in others if at < t][-1])
    assert agreed_us < (ON_S + 10) * 1e6, "within a few heartbeats, while the other robot is at work"


def test_p35_the_model_holds_cars_plans_and_where_all_machines_are(restarted: Scene) -> None:
    world = restarted.simulation.plant.world
    standing = {where.number for where in world.where.values() if isinstance(where, Station)}
    assert len(standing) == 2
    for controller in restarted.simulation.controllers.values():
        mirror = controller.holon.mirror
        assert {record.station for record in way_mirror(mirror).cars.values()} == standing
        assert len(way_mirror(mirror).free_places()) == len(SMALL.places) - 2
        assert {node for node in SMALL.machines if node in mirror.itineraries} >= set(world.robots)
        for node in set(world.robots) - {controller.holon.node_id}:
            seen = mirror.progress[node]
            assert (seen.track, seen.index) == world.standing_position(node)


def narrow() -> CarPark:
    """The small site with a second compartment beside the first; p(1,7) is the nearest place that both have left."""
    text = (ROOT / "bus_sim" / "sites" / "small.toml").read_text(encoding="utf-8")
    gone = "".join(f'"p(1,{index})", ' for index in range(1, 5))
    text = changed('sides = ["near", "far"]', f'sides = ["near"]\nwithout = [{gone}]', text)
    return at_the_key(parse_site(text + '[[compartments]]\nname = "IOC2"\nnode = 2\nat = "p(1,6)"\n', "narrow.toml"))


def aims(itinerary: Itinerary) -> Station | None:
    """The place at which an itinerary leaves a car."""
    works = [Station(leg.track, leg.to_index, leg.side) for leg in itinerary.legs if leg.action is LegAction.WORK]
    return works[-1] if works else None


def test_p42_two_parkings_of_one_moment_never_come_to_one_place() -> None:
    """The bidder chooses the place: both bids aim at one, and the award that is first takes it."""
    scene = play(telling(narrow()), stays((2.9, None), (0, None)), extra_s=200)
    calls = [(t, call) for t, call in scene.all(CallForProposals) if call.operation is Operation.PARK]
    assert calls[1][0] < from_bus_ms(calls[0][1].deadline_ms, calls[0][0]), "both are open at once"
    wished = [aims(plan) for _, plan in scene.all(Itinerary) if plan.grade is Grade.TENTATIVE]
    assert wished == [Station(1, 7, Side.NEAR)] * 2
    firm: dict[int, Station] = {}
    for _, plan in scene.all(Itinerary):
        if plan.grade is Grade.FIRM and (place := aims(plan)) is not None:
            firm[plan.sender] = place
            assert len(set(firm.values())) == len(firm), f"both to {place}"
    scene.assert_sound()
    assert set(firm.values()) == {Station(1, 7, Side.NEAR), Station(1, 8, Side.NEAR)}
    left = {report.station for _, report in scene.all(TaskReport) if report.phase is TaskPhase.DONE}
    world = scene.simulation.plant.world
    assert left == {place.number for place in firm.values()}
    assert left == {where.number for where in world.where.values() if isinstance(where, Station)}
