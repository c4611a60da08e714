"""The busiest hour, hours by the clock, and the densest five minutes."""

from datetime import date
from pathlib import Path

import pytest

from bus_sim.demand import DemandError
from bus_sim.systems.car_park.demand import WHOLE_DAY, Demand, Stay
from bus_sim.systems.car_park.plant.bodies import CarBody
from bus_sim.systems.car_park.window import (
    DAY_US,
    EVE_US,
    HOUR_US,
    MINUTE_US,
    DayWindow,
    busiest_hour,
    choose_window,
    densest,
    two_way_hour,
    with_short_eve,
)

CAR = CarBody("car", 2700, 4300, 1500, 1400)


def demand(*minutes: tuple[float, float | None]) -> Demand:
    """Cars that come and go at these minutes."""
    return Demand(
        tuple(Stay(round(come * MINUTE_US), None if go is None else round(go * MINUTE_US), CAR) for come, go in minutes)
    )


def test_p55_the_whole_shipped_day_has_82_cars_at_52_stalls_and_holds_the_day_of_level_1() -> None:
    whole, level1 = Demand.from_sessions(shipped=WHOLE_DAY), Demand.from_sessions()
    assert (len(whole.stays), len(level1.stays)) == (82, 33)
    assert {stay.car.name for stay in level1.stays} <= {stay.car.name for stay in whole.stays}
    assert Demand.from_sessions(shipped=WHOLE_DAY, stations=["AG-1F"]).stays == level1.stays


def test_the_busiest_hour_of_the_shipped_day_is_found_from_its_events() -> None:
    whole = Demand.from_sessions(shipped=WHOLE_DAY)
    window = busiest_hour(whole)
    assert window.described(whole) == "2019-07-24 06:34 to 07:34"
    events = [time_us for stay in whole.stays for time_us in (stay.arrival_us, stay.departure_us or 0)]

    def busy(begin_us: int) -> int:
        return sum(begin_us <= time_us < begin_us + HOUR_US for time_us in events)

    assert busy(window.begin_us) == 32 == max(busy(minute * MINUTE_US) for minute in range(36 * 60))


def test_departures_count_as_much_as_arrivals_and_the_first_of_equal_hours_wins() -> None:
    quiet_morning = demand((0, 300), (10, 310), (200, 320), (500, None))
    assert busiest_hour(quiet_morning) == DayWindow(261 * MINUTE_US, 261 * MINUTE_US + HOUR_US)
    assert busiest_hour(demand((30, None), (400, None))).begin_us == 0


def test_the_two_way_hour_of_the_shipped_day_has_cars_that_come_and_cars_that_go() -> None:
    whole = Demand.from_sessions(shipped=WHOLE_DAY)
    window = two_way_hour(whole)
    assert choose_window(whole, "two-way") == window and window.described(whole) == "2019-07-24 15:31 to 16:31"
    assert sum(window.begin_us <= stay.arrival_us < window.end_us for stay in whole.stays) == 9
    assert sum(window.begin_us <= (stay.departure_us or 0) < window.end_us for stay in whole.stays) == 21
    one_way = demand((0, None), (10, None), (200, 900))
    assert two_way_hour(one_way) == busiest_hour(one_way)


def test_a_short_eve_brings_who_is_inside_and_leaves_the_window_as_it_is() -> None:
    whole = demand((0, 700), (1, 90), (2, None), (3, 130), (95, 700), (119, 125), (130, 140))
    window = DayWindow(120 * MINUTE_US, 180 * MINUTE_US)
    eve = with_short_eve(whole, window, 3)
    assert EVE_US == 3 * MINUTE_US
    arrivals = [stay.arrival_us / MINUTE_US for stay in eve.stays]
    assert arrivals == [115, 116, 117, 118, 119, 130], "one a minute, and nobody sooner than they came"
    assert [stay.departure_us for stay in eve.stays] == [
        stay.departure_us for stay in whole.stays if stay.departure_us != 90 * MINUTE_US
    ]


def test_an_hour_without_anybody_is_told() -> None:
    with pytest.raises(DemandError, match="nobody comes at all"):
        busiest_hour(Demand(()))


@pytest.mark.parametrize(
    ("text", "begin_minute", "end_minute"),
    [
        ("06:30", 390, 450),
        ("00:00", 0, 60),
        ("06:30-09:00", 390, 540),
        ("23:00-01:30", 1380, 1530),
        ("22:00-24:00", 1320, 1440),
        ("2019-07-25T07:15", 1440 + 435, 1440 + 495),
    ],
)
def test_a_window_by_the_clock(text: str, begin_minute: int, end_minute: int) -> None:
    whole = Demand.from_sessions(shipped=WHOLE_DAY)
    assert choose_window(whole, text) == DayWindow(begin_minute * MINUTE_US, end_minute * MINUTE_US)


@pytest.mark.parametrize("text", ["", "6", "6:3", "25:00", "06:30-", "06:30-noon", "2019-07-25T7", "2019-07-23T07:00"])
def test_a_window_that_is_none_gets_one_clear_line(text: str) -> None:
    whole = Demand.from_sessions(shipped=WHOLE_DAY)
    if text == "06:30-":
        assert choose_window(whole, text) == choose_window(whole, "06:30")
        return
    with pytest.raises(DemandError) as caught:
        choose_window(whole, text)
    assert f" {text}: " in str(caught.value) and "\n" not in str(caught.value)


def test_a_window_over_midnight_tells_both_days() -> None:
    whole = Demand.from_sessions(shipped=WHOLE_DAY)
    assert choose_window(whole, "23:30").described(whole) == "2019-07-24 23:30 to 2019-07-25 00:30"
    assert choose_window(demand((1, None)), "00:00").described(demand()) == "00:00 to 01:00"


def test_p55_the_densest_five_minutes_of_arrivals() -> None:
    found = densest(demand((0, None), (3, None), (20, 21), (22, 22.5), (24.9, None), (25, None)))
    assert found is not None
    assert (found.begin_us, found.count) == (20 * MINUTE_US, 3), "five minutes end before the car of minute 25"
    early = densest(demand((0, None), (3, None), (20, None), (21, None), (22, None)), DayWindow(0, 10 * MINUTE_US))
    assert early is not None and (early.begin_us, early.count) == (0, 2)
    assert densest(demand((0, None)), DayWindow(HOUR_US, DAY_US)) is None


def test_a_range_of_days_keeps_the_cars_that_stay_over_midnight(tmp_path: Path) -> None:
    rows = [
        ("2019-07-24 20:00:00-07:00", "2019-07-25 07:00:00-07:00", "over night"),
        ("2019-07-25 08:00:00-07:00", "2019-07-25 09:00:00-07:00", "second day"),
        ("2019-07-26 08:00:00-07:00", "2019-07-26 09:00:00-07:00", "third day"),
    ]
    path = tmp_path / "sessions.csv"
    lines = [f"{come},{go},S,{name}\n" for come, go, name in rows]
    path.write_text("arrival,departure,station_id,session_id\n" + "".join(lines))
    two = Demand.from_sessions(path, day=date(2019, 7, 24), until=date(2019, 7, 25))
    assert [stay.car.name for stay in two.stays] == ["over night", "second day"]
    assert two.stays[0].departure_us == 31 * HOUR_US
    assert two.stays[1].arrival_us == 32 * HOUR_US
    with pytest.raises(DemandError, match="nobody arrives from 2019-07-27 to 2019-07-28; the file has 2019-07-24 to"):
        Demand.from_sessions(path, day=date(2019, 7, 27), until=date(2019, 7, 28))
