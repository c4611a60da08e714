"""Who says that it goes and stands is an obstacle until it moves; who waits and says so is given longer."""

from dataclasses import replace

from onboard.config.site import parse_site
from onboard.contract.codes import Grade, KindCode, LegAction, MachineState, Reason, Side
from onboard.contract.messages import Heartbeat, Itinerary, Leg, Progress, Stamp, Waiting
from onboard.core.mirror import Mirror
from onboard.core.site import Segment
from onboard.ways.mirror import WayMirror
from onboard.ways.reservations import SlotWindow
from onboard.ways.site import way_site
from onboard.ways.standing import STANDS_AFTER_US, WAITS_AFTER_US, Standing
from tests.sites import one_floor

ROBOT, ME = 11, 1
#: One floor, with a branch of three positions off position 3: track 2.
BRANCH = """
[site]
name = "branch"
[floors]
count = 1
positions = 12
[[alleys]]
name = "B"
from = "p(*,3)"
positions = 3
[[compartments]]
name = "IOC1"
node = 1
at = "p(1,7)"
[[robots]]
name = "MR1"
node = 11
home = "p(1,11)"
"""
BRANCH_TRACK = 2
RUN_MS = 10_000


def goes(version: int = 1) -> Itinerary:
    """From position 3 to 7, in ten seconds."""
    run = Leg(LegAction.TRAVEL, 1, 3, 7, Side.NEAR, RUN_MS)
    return Itinerary(ROBOT, version, Grade.FIRM, Stamp(0, ME, 1), (run,))


def stays(place: int, version: int) -> Itinerary:
    """At a place, for ever."""
    return Itinerary(
        ROBOT, version, Grade.FIRM, Stamp(0, ME, 1), (Leg(LegAction.STAND, 1, place, place, Side.NEAR, 1),)
    )


def seen(place: int = 3) -> Standing:
    """A robot at a place that has told where it goes."""
    site = one_floor()
    mirror = Mirror(site, ME)
    mirror.on_itinerary(goes(), 0)
    standing = Standing(site, mirror.itineraries, lambda node: False)
    standing.hear(Progress(ROBOT, 1, 0, 1, place, 0, 0), 0)
    return standing


def test_a_machine_that_stands_where_its_plan_does_not_leave_it_is_found() -> None:
    standing = seen()
    due_us = RUN_MS * 1000 + STANDS_AFTER_US
    assert not standing.stands(ROBOT, due_us - 1)
    assert standing.stands(ROBOT, due_us)
    standing.hear(Waiting(ROBOT, 1, 4, 12, Reason.TOKEN_HELD_BY_OTHER), due_us)
    assert standing.stands(ROBOT, due_us + 1), "no word is a motion"
    standing.hear(Progress(ROBOT, 1, 0, 1, 4, 0, 500), due_us + 2)
    assert not standing.stands(ROBOT, due_us + 2)


def test_a_plan_by_which_it_stays_ends_it_but_not_with_a_car_aboard() -> None:
    """A robot whose task was taken back for it stood, planned nothing, and was given no task to move with."""
    site, laden = one_floor(), {ROBOT}
    mirror = Mirror(site, ME)
    standing = Standing(site, mirror.itineraries, laden.__contains__)
    standing.hear(Progress(ROBOT, 1, 0, 1, 3, 0, 0), 0)
    mirror.on_itinerary(goes(), 0)
    late_us = RUN_MS * 1000 + STANDS_AFTER_US
    assert standing.stands(ROBOT, late_us)
    mirror.on_itinerary(stays(3, 2), late_us)
    assert standing.stands(ROBOT, late_us), "a person has to come"
    laden.clear()
    assert not standing.stands(ROBOT, late_us)


def test_a_machine_that_waits_and_says_so_is_given_longer() -> None:
    standing = seen()
    for now_us in range(0, WAITS_AFTER_US + STANDS_AFTER_US, 10_000_000):
        standing.hear(Waiting(ROBOT, 1, 4, 12, Reason.TOKEN_HELD_BY_OTHER), now_us)
        assert not standing.stands(ROBOT, now_us)
    assert standing.stands(ROBOT, WAITS_AFTER_US + STANDS_AFTER_US)


def test_a_machine_that_has_stood_idle_for_long_has_all_the_time_for_a_new_plan() -> None:
    site = one_floor()
    mirror = Mirror(site, ME)
    standing = Standing(site, mirror.itineraries, lambda node: False)
    now_us = 2 * WAITS_AFTER_US
    standing.hear(Progress(ROBOT, 0, 0, 1, 3, 0, 0), 0)
    assert not standing.stands(ROBOT, now_us)
    plan = goes()
    begins = now_us // 1000
    plan = replace(plan, stamp=Stamp(begins, ME, 1), legs=(plan.legs[0]._replace(end_ms=begins + RUN_MS),))
    mirror.on_itinerary(plan, now_us)
    standing.hear(plan, now_us)
    assert not standing.stands(ROBOT, now_us + 1_000_000)
    assert standing.stands(ROBOT, now_us + RUN_MS * 1000 + STANDS_AFTER_US)


