"""Robots start in spurs, end there, and turn into them to let others pass (rows P38, P44; design, section 5)."""

import asyncio
import random
from collections.abc import Callable
from functools import cache

import pytest

from bus_sim.sites import find_site
from bus_sim.systems.car_park.demand import Demand
from bus_sim.systems.car_park.show import draw_floor
from bus_sim.systems.car_park.simulation import Simulation
from onboard.config.site import parse_site
from onboard.contract.codes import DriveMode, Grade, KindCode, LegAction, TaskPhase
from onboard.contract.messages import (
    CallForProposals,
    DriveOrder,
    DriveState,
    Itinerary,
    Progress,
    TaskReport,
    TokenGrant,
)
from onboard.core.authority import segment_token
from onboard.core.site import Segment
from onboard.systems.car_park.site import CarPark
from onboard.trace.view import SiteView
from onboard.ways.site import WaySite, way_site
from tests.sites import ONE_FLOOR, at_the_key
from tests.system.scene import Scene, play, stays

MR1, MR2 = 11, 12
SPUR, OTHER_SPUR = 192, 193


@cache
def alley(homes: tuple[str, ...], spurs: tuple[str, ...], without: tuple[str, ...] = ()) -> CarPark:
    """One alley of 12 with the compartment at p(1,4), and no place at ``without``."""
    gone = ", ".join(f'"{place}"' for place in without)
    text = ONE_FLOOR.format(positions=f"12\nwithout = [{gone}]") + "".join(
        f'[[spurs]]\nat = "{mouth}"\n' for mouth in spurs
    )
    for number, home in enumerate(homes, start=1):
        text += f'[[robots]]\nname = "MR{number}"\nnode = {10 + number}\nhome = "{home}"\n'
    return at_the_key(parse_site(text, "alley.toml", crowded=True))


def idle(simulation: Simulation) -> None:
    """MR1 takes no tasks."""

    def never(call: CallForProposals, now_us: int) -> int | None:
        return None

    estimator = simulation.controllers[MR1].holon.negotiation.estimator
    estimator.lower_bound = never  # type: ignore[method-assign]  # a machine that can do nothing, for this scene


def told(scene: Scene, node: int, from_us: int = 0) -> list[Segment]:
    """Where a robot said that it was, in order."""
    return [Segment(m.track, m.index) for at, m in scene.all(Progress, "fleet") if m.sender == node and at >= from_us]


def in_the_way() -> CarPark:
    """MR1 stands between MR2 and the compartment; the only place is at the other end, and the spur in between."""
    without = tuple(f"p(1,{index}){side}" for index in range(1, 13) for side in "NF")[1:]
    kept = tuple(place for place in without if place not in ("p(1,4)N", "p(1,6)F"))
    return alley(("p(1,8)", "p(1,11)"), ("p(1,6)",), kept)


@pytest.fixture(scope="module")
def passing() -> Scene:
    return play(in_the_way(), stays((0, 200)), before=idle, limit_s=600)


def test_p38_one_hides_in_the_spur_while_the_other_passes(passing: Scene) -> None:
    passing.assert_sound()
    assert passing.simulation.plant.street.summary().served == 1
    asked_us, _ = passing.first(Itinerary, lambda m: m.sender == MR2 and len(m.legs) > 3 and m.grade is Grade.FIRM)
    _, evades = passing.first(Itinerary, lambda m: m.sender == MR1, after_us=asked_us)
    assert [(leg.action, leg.track) for leg in evades.legs][-2:] == [(LegAction.TRAVEL, 1), (LegAction.TRAVEL, SPUR)]
    hidden_us, _ = passing.first(
        Progress, lambda m: (m.sender, m.track, m.index, m.offset_mm) == (MR1, SPUR, 1, 0), after_us=asked_us
    )
    passed = told(passing, MR2, hidden_us)
    assert min(position.index for position in passed) < 8, "where MR1 stood before"
    assert told(passing, MR1)[-1] == Segment(SPUR, 1)


def test_the_mouth_and_the_spur_are_held_before_the_drive_is_told_to_turn(passing: Scene) -> None:
    turn_us, _ = passing.first(DriveOrder, lambda m: m.sender == MR1 and m.across)
    for slot in (Segment(1, 6), Segment(SPUR, 1)):
        key = segment_token(slot)
        given = [(at, m) for at, m in passing.all(TokenGrant, "fleet") if m.token == key.number and at < turn_us]
        assert given and given[-1][1].holder == MR1, slot
    turned_us, _ = passing.first(DriveState, lambda m: m.sender == MR1 and m.across)
    assert turned_us - turn_us == pytest.approx(way_site(passing.simulation.site).carrier_turn_us, abs=5_000)
    inside_us, _ = passing.first(DriveState, lambda m: (m.sender, m.across, m.position_mm) == (MR1, True, 0))
    mouth = segment_token(Segment(1, 6)).number
    left_us, _ = passing.first(TokenGrant, lambda m: (m.sender, m.token) == (MR1, mouth))
    assert left_us >= inside_us, "the mouth is given back by a body that is wholly inside"


def test_with_a_spur_for_each_both_serve_one_alley_and_end_in_spurs() -> None:
    scene = play(
        alley(("p(192,1)", "p(193,1)"), ("p(1,2)", "p(1,8)")), stays((0, 150), (40, 190), (80, 230)), limit_s=900
    )
    scene.assert_sound()
    assert scene.simulation.plant.street.summary().served == 3
    assert {told(scene, node)[-1] for node in (MR1, MR2)} == {Segment(SPUR, 1), Segment(OTHER_SPUR, 1)}
    ends = {m.legs[-1].track for _, m in scene.all(Itinerary, "fleet") if m.sender in (MR1, MR2)}
    assert ends <= {SPUR, OTHER_SPUR}, "nobody plans to stand in the way"


