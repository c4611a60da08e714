"""Several floors: steps 15 to 20 of Fig. 9, rides in plans and as calls, robots that share lifts (P02, P49, P50)."""

import dataclasses

import pytest

from bus_sim.sites import find_site
from onboard.config.site import parse_site
from onboard.contract.codes import CallResult, DriveMode, Grade, KindCode, LegAction, Operation, TaskPhase
from onboard.contract.messages import (
    Award,
    Bid,
    CallForProposals,
    DriveState,
    Itinerary,
    PlatformState,
    Progress,
    TaskReport,
    TokenGrant,
)
from onboard.core.authority import TokenKey, segment_token
from onboard.systems.car_park.site import RideCalls, car_park
from onboard.ways.lifts import gate, platform
from onboard.ways.site import way_site
from tests.system.scene import Scene, play, stays
from tests.thinned import is_long


@pytest.fixture(scope="module")
def entry() -> Scene:
    """One car on the small site: the robot comes down by a lift, parks it, and goes up again."""
    scene = play(find_site("small"), stays((0, None)), extra_s=200)
    scene.assert_sound()
    return scene


@pytest.fixture(scope="module")
def asked() -> Scene:
    """The same where robots ask the lifts before they bid."""
    site = dataclasses.replace(car_park(find_site("small")), rides=RideCalls.BEFORE)
    scene = play(site, stays((0, None)), extra_s=200)
    scene.assert_sound()
    return scene


def granted(scene: Scene, key: TokenKey, holder: int, after_us: int) -> int:
    return scene.first(
        TokenGrant, lambda m: (m.token_kind, m.token, m.holder) == (key.kind, key.number, holder), after_us
    )[0]


def test_p50_steps_15_to_20_the_lift_is_told_comes_takes_the_robot_and_lets_it_go(entry: Scene) -> None:
    site = entry.simulation.site
    _, call = entry.first(CallForProposals, lambda m: m.operation is Operation.PARK)
    award_us, award = entry.first(Award, lambda m: m.task == call.task)
    robot = award.winner
    told_us, plan = entry.first(Itinerary, lambda m: m.grade is Grade.FIRM and m.sender == robot and len(m.legs) > 2)
    leg = next(leg for leg in plan.legs if leg.action is LegAction.RIDE)
    lift = site.stewards[leg.track]
    arrived_us, _ = entry.first(
        Progress, lambda m: (m.sender, m.index, m.speed_mm_s) == (lift, leg.from_index, 0), after_us=award_us
    )
    boards_us = granted(entry, segment_token(gate(leg.track)), robot, arrived_us)
    aboard_us, _ = entry.first(PlatformState, lambda m: m.sender == lift and m.carrier_aboard, after_us=boards_us)
    back_us = granted(entry, segment_token(gate(leg.track)), lift, boards_us)
    rides_us, _ = entry.first(DriveState, lambda m: m.sender == lift and m.mode is DriveMode.MOVING, after_us=back_us)
    there_us, _ = entry.first(
        Progress, lambda m: (m.sender, m.index, m.speed_mm_s) == (lift, leg.to_index, 0), after_us=rides_us
    )
    leaves_us = granted(entry, segment_token(gate(leg.track)), robot, there_us)
    free_us = granted(entry, segment_token(platform(leg.track)), lift, leaves_us)
    order = [award_us, told_us, arrived_us, boards_us, aboard_us, rides_us, there_us, leaves_us, free_us]
    assert order == sorted(order) and back_us < rides_us
    done_us, _ = entry.first(TaskReport, lambda m: m.task == call.task and m.phase is TaskPhase.DONE)
    assert free_us < done_us


def test_p49_p02_lifts_compartments_and_robots_call_or_answer(asked: Scene) -> None:
    kinds = {node: machine.kind for node, machine in asked.simulation.site.machines.items()}
    assert {kinds[call.sender] for _, call in asked.all(CallForProposals)} == {KindCode.COMPARTMENT, KindCode.ROBOT}
    assert {kinds[bid.sender] for _, bid in asked.all(Bid)} == {KindCode.ROBOT, KindCode.LIFT}
    _, won = asked.first(Award, lambda m: kinds[m.winner] is KindCode.ROBOT)
    rides = {(m.sender, m.call) for _, m in asked.all(CallForProposals) if m.operation is Operation.RIDE}
    taken = {(m.sender, m.call) for _, m in asked.all(Award) if m.result is CallResult.AWARDED} & rides
    assert taken and {sender for sender, _ in taken} == {won.winner}


def test_what_a_plan_tells_of_rides_nobody_calls_for(entry: Scene) -> None:
    """The winner's firm itinerary moves the lift: a call for what it holds would be said in vain."""
    assert any(leg.action is LegAction.RIDE for _, plan in entry.all(Itinerary) for leg in plan.legs)
    assert {call.kind for _, call in entry.all(CallForProposals)} == {KindCode.ROBOT}


def test_a_lift_never_moves_while_somebody_holds_its_gate(entry: Scene) -> None:
    site = entry.simulation.site
    for track, lift in ((track, site.stewards[track]) for track in way_site(site).tracks if track >= 128):
        holder = lift
        for said in entry.said:
            message = said.message
            if isinstance(message, TokenGrant) and message.token == gate(track).number and message.token_kind == 0:
                holder = message.holder
            if isinstance(message, DriveState) and message.sender == lift and message.mode is DriveMode.MOVING:
                assert holder == lift, f"at {said.time_us / 1e6:.3f} s"


@pytest.mark.parametrize("site", ["small", "standard"])
def test_several_robots_share_lifts_and_serve_everybody(site: str) -> None:
    cars = 8 if is_long() else 5
    demand = stays(*[(45.0 * number, 90.0 * cars + 60.0 * number) for number in range(cars)])
    scene = play(find_site(site), demand, limit_s=3_000)
    scene.assert_sound()
    summary = scene.simulation.plant.street.summary()
    assert (summary.parked, summary.served, summary.inside) == (cars, cars, 0)
    assert len({bid.sender for _, bid in scene.all(Bid) if bid.sender >= 11}) >= 2, "more than one robot took part"


#: Machines so fast that a ride is over within the time for which its plan still counts, when it is told anew.
FAST = """
[site]
name = "fast"
[floors]
count = 3
positions = 4
[carrier]
speed_mm_s = 3_000
acceleration_mm_s2 = 2_000
[shuttle]
speed_mm_s = 3_000
acceleration_mm_s2 = 2_000
[lift]
speed_mm_s = 3_000
acceleration_mm_s2 = 2_000
[[compartments]]
name = "IOC1"
node = 1
at = "p(1,3)"
[[lifts]]
name = "ER1"
node = 5
end = "left"
[[robots]]
name = "MR1"
node = 11
home = "p(2,2)"
"""


@pytest.mark.parametrize("ask_s", [50.0, 51.0, 52.0, 53.0, 54.0])
def test_a_robot_that_wins_a_task_while_aboard_is_not_fetched_again(ask_s: float) -> None:
    """Its new plan tells the ride under way once more: the lift has made it when it is over."""
    scene = play(parse_site(FAST, "fast.toml"), stays((0, ask_s)), extra_s=200)
    scene.assert_sound()
    assert scene.simulation.plant.street.summary().served == 1
