"""A robot of a car park is held and let go (row M38; startPause and stopPause of VDA 5050)."""

from collections.abc import Sequence
from functools import partial

import pytest

from bus_sim.can.node import SimulatedBus
from bus_sim.faults.arm import arm
from bus_sim.faults.injection import parse_injection
from bus_sim.sites import find_site
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import MachineState, ManualMode, Reason, ShuttleMode, TaskPhase
from onboard.contract.messages import (
    Bid,
    DriveState,
    Heartbeat,
    ManualOrder,
    ManualState,
    Progress,
    ShuttleState,
    TaskReport,
)
from onboard.core.site import Segment
from onboard.trace.story.why import WaitingStory
from onboard.trace.view import SiteView
from onboard.ways.lifts import lift_at
from onboard.ways.site import TrackKind, WaySite
from onboard.wire.codec import fleet_codec
from tests.sites import at_the_key
from tests.system.scene import Scene, play, stays
from tests.system.test_spurs import alley
from tests.thinned import some

PERSON = 254
SITE = at_the_key(find_site("small"))
#: The robot that wins the first task: on its way from 20 s, at the bay at 24 s, aboard the lift at 33 s, at the place
#: at 51 s, back in a refuge after 70 s.
FIRST, OTHER = 11, 12
CARS = ((0, 400), (60, 500), (120, None))
Orders = Sequence[tuple[float, int, ManualMode]]
HELD, AUTOMATIC = ManualMode.HELD, ManualMode.AUTOMATIC


def say(bus: SimulatedBus, order: ManualOrder) -> None:
    for frame in fleet_codec().encode(order):
        bus.send(frame)


def held(
    orders: Orders, *faults: str, site: WaySite = SITE, cars: Sequence[tuple[float, float | None]] = CARS
) -> Scene:
    """Three cars, and a person who gives these orders (s, robot, mode), each said once."""

    def before(simulation: Simulation) -> None:
        bus = simulation.fleet.attach("person", PERSON)
        for number, (at_s, node, mode) in enumerate(orders, start=1):
            simulation.loop.call_at(at_s, partial(say, bus, ManualOrder(PERSON, node, number, mode)))

    def plant(simulation: Simulation) -> None:
        arm(simulation, [parse_injection(fault) for fault in faults])

    return play(site, stays(*cars), before=before, plant=plant, limit_s=1_200)


def rests_us(scene: Scene, node: int) -> int:
    return scene.first(ManualState, lambda state: state.sender == node and state.at_rest)[0]


def moves(scene: Scene, node: int, from_us: float, to_us: float) -> list[DriveState]:
    """What its drive told while it moved: it says on the fleet bus only now and then where it is."""
    name = scene.simulation.site.machines[node].name
    told = [one for t, one in scene.all(DriveState, name) if from_us < t < to_us]
    places = {one.position_mm for one in told}
    return [one for one in told if one.speed_mm_s or len(places) > 1]


def assert_stands(scene: Scene, at_s: int, rest_us: int, until_s: int) -> None:
    """From its word on it is an obstacle that does not move, and no lift waits for it; it bids for nothing."""
    assert at_s * 1e6 < rest_us < (at_s + 30) * 1e6
    assert moves(scene, FIRST, rest_us, until_s * 1e6) == []
    where = [one for t, one in scene.all(Progress) if one.sender == FIRST and t <= rest_us][-1]
    assert lift_at(SITE, Segment(where.track, where.index)) is None
    shuttle = [one.mode for t, one in scene.all(ShuttleState, "MR1") if t <= rest_us][-1]
    assert shuttle is ShuttleMode.HOME, "no car is half taken"
    states = {beat.state for t, beat in scene.all(Heartbeat) if beat.sender == FIRST and rest_us < t < until_s * 1e6}
    assert states == {MachineState.OBSTACLE}
    assert not [one for t, one in scene.all(Bid) if one.sender == FIRST and at_s * 1e6 < t < until_s * 1e6]


@pytest.mark.parametrize("at_s", some([5, 21, 24, 26, 31, 36, 42, 49, 52, 60, 75], 4))
def test_a_held_robot_ends_what_cannot_be_left_stands_and_goes_on_with_the_same_task(at_s: int) -> None:
    """Idle, on the way, at the bay, loading, before, aboard and behind the lift, setting down, and after."""
    until_s = at_s + 45
    scene = held([(at_s, FIRST, HELD), (until_s, FIRST, AUTOMATIC)])
    scene.assert_sound()
    rest_us = rests_us(scene, FIRST)
    assert_stands(scene, at_s, rest_us, until_s)
    street = scene.simulation.plant.street.summary()
    assert (street.parked, street.asking, street.queueing) == (3, 0, 0)
    assert moves(scene, FIRST, until_s * 1e6, 600e6), "it went on"
    loaded = [(t, one.task) for t, one in scene.all(TaskReport) if (one.sender, one.phase) == (FIRST, TaskPhase.LOADED)]
    done = {one.task for _, one in scene.all(TaskReport) if (one.sender, one.phase) == (FIRST, TaskPhase.DONE)}
    assert {task for t, task in loaded if t < rest_us} <= done, "what it had aboard, it brought where it belongs"


