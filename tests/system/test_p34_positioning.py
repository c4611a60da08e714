"""Fine positioning, by sensors (row P34): nothing leaves or enters a carrier that does not stand at its mark."""

from collections.abc import Iterator
from dataclasses import replace

import pytest

from bus_sim.sites import find_site
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import DriveMode, KindCode, LegAction, ShuttleAction, ShuttleMode
from onboard.contract.messages import DriveState, Itinerary, PlatformState, Progress, ShuttleOrder, ShuttleState
from onboard.systems.car_park.site import car_park
from onboard.ways.site import WaySite
from tests.sites import one_floor
from tests.system.scene import Scene, play, stays

SITE = car_park(find_site("small"))
TOLERANCE_MM = 5


@pytest.fixture(scope="module")
def scene() -> Scene:
    """Two cars in, one out again, over three floors."""
    played = play(SITE, stays((0, None), (60, 500)))
    played.assert_sound()
    return played


def reaches(scene: Scene) -> Iterator[tuple[int, int, DriveState]]:
    """Time, robot and last sensed drive state of each new order to a shuttle to leave its carrier."""
    sensed: dict[int, DriveState] = {}
    known: dict[int, int] = {}
    for said in scene.said:
        message = said.message
        if isinstance(message, DriveState):
            sensed[message.sender] = message
        if isinstance(message, ShuttleOrder) and message.action is ShuttleAction.REACH:
            if known.get(message.sender) != message.sequence:
                yield said.time_us, message.sender, sensed[message.sender]
            known[message.sender] = message.sequence


def off_mark_mm(site: WaySite, track: int, position_mm: float) -> float:
    pitch_mm = site.tracks[track].pitch_mm
    return abs(position_mm - round(position_mm / pitch_mm) * pitch_mm)


def test_p34_the_shuttle_is_sent_out_only_from_a_mark_that_the_sensor_sees(scene: Scene) -> None:
    orders = list(reaches(scene))
    assert len(orders) == 6, "taken and left three times"
    for _, _, state in orders:
        assert (state.mode, state.at_mark, state.speed_mm_s) == (DriveMode.STANDING, True, 0)
        assert off_mark_mm(SITE, 1, state.position_mm) <= TOLERANCE_MM


def test_p34_the_carrier_stands_opposite_the_very_station_of_its_plan(scene: Scene) -> None:
    for time_us, robot, state in reaches(scene):
        plans = [m for t, m in scene.all(Itinerary) if m.sender == robot and t < time_us]
        work = [leg for leg in plans[-1].legs if leg.action is LegAction.WORK]
        pitch_mm = SITE.tracks[1].pitch_mm
        assert round(state.position_mm / pitch_mm) + 1 in {leg.from_index for leg in work}


def test_p34_a_car_is_gripped_and_let_go_before_the_carrier_moves_on(scene: Scene) -> None:
    home: dict[int, ShuttleMode] = {}
    for said in scene.said:
        message = said.message
        if isinstance(message, ShuttleState):
            home[message.sender] = message.mode
        is_robot = message.sender in scene.simulation.plant.shuttles
        if isinstance(message, DriveState) and is_robot and message.mode is DriveMode.MOVING:
            assert home[message.sender] is ShuttleMode.HOME, f"at {said.time_us / 1e6:.3f} s"


def test_p34_a_lift_moves_with_a_robot_only_when_it_stands_wholly_aboard_at_the_mark(scene: Scene) -> None:
    """Over the sill nothing moves; and a robot in a lift stands where the platform's mark is."""
    platforms: dict[int, PlatformState] = {}
    rides = 0
    for said in scene.said:
        message = said.message
        if isinstance(message, PlatformState):
            platforms[message.sender] = message
        is_lift = isinstance(message, DriveState) and SITE.machines[message.sender].kind is KindCode.LIFT
        if is_lift and isinstance(message, DriveState) and message.mode is DriveMode.MOVING:
            platform = platforms[message.sender]
            assert not platform.crossing
            rides += platform.carrier_aboard
    assert rides
    aboard = [m for _, m in scene.all(Progress) if m.index in (0, SITE.tracks[1].length + 1) and m.speed_mm_s == 0]
    assert aboard and all(
        abs(m.offset_mm) <= TOLERANCE_MM for m in aboard if SITE.machines[m.sender].kind is KindCode.ROBOT
    )


@pytest.mark.parametrize("seen", [True, False])
def test_p34_the_shuttle_stays_home_where_the_fine_sensor_sees_no_mark(seen: bool) -> None:
    """The mark before the compartment is missing: the drive's measured way alone must not let the shuttle out."""
    site = one_floor()
    bay_mm = site.position_mm(site.compartments[1].segment)

    def take_away_the_mark(simulation: Simulation) -> None:
        drive = simulation.plant.carriers[11]
        honest = drive.state

        def state(now_us: int) -> DriveState:
            told = honest(now_us)
            return told if abs(told.position_mm - bay_mm) > TOLERANCE_MM else replace(told, at_mark=seen)

        setattr(drive, "state", state)  # noqa: B010  # a sensor that sees nothing there

    scene = play(site, stays((0, None)), before=take_away_the_mark, extra_s=60)
    last = [m for _, m in scene.all(DriveState) if m.mode is DriveMode.STANDING][-1]
    assert bool(list(reaches(scene))) is seen
    assert seen or abs(last.position_mm - bay_mm) <= TOLERANCE_MM, "it stands there and waits"
