"""Sizes of cars in a table of sessions: what is given, what is drawn, and who fits nowhere."""

from dataclasses import replace
from pathlib import Path

import pytest

from bus_sim.demand import DemandError
from bus_sim.options import RunOptions
from bus_sim.session import play, run_site
from bus_sim.sites import find_site
from bus_sim.systems.car_park.day import ParkingDay
from bus_sim.systems.car_park.demand import Demand
from bus_sim.systems.car_park.plant.bodies import CarBody, random_car
from bus_sim.systems.car_park.plant.customer import VisitOutcome
from bus_sim.systems.car_park.sizes import broken_limits, misfits
from bus_sim.systems.car_park.stage import CarParkStage
from onboard.systems.car_park.site import CarPark, SizeClass

HEAD = "arrival,departure,session_id,length_mm,height_mm,width_mm,weight_kg,wheelbase_mm,class,charging\n"


def park(*classes: SizeClass, of_places: int = 0) -> CarPark:
    """The small site, all of whose places are of one class."""
    site = find_site("small")
    assert isinstance(site, CarPark)
    number = {place.number: of_places for place in site.places} if of_places else {}
    return replace(site, classes=classes, place_class=number)


def cars(tmp_path: Path, *rows: str, site: CarPark | None = None, minutes: int = 20) -> list[CarBody]:
    path = table(tmp_path, *rows, minutes=minutes)
    return [stay.car for stay in Demand.from_sessions(path, park=site).stays]


def table(tmp_path: Path, *rows: str, minutes: int = 20) -> Path:
    path = tmp_path / "table.csv"
    text = HEAD
    for at, row in enumerate(rows):
        cells = row.split(",") + [""] * (6 - row.count(","))
        text += f"2019-07-24T05:0{at}Z,2019-07-24T05:{minutes + at}Z,car {at},{','.join(cells)}\n"
    path.write_text(text)
    return path


def test_a_car_is_as_the_table_says_and_drawn_where_it_is_silent(tmp_path: Path) -> None:
    whole, silent, long = cars(tmp_path, "4500,1600,1850,1700,2800,", ",,,,,", "4800,,,,,")
    assert whole == CarBody("car 0", 2800, 4500, 1600, 1700, 1850)
    assert silent == random_car("car 1", 0)
    drawn = random_car("car 2", 0)
    assert long.length_mm == 4800
    assert long.wheelbase_mm / 4800 == pytest.approx(drawn.wheelbase_mm / drawn.length_mm, abs=1e-3)
    assert long.mass_kg / 4800 == pytest.approx(drawn.mass_kg / drawn.length_mm, abs=1e-3)
    assert (long.height_mm, long.width_mm) == (drawn.height_mm, drawn.width_mm)


SMALL, TALL = SizeClass("small", 4200, 1500, 1500), SizeClass("tall", 5000, 2050, 2500)


def test_a_car_of_a_class_is_as_large_as_the_class_allows(tmp_path: Path) -> None:
    site = park(SMALL, TALL)
    one, other, given = cars(tmp_path, ",,,,,small", ",,,,,Tall", "4100,,,,,tall", site=site)
    assert [site.car_class(car.length_mm, car.height_mm, car.mass_kg) for car in (one, other, given)] == [1, 2, 2]
    assert (one.length_mm, one.height_mm, one.mass_kg) == (4200, 1500, 1500)
    assert (given.length_mm, given.height_mm) == (4100, 2050)
    with pytest.raises(DemandError, match=r"table\.csv:2: class 'van': the site has small, tall; write one of them"):
        cars(tmp_path, ",,,,,van", site=site)
    assert cars(tmp_path, ",,,,,van", site=park()) == [random_car("car 0", 0)], "a column of somebody else's"


@pytest.mark.parametrize(
    ("row", "line"),
    [
        ("long,,,,,", "length_mm 'long' is no number; write a whole number from 1000 to 8191"),
        ('"4,25",,,,,,', "length_mm '4,25' has a comma; write a whole number from 1000 to 8191, without a comma"),
        ("900,,,,,", "length_mm '900' is out of range; write a whole number from 1000 to 8191"),
        (",,,1.5,,", "weight_kg '1.5' is out of range; write a whole number from 50 to 4095"),
        (",,,,,,maybe", "charging 'maybe': write yes or no"),
        (",,2900,,,", "width_mm '2900' is wider than every place of small, 2400 mm, and no gate measures it; correct"),
    ],
)
def test_a_size_that_cannot_be_is_a_bad_row(row: str, line: str, tmp_path: Path) -> None:
    with pytest.raises(DemandError) as caught:
        cars(tmp_path, row, site=park())
    assert f"table.csv:2: {line}" in str(caught.value)


def test_who_asks_to_charge_says_so_in_the_table_or_by_the_class(tmp_path: Path) -> None:
    plug = SizeClass("plug", 4200, 1500, 1500, charging=True)
    yes, no, silent, named, not_so = cars(
        tmp_path, ",,,,,,yes", ",,,,,,0", ",,,,,,", ",,,,,plug,", ",,,,,plug,no", site=park(SMALL, plug)
    )
    assert [car.charging for car in (yes, no, silent, named, not_so)] == [True, False, False, True, False]


