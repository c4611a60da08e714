"""Tables as others write them: other columns, delimiters, encodings, times and zones; and their bad rows.

The shapes are those of published tables, with rows of our own: ACN-Data of Caltech (times with offset), charging in
Ticino (day and hour in two columns, two formats in one file, quoted commas), parking bays of Melbourne (12-hour clock,
thousands in quotes). One real table is read as a whole where it is there.
"""

import os
from argparse import Namespace
from datetime import date, datetime
from pathlib import Path

import pytest

from bus_sim.cli import build_parser, main
from bus_sim.demand import DemandError
from bus_sim.sites import find_site
from bus_sim.systems.car_park.csv_rows import MOST_ROWS
from bus_sim.systems.car_park.day import asked_day, brought_in, choose_demand
from bus_sim.systems.car_park.demand import Demand
from bus_sim.systems.car_park.window import EVE_US, MINUTE_US, busiest_hour, with_eve
from onboard.config.problems import ConfigError
from onboard.systems.car_park.site import car_park

SHAPES = {
    "offsets": (
        "arrival,departure,requested_energy (kWh),station_id,session_id,claimed\n"
        "2019-05-01 05:04:06-07:00,2019-05-01 17:56:21-07:00,44.85,AG-1F11,1_1_194,True\n"
        "2019-05-01 05:40:27-07:00,2019-05-02 12:23:55-07:00,150.0,AG-1F01,1_1_193,True\n",
        [],
        [
            ("2019-05-01T05:04:06-07:00", "2019-05-01T17:56:21-07:00"),
            ("2019-05-01T05:40:27-07:00", "2019-05-02T12:23:55-07:00"),
        ],
    ),
    "two columns, two formats": (
        "ChargeLogId,BeginDate,BeginHour,EndDate,EndHour,ChargingStationName,Stazione\n"
        '7,01.03.17,22:17,01.04.17,02:56,PIAZZA,"PIAZZA, Montagnola"\n'
        '8,01/13/2017,09:25,01/13/2017,10:46,PIAZZA,"PIAZZA, ""Nord"""\n',
        [
            *("--columns", "arrival=BeginDate+BeginHour,departure=EndDate+EndHour,session_id=ChargeLogId"),
            *("--date-format", "%m.%d.%y %H:%M", "--date-format", "%m/%d/%Y %H:%M", "--zone", "Europe/Zurich"),
        ],
        [
            ("2017-01-03T22:17:00+01:00", "2017-01-04T02:56:00+01:00"),
            ("2017-01-13T09:25:00+01:00", "2017-01-13T10:46:00+01:00"),
        ],
    ),
    "12-hour clock": (
        "DeviceId,ArrivalTime,DepartureTime,DurationSeconds,StreetMarker\n"
        '"18,773",04/11/2017 07:24:35 AM,04/11/2017 07:30:00 PM,43525,C1234\n',
        [
            *("--columns", "arrival=ArrivalTime,departure=DepartureTime,station_id=StreetMarker"),
            *("--date-format", "%d/%m/%Y %I:%M:%S %p", "--zone", "Australia/Melbourne"),
        ],
        [("2017-11-04T07:24:35+11:00", "2017-11-04T19:30:00+11:00")],
    ),
    "semicolons, mark, CRLF, empty rows": (
        "\ufeffEinfahrt;Ausfahrt\r\n24.07.2019 05:35;24.07.2019 06:00\r\n;\r\n\r\n",
        [
            *("--columns", "arrival=Einfahrt,departure=Ausfahrt", "--delimiter", "semicolon"),
            *("--date-format", "%d.%m.%Y %H:%M", "--zone", "Europe/Berlin"),
        ],
        [("2019-07-24T05:35:00+02:00", "2019-07-24T06:00:00+02:00")],
    ),
    "seconds since 1970": (
        "in\tout\n1563946506\t1563946806.5\n",
        [
            *("--columns", "arrival=in,departure=out", "--delimiter", "tab", "--date-format", "epoch"),
            *("--zone", "America/Los_Angeles"),
        ],
        [("2019-07-23T22:35:06-07:00", "2019-07-23T22:40:06.500000-07:00")],
    ),
    "milliseconds": (
        "arrival|departure\n1563946506000|1563946806000\n",
        ["--delimiter", "|", "--date-format", "epoch_ms"],
        [("2019-07-24T05:35:06+00:00", "2019-07-24T05:40:06+00:00")],
    ),
}


