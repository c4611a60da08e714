"""Sessions from files, random intervals, cars by hand, and what a person is told about a file that cannot be read."""

import statistics
from datetime import date
from itertools import pairwise
from pathlib import Path

import pytest

from bus_sim.demand import DemandError, Law
from bus_sim.systems.car_park.demand import Demand

HEAD = "arrival,departure,station_id,session_id\n"
GOOD = "2019-07-24 05:35:06-07:00,2019-07-24 15:39:33-07:00,AG-1F11,one\n"


def write(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "sessions.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_shipped_day_has_33_arrivals_and_never_more_than_14_cars() -> None:
    demand = Demand.from_sessions()
    assert len(demand.stays) == 33
    assert demand.zero is not None
    assert demand.zero.isoformat() == "2019-07-24T00:00:00-07:00"
    first = demand.stays[0]
    assert first.arrival_us == (5 * 3600 + 35 * 60 + 6) * 1_000_000
    assert first.departure_us == (15 * 3600 + 39 * 60 + 33) * 1_000_000
    steps = sorted(
        [(stay.arrival_us, 1) for stay in demand.stays] + [(stay.departure_us or 0, -1) for stay in demand.stays]
    )
    present = [sum(step for _, step in steps[: n + 1]) for n in range(len(steps))]
    assert max(present) == 14
    # Two cars stay over midnight and leave next morning.
    late = [stay.departure_us for stay in demand.stays if (stay.departure_us or 0) > 86_400_000_000]
    assert late == [(24 * 3600 + 41 * 60 + 46) * 1_000_000, (25 * 3600 + 33 * 60 + 8) * 1_000_000]
    assert len({stay.car.name for stay in demand.stays}) == 33


def test_a_session_gets_the_same_car_in_every_run_of_a_seed() -> None:
    one, same, other = (Demand.from_sessions(seed=seed).stays for seed in (4, 4, 5))
    assert one == same
    assert [stay.car for stay in one] != [stay.car for stay in other]
    for stay in one:
        assert 2300 <= stay.car.wheelbase_mm <= 3100
        assert 3700 <= stay.car.length_mm <= 4900
        assert 1000 <= stay.car.mass_kg <= 2100


def test_rows_are_chosen_by_day_and_station_and_sorted(tmp_path: Path) -> None:
    rows = [
        "2019-07-24 09:00:00-07:00,2019-07-24 10:00:00-07:00,AG-1F02,b\n",
        "2019-07-24 08:00:00-07:00,2019-07-25 10:00:00-07:00,AG-1F01,a\n",
        "2019-07-24 08:30:00-07:00,2019-07-24 10:00:00-07:00,AG-3F01,c\n",
        "2019-07-25 08:00:00-07:00,2019-07-25 10:00:00-07:00,AG-1F01,d\n",
    ]
    path = write(tmp_path, HEAD + "".join(rows))
    chosen = Demand.from_sessions(path, stations=["AG-1F"], day=date(2019, 7, 24))
    assert [stay.car.name for stay in chosen.stays] == ["a", "b"]
    assert chosen.skipped == 2
    assert [stay.car.name for stay in Demand.from_sessions(path, stations=["AG-1F01", "AG-3F"]).stays] == [
        "a",
        "c",
        "d",
    ]


def test_the_day_is_that_of_the_offset_in_the_file(tmp_path: Path) -> None:
    # 23:30 local time is the next day in UTC.
    path = write(tmp_path, HEAD + "2019-07-24 23:30:00-07:00,2019-07-25T07:00:00Z,S,one\n")
    stay = Demand.from_sessions(path, day=date(2019, 7, 24)).stays[0]
    assert stay.arrival_us == (23 * 3600 + 30 * 60) * 1_000_000
    assert stay.departure_us == 24 * 3600 * 1_000_000


def test_columns_may_come_in_any_order_with_crlf_and_more(tmp_path: Path) -> None:
    text = (
        "x,session_id,station_id,departure,arrival\r\n9,one,S,2019-07-24T10:00:00+02:00,2019-07-24T08:00:00+02:00\r\n"
    )
    stays = Demand.from_sessions(write(tmp_path, text)).stays
    assert [(stay.arrival_us, stay.departure_us) for stay in stays] == [(28_800_000_000, 36_000_000_000)]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", "sessions.csv:1: no column arrival, departure; the first line must name"),
        (
            "arrival,station_id,session_id\n",
            "sessions.csv:1: no column departure; it has arrival, station_id, session_id; say which is which",
        ),
        (HEAD, "sessions.csv: no sessions in the file"),
        (HEAD + GOOD + GOOD, "sessions.csv:3: session_id 'one' is that of line 2 too; make it unique"),
        (
            HEAD + GOOD.replace("05:35:06", "soon"),
            "sessions.csv:2: arrival '2019-07-24 soon-07:00' is no date and time;",
        ),
        (HEAD + GOOD.replace("-07:00", "", 1), "sessions.csv:2: arrival '2019-07-24 05:35:06' has no UTC offset;"),
        (HEAD + GOOD.replace("15:39:33", "05:35:06"), "is not after arrival '2019-07-24 05:35:06-07:00'; correct"),
        (HEAD + ",-,AG-1F11,one\n", "sessions.csv:2: arrival and departure are empty; every row needs one of them"),
        (HEAD + GOOD + "2019-07-24 05:35:06-07:00\n", "sessions.csv:3: has 1 cell, the first line 4 names; put values"),
    ],
)
def test_a_bad_file_gets_one_line_with_place_value_and_remedy(tmp_path: Path, text: str, line: str) -> None:
    with pytest.raises(DemandError) as caught:
        Demand.from_sessions(write(tmp_path, text))
    assert line in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there_or_no_text_gets_one_line(tmp_path: Path) -> None:
    with pytest.raises(DemandError, match=r"nowhere\.csv: cannot be read .*; name a CSV file"):
        Demand.from_sessions(tmp_path / "nowhere.csv")
    with pytest.raises(DemandError, match="cannot be read"):
        Demand.from_sessions(tmp_path)
    (tmp_path / "x.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(DemandError, match="cannot be read"):
        Demand.from_sessions(tmp_path / "x.csv")


def test_a_day_or_station_that_the_file_lacks_names_what_it_has() -> None:
    with pytest.raises(DemandError, match="nobody arrives on 2019-07-30; the file has 2019-07-24 to 2019-07-24"):
        Demand.from_sessions(day=date(2019, 7, 30))
    with pytest.raises(DemandError, match="no station AG-9; the file has AG-1F01 to AG-1F14"):
        Demand.from_sessions(stations=["AG-9"])


def test_p53_intervals_have_the_mean_and_deviation_asked_for() -> None:
    demand = Demand.by_mean(300, 60, seed=1, count=4000, out=(320, 40))
    arrivals = [stay.arrival_us for stay in demand.stays]
    gaps = [(b - a) / 1e6 for a, b in pairwise(arrivals)]
    assert statistics.mean(gaps) == pytest.approx(300, abs=4)
    assert statistics.stdev(gaps) == pytest.approx(60, abs=3)
    departures = sorted(stay.departure_us or 0 for stay in demand.stays)
    # Behind the first car there is always one to fetch, as outputs are rarer than inputs.
    gaps = [(b - a) / 1e6 for a, b in pairwise(departures)]
    assert statistics.median(gaps) == pytest.approx(320, abs=5)
    assert all((stay.departure_us or 0) >= stay.arrival_us + 300_000_000 for stay in demand.stays)


def test_p53_the_same_seed_gives_the_same_demand() -> None:
    assert Demand.by_mean(60, 20, 7) == Demand.by_mean(60, 20, 7)
    assert Demand.by_mean(60, 20, 7) != Demand.by_mean(60, 20, 8)
    assert Demand.by_mean(60, 0, 7, count=3).stays[2].arrival_us == 180_000_000


def test_p53_no_interval_is_below_zero_however_wide_the_law() -> None:
    arrivals = [stay.arrival_us for stay in Demand.by_mean(10, 100, 1, count=300).stays]
    assert all(later > earlier for earlier, later in pairwise(arrivals))


@pytest.mark.parametrize(("mean_s", "sigma_s"), [(0, 1), (-5, 1), (float("nan"), 1), (10, -1), (10, float("nan"))])
def test_p53_senseless_parameters_get_one_line(mean_s: float, sigma_s: float) -> None:
    with pytest.raises(DemandError, match=r"input interval: .* must be"):
        Demand.by_mean(mean_s, sigma_s, 1)
    with pytest.raises(DemandError, match=r"output interval: .* must be"):
        Demand.by_mean(10, 1, 1, out=Law(mean_s, sigma_s))


def test_p52_one_car_by_hand() -> None:
    stay = Demand.one_car(stay_s=90).stays[0]
    assert (stay.arrival_us, stay.departure_us) == (0, 90_000_000)
    assert Demand.one_car().stays[0].departure_us is None
    with pytest.raises(DemandError, match="must be from 0 to"):
        Demand.one_car(stay_s=-1)