def test_where_widths_are_limited_the_gate_judges_a_wide_car(tmp_path: Path) -> None:
    site = park(replace(SMALL, max_width_mm=1700), replace(TALL, max_width_mm=1900), of_places=2)
    slim, wide, classed = cars(tmp_path, "4100,1450,1650,1200,,", "4100,1450,2500,1200,,", ",,,,,tall", site=site)
    assert [broken_limits(car, site) for car in (slim, classed)] == [[], []]
    assert broken_limits(wide, site) == [
        "length 4100 mm, height 1450 mm, weight 1200 kg, width 2500 mm is of no class, and no place takes it"
    ]
    limited = replace(park(), cars=replace(park().cars, max_width_mm=2000))
    assert broken_limits(wide, limited) == ["width 2500 mm, at most 2000"]
    assert broken_limits(replace(slim, charging=True), limited) == [
        "length 4100 mm, height 1450 mm, weight 1200 kg, width 1650 mm is of no class where one can charge, and no "
        "place takes it"
    ]


def test_who_fits_nowhere_is_told_with_the_limits_that_it_breaks() -> None:
    site = park()
    assert broken_limits(CarBody("fits", 2700, 4300, 1500, 1400), site) == []
    assert misfits([CarBody("bus", 4000, 6200, 2100, 3100)], site) == [
        "bus fits nowhere: length 6200 mm, at most 5300; wheelbase 4000 mm, at most 3400; weight 3100 kg, at most 3000"
    ]
    assert broken_limits(CarBody("toy", 1600, 2500, 1500, 800), site) == ["wheelbase 1600 mm, at least 1800"]
    only_small = park(SMALL, TALL, of_places=1)
    assert broken_limits(CarBody("van", 2700, 4300, 1900, 1400), only_small) == [
        "length 4300 mm, height 1900 mm, weight 1400 kg is of class tall, and no place takes it"
    ]
    assert broken_limits(CarBody("mini", 2300, 3700, 1450, 1000), only_small) == []


def test_a_car_that_fits_nowhere_is_refused_at_the_gate(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = table(tmp_path, "6200,,,,2700,", "4300,1500,1800,1400,2700,", "4300,1500,2100,1400,2700,", minutes=10)
    site = park()
    site = replace(site, cars=replace(site.cars, max_width_mm=2000))
    summary = run_site(site, RunOptions(demand=ParkingDay(sessions=path))).to_json()
    out = capsys.readouterr().out
    assert "car 0 fits nowhere: length 6200 mm, at most 5300\n" in out
    assert "car 2 fits nowhere: width 2100 mm, at most 2000\n" in out
    assert (summary["refused_too_large"], summary["cars_in"], summary["cars_out"]) == (2, 1, 1)


def test_each_car_stands_only_where_it_fits_and_full_is_full_for_its_class(tmp_path: Path) -> None:
    site = park(SMALL, TALL)
    small, tall = 1, 2
    tall_places = {place.number for place in site.places[-2:]}
    site = replace(
        site, place_class={place.number: tall if place.number in tall_places else small for place in site.places}
    )
    path = table(tmp_path, ",,,,,tall", ",,,,,small", ",,,,,tall", ",,,,,tall", ",,,,,small", minutes=40)
    stage = play(site, RunOptions(demand=ParkingDay(sessions=path), limit_s=1_500.0))
    assert isinstance(stage, CarParkStage)
    outcomes = [customer.visit.outcome for customer in stage.customers]
    assert [outcome is VisitOutcome.FULL for outcome in outcomes] == [False, False, False, True, False]
    where = {body.name: at for at in site.places for body in stage.plant.world.cars_at(at)}
    assert {name: at.number in tall_places for name, at in where.items()} == {
        "car 0": True,
        "car 1": False,
        "car 2": True,
        "car 4": False,
    }
    assert not stage.violations()


def test_who_charges_gets_a_place_for_it_and_others_get_one_only_at_last(tmp_path: Path) -> None:
    plug = replace(SMALL, name="plug", charging=True)
    site = park(SMALL, plug)
    # Two places on the floor of the street are to charge at, so nearest to all; three others are on the highest.
    kept = (*site.places[:2], *site.places[-3:])
    charging = {place.number for place in kept[:2]}
    of_place = {place.number: 2 if place.number in charging else 1 for place in kept}
    site = replace(site, places=kept, place_class=of_place)
    rows = [",,,,,small,no", ",,,,,small,yes", ",,,,,small,yes", ",,,,,small,yes", ",,,,,small,no"]
    path = table(tmp_path, *rows, minutes=40)
    stage = play(site, RunOptions(demand=ParkingDay(sessions=path), limit_s=1_500.0))
    assert isinstance(stage, CarParkStage)
    outcomes = [customer.visit.outcome for customer in stage.customers]
    assert [outcome is VisitOutcome.NO_CHARGING for outcome in outcomes] == [False, False, False, True, False]
    where = {body.name: at.number in charging for at in site.places for body in stage.plant.world.cars_at(at)}
    assert where == {"car 0": False, "car 1": True, "car 2": True, "car 4": False}
    assert not stage.violations()
