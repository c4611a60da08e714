"""A plan that is late is told later, but not by time that nobody needs."""

from bus_sim.sites import find_site
from onboard.contract.codes import LegAction
from onboard.contract.messages import Stamp
from onboard.core.site import Segment
from onboard.systems.car_park.program import CarStep, Program
from onboard.ways.site import way_site

SECOND = 1_000_000


def step(begin_s: int, end_s: int, action: LegAction = LegAction.TRAVEL) -> CarStep:
    return CarStep(action, 1, 1, 5, begin_s * SECOND, end_s * SECOND)


def times(program: Program) -> list[tuple[float, float]]:
    return [(one.begin_us / SECOND, one.end_us / SECOND) for one in program.remaining]


def planned(*steps: CarStep) -> Program:
    program = Program(way_site(find_site("small")))
    program.begin(Segment(1, 1), list(steps), Stamp(0, 1, 1))
    return program


def test_what_follows_without_a_gap_is_as_late() -> None:
    program = planned(step(0, 10), step(10, 20), step(20, 30))
    program.shift(5 * SECOND)
    assert times(program) == [(5, 15), (15, 25), (25, 35)]


def test_what_was_planned_anew_behind_a_late_run_is_not_late_with_it() -> None:
    """After a sleep of a day the run in hand is a day late; the rest was planned from now on and stays."""
    day = 86_400
    program = planned(step(0, 10), step(day, day + 20), step(day + 20, day + 30))
    program.shift(day * SECOND)
    assert times(program) == [(day, day + 10), (day + 10, day + 30), (day + 30, day + 40)]


def test_a_wait_takes_up_a_delay_as_far_as_it_can() -> None:
    program = planned(step(0, 10), step(10, 14, LegAction.STAND), step(14, 20))
    program.shift(3 * SECOND)
    assert times(program) == [(3, 13), (13, 14), (14, 20)]


def test_a_stamp_from_which_the_plan_cannot_be_told_is_made_anew() -> None:
    """A leg's end has 24 bits of milliseconds after the stamp: 4.6 hours."""
    now_us = 100_000 * SECOND
    for award_s in (100_000 - 17_000, 100_000 + 3_600, 1_900_000):
        program = planned(step(100_000, 100_010), step(100_010, 100_020))
        program.stamp = Stamp(award_s * 1000, 7, 3)
        told = program.itinerary(11, now_us)
        assert told.stamp == Stamp(100_000_000, 7, 3)
        assert [leg.end_ms for leg in told.legs[-2:]] == [100_010_000, 100_020_000]


def test_a_stamp_of_hours_ago_keeps_its_rank() -> None:
    program = planned(step(100_000, 100_010))
    program.stamp = Stamp(90_000_000, 7, 3)
    assert program.itinerary(11, 100_000 * SECOND).stamp == program.stamp
