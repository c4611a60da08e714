"""What customers want of a car park: who comes when with which car, and when it is fetched.

Four sources: recorded sessions and hourly counts (CSV), random intervals by mean and standard deviation (row P53), cars
by hand (P52).
"""

import random
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from datetime import date, datetime, time
from importlib.resources import files
from pathlib import Path

from bus_sim.demand import LONGEST_S, MOST_CARS, DemandError, Law, check_count
from bus_sim.systems.car_park.counts import chosen_counts, day_zero, drawn_stays, no_counts, read_counts
from bus_sim.systems.car_park.csv_rows import CsvForm, CsvTable, Readable
from bus_sim.systems.car_park.plant.bodies import CarBody, random_car
from bus_sim.systems.car_park.sessions import ParkingSession, nothing_chosen, read_sessions
from onboard.systems.car_park.site import CarPark

MINUTE_S, MINUTE_US = 60, 60_000_000
#: What ships with the simulator, both 2019-07-24 (bus_sim/data/README.md): stalls AG-1F01 to AG-1F14, and all 52.
LEVEL1_DAY = "acn_jpl_2019-07-24_level1.csv"
WHOLE_DAY = "acn_jpl_2019-07-24.csv"


@dataclass(frozen=True, slots=True)
class Stay:
    """One car's visit, in us after the demand's time zero; ``departure_us`` None: never fetched.

    ``cancel_us``: when the customer changes their mind and presses cancel, if the car is not fetched before.
    """

    arrival_us: int
    departure_us: int | None
    car: CarBody
    cancel_us: int | None = None
    #: When the driver says, on the day, that the car will be fetched; None: says nothing.
    announced_us: int | None = None


@dataclass(frozen=True)
class Demand:
    """Stays in the order of arrival. ``zero`` is the wall time of time zero, where the demand has one.

    ``inside``: cars that are inside when it begins; when they came is not known. ``remarks``: lines for who asked.
    """

    stays: tuple[Stay, ...]
    zero: datetime | None = None
    skipped: int = 0
    inside: tuple[Stay, ...] = ()
    remarks: tuple[str, ...] = ()

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
        form: CsvForm | None = None,
        overnight: bool = False,
        park: CarPark | None = None,
    ) -> "Demand":
        """The sessions of a CSV file that begin on one local day at stations named, or beginning as named.

        Without a path the ``shipped`` day is read; without stations all count; without a day all days, and time zero is
        midnight before the first arrival. With ``until`` the days from ``day`` to it, both included. A session still
        there at midnight keeps its later departure. One without an arrival is inside at the start if it is fetched on
        one of the days, with ``overnight`` also who came before the first day and was there when it began. ``skipped``
        counts rows of other days and stations. ``park``: whose classes the table may name.
        Raises ``DemandError`` for what cannot be read, and for bad rows unless the form passes them over.
        """
        source: Readable = Path(path) if path is not None else _shipped(shipped)
        wanted, last = tuple(stations), until or day
        table = CsvTable(source.name, form or CsvForm())
        sessions = list(read_sessions(source, table, seed, park))
        remarks = table.checked()
        here = [one for one in sessions if one.is_at(wanted)]
        held = [one for one in here if overnight and one.is_inside(day)]
        chosen = [one for one in here if one not in held and _is_within(one.first.date(), day, last)]
        if not chosen:
            raise nothing_chosen(source.name, sessions, wanted, day, last)
        chosen.sort(key=lambda session: (session.first, session.name))
        first = chosen[0].first
        zero = datetime.combine(first.date(), time(), first.tzinfo)
        stays = tuple(_session_stay(one, zero) for one in chosen if one.arrival is not None)
        unknown = [one for one in chosen if one.arrival is None]
        before = tuple(_session_stay(one._replace(arrival=None), zero) for one in (*held, *unknown))
        return cls(stays, zero, len(sessions) - len(chosen) - len(held), before, tuple(remarks))

    @classmethod
    def from_counts(
        cls,
        path: str | Path,
        *,
        day: date | None = None,
        until: date | None = None,
        seed: int = 0,
        form: CsvForm | None = None,
        inside: int = 0,
    ) -> "Demand":
        """Cars that come and go as often as a CSV file counts in each hour; see ``drawn_stays``.

        Raises ``DemandError`` as ``from_sessions`` does.
        """
        source = Path(path)
        table = CsvTable(source.name, form or CsvForm())
        counts = read_counts(source, table)
        remarks = table.checked()
        chosen = chosen_counts(counts, day, until or day)
        if not chosen:
            raise no_counts(source.name, counts, day, until or day)
        drawn = drawn_stays(chosen, inside, seed)
        cars = [
            replace(random_car(f"car {number}", seed), charging=one.charging)
            for number, one in enumerate(drawn, start=1)
        ]
        stays = [Stay(one.arrival_us or 0, one.departure_us, car) for one, car in zip(drawn, cars, strict=True)]
        held = sum(one.arrival_us is None for one in drawn)
        if held > inside:
            who = "1 car is" if held == 1 else f"{held} cars are"
            remarks.append(f"{source.name}: {who} inside at the start: so many leave before they came")
        return cls(
            tuple(stays[held:]), day_zero(chosen), len(counts) - len(chosen), tuple(stays[:held]), tuple(remarks)
        )

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
        inside: int = 0,
    ) -> "Demand":
        """Automatic piloting (row P53): ``count`` cars come at normal intervals and are fetched at normal intervals.

        ``mean_s`` and ``sigma_s`` are those of the input, ``out`` those of the output (the same unless given). Each
        output fetches one of the cars that came at least ``min_stay_s`` before, by chance, or none where none did.
        With ``inside`` so many cars are there when it begins, may be fetched at once, and as many go as come.
        The law is cut off at 0 by drawing again: with a deviation above about a third of the mean the true mean is
        larger than ``mean_s``. Raises ``DemandError`` for what is below 0, a mean that is 0, and what
        no run is long enough for (``bus_sim.demand``).
        """
        arriving, leaving = Law(mean_s, sigma_s), Law(*(out or (mean_s, sigma_s)))
        arriving.check("input interval")
        leaving.check("output interval")
        check_count("cars", count, MOST_CARS)
        if not 0 <= min_stay_s <= LONGEST_S:
            raise DemandError(f"least stay {min_stay_s:g} s: must be from 0 to {LONGEST_S}")
        times = list(_running(arriving, random.Random(f"input:{seed}"), count))
        chance = random.Random(f"output:{seed}")
        departures = _departures(times, leaving, round(min_stay_s * 1e6), chance, inside)
        stays = tuple(
            Stay(arrival_us, departures.get(number), random_car(f"car {number + 1}", seed))
            for number, arrival_us in enumerate(times)
        )
        held = (Stay(0, departures.get(-one), random_car(f"inside {one}", seed)) for one in range(1, inside + 1))
        return cls(stays, inside=tuple(held))

    @classmethod
    def one_car(cls, car: CarBody | None = None, *, stay_s: float | None = None, seed: int = 0) -> "Demand":
        """Manual piloting (row P52): one car at time zero, fetched after ``stay_s`` or when somebody asks for it.

        Raises ``DemandError`` for a stay below 0, or above ``LONGEST_S``.
        """
        if stay_s is not None and not 0 <= stay_s <= LONGEST_S:
            raise DemandError(f"stay {stay_s:g} s: must be from 0 to {LONGEST_S}")
        departure_us = None if stay_s is None else round(stay_s * 1e6)
        return cls((Stay(0, departure_us, car or random_car("car 1", seed)),))


