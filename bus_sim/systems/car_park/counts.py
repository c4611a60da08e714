"""Counts by the hour: how many came and went, and cars that come and go so."""

import random
from collections.abc import Iterable, Sequence
from datetime import date, datetime, time, timedelta
from typing import NamedTuple

from bus_sim.demand import DemandError
from bus_sim.systems.car_park.csv_rows import CsvRow, CsvTable, Readable
from bus_sim.systems.car_park.moments import CellError, MomentForm

NEEDED = ("hour", "arrivals", "departures")
#: How many of the arrivals ask for a place to charge; 0 without the column, and in an empty cell.
OPTIONAL = ("charging",)
#: More in an hour is a mistake: a compartment serves some hundred at most.
MOST_AN_HOUR = 10_000
HOUR_US = 3_600_000_000
#: Nobody is fetched sooner than so long after coming, us: as with cars by chance (``Demand.by_mean``).
MIN_STAY_US = 300_000_000


class HourCount(NamedTuple):
    """How many came and went in the hour from ``hour`` on: a point in time, or an hour of one day without a date."""

    hour: datetime | int
    arrivals: int
    departures: int
    charging: int = 0


class DrawnStay(NamedTuple):
    """One car's times, us after the demand's time zero; None for a car that was inside, and one that stays."""

    arrival_us: int | None
    departure_us: int | None
    charging: bool = False


def read_counts(source: Readable, table: CsvTable) -> list[HourCount]:
    """All good rows; bad rows are noted. Raises ``DemandError`` where the file cannot be read or lacks a column."""
    counts: list[HourCount] = []
    lines: dict[datetime | int, int] = {}
    for row in table.rows(source, NEEDED, OPTIONAL):
        try:
            hours, text = _hours(row, table.form.moments), row.text("hour")
            # An hour that the clock showed twice is the first of both where it is there once.
            hour = next((one for one in hours if one not in lines), None)
            if hour is None:
                raise CellError(f"hour {text!r} is that of line {lines[hours[0]]} too; leave one out")
            if counts and isinstance(hour, int) is not isinstance(counts[0].hour, int):
                raise CellError(f"hour {text!r}: others are written in another way; write all with a date, or none")
            arrivals, departures = (row.number(column, 0, MOST_AN_HOUR) for column in ("arrivals", "departures"))
            charging = row.number("charging", 0, arrivals) if "charging" in row.cells else 0
            count = HourCount(hour, arrivals, departures, charging)
        except CellError as error:
            table.note(row, error)
            continue
        lines[count.hour] = row.line
        counts.append(count)
    return counts


def _hours(row: CsvRow, form: MomentForm) -> Sequence[datetime | int]:
    """What the hour of a row can mean."""
    text = row.text("hour")
    clock = _hour_of_day(text) if not form.formats else None
    if clock is not None:
        return (clock,)
    try:
        hours = form.read(text)
    except CellError as error:
        raise CellError(f"hour {text!r} {error}") from error
    if hours[0] != hours[0].replace(minute=0, second=0, microsecond=0):
        raise CellError(f"hour {text!r} is no full hour; write when each hour begins")
    return hours


def _hour_of_day(text: str) -> int | None:
    """``7``, ``07`` or ``07:00``; None for anything else."""
    hours, _, minutes = text.partition(":")
    is_such = hours.isdecimal() and len(hours) <= 2 and minutes in ("", "00")
    if is_such and int(hours) > 23:
        raise CellError(f"hour {text!r} is out of range; write one from 0 to 23")
    return int(hours) if is_such else None


def chosen_counts(counts: Iterable[HourCount], day: date | None, last: date | None) -> list[HourCount]:
    """Those of the days from ``day`` to ``last``, in order. Raises ``DemandError`` where the hours have no date."""
    chosen = []
    for one in counts:
        if day is not None and not isinstance(one.hour, datetime):
            raise DemandError(f"--day {day}: the counts are of one day without a date; leave it out")
        if day is None or last is None or (isinstance(one.hour, datetime) and day <= one.hour.date() <= last):
            chosen.append(one)
    return sorted(chosen, key=lambda one: one.hour.timestamp() if isinstance(one.hour, datetime) else one.hour)


def no_counts(name: str, counts: list[HourCount], day: date | None, last: date | None) -> DemandError:
    """Why no hour is chosen, and what the table has."""
    days = sorted(one.hour.date() for one in counts if isinstance(one.hour, datetime))
    if not days:
        return DemandError(f"{name}: no counts in the file")
    when = f"of {day}" if day == last else f"from {day} to {last}"
    return DemandError(f"{name}: no counts {when}; the file has {days[0]} to {days[-1]}")


def day_zero(counts: list[HourCount]) -> datetime | None:
    """Midnight before the first hour; None where it has no date."""
    first = counts[0].hour
    return datetime.combine(first.date(), time(), first.tzinfo) if isinstance(first, datetime) else None


def drawn_stays(counts: list[HourCount], inside: int, seed: int) -> list[DrawnStay]:
    """Cars that come and go so often; the cars inside at the start first.

    Times are drawn in each hour, all alike likely. Each departure fetches one of the cars inside, by chance, that came
    ``MIN_STAY_US`` before or was inside at the start; where there is none it waits for the next that is, so that it can
    be so long after its hour. So many are inside at the start as would leave before they came, by the sums at the end
    of each hour, and at least ``inside``. Who charges is drawn from those who come in each hour.
    """
    chance, wishes, zero = random.Random(f"counts:{seed}"), random.Random(f"charging:{seed}"), day_zero(counts)
    come: list[int] = []
    go: list[int] = []
    charging: set[int] = set()
    lacking = 0
    for count in counts:
        begin_us = _begin_us(count.hour, zero)
        charging.update(wishes.sample(range(len(come), len(come) + count.arrivals), count.charging))
        come += sorted(begin_us + chance.randrange(HOUR_US) for _ in range(count.arrivals))
        go += sorted(begin_us + chance.randrange(HOUR_US) for _ in range(count.departures))
        lacking = max(lacking, len(go) - len(come))
    first = max(inside, lacking)
    leaving = _matched(first, come, go, chance)
    arrivals: list[int | None] = [*[None] * first, *come]
    return [DrawnStay(arrival_us, leaving.get(car), car - first in charging) for car, arrival_us in enumerate(arrivals)]


def _matched(inside: int, come: list[int], go: list[int], chance: random.Random) -> dict[int, int]:
    """When each car leaves, by its number: those inside at the start are numbered first, then who comes."""
    present, coming, leaving = list(range(inside)), 0, {}
    for time_us in go:
        moment_us = time_us
        if not present:
            moment_us = max(moment_us, come[coming] + MIN_STAY_US)
        while coming < len(come) and come[coming] + MIN_STAY_US <= moment_us:
            present.append(inside + coming)
            coming += 1
        leaving[present.pop(chance.randrange(len(present)))] = moment_us
    return leaving


def _begin_us(hour: datetime | int, zero: datetime | None) -> int:
    if isinstance(hour, int) or zero is None:
        assert isinstance(hour, int), "hours with a date have a day zero"
        return hour * HOUR_US
    return (hour - zero) // timedelta(microseconds=1)