def asked(tmp_path: Path, text: str | bytes, *options: str, kind: str = "sessions") -> Demand:
    """The demand of a table by the options of `bus-sim run`."""
    path = tmp_path / "table.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return choose_demand(asked_day(arguments(f"--{kind}", str(path), *options), live=False))


def arguments(*options: str) -> Namespace:
    return build_parser().parse_args(["run", "small", *options])


def refused(tmp_path: Path, text: str | bytes, *options: str, kind: str = "sessions") -> list[str]:
    """The lines that a person is told."""
    with pytest.raises((DemandError, ConfigError)) as caught:
        asked(tmp_path, text, *options, kind=kind)
    return str(caught.value).splitlines()


def at(demand: Demand, time_us: int | None) -> float | None:
    assert demand.zero is not None
    return None if time_us is None else demand.zero.timestamp() + time_us / 1e6


@pytest.mark.parametrize("shape", SHAPES)
def test_a_table_is_read_as_its_options_say(shape: str, tmp_path: Path) -> None:
    text, options, expected = SHAPES[shape]
    demand = asked(tmp_path, text, *options)
    for stay, (arrival, departure) in zip(demand.stays, expected, strict=True):
        assert at(demand, stay.arrival_us) == datetime.fromisoformat(arrival).timestamp()
        assert at(demand, stay.departure_us) == datetime.fromisoformat(departure).timestamp()
    assert demand.zero is not None
    assert demand.zero.utcoffset() == datetime.fromisoformat(expected[0][0]).utcoffset(), (
        "the run shows the clock of the place"
    )
    assert not demand.remarks


def test_a_mapping_file_says_the_same_and_the_command_line_counts_before_it(tmp_path: Path) -> None:
    text, options, _ = SHAPES["two columns, two formats"]
    mapping = tmp_path / "mapping.toml"
    mapping.write_text(
        'zone = "Europe/Zurich"\ndate_format = ["%m.%d.%y %H:%M", "%m/%d/%Y %H:%M"]\ndelimiter = "bar"\n'
        '[columns]\narrival = ["BeginDate", "BeginHour"]\ndeparture = "EndDate+EndHour"\nsession_id = "ChargeLogId"\n'
    )
    by_file = asked(tmp_path, text, "--mapping", str(mapping), "--delimiter", "comma")
    assert by_file == asked(tmp_path, text, *options)
    mapping.write_text('zones = "x"\ndelimiter = 3\n[columns]\narival = "a"\ndeparture = [1]\n')
    assert refused(tmp_path, text, "--mapping", str(mapping)) == [
        f'{mapping}:1: zones: unknown key; did you mean "zone"?',
        f"{mapping}:2: delimiter = 3: is a whole number; write a text in quotes",
        f'{mapping}:4: columns.arival: unknown key; did you mean "arrival"?',
        f"{mapping}:5: columns.departure[0] = 1: is no text; write it in quotes",
    ]


@pytest.mark.parametrize("encoding", ["cp1252", "utf-16", "latin-1"])
def test_other_encodings_are_named_or_told_by_their_mark(encoding: str, tmp_path: Path) -> None:
    text = "arrival,departure,Straße\n2019-07-24T05:00Z,2019-07-24T06:00Z,Königsallee\n".encode(encoding)
    named = [] if encoding == "utf-16" else ["--encoding", encoding]
    assert len(asked(tmp_path, text, *named).stays) == 1
    if named:
        assert refused(tmp_path, text) == [
            "table.csv: cannot be read as UTF-8 text (invalid continuation byte); name a CSV file, or its encoding: "
            "--encoding cp1252 for one of Excel on Windows"
        ]
    assert refused(tmp_path, text, "--encoding", "nothing") == [
        "--encoding nothing: no such encoding; such as utf-8, cp1252, latin-1"
    ]


def test_a_spreadsheet_is_no_table(tmp_path: Path) -> None:
    assert refused(tmp_path, b"PK\x03\x04...") == ["table.csv: is a spreadsheet or an archive, no text; save it as CSV"]


BERLIN = ("--zone", "Europe/Berlin")


def test_a_time_that_the_clock_left_out_is_a_bad_row(tmp_path: Path) -> None:
    text = "arrival,departure\n2019-03-31 02:30:00,2019-03-31 12:00:00\n"
    assert refused(tmp_path, text, *BERLIN) == [
        "table.csv:2: arrival '2019-03-31 02:30:00' was left out by the clock of Europe/Berlin; write the time that "
        "the clock showed, or its UTC offset, or pass it over: --skip-bad"
    ]