@dataclass(frozen=True)
class Announcements:
    """``share`` of those who fetch their cars say beforehand when; ``sigma_s`` is how far off they are."""

    share: float
    sigma_s: float = 0.0

    def check(self) -> None:
        """Raise ``DemandError`` for a share that is none, or a negative deviation."""
        if not (0 <= self.share <= 1 and self.sigma_s >= 0):
            given = f"--announce {self.share:g} {self.sigma_s / MINUTE_S:g}"
            raise DemandError(f"{given}: the share must be from 0 to 1, the deviation 0 min or more")

    def of(self, demand: Demand, seed: int) -> Demand:
        """The demand with what is announced: full minutes, as people say them, drawn apart from all else."""
        return replace(demand, stays=tuple(self._said(stay, seed) for stay in demand.stays))

    def _said(self, stay: Stay, seed: int) -> Stay:
        chance = random.Random(f"announced:{seed}:{stay.car.name}")
        is_said, off_us = chance.random() < self.share, chance.gauss(0, self.sigma_s) * 1e6
        if stay.departure_us is None or not is_said:
            return stay
        return replace(stay, announced_us=round((stay.departure_us + off_us) / MINUTE_US) * MINUTE_US)


def with_more_inside(demand: Demand, cars: int, seed: int) -> Demand:
    """So many more cars are inside when it begins, and stay."""
    more = tuple(Stay(0, None, random_car(f"inside {number}", seed)) for number in range(1, cars + 1))
    return replace(demand, inside=(*demand.inside, *more)) if more else demand


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


def _session_stay(session: ParkingSession, zero: datetime) -> Stay:
    """The visit in us after ``zero``; at 0 where the arrival is not known."""
    arrival_us = 0 if session.arrival is None else _us(session.arrival, zero)
    departure_us = None if session.departure is None else _us(session.departure, zero)
    return Stay(arrival_us, departure_us, session.car)


def _is_within(day: date, first: date | None, last: date | None) -> bool:
    return (first is None or first <= day) and (last is None or day <= last)


def _us(moment: datetime, zero: datetime) -> int:
    gone = moment - zero
    return (gone.days * 86_400 + gone.seconds) * 1_000_000 + gone.microseconds


def _running(law: Law, chance: random.Random, count: int) -> Iterator[int]:
    moment_us = 0
    for _ in range(count):
        moment_us += law.draw_us(chance)
        yield moment_us


def _departures(
    arrivals_us: list[int], law: Law, min_stay_us: int, chance: random.Random, inside: int = 0
) -> dict[int, int]:
    """Departure of each car by its number, -1, -2 ... of those inside. Outputs go on until as many went as came."""
    departures: dict[int, int] = {}
    present = [-number for number in range(1, inside + 1)]
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
