"""What customers want of a car park: who comes when with which car, and when it is fetched.

Three sources: recorded sessions (CSV), random intervals by mean and standard deviation (row P53), cars by hand (P52).
"""

import csv
import io
import random
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import date, datetime, time
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple, Protocol

from bus_sim.demand import DemandError, Law
from bus_sim.systems.car_park.plant.bodies import CarBody, random_car

#: Columns of a session file that are read; others may be there.
COLUMNS = ("arrival", "departure", "station_id", "session_id")
#: What ships with the simulator, both 2019-07-24 (bus_sim/data/README.md): stalls AG-1F01 to AG-1F14, and all 52.
LEVEL1_DAY = "acn_jpl_2019-07-24_level1.csv"
WHOLE_DAY = "acn_jpl_2019-07-24.csv"


class Readable(Protocol):
    """A file, on disk or inside a package."""

    @property
    def name(self) -> str:
        """Its name, for error lines."""

    def read_text(self, encoding: str) -> str:
        """The whole text of the file. Raises ``OSError``, and ``UnicodeDecodeError`` for other text."""


@dataclass(frozen=True, slots=True)
class Stay:
    """One car's visit, in us after the demand's time zero; ``departure_us`` None: never fetched.

    ``cancel_us``: when the customer changes their mind and presses cancel, if the car is not fetched before.
    """

    arrival_us: int
    departure_us: int | None
    car: CarBody
    cancel_us: int | None = None


@dataclass(frozen=True)
class Demand:
    """Stays in the order of arrival. ``zero`` is the wall time of time zero, where the demand has one."""

    stays: tuple[Stay, ...]
    zero: datetime | None = None
    skipped: int = 0

    @classmethod
    def from_sessions(
        cls,
        path: str | Path | None = None,
        *,
        stations: Iterable[str] = (),
        day: date | None = None,
        until: date | None = None,
        shipped: str = LEVEL1_DAY,
        seed: int = 0,
    ) -> "Demand":
        """The sessions of a CSV file that begin on one local day at stations named, or beginning as named.

        Without a path the ``shipped`` day is read; without stations all count; without a day all days, and time zero is
        midnight before the first arrival. With ``until`` the days from ``day`` to it, both included. A session still
        there at midnight keeps its later departure. ``skipped`` counts rows of other days and stations. Raises
        ``DemandError`` for what cannot be read.
        """
        source: Readable = Path(path) if path is not None else _shipped(shipped)
        wanted = tuple(stations)
        sessions = list(read_sessions(source))
        last = until or day
        chosen = [s for s in sessions if s.is_at(wanted) and _is_within(s.arrival.date(), day, last)]
        if not chosen:
            raise DemandError(_nothing(source.name, sessions, wanted, day, last))
        chosen.sort(key=lambda session: (session.arrival, session.name))
        first = chosen[0].arrival
        zero = datetime.combine(first.date(), time(), first.tzinfo)
        stays = tuple(session.stay(zero, seed) for session in chosen)
        return cls(stays, zero, len(sessions) - len(chosen))

    @classmethod
    def by_mean(
        cls,
        mean_s: float,
        sigma_s: float,
        seed: int,
        *,
        count: int = 100,
        out: tuple[float, float] | None = None,
        min_stay_s: float = 300.0,
    ) -> "Demand":
        """Automatic piloting (row P53): ``count`` cars come at normal intervals and are fetched at normal intervals.

        ``mean_s`` and ``sigma_s`` are those of the input, ``out`` those of the output (the same unless given). Each
        output fetches one of the cars that came at least ``min_stay_s`` before, by chance, or none where none did.
        The law is cut off at 0 by drawing again: with a deviation above about a third of the mean the true mean is
        larger than ``mean_s``. Raises ``DemandError`` for a mean not above 0, a negative deviation or count.
        """
        arriving, leaving = Law(mean_s, sigma_s), Law(*(out or (mean_s, sigma_s)))
        arriving.check("input interval")
        leaving.check("output interval")
        if count < 0:
            raise DemandError(f"count {count}: must be 0 or more")
        times = list(_running(arriving, random.Random(f"input:{seed}"), count))
        departures = _departures(times, leaving, round(min_stay_s * 1e6), random.Random(f"output:{seed}"))
        return cls(
            tuple(
                Stay(arrival_us, departures.get(number), random_car(f"car {number + 1}", seed))
                for number, arrival_us in enumerate(times)
            )
        )

    @classmethod
    def one_car(cls, car: CarBody | None = None, *, stay_s: float | None = None, seed: int = 0) -> "Demand":
        """Manual piloting (row P52): one car at time zero, fetched after ``stay_s`` or when somebody asks for it.

        Raises ``DemandError`` for a stay below 0.
        """
        if stay_s is not None and stay_s < 0:
            raise DemandError(f"stay {stay_s} s: must be 0 or more")
        departure_us = None if stay_s is None else round(stay_s * 1e6)
        return cls((Stay(0, departure_us, car or random_car("car 1", seed)),))


