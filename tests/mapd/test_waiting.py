"""Where robots without work wait: apart, near where the next call may be, and by looks that come to an end."""

from bus_sim.systems.mapd.steps import SteppedDay
from onboard.systems.mapd.floor import grid_floor
from onboard.systems.mapd.waiting import WORTH, WaitingPlaces
from tests.mapd.sites import drawn, made, played

ROW = grid_floor(["." * 13])
ENDS = tuple(range(13))


def test_a_robot_waits_away_from_another_and_none_moves_for_little() -> None:
    free = set(ENDS)
    assert WaitingPlaces(ROW, ENDS).better(1, [(0, 0, False)], free) == 7
    assert WaitingPlaces(ROW, ENDS).better(9, [(3, 0, False)], free) is None
    assert WORTH > 0


def test_who_will_be_free_there_soon_counts_and_who_will_be_late_does_not() -> None:
    free = set(ENDS)
    assert WaitingPlaces(ROW, ENDS).better(2, [(8, 0, True)], free) is None
    late = WaitingPlaces(ROW, ENDS).better(2, [(8, 40, True)], free)
    assert late is not None and late > 4, "nobody is there for long"


def test_it_goes_only_where_it_may_stay() -> None:
    assert WaitingPlaces(ROW, ENDS).better(1, [(0, 0, False)], {1, 4}) == 4
    assert WaitingPlaces(ROW, ENDS).better(1, [(0, 0, False)], {1}) is None


def day(seed: int, *, waits: bool) -> SteppedDay:
    site = made(3, drawn(30, seed, every=14))
    homes = list(site.homes.values())
    return SteppedDay(site.floor, homes, site.rests, site.tasks, ends=site.endpoints, waits=waits).run()


def test_calls_that_come_seldom_are_served_sooner_than_by_robots_that_stay() -> None:
    stays, goes = ([day(seed, waits=waits).service_time for seed in (31, 32, 33)] for waits in (False, True))
    assert sum(goes) < 0.97 * sum(stays)


def test_with_nothing_to_do_robots_come_to_rest() -> None:
    site = made(4, [(0, "1,2", "3,5"), (60, "3,2", "1,5")])
    run, plant = played(site)
    assert run.is_good
    assert len(set(plant.history[45:60])) == 1, "the last quarter of a minute nobody moves"
    assert plant.history[50] != plant.history[0], "and not all are at home"
