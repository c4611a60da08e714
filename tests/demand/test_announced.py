"""Customers who say beforehand when they will fetch their cars: by chance in a run, by keys, and what is refused."""

from datetime import UTC, datetime

import pytest

from bus_sim.cli import main
from bus_sim.demand import DemandError
from bus_sim.systems.car_park.by_hand import StreetByHand, time_of_day
from bus_sim.systems.car_park.day import ParkingDay, choose_demand
from bus_sim.systems.car_park.demand import MINUTE_US, Announcements
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.announce import FetchTime, FetchWord
from tests.sites import one_floor
from tests.system.scene import play, stays

MIDNIGHT = datetime(2019, 7, 24, tzinfo=UTC)
HOUR_US = 60 * MINUTE_US


def test_a_share_of_those_who_come_back_says_when_and_nothing_else_of_the_day_is_another() -> None:
    plain = choose_demand(ParkingDay())
    none, half, everybody = (choose_demand(ParkingDay(announced=Announcements(one, 600))) for one in (0, 0.5, 1))
    assert none == plain
    said = [one.announced_us for one in half.stays]
    assert 0.3 < sum(one is not None for one in said) / len(said) < 0.7
    for one, before in zip(everybody.stays, plain.stays, strict=True):
        assert (one.arrival_us, one.departure_us, one.car) == (before.arrival_us, before.departure_us, before.car)
        assert one.announced_us is not None and one.announced_us % MINUTE_US == 0
    off_s = [((one.announced_us or 0) - (one.departure_us or 0)) / 1e6 for one in everybody.stays]
    assert 300 < (sum(one * one for one in off_s) / len(off_s)) ** 0.5 < 900


def test_who_is_sure_says_the_minute_in_which_the_car_is_fetched() -> None:
    for one in choose_demand(ParkingDay(announced=Announcements(1))).stays:
        assert abs((one.announced_us or 0) - (one.departure_us or 0)) <= MINUTE_US / 2


@pytest.mark.parametrize("given", [["1.5", "10"], ["nan", "10"], ["0.5", "-1"]])
def test_a_share_that_is_none_is_refused(given: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "small", "--announce", *given]) == 2
    assert "the share must be from 0 to 1, the deviation 0 min or more" in capsys.readouterr().err


def test_a_time_of_day_is_of_the_day_that_it_is() -> None:
    assert time_of_day("17:30", MIDNIGHT, HOUR_US) == 17 * HOUR_US + 30 * MINUTE_US
    assert time_of_day("00:30", MIDNIGHT, 24 * HOUR_US) == 24 * HOUR_US + 30 * MINUTE_US


@pytest.mark.parametrize(("text", "why"), [("25:99", "no time of day"), ("5:30", "no time"), ("", "no time")])
def test_what_is_no_time_of_day_is_refused(text: str, why: str) -> None:
    with pytest.raises(DemandError, match=f"f{text}: {why}"):
        time_of_day(text, MIDNIGHT, HOUR_US)


def test_a_time_that_is_past_is_refused() -> None:
    with pytest.raises(DemandError, match=r"f00:59: is past, it is 01:00"):
        time_of_day("00:59", MIDNIGHT, HOUR_US)


def test_by_keys_the_driver_of_the_first_car_says_when_and_reads_the_answer() -> None:
    told: list[object] = []

    def types(simulation: Simulation) -> None:
        hand = StreetByHand(simulation.plant.street, 1)
        for at_s in (5, 60, 61):
            simulation.loop.call_at(
                at_s, lambda: told.append(hand.announce(HOUR_US, lambda *shown: told.append(shown)))
            )

    scene = play(one_floor(), stays((0, None)), before=types, limit_s=90)
    nobody = "no car is inside of which nobody has said when it will be fetched"
    assert told == [nobody, None, ("car 1", FetchWord.NOTED), nobody]
    ((_, noted),) = scene.all(FetchTime, "fleet")
    assert abs(noted.fetch_ms - HOUR_US // 1_000) < 2_000
