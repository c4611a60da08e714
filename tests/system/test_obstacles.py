"""What is in the way and what wakes there: blocked segments, sleepers, strangers (issue 4, point 3)."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import pytest

from bus_sim.faults.arm import arm
from bus_sim.faults.injection import parse_injection
from bus_sim.sites import find_site
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import CallResult, Grade, MachineState, Reason
from onboard.contract.constants import SEEN_VERSION_BITS
from onboard.contract.messages import Award, Bid, Blocked, CallForProposals, Clear, Heartbeat, Itinerary, Progress
from onboard.controller.shell import Controller
from onboard.core.authority import genesis_holder, segment_token, station_token
from onboard.core.site import Segment
from onboard.holon import holon
from onboard.systems.car_park.compartment import Compartment
from onboard.systems.car_park.robot import ParkingRobot
from onboard.systems.car_park.site import RideCalls, car_park
from onboard.ways.mirror import way_mirror
from tests.sites import at_the_key
from tests.system.scene import Scene, play, stays

#: The robots of the small site; the first one wins the first task and comes down by the left lift at 46 s.
FIRST, OTHER = 11, 12
CARS = ((0, 200), (60, 300), (120, None))
#: A version of a token just before what requests tell of it goes round.
_NEARLY = (1 << SEEN_VERSION_BITS) - 2


def scene_with(
    *faults: str, before_start: Callable[[Controller], None] | None = None, rides: RideCalls = RideCalls.PLANNED
) -> Scene:
    injections = [parse_injection(fault) for fault in faults]

    def plant(simulation: Simulation) -> None:
        arm(simulation, injections)
        if before_start is not None:
            simulation.before_start.append(before_start)

    return play(replace(at_the_key(find_site("small")), rides=rides), stays(*CARS), plant=plant, limit_s=900)


@cache
def undisturbed() -> Scene:
    """The same cars with nothing in the way."""
    return scene_with()


def assert_all_served(scene: Scene) -> None:
    scene.assert_sound()
    street = scene.simulation.plant.street.summary()
    assert (street.parked, street.served, street.asking, street.queueing) == (3, 2, 0, 0)


def plans(scene: Scene, node: int, from_s: float, to_s: float) -> int:
    """How many new versions of its firm itinerary a machine told in a span of time."""
    told = [
        (t, i.version) for t, i in scene.all(Itinerary) if i.sender == node and i.grade is Grade.FIRM and t < to_s * 1e6
    ]
    old = {version for t, version in told if t < from_s * 1e6}
    return len({version for t, version in told if t >= from_s * 1e6} - old)


# --- blocked segments ------------------------------------------------------------------------------------------


def test_a_blocked_segment_is_gone_around_and_touches_only_the_plans_through_it() -> None:
    scene = scene_with("blocked:track=1,index=3,at_s=44,for_s=60")
    assert_all_served(scene)
    assert [m.reason for _, m in scene.all(Blocked)] + [m.reason for _, m in scene.all(Clear)] == [Reason.OPERATOR] * 2
    assert plans(scene, FIRST, 44, 60) >= 1, "its way led through it"
    assert plans(scene, OTHER, 44, 60) == 0
    over = [p for t, p in scene.all(Progress) if 50e6 < t < 104e6 and (p.track, p.index) == (1, 3)]
    assert over == []


def test_a_segment_off_all_plans_changes_none() -> None:
    scene, free = scene_with("blocked:track=1,index=9,at_s=44,for_s=10"), undisturbed()
    assert_all_served(scene)
    for node in (FIRST, OTHER):
        assert plans(scene, node, 44, 90) == plans(free, node, 44, 90)


def test_a_machine_that_starts_later_hears_of_a_blocked_segment() -> None:
    scene = scene_with("blocked:track=1,index=9,at_s=20,for_s=0", "crash:target=MR2,at_s=15,restart_s=10")
    assert_all_served(scene)
    blocked = {
        node: way_mirror(controller.holon.mirror).obstacles.blocked
        for node, controller in scene.simulation.controllers.items()
    }
    assert set(blocked) == {1, 5, 6, FIRST, OTHER}
    assert all(set(known) == {Segment(1, 9)} for known in blocked.values())


# --- who wakes -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "at_s", "for_s"),
    [("MR1", 29, 8), ("MR1", 36, 9), ("MR1", 46, 30), ("MR1", 57, 10), ("IOC1", 40, 10), ("ER1", 36, 9)],
)
def test_a_machine_that_wakes_is_an_obstacle_until_it_is_admitted(name: str, at_s: int, for_s: int) -> None:
    """On the way, aboard a lift, in the middle of taking a car; with the wrong beliefs of before."""
    scene = scene_with(f"pause:target={name},at_s={at_s},for_s={for_s}")
    assert_all_served(scene)
    node, woke_us = scene.simulation.site.machine(name).node_id, (at_s + for_s) * 1e6
    states = [(t, beat.state) for t, beat in scene.all(Heartbeat) if beat.sender == node and t >= woke_us]
    assert states[0][1] is MachineState.OBSTACLE and states[0][0] - woke_us < 100_000
    assert states[1][1] not in (MachineState.OBSTACLE, MachineState.STARTING)
    assert not [bid for t, bid in scene.all(Bid) if bid.sender == node and woke_us <= t < states[1][0]]


# --- strangers -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "reason"), [("MR1", Reason.OTHER_SITE), ("MR2", Reason.OTHER_CONTRACT), ("ER1", Reason.OTHER_SITE)]
)
def test_a_machine_with_another_site_or_contract_is_an_obstacle_and_never_bids(
    name: str, reason: Reason, monkeypatch: pytest.MonkeyPatch
) -> None:
    stranger = car_park(find_site("small")).machine(name).node_id
    heartbeat = holon.Holon._heartbeat

    def strange(one: holon.Holon) -> Heartbeat:
        beat = heartbeat(one)
        own = one.node_id == stranger
        return replace(beat, contract=2) if own and reason is Reason.OTHER_CONTRACT else beat

    def other_site(controller: Controller) -> None:
        if controller.holon.node_id == stranger and reason is Reason.OTHER_SITE:
            other = replace(controller.holon.site, digest=controller.holon.site.digest ^ 1)
            controller.holon.site = controller.holon.regeneration.site = other
            controller.holon.change.own = other.digest
        if controller.holon.node_id == stranger and reason is Reason.OTHER_CONTRACT:
            on_heartbeat = controller.holon._on_heartbeat
            controller.holon._handlers[Heartbeat] = lambda beat, now: on_heartbeat(replace(beat, contract=3), now)

    monkeypatch.setattr(holon.Holon, "_heartbeat", strange)
    scene = scene_with(before_start=other_site)
    assert_all_served(scene)
    assert not [bid for _, bid in scene.all(Bid) if bid.sender == stranger]
    assert {beat.state for t, beat in scene.all(Heartbeat) if beat.sender == stranger and t > 6e6} == {
        MachineState.OBSTACLE
    }
    for node, controller in scene.simulation.controllers.items():
        assert controller.holon.drops[reason] > 0
        assert (stranger in way_mirror(controller.holon.mirror).obstacles.machines) is (node != stranger)


# --- counters that wrap ----------------------------------------------------------------------------------------


def test_all_counters_may_wrap_in_the_middle_of_the_work() -> None:
    """Calls, tasks, cars and itineraries begin a few steps below their wraps, and what requests tell of versions."""
    site = car_park(find_site("small"))
    stations = [*site.places, *site.compartments.values()]
    slots = [
        Segment(track, index) for track, one in site.tracks.items() for index in (0, *range(1, one.length + 1), 255)
    ]
    keys = [*(segment_token(slot) for slot in slots), *(station_token(station) for station in stations)]

    def nearly_full(controller: Controller) -> None:
        one = controller.holon
        one.negotiation._last_call = 0xFFFE
        for key in keys:
            first = genesis_holder(site, key)
            one.tokens.beliefs.take_up(key, _NEARLY, first)
            if first == one.node_id:
                one.tokens.held[key] = one.tokens.seen[key] = _NEARLY
        if isinstance(one.behaviour, ParkingRobot):
            one.behaviour.program.version = 0xFE
        if isinstance(one.behaviour, Compartment):
            one.behaviour.memory.number = 0xFFFE

    scene = scene_with(before_start=nearly_full)
    assert scene.simulation.plant.oracle.finish() == []
    street = scene.simulation.plant.street.summary()
    assert (street.parked, street.served, street.asking, street.queueing) == (3, 2, 0, 0)
    calls = [call.call for _, call in scene.all(CallForProposals) if call.sender == 1]
    assert calls[0] == 0xFFFF and calls[1:] == sorted(calls[1:]) and calls[1] == 1
    for one in (c.holon for c in scene.simulation.controllers.values()):
        assert any(version >= 1 << SEEN_VERSION_BITS for version in one.tokens.seen.values())


# --- initiators that are lost ----------------------------------------------------------------------------------


def test_an_initiator_lost_between_deadline_and_award_calls_anew_and_one_machine_does_the_task() -> None:
    award_us = undisturbed().first(Award)[0]
    scene = scene_with(f"crash:target=IOC1,at_s={(award_us - 2_000) / 1e6},restart_s=4")
    assert_all_served(scene)
    first_us, first = scene.first(Award, lambda award: award.sender == 1 and award.result is CallResult.AWARDED)
    assert first_us > award_us + 4e6
    called = [call.call for _, call in scene.all(CallForProposals) if call.task == first.task and call.sender == 1]
    assert len(called) == 2 and first.call == called[1]


def test_an_outer_winner_lost_after_its_sub_award_leaves_the_lift_to_others() -> None:
    scene = scene_with("crash:target=MR1,at_s=28,restart=no", rides=RideCalls.BEFORE)
    assert_all_served(scene)
    sub_us, sub = scene.first(Award, lambda award: award.sender == FIRST and award.result is CallResult.AWARDED)
    assert sub_us < 28e6 and sub.winner == 5
    rides = [t for t, p in scene.all(Progress) if p.sender == 5 and t > 60e6 and p.index == 3]
    assert rides or scene.simulation.controllers[5].holon.behaviour.state is MachineState.IDLE
