"""stop and go on a running site: who stands, for how long, and that everybody is served afterwards."""

import pytest

from bus_sim.faults.arm import arm
from bus_sim.faults.injection import parse_injection
from bus_sim.sites import find_site
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import Reason
from onboard.contract.messages import DriveState, EmergencyStop, Go, Halted
from onboard.operate.commands import CommandRequest, maker_of
from tests.operate.played import Played, operates
from tests.sites import at_the_key
from tests.system.scene import Scene, play, stays

SITE = at_the_key(find_site("small"))
CARS = stays((0, 300), (40, 400), (80, None))


def played(*orders: tuple[float, CommandRequest], faults: tuple[str, ...] = ()) -> tuple[Scene, list[Played]]:
    told: list[Played] = []

    def before(simulation: Simulation) -> None:
        told.extend(operates(simulation, at_s, maker_of(SITE, command, 1)) for at_s, command in orders)

    def plant(simulation: Simulation) -> None:
        arm(simulation, [parse_injection(fault) for fault in faults])

    return play(SITE, CARS, before=before, plant=plant, limit_s=1_500), told


def moving_s(scene: Scene, from_s: float, to_s: float) -> list[float]:
    """When drives told that they move: robots say on the fleet bus only now and then where they are."""
    return [t / 1e6 for t, one in scene.all(DriveState) if from_s < t / 1e6 < to_s and one.speed_mm_s]


def assert_all_served(scene: Scene) -> None:
    assert scene.simulation.plant.oracle.finish() == []
    street = scene.simulation.plant.street.summary()
    assert (street.parked, street.served, street.queueing, street.asking) == (3, 2, 0, 0)


def test_stop_is_confirmed_by_all_and_holds_until_go() -> None:
    """The stop is still said when another person says go: it is lifted, and the first tool ends."""
    scene, (stop, go) = played((45, CommandRequest("stop")), (150, CommandRequest("go")))
    assert_all_served(scene)
    assert (stop.status, go.status) == (0, 0)
    names = [machine.name for machine in SITE.machines.values()]
    assert sorted(f"{name} holds by it" for name in names) == sorted(
        line for _, line in stop.lines if "holds by" in line
    )
    assert next(t for t, line in stop.lines if line == "all hold") <= 46_000_000
    assert moving_s(scene, 44, 45) and not moving_s(scene, 48, 150)
    assert {one.sender for _, one in scene.all(Go)} == {252}, "251 was heard"
    assert stop.lines[-1][1] == "node 252 has lifted this stop"
    assert {f"{name} goes on" for name in names} <= {line for _, line in go.lines}
    assert any("MR1 stands: emergency stop by node 251" in line for _, line in go.lines)


@pytest.mark.parametrize("at_s", [64, 82])
def test_who_has_a_car_aboard_at_a_stop_goes_on_with_it_after_a_minute(at_s: float) -> None:
    """It was said to stand, where its plan had left meanwhile, and a person had to release it: one was not served."""
    scene, (stop,) = played((at_s, CommandRequest("stop", for_us=60_000_000)))
    assert_all_served(scene)
    assert stop.status == 0
    assert not [one for _, one in scene.all(Halted) if one.reason is not Reason.EMERGENCY_STOP]


def test_a_stop_that_is_no_longer_said_ends_by_itself() -> None:
    scene, (stop,) = played((45, CommandRequest("stop", for_us=0)))
    assert_all_served(scene)
    last_us = scene.all(EmergencyStop)[-1][0]
    assert stop.status == 0 and stop.ended_us < 48_000_000
    halted = [t for t, one in scene.all(Halted) if one.reason is Reason.EMERGENCY_STOP]
    assert last_us + 26_000_000 < max(halted) < last_us + 30_000_000
    assert moving_s(scene, 76, 120)


def test_a_machine_that_is_off_has_not_confirmed_the_stop() -> None:
    scene, (stop,) = played((45, CommandRequest("stop", for_us=0)), faults=("crash:target=MR2,at_s=20,restart_s=100",))
    assert_all_served(scene)
    assert stop.status == 1 and "not confirmed by MR2" in stop.text


def test_a_scenario_stops_and_lets_go() -> None:
    faults = ("operate:do=stop,at_s=45,for_s=20", "operate:do=go,at_s=70", "operate:do=hold,target=MR1,at_s=90")
    # It keeps its task over the stop: held for longer it would stand before the bay with a car, as the next one comes.
    scene, _ = played(faults=(*faults, "operate:do=release,target=MR1,at_s=118"))
    assert_all_served(scene)
    told = [line for _, who, line in scene.simulation.log.lines if who == "operator"]
    assert "MR1 holds by it" in told and "MR1 goes on" in told
    assert told.index("MR1 is held, and stands") < told.index("MR1 goes on by itself")