def test_a_time_that_the_clock_showed_twice_is_the_first_that_is_possible(tmp_path: Path) -> None:
    text = "arrival,departure\n2019-10-27 02:50,2019-10-27 02:10\n2019-10-27 01:30,2019-10-27 02:30\n"
    demand = asked(tmp_path, text, *BERLIN)
    # Both days begin at +02:00: 01:30 to 02:30 is one hour, 02:50 to 02:10 twenty minutes over the change.
    assert [(stay.departure_us or 0) - stay.arrival_us for stay in demand.stays] == [60 * MINUTE_US, 20 * MINUTE_US]


def test_a_stay_over_a_change_of_the_clock_is_as_long_as_it_was(tmp_path: Path) -> None:
    demand = asked(tmp_path, "arrival,departure\n2019-03-30 22:00,2019-03-31 08:00\n", *BERLIN)
    assert (demand.stays[0].departure_us or 0) - demand.stays[0].arrival_us == 9 * 60 * MINUTE_US


BAD = (
    "arrival,departure,session_id\n"
    "2019-07-24T05:00Z,2019-07-24T06:00Z,a\n"
    "soon,2019-07-24T06:00Z,b\n"
    "2019-07-24T05:00Z,2019-07-24T04:00Z,c\n"
    "2019-07-24T05:00Z,2019-07-24T06:00Z,a\n"
    "2019-07-24T05:00Z\n"
    "2019-07-24T05:00Z,1563946506,e\n"
    "2019-07-24,2019-07-24T06:00Z,f\n"
    "2019-07-24T05:00Z,2919-07-24T06:00Z,g\n"
    "2019-07-24T05:00Z,2019-07-24T06:00Z,h,,\n"
)


def test_every_bad_row_is_named_and_none_is_passed_over_unasked(tmp_path: Path) -> None:
    told = [
        "table.csv:3: arrival 'soon' is no date and time; write it as",
        "table.csv:4: departure '2019-07-24T04:00Z' is not after arrival '2019-07-24T05:00Z'; correct",
        "table.csv:5: session_id 'a' is that of line 2 too; make it unique",
        "table.csv:6: has 1 cell, the first line 3 names; put values that hold a comma in quotes",
        "table.csv:7: departure '1563946506' is no date and time; seconds or milliseconds since 1970 are --date-format",
        "table.csv:8: arrival '2019-07-24' is no date and time; write it as",
        "table.csv:9: departure '2919-07-24T06:00Z' is in the year 2919; write one from 1970 to 2199",
    ]
    lines = refused(tmp_path, BAD)
    assert lines[-1] == "table.csv: 7 bad rows; --skip-bad passes them over"
    assert all(line.startswith(start) for line, start in zip(lines, told, strict=False)) and len(lines) == 8, lines
    passed = asked(tmp_path, BAD, "--skip-bad")
    assert [stay.car.name for stay in passed.stays] == ["a", "h"]
    assert passed.remarks == ("table.csv: 7 of 9 rows are bad and passed over", *lines[:-1])


def test_bad_rows_beyond_a_bound_are_counted(tmp_path: Path) -> None:
    lines = refused(tmp_path, "arrival,departure\n" + "x,y\n" * (MOST_ROWS + 5))
    assert len(lines) == MOST_ROWS + 2
    assert lines[-2:] == ["and 5 more", f"table.csv: {MOST_ROWS + 5} bad rows; --skip-bad passes them over"]