def test_who_works_where_it_came_by_before_stands_there_until_its_plan_turns_out_of_it() -> None:
    """Into a branch, past its first position to the end and back to it, work there, and out by the mouth."""
    site = parse_site(BRANCH, "branch.toml")
    legs = (
        Leg(LegAction.TRAVEL, BRANCH_TRACK, 1, 1, Side.NEAR, RUN_MS),
        Leg(LegAction.TRAVEL, BRANCH_TRACK, 1, 3, Side.NEAR, 2 * RUN_MS),
        Leg(LegAction.TRAVEL, BRANCH_TRACK, 3, 1, Side.NEAR, 3 * RUN_MS),
        Leg(LegAction.WORK, BRANCH_TRACK, 1, 1, Side.NEAR, 8 * RUN_MS),
        Leg(LegAction.TRAVEL, 1, 3, 3, Side.NEAR, 9 * RUN_MS),
        Leg(LegAction.TRAVEL, 1, 3, 1, Side.NEAR, 10 * RUN_MS),
    )
    mirror = Mirror(site, ME)
    mirror.on_itinerary(Itinerary(ROBOT, 1, Grade.FIRM, Stamp(0, ME, 1), legs), 0)
    standing = Standing(way_site(site), mirror.itineraries, lambda node: False)
    standing.hear(Progress(ROBOT, 1, 2, BRANCH_TRACK, 1, 0, 0), 3 * RUN_MS * 1000)
    assert not standing.stands(ROBOT, 8 * RUN_MS * 1000)
    assert standing.stands(ROBOT, 9 * RUN_MS * 1000 + STANDS_AFTER_US)


def test_who_turns_in_a_mouth_for_long_is_on_its_way_as_long_as_its_plan_leads_it_through() -> None:
    """It is told as the position beyond the end of the track inside, where no leg of its plan ends or begins."""
    site = parse_site(BRANCH, "branch.toml")
    legs = (
        Leg(LegAction.TRAVEL, 1, 7, 3, Side.NEAR, RUN_MS),
        Leg(LegAction.TRAVEL, BRANCH_TRACK, 1, 1, Side.NEAR, 9 * RUN_MS),
    )
    mirror = Mirror(site, ME)
    mirror.on_itinerary(Itinerary(ROBOT, 1, Grade.FIRM, Stamp(0, ME, 1), legs), 0)
    standing = Standing(way_site(site), mirror.itineraries, lambda node: False)
    standing.hear(Progress(ROBOT, 1, 1, BRANCH_TRACK, 0, 0, 0), RUN_MS * 1000)
    assert not standing.stands(ROBOT, 9 * RUN_MS * 1000 + STANDS_AFTER_US - 1)
    assert standing.stands(ROBOT, 9 * RUN_MS * 1000 + STANDS_AFTER_US)


def test_a_machine_at_the_end_of_its_plan_may_stand_there_for_ever() -> None:
    assert not seen(place=7).stands(ROBOT, 10 * WAITS_AFTER_US)


def test_time_that_nobody_saw_pass_is_not_time_that_somebody_stood() -> None:
    standing, day_us = seen(), 86_400_000_000
    standing.begin_anew(day_us)
    assert not standing.stands(ROBOT, day_us), "my clock has jumped, or I have slept"
    assert standing.stands(ROBOT, day_us + STANDS_AFTER_US), "but from now on it counts"
    standing.begin_anew(2 * day_us)
    assert standing.stands(ROBOT, 2 * day_us), "what stood before that stands until it moves"


def test_who_is_started_again_has_not_stood() -> None:
    mirror = WayMirror(one_floor(), ME)
    beat = Heartbeat(ROBOT, 0, 0, 0, 1, KindCode.ROBOT, MachineState.IDLE, 0)
    mirror.on_heartbeat(beat, 0)
    mirror.hear(Progress(ROBOT, 1, 0, 1, 3, 0, 0), 0)
    mirror.on_itinerary(goes(), 0)
    late_us = RUN_MS * 1000 + STANDS_AFTER_US
    assert mirror.stands(ROBOT, late_us)
    mirror.on_heartbeat(replace(beat, boot=2, state=MachineState.STARTING), late_us)
    mirror.hear(Progress(ROBOT, 0, 0, 1, 3, 0, 0), late_us)
    assert not mirror.stands(ROBOT, late_us), "it would never be given anything to do again"


def test_a_plan_without_a_leg_leaves_its_machine_where_it_is() -> None:
    """Others planned to end where it stood, and asked it for its place for ten minutes."""
    mirror = WayMirror(one_floor(), ME)
    home = mirror.site.machines[ROBOT].home
    mirror.on_itinerary(replace(goes(), legs=()), 0)
    assert mirror.others_standing() == [home], "it has not said where it is"
    for place in (3, 5):
        mirror.hear(Progress(ROBOT, 1, 0, 1, place, 0, 0), 0)
        mirror.on_progress(Progress(ROBOT, 1, 0, 1, place, 0, 0))
        here = Segment(1, place)
        assert mirror.others_standing() == [here]
        assert mirror.reservations.standing_in(ME, [SlotWindow(here, RUN_MS, RUN_MS + 1)]) == [ROBOT]
        assert not mirror.reservations.standing_in(ME, [SlotWindow(home, RUN_MS, RUN_MS + 1)])
    mirror.on_itinerary(goes(2), 0)
    assert mirror.others_standing() == [Segment(1, 7)]