# --- after a restart -------------------------------------------------------------------------------------------------

#: MR1 loses its controller so long after power-up: in the spur, driving out, in the mouth before it turns back, turning
#: back, on the alley; then back before the mouth, turning, turned, driving in, inside.
KILLED_S = (26.6, 28.0, 30.7, 30.95, 32.0, 33.85, 35.0, 85.0, 88.45, 90.0, 91.45, 92.0, 94.0, 96.0)


def killed(site: WaySite, demand: Demand, at_s: float, before: Callable[[Simulation], None] | None = None) -> Scene:
    """MR1 loses its controller and gets it back with the same journal."""
    outages: list[asyncio.Task[None]] = []

    def kill(simulation: Simulation) -> None:
        machine = simulation.site.machine("MR1")
        if before is not None:
            before(simulation)

        async def outage() -> None:
            await asyncio.sleep(at_s)
            await simulation.controllers[MR1].stop()
            await asyncio.sleep(1.0)
            simulation.start_controller(machine)

        outages.append(simulation.loop.create_task(outage()))

    scene = play(site, demand, before=kill, limit_s=500)
    scene.assert_sound()
    assert outages[0].done() and outages[0].exception() is None
    assert scene.simulation.plant.street.summary().served == 1
    return scene


@pytest.mark.parametrize("at_s", KILLED_S)
def test_p20_a_robot_killed_in_a_spur_or_in_its_mouth_goes_on(at_s: float) -> None:
    scene = killed(alley(("p(192,1)", "p(193,1)"), ("p(1,2)", "p(1,8)")), stays((0, 100)), at_s)
    assert told(scene, MR1)[-1] == Segment(SPUR, 1)


@pytest.mark.parametrize("after_s", [1.0, 4.0, 30.0], ids=["turning", "driving in", "inside"])
def test_p20_a_robot_killed_in_a_spur_that_is_not_its_home_knows_which(passing: Scene, after_s: float) -> None:
    turn_us, _ = passing.first(DriveState, lambda m: m.sender == MR1 and m.mode is DriveMode.TURNING)
    scene = killed(in_the_way(), stays((0, 200)), turn_us / 1e6 + after_s, idle)
    body = scene.simulation.plant.world.standing_position(MR1)
    assert body is not None and told(scene, MR1)[-1] == body


def test_the_times_of_the_restarts_meet_every_state_of_a_turn() -> None:
    """The same scene without a restart: what the drive does at those times."""
    scene = play(alley(("p(192,1)", "p(193,1)"), ("p(1,2)", "p(1,8)")), stays((0, 100)), limit_s=500)
    states = [(at, m) for at, m in scene.all(DriveState) if m.sender == MR1]
    met = {[(m.mode, m.across) for at, m in states if at <= at_s * 1e6][-1] for at_s in KILLED_S}
    turned, along = {True}, {False}
    assert met >= {(mode, across) for mode in (DriveMode.MOVING, DriveMode.TURNING) for across in turned | along}


# --- on the sites that are shipped -----------------------------------------------------------------------------------


def cars(count: int, seed: int, gap_s: float) -> list[tuple[float, float | None]]:
    chance = random.Random(seed)
    comes_s = [number * gap_s + chance.uniform(0, gap_s) for number in range(count)]
    return [(come_s, come_s + chance.uniform(150, 300)) for come_s in comes_s]


def test_the_spur_of_the_standard_site_is_used() -> None:
    scene = play(find_site("standard"), stays(*cars(4, 1, 30)), limit_s=1_200)
    scene.assert_sound()
    assert scene.simulation.plant.street.summary().served == 4
    assert any(m.across and m.position_mm == 0 and m.mode is DriveMode.STANDING for _, m in scene.all(DriveState))


def test_on_the_large_site_those_in_spurs_serve_too_and_all_twelve_can_bid() -> None:
    able: set[int] = set()

    def watch(simulation: Simulation) -> None:
        for node, controller in simulation.controllers.items():
            if simulation.site.machines[node].kind is not KindCode.ROBOT:
                continue
            estimator = controller.holon.negotiation.estimator

            def bound(call: CallForProposals, now_us: int, node: int = node, of: object = estimator) -> int | None:
                found: int | None = type(of).lower_bound(of, call, now_us)  # type: ignore[attr-defined]  # the one replaced
                able.update([node] if found is not None else [])
                return found

            estimator.lower_bound = bound  # type: ignore[method-assign]  # looked over the shoulder, for this scene

    scene = play(find_site("large"), stays(*cars(4, 2, 10)), before=watch, limit_s=1_200)
    scene.assert_sound()
    assert scene.simulation.plant.street.summary().served == 4
    robots = {n for n, machine in scene.simulation.site.machines.items() if machine.kind is KindCode.ROBOT}
    assert able == robots and len(robots) == 12
    done = {m.sender for _, m in scene.all(TaskReport, "fleet") if m.phase is TaskPhase.DONE}
    assert done & {20, 21, 22}, "the nearest start in spurs"


# --- the picture -----------------------------------------------------------------------------------------------------


def test_p54_the_picture_shows_who_is_in_a_spur_and_who_turns() -> None:
    site = alley(("p(192,1)", "p(1,11)"), ("p(1,2)",))
    view = SiteView(site)

    def rows() -> list[str]:
        return [row.plain for row in draw_floor(site, view, 1)]

    assert "(MR1)" in rows()[0] and "MR1" not in rows()[1]
    view.feed(Progress(MR1, 1, 0, SPUR, 0, 0, 0), 1)
    assert "(   )" in rows()[0] and "MR1" in rows()[1]
    assert rows()[1].index("MR1") == pytest.approx(rows()[0].index("(   )"), abs=2)
