"""Two robots on one alley, who cannot pass each other: what is seen of them on the bus and in the plant."""

import pytest

from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import CallResult, DriveMode, Grade, LegAction, TaskPhase
from onboard.contract.messages import Award, Bid, CallForProposals, DriveState, Heartbeat, Itinerary, TaskReport
from onboard.core.site import Segment
from tests.sites import at_the_key, one_floor
from tests.system.scene import Scene, play, stays

SITE = at_the_key(one_floor(robots=2))


@pytest.fixture(scope="module")
def pair() -> Scene:
    """Two robots on the floor; the one at the far end cannot pass the other."""
    scene = play(SITE, stays((0, 400), (30, 700)), extra_s=200)
    scene.assert_sound()
    return scene


def test_p46_every_bid_on_the_bus_is_the_earliest_of_what_was_weighed_and_logged(pair: Scene) -> None:
    """The log names each place that was worked out with its date, and counts those that could not be sooner."""
    bids = [(t, bid) for t, bid in pair.all(Bid) if bid.sender == 12]
    logged = [(t, text) for t, who, text in pair.simulation.log.lines if who == "MR2" and text.startswith("weighed: ")]
    assert len(bids) == len(logged) == 4
    weighed = []
    for (bid_us, bid), (time_us, text) in zip(bids, logged, strict=True):
        assert 0 <= bid_us - time_us < 5_000
        dated, _, counts = text.removeprefix("weighed: ").partition("; ")
        dates = {place: float(at_s) for place, at_s in (one.split(" at ") for one in dated.split(", "))}
        assert round(min(dates.values()) * 1000) == bid.cost
        others = sum(int(count.rpartition(" ")[2]) for count in counts.split("; "))
        weighed.append(len(dates) + others)
    assert weighed == [len(SITE.places), len(SITE.places) - 1, 1, 1], "all places but that of the other car"


def test_p23_the_program_that_a_robot_prints_is_the_itinerary_that_it_sends(pair: Scene) -> None:
    """Step by step and to the millisecond: what is told of it in words, and the legs on the bus."""
    printed = [(t, text[9:].split("; ")) for t, who, text in pair.simulation.log.lines if text.startswith("program: [")]
    assert len(printed) == 4
    for time_us, steps in printed:
        _, plan = pair.first(Itinerary, lambda m: m.sender == 12 and m.grade is Grade.FIRM, after_us=time_us)
        legs = plan.legs[-len(steps) :]
        for step, leg in zip(steps, legs, strict=True):
            times, what = step[1:].split("] ")
            assert leg.end_ms == pytest.approx(float(times.split()[1]) * 1000, abs=1)
            word = {"travel": LegAction.TRAVEL, "stand": LegAction.STAND}.get(what.split()[0], LegAction.WORK)
            assert leg.action is word and str(Segment(leg.track, leg.to_index)) in what


def test_the_nearer_robot_does_all_the_work_and_the_other_saves_its_searches(pair: Scene) -> None:
    assert {bid.sender for _, bid in pair.all(Bid)} == {12}
    done = [report for _, report in pair.all(TaskReport) if report.phase is TaskPhase.DONE]
    assert [report.sender for report in done] == [12, 12, 12, 12]
    behind = pair.simulation.controllers[11].holon.negotiation.counters
    assert (behind.bids_sent, behind.calls_heard, behind.searches_saved) == (0, 4, 4)


def test_p45_who_is_shut_in_counts_the_calls_and_says_nothing() -> None:
    """The robot before it has lost its controller and stands in the only alley: no way leads around it."""

    def cut(simulation: Simulation) -> None:
        simulation.loop.call_at(9.0, simulation.crash, SITE.machines[12])
        # Somebody acknowledges what the devices say: a lone sensor would repeat its frame for ever.
        simulation.devices[12].attach("listener")

    scene = play(SITE, stays((0, None)), before=cut, limit_s=300)
    assert scene.simulation.plant.oracle.finish() == []
    calls = [call for _, call in scene.all(CallForProposals)]
    assert [call.attempt for call in calls] == [1, 2, 3, 4, 5]
    called_us = scene.first(CallForProposals)[0]
    said = {type(one.message) for one in scene.said if one.message.sender == 11 and one.time_us > called_us}
    assert Heartbeat in said and said.isdisjoint({Bid, Itinerary, Award, TaskReport})
    counters = scene.simulation.controllers[11].holon.negotiation.counters
    assert (counters.calls_heard, counters.searches, counters.calls_impossible) == (5, 5, 5)


def test_p44_a_robot_follows_another_at_speed_and_at_a_distance() -> None:
    """Both drive down the alley to a bay each: the second sets off while the first still drives before it."""
    site = at_the_key(one_floor(robots=2, extra='[[compartments]]\nname = "IOC2"\nnode = 2\nat = "p(1,8)"\n'))
    scene = play(site, stays((0, None), (0, None)), limit_s=60, extra_s=0)
    scene.assert_sound()
    sensed: dict[int, DriveState] = {}
    gaps_mm, starts = [], 0
    for _, state in scene.all(DriveState):
        before = sensed.get(state.sender, state)
        starts += (state.sender, before.mode, state.mode) == (11, DriveMode.STANDING, DriveMode.MOVING)
        sensed[state.sender] = state
        if state.sender == 11 and {one.speed_mm_s for one in sensed.values()} == {-site.carrier.speed_mm_s}:
            gaps_mm.append(state.position_mm - sensed[12].position_mm)
    assert len(gaps_mm) >= 3, "both at full speed, one behind the other"
    assert min(gaps_mm) > site.carrier_length_mm and max(gaps_mm) < 4 * site.tracks[1].pitch_mm
    assert starts == 1, "and without a stop on the way"


def test_p06_other_kinds_spend_nothing_on_a_call(pair: Scene) -> None:
    robot = pair.simulation.controllers[12].holon.negotiation.counters
    compartment = pair.simulation.controllers[1].holon.negotiation.counters
    assert robot.searches == 4
    assert (compartment.searches, compartment.calls_heard) == (0, 0)


def test_p15_no_plan_reaches_beyond_its_task_and_no_task_is_known_before_its_call(pair: Scene) -> None:
    called = {call.task: time_us for time_us, call in pair.all(CallForProposals)}
    for time_us, report in pair.all(TaskReport):
        assert called[report.task] < time_us
    for time_us, itinerary in pair.all(Itinerary):
        if itinerary.grade is Grade.FIRM and itinerary.legs:
            assert itinerary.legs[-1].end_ms * 1000 < time_us + 180_000_000


def test_p19_the_bus_is_the_only_link(pair: Scene) -> None:
    """Every machine that took part was heard on the bus, and the log of it alone tells the whole story."""
    assert {beat.sender for _, beat in pair.all(Heartbeat)} == set(SITE.machines)
    awarded = {award.task for _, award in pair.all(Award) if award.result is CallResult.AWARDED}
    finished = {report.task for _, report in pair.all(TaskReport) if report.phase is TaskPhase.DONE}
    assert awarded == finished and len(awarded) == 4