def test_bad_rows_end_a_command_with_status_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "table.csv"
    path.write_text(BAD)
    for command in (["run", "small"], ["compare", "small", "--parts", "day"]):
        assert main([*command, "--sessions", str(path)]) == 2
        error = capsys.readouterr().err.splitlines()
        assert len(error) == 8 and all(line.startswith("bus-sim: table.csv:") for line in error)


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (
            ["--columns", "arrival"],
            "--columns arrival: must be COLUMN=NAME; a name that holds a comma goes into",
        ),
        (["--columns", "come=In"], "--columns come=In: no such column; those that can be named: arrival, departure,"),
        (["--columns", "hour=In"], "--columns hour=...: no such column here; those that can be named: arrival,"),
        (["--columns", "arrival=In"], "table.csv:1: no column In; it has arrival, departure; say which is which"),
        (["--delimiter", "::"], "--delimiter ::: must be one character, or one of comma, semicolon, tab, bar"),
        (["--zone", "Europe/Paradise"], "--zone Europe/Paradise: no such zone; write its IANA name"),
        (["--date-format", "%d"], "table.csv:2: arrival '2019-07-24T05:00' is not written as %d; correct it, or add"),
        (["--date-format", "%d.%m.%Q"], "--date-format %d.%m.%Q: 'Q' is a bad directive; such as '%d.%m.%Y %H:%M'"),
        (["--columns", "arrival=a,arrival=b"], "--columns arrival=b: arrival is named twice; leave one out, or join"),
        ([], "table.csv:2: arrival '2019-07-24T05:00' has no UTC offset; write it as"),
        (["--inside", "some"], "--inside some: must be a number of cars from 0 to"),
        (["--inside", "recorded"], "--inside recorded: who came before the day; add --day D"),
        (["--counts", "x.csv"], "--sessions: does not go with --counts; leave one out"),
        (["--inside", "3", "--one-car", "5"], "--inside 3: does not go with --one-car; leave one of them out"),
    ],
)
def test_a_mistake_in_the_options_is_one_line(options: list[str], line: str, tmp_path: Path) -> None:
    (told,) = refused(tmp_path, "arrival,departure\n2019-07-24T05:00,2019-07-24T06:00\n", *options)
    assert told.startswith(line)


@pytest.mark.parametrize(
    ("text", "options", "line"),
    [
        (
            "45426,45427",
            ["--zone", "UTC"],
            "'45426' is a spreadsheet's number of a day; give its column a format of dates",
        ),
        ("45426.3125,45426.5", ["--date-format", "epoch"], "'45426.3125' is a spreadsheet's number of a day"),
        ("07:00,09:00", ["--date-format", "%H:%M", "--zone", "UTC"], "'07:00' has no year; join the column of the day"),
    ],
)
def test_what_is_no_point_in_time_is_said_so(text: str, options: list[str], line: str, tmp_path: Path) -> None:
    (told,) = refused(tmp_path, f"arrival,departure\n{text}\n", *options)
    assert told.startswith(f"table.csv:2: arrival {line}")


def test_a_first_line_for_excel_alone_is_to_be_taken_out(tmp_path: Path) -> None:
    (told,) = refused(tmp_path, "sep=;\narrival;departure\n", "--delimiter", "semicolon")
    assert told == "table.csv:1: no column arrival, departure; take that line out: the first line must name the columns"


def test_a_day_of_the_year_is_no_number_of_a_spreadsheet(tmp_path: Path) -> None:
    demand = asked(tmp_path, "arrival,departure\n24135,24136\n", "--date-format", "%y%j", "--zone", "UTC")
    assert demand.zero == datetime.fromisoformat("2024-05-14T00:00:00+00:00")


def test_options_about_a_table_need_one() -> None:
    with pytest.raises(DemandError, match="--zone: is about a table; add --sessions FILE or --counts FILE"):
        asked_day(arguments(*BERLIN), live=False)


def test_who_has_no_arrival_is_inside_at_the_start_and_who_has_no_departure_stays(tmp_path: Path) -> None:
    text = (
        "arrival,departure,session_id\nNULL,2019-07-24T06:00Z,early\n2019-07-24T05:00Z,,late\n"
        "2019-07-23T20:00Z,2019-07-24T07:00Z,night\n,2019-07-25T06:00Z,other day\n"
    )
    demand = asked(tmp_path, text, "--day", "2019-07-24", "--inside", "1")
    assert [stay.car.name for stay in demand.inside] == ["early", "inside 1"]
    assert [(stay.car.name, stay.departure_us) for stay in demand.stays] == [("late", None)]
    assert demand.skipped == 2
    recorded = asked(tmp_path, text, "--day", "2019-07-24", "--inside", "recorded")
    assert [stay.car.name for stay in recorded.inside] == ["night", "early"]
    # They come before the first minute that is known of anybody, one after the other, and are fetched as recorded.
    played = with_eve(recorded, 1)
    assert [(stay.car.name, stay.arrival_us) for stay in played.stays] == [
        ("night", 5 * 60 * MINUTE_US - 2 * EVE_US),
        ("early", 5 * 60 * MINUTE_US - EVE_US),
        ("late", 5 * 60 * MINUTE_US),
    ]
    assert [stay.departure_us for stay in played.stays[:2]] == [7 * 60 * MINUTE_US, 6 * 60 * MINUTE_US]
    assert busiest_hour(recorded).begin_us == (4 * 60 + 1) * MINUTE_US
    # A compartment for exit brings nobody in.
    (told,) = brought_in(asked(tmp_path, text, "--day", "2019-07-24"), car_park(find_site("sizes"))).remarks
    assert told == "1 car is inside at the start, brought in before it, one in 180 s"