def test_a_held_robot_is_held_after_a_restart_and_others_do_its_untouched_task() -> None:
    scene = held([(21, FIRST, HELD), (300, FIRST, AUTOMATIC)], "crash:target=MR1,at_s=40,restart_s=10")
    scene.assert_sound()
    assert moves(scene, FIRST, 40e6, 300e6) == []
    again_us, _ = scene.first(ManualState, lambda one: one.sender == FIRST and one.at_rest, after_us=50_000_000)
    assert again_us < 53e6
    done = [
        (t, one.sender)
        for t, one in scene.all(TaskReport)
        if one.phase is TaskPhase.DONE and one.sender in SITE.machines
    ]
    assert {robot for t, robot in done if t < 300e6 and robot in (FIRST, OTHER)} == {OTHER}
    assert moves(scene, FIRST, 300e6, 900e6)


def test_all_robots_held_at_once_are_no_stall_and_all_goes_on() -> None:
    """Longer than any rule of liveness would wait."""
    orders = [(25.0, FIRST, HELD), (25.5, OTHER, HELD), (425.0, FIRST, AUTOMATIC), (425.5, OTHER, AUTOMATIC)]
    scene = held(orders)
    scene.assert_sound()
    assert scene.simulation.plant.street.summary().parked == 3
    assert [moves(scene, node, 80e6, 420e6) for node in (FIRST, OTHER)] == [[], []]


def test_an_order_said_again_is_only_answered_and_a_step_by_hand_changes_nothing() -> None:
    def again(simulation: Simulation) -> None:
        bus = simulation.fleet.attach("person", PERSON)
        orders = [ManualOrder(PERSON, FIRST, 1, HELD)] * 3 + [ManualOrder(PERSON, FIRST, 2, ManualMode.STEP)]
        for at_s, order in enumerate(orders, start=21):
            simulation.loop.call_at(float(at_s), partial(say, bus, order))

    scene = play(SITE, stays((0, None)), before=again, limit_s=60, extra_s=30)
    told = [(one.number, one.manual_mode, one.at_rest) for _, one in scene.all(ManualState)]
    assert told[0] == (1, HELD, False) and set(told[1:-1]) == {(1, HELD, True)} and told[-1] == (2, HELD, True)


def test_a_task_that_is_won_while_being_held_is_given_back() -> None:
    """The call is open when the order comes, and the robot's bid stands."""
    free = play(SITE, stays((0, None)), limit_s=60, extra_s=30)
    bid_us, bid = free.first(Bid)
    scene = held([((bid_us + 1_000) / 1e6, bid.sender, HELD), (120, bid.sender, AUTOMATIC)])
    scene.assert_sound()
    _, given_back = scene.first(TaskReport, lambda one: one.phase is TaskPhase.FORFEITED)
    assert (given_back.sender, given_back.reason) == (bid.sender, Reason.OPERATOR)
    assert scene.simulation.plant.street.summary().parked == 3


def test_a_task_that_was_taken_from_a_held_robot_is_not_clung_to() -> None:
    """Its next car's custodian takes the right back after 8 s; the other robot cannot come by, so nobody is won."""
    site = alley(("p(192,1)", "p(193,1)"), ("p(1,2)", "p(1,8)"))
    scene = held([(228, FIRST, HELD), (288, FIRST, AUTOMATIC)], site=site, cars=((0, 150), (40, 190), (80, 230)))
    scene.assert_sound()
    _lost_us, lost = scene.first(TaskReport, lambda one: one.phase is TaskPhase.FORFEITED, after_us=228_000_000)
    assert lost.sender not in (FIRST, OTHER) and lost.reason is Reason.NODE_SILENT
    assert scene.simulation.plant.street.summary().served == 3


@pytest.mark.parametrize("at_s", [27.0, 32.0, 90.0])
def test_a_turn_in_the_mouth_of_a_spur_is_ended(at_s: float) -> None:
    site = alley(("p(192,1)", "p(193,1)"), ("p(1,2)", "p(1,8)"))
    scene = held([(at_s, FIRST, HELD), (at_s + 40, FIRST, AUTOMATIC)], site=site, cars=((0, 150), (40, 190)))
    scene.assert_sound()
    where = [one for t, one in scene.all(Progress) if one.sender == FIRST and t <= rests_us(scene, FIRST)][-1]
    assert (site.tracks[where.track].kind, where.index) != (TrackKind.SPUR, 0), "turned, in the mouth"
    assert scene.simulation.plant.street.summary().served == 2


def test_the_log_tells_that_a_person_held_it_and_for_how_long() -> None:
    """What `onboard trace why` and the picture say of a car that waited aboard."""
    scene = held([(52, FIRST, HELD), (152, FIRST, AUTOMATIC)])
    why, view = WaitingStory(SITE), SiteView(SITE)
    for said in scene.said:
        if said.bus == "fleet":
            why.feed(said.message, said.time_us)
            view.feed(said.message, said.time_us)
    why.finish()
    parts = [part for story in why.tasks.values() for part in story.parts if part.cause.what == "held by a person"]
    rest_us = rests_us(scene, FIRST)
    assert any(abs(part.begin_us - rest_us) < 1_000_000 and abs(part.end_us - 152e6) < 1_000_000 for part in parts)
    events = [text for _, text in view.events if text.startswith("MR1 ")]
    told = [text for text in events if "person" in text or "itself" in text]
    assert told == ["MR1 is held by a person", "MR1 is held by a person and stands", "MR1 goes on by itself"]