@dataclass(frozen=True)
class Arrivals:
    """Cars at normal intervals, in s, fetched at such intervals ``min_stay_s`` after their coming at the earliest."""

    cars: int = 6
    mean_s: float = 120.0
    sigma_s: float = 60.0
    min_stay_s: float = 200.0

    @property
    def apart_s(self) -> float:
        """Mean time between two cars, s."""
        return self.mean_s

    def demand(self, seed: int) -> Demand:
        """The stays of one seed. Raises ``DemandError`` for a law that is none."""
        return Demand.by_mean(self.mean_s, self.sigma_s, seed, count=self.cars, min_stay_s=self.min_stay_s)

    def to_toml(self) -> list[str]:
        """The lines of a scenario file's section ``[demand]``, times in s."""
        return [
            "[demand]",
            f"cars = {self.cars}",
            f"mean_s = {self.mean_s:.15g}",
            f"sigma_s = {self.sigma_s:.15g}",
            f"min_stay_s = {self.min_stay_s:.15g}",
        ]


class ParkingSession(NamedTuple):
    """One row of a session file; both times carry their UTC offset."""

    arrival: datetime
    departure: datetime
    station: str
    name: str

    def is_at(self, stations: tuple[str, ...]) -> bool:
        """Whether the session's station is named by, or begins with, one of ``stations``; any where there are none."""
        return not stations or self.station.startswith(stations)

    def stay(self, zero: datetime, seed: int) -> Stay:
        """The visit in us after ``zero``, with a car drawn for this session."""
        return Stay(_us(self.arrival, zero), _us(self.departure, zero), random_car(self.name, seed))


def read_sessions(source: Readable) -> Iterator[ParkingSession]:
    """All sessions of a CSV file in its order. Raises ``DemandError`` at the first thing that cannot be read."""
    try:
        text = source.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise DemandError(f"{source.name}: cannot be read as UTF-8 text ({error}); name a session CSV file") from error
    rows = csv.DictReader(io.StringIO(text, newline=""))
    missing = [column for column in COLUMNS if column not in (rows.fieldnames or ())]
    if missing:
        raise DemandError(f"{source.name}:1: no column {', '.join(missing)}; {_header_remedy(rows.fieldnames)}")
    names: dict[str, int] = {}
    for row in rows:
        where = f"{source.name}:{rows.line_num}"
        session = _session(row, where)
        if session.name in names:
            raise DemandError(
                f"{where}: session_id {session.name!r} is that of line {names[session.name]} too; make it unique"
            )
        names[session.name] = rows.line_num
        yield session


def _header_remedy(names: Sequence[str] | None) -> str:
    """What to do about a first line that does not name the columns; spreadsheets often divide by other characters."""
    if names is not None and len(names) == 1:
        for mark, word in ((";", "semicolons"), ("\t", "tabs")):
            if mark in names[0]:
                return f"its columns are divided by {word}; save it with commas"
    return f"the first line must name {', '.join(COLUMNS)}, divided by commas"


def _session(row: dict[str, str | None], where: str) -> ParkingSession:
    arrival, departure = _time(row, "arrival", where), _time(row, "departure", where)
    if departure <= arrival:
        times = f"departure {row['departure']!r} is not after arrival {row['arrival']!r}"
        raise DemandError(f"{where}: {times}; correct or leave out the row")
    return ParkingSession(arrival, departure, _cell(row, "station_id", where), _cell(row, "session_id", where))


def _cell(row: dict[str, str | None], column: str, where: str) -> str:
    value = (row.get(column) or "").strip()
    if not value:
        raise DemandError(f"{where}: {column} is empty; every row needs one")
    return value


def _time(row: dict[str, str | None], column: str, where: str) -> datetime:
    value = _cell(row, column, where)
    remedy = "write it as 2019-07-24 05:35:06-07:00"
    try:
        moment = datetime.fromisoformat(value)
    except ValueError as error:
        raise DemandError(f"{where}: {column} {value!r} is no date and time; {remedy}") from error
    if moment.tzinfo is None:
        raise DemandError(f"{where}: {column} {value!r} has no UTC offset; {remedy}")
    return moment


def _is_within(day: date, first: date | None, last: date | None) -> bool:
    return (first is None or first <= day) and (last is None or day <= last)


def _nothing(
    name: str, sessions: list[ParkingSession], stations: tuple[str, ...], day: date | None, last: date | None
) -> str:
    if not sessions:
        return f"{name}: no sessions in the file"
    here = [session for session in sessions if session.is_at(stations)]
    if not here:
        known = sorted({session.station for session in sessions})
        return f"{name}: no station {', '.join(stations)}; the file has {known[0]} to {known[-1]}"
    days = sorted({session.arrival.date() for session in here})
    when = f"on {day}" if day == last else f"from {day} to {last}"
    return f"{name}: nobody arrives {when}; the file has {days[0]} to {days[-1]}"


def _us(moment: datetime, zero: datetime) -> int:
    gone = moment - zero
    return (gone.days * 86_400 + gone.seconds) * 1_000_000 + gone.microseconds


def _running(law: Law, chance: random.Random, count: int) -> Iterator[int]:
    moment_us = 0
    for _ in range(count):
        moment_us += law.draw_us(chance)
        yield moment_us


def _departures(arrivals_us: list[int], law: Law, min_stay_us: int, chance: random.Random) -> dict[int, int]:
    """Departure of each car by its number. Outputs go on until the last car is fetched."""
    departures: dict[int, int] = {}
    present: list[int] = []
    coming = 0
    moment_us = 0
    while len(departures) < len(arrivals_us):
        moment_us += law.draw_us(chance)
        while coming < len(arrivals_us) and arrivals_us[coming] + min_stay_us <= moment_us:
            present.append(coming)
            coming += 1
        if present:
            departures[present.pop(chance.randrange(len(present)))] = moment_us
    return departures


def _shipped(name: str) -> Readable:
    return files("bus_sim").joinpath("data", name)