COUNTS = "Stunde;ein;aus\n2019-07-24 07:00;5;8\n2019-07-24 08:00;6;2\n2019-07-25 07:00;0;1\n"
COUNTED = ("--columns", "hour=Stunde,arrivals=ein,departures=aus", "--delimiter", "semicolon", *BERLIN)


def by_hour(times_us: list[int]) -> list[int]:
    hours = [time_us // (60 * MINUTE_US) for time_us in times_us]
    return [hours.count(hour) for hour in (7, 8, 24 + 7)]


def test_counts_by_the_hour_are_cars_that_come_and_go_so(tmp_path: Path) -> None:
    demand = asked(tmp_path, COUNTS, *COUNTED, kind="counts")
    assert demand.zero == datetime.fromisoformat("2019-07-24T00:00+02:00")
    assert by_hour([stay.arrival_us for stay in demand.stays]) == [5, 6, 0]
    # Three more leave in the first hour than come: they were inside.
    assert len(demand.inside) == 3
    assert demand.remarks == ("table.csv: 3 cars are inside at the start: so many leave before they came",)
    leaving = sorted(stay.departure_us for stay in (*demand.inside, *demand.stays) if stay.departure_us is not None)
    assert len(leaving) == 11
    # Each leaves in its hour, or up to five minutes later where nobody had been there for so long.
    assert all(
        begin <= time_us < begin + 65 * MINUTE_US for begin, time_us in zip(hours_of(8, 2, 1), leaving, strict=True)
    )
    for stay in demand.stays:
        assert stay.departure_us is None or stay.departure_us - stay.arrival_us >= 5 * MINUTE_US
    assert len({stay.car.name for stay in (*demand.inside, *demand.stays)}) == 14


def hours_of(*counts: int) -> list[int]:
    begins = [7 * 60 * MINUTE_US, 8 * 60 * MINUTE_US, (24 + 7) * 60 * MINUTE_US]
    return [begin for begin, count in zip(begins, counts, strict=True) for _ in range(count)]


def test_counts_are_drawn_by_the_seed_and_of_the_days_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text("hour,arrivals,departures\n2019-07-24T07Z,9,3\n2019-07-25T07Z,4,0\n")
    one, same, other = (Demand.from_counts(path, seed=seed) for seed in (1, 1, 2))
    assert one == same != other
    assert one.inside == ()
    day = Demand.from_counts(path, day=date(2019, 7, 25), inside=2)
    assert (len(day.stays), len(day.inside), day.skipped) == (4, 2, 1)
    assert all(stay.departure_us is None for stay in day.inside)
    with pytest.raises(DemandError, match=r"table.csv: no counts of 2019-07-26; the file has 2019-07-24 to 2019-07-25"):
        Demand.from_counts(path, day=date(2019, 7, 26))


def test_hours_of_one_day_need_no_date(tmp_path: Path) -> None:
    demand = asked(tmp_path, "hour,arrivals,departures\n07:00,2,0\n8,0,2\n", kind="counts")
    assert demand.zero is None
    assert by_hour([stay.arrival_us for stay in demand.stays]) == [2, 0, 0]
    assert by_hour([stay.departure_us or 0 for stay in demand.stays]) == [0, 2, 0]


def test_so_many_of_who_come_in_an_hour_ask_to_charge(tmp_path: Path) -> None:
    head = "hour,arrivals,departures,charging\n"
    demand = asked(tmp_path, head + "07:00,6,4,2\n8,5,8,\n9,4,0,4\n", kind="counts")
    charging = [stay.arrival_us for stay in demand.stays if stay.car.charging]
    assert [time_us // (60 * MINUTE_US) for time_us in charging] == [7, 7, 9, 9, 9, 9]
    plain = asked(tmp_path, "hour,arrivals,departures\n07:00,6,4\n8,5,8\n9,4,0\n", kind="counts")
    assert [stay.arrival_us for stay in plain.stays] == [stay.arrival_us for stay in demand.stays]
    assert not any(stay.car.charging for stay in plain.stays)
    assert refused(tmp_path, head + "7,3,1,4\n", kind="counts")[0].startswith(
        "table.csv:2: charging '4' is out of range; write a whole number from 0 to 3"
    )


def test_an_hour_that_the_clock_showed_twice_is_counted_twice(tmp_path: Path) -> None:
    text = "hour,arrivals,departures\n2019-10-27 02:00,1,0\n2019-10-27 02:00,1,0\n2019-10-27 03:00,1,0\n"
    demand = asked(tmp_path, text, *BERLIN, kind="counts")
    assert [stay.arrival_us // (60 * MINUTE_US) for stay in demand.stays] == [2, 3, 4]


def test_bad_rows_of_counts_are_named(tmp_path: Path) -> None:
    text = (
        "hour,arrivals,departures\n7,1,1\n7,1,1\n24,1,1\n8,x,1\n9,-1,1\n10,1.5,1\n11,1,\n07:30,1,1\n"
        '2019-07-24T07:30Z,1,1\n2019-07-24T08:00Z,1,1\n12,"4,25",1\n13,4,25,1\n'
    )
    told = [
        "table.csv:3: hour '7' is that of line 2 too; leave one out",
        "table.csv:4: hour '24' is out of range; write one from 0 to 23",
        "table.csv:5: arrivals 'x' is no number; write a whole number from 0 to 10000",
        "table.csv:6: arrivals '-1' is out of range; write a whole number from 0 to 10000",
        "table.csv:7: arrivals '1.5' is out of range; write a whole number from 0 to 10000",
        "table.csv:8: departures is empty; every row needs one",
        "table.csv:9: hour '07:30' is no date and time; write it as",
        "table.csv:10: hour '2019-07-24T07:30Z' is no full hour; write when each hour begins",
        "table.csv:11: hour '2019-07-24T08:00Z': others are written in another way; write all with a date, or none",
        "table.csv:12: arrivals '4,25' has a comma; write a whole number from 0 to 10000, without a comma",
        "table.csv:13: has 4 cells, the first line 3 names; put values that hold a comma in quotes, and write numbers",
    ]
    lines = refused(tmp_path, text, kind="counts")
    assert len(lines) == len(told) + 1
    assert all(line.startswith(start) for line, start in zip(lines, told, strict=False)), lines
    assert refused(tmp_path, "hour,arrivals,departures\n7,1,1\n", "--day", "2019-07-24", kind="counts") == [
        "--day 2019-07-24: the counts are of one day without a date; leave it out"
    ]


def test_more_inside_than_there_are_places_is_a_mistake(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "small", "--inside", "99", "--day", "2019-07-24"]) == 2
    assert "99 cars inside at the start: small has " in capsys.readouterr().err
    assert main(["compare", "small", "--parts", "day", "--inside", "99", "--day", "2019-07-24"]) == 2
    assert "99 cars inside at the start: small has " in capsys.readouterr().err
    assert main(["compare", "small", "--parts", "day", "--counts", "x.csv", "--sessions", "y.csv"]) == 2
    assert "--sessions: does not go with --counts" in capsys.readouterr().err


def test_whole_real_tables_are_read() -> None:
    """Those that ship; with the environment variable CARPARK_DATA those of that folder, which holds longer ones."""
    folder = Path(os.environ.get("CARPARK_DATA", "bus_sim/data"))
    tables = sorted(folder.glob("acn_jpl_*.csv"))
    assert tables, f"no acn_jpl_*.csv in {folder}"
    for path in tables:
        rows = path.read_text(encoding="utf-8").splitlines()[1:]
        whole, day = Demand.from_sessions(path), Demand.from_sessions(path, day=date(2019, 7, 24), overnight=True)
        assert (len(whole.stays), whole.inside) == (len(rows), ())
        assert len(day.stays) == sum(row.startswith("2019-07-24") for row in rows)
        # Two came on the evening before; the shipped selections leave them out (bus_sim/data/README.md).
        assert len(day.inside) == (2 if len(whole.stays) > 82 else 0)


def test_nobody_is_fetched_within_five_minutes_of_coming(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text("hour,arrivals,departures\n7,40,40\n")
    for seed in range(5):
        demand = Demand.from_counts(path, seed=seed)
        assert demand.inside == ()
        gone = [stay.departure_us - stay.arrival_us for stay in demand.stays if stay.departure_us is not None]
        assert len(gone) == 40 and min(gone) >= 5 * MINUTE_US
