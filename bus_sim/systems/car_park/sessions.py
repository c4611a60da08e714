"""Recorded sessions: who came when and was fetched when, one row each."""

from collections.abc import Iterator
from datetime import date, datetime
from typing import NamedTuple

from bus_sim.demand import DemandError
from bus_sim.systems.car_park import sizes
from bus_sim.systems.car_park.csv_rows import CsvRow, CsvTable, Readable
from bus_sim.systems.car_park.moments import CellError, MomentForm
from bus_sim.systems.car_park.plant.bodies import CarBody
from bus_sim.systems.car_park.sizes import car_of
from onboard.systems.car_park.site import CarPark

#: Columns that every table of sessions has; a cell of one of them may be empty.
NEEDED = ("arrival", "departure")
#: Columns that are read where they are there.
OPTIONAL = ("station_id", "session_id", *sizes.COLUMNS)


class ParkingSession(NamedTuple):
    """One row; both times carry their UTC offset.

    ``arrival`` None: it came before the table begins. ``departure`` None: it is still there when the table ends.
    """

    arrival: datetime | None
    departure: datetime | None
    station: str
    name: str
    car: CarBody

    @property
    def first(self) -> datetime:
        """The first that is known of it."""
        known = self.arrival or self.departure
        assert known is not None, "a row without any time is a bad row"
        return known

    def is_at(self, stations: tuple[str, ...]) -> bool:
        """Whether the session's station is named by, or begins with, one of ``stations``; any where there are none."""
        return not stations or self.station.startswith(stations)

    def is_inside(self, day: date | None) -> bool:
        """Whether it came before this day began and was not fetched by then."""
        if day is None or self.arrival is None or self.arrival.date() >= day:
            return False
        return self.departure is None or self.departure.date() >= day


def read_sessions(
    source: Readable, table: CsvTable, seed: int = 0, park: CarPark | None = None
) -> Iterator[ParkingSession]:
    """All good sessions of a table in its order; bad rows are noted there. ``park``: where the cars are to stand.

    Raises ``DemandError`` where the file cannot be read, or has no such columns.
    """
    names: dict[str, int] = {}
    for row in table.rows(source, NEEDED, OPTIONAL):
        try:
            session = _session(row, table.form.moments, seed, park)
            if session.name in names:
                earlier = f"is that of line {names[session.name]} too"
                raise CellError(f"session_id {session.name!r} {earlier}; make it unique")
        except CellError as error:
            table.note(row, error)
            continue
        names[session.name] = row.line
        yield session


def _session(row: CsvRow, form: MomentForm, seed: int, park: CarPark | None) -> ParkingSession:
    arrivals, departures = _moments(row, "arrival", form), _moments(row, "departure", form)
    if not arrivals and not departures:
        raise CellError("arrival and departure are empty; every row needs one of them")
    arrival = arrivals[0] if arrivals else None
    # A departure that the clock showed twice is the first that is possible.
    departure = next((one for one in departures if arrival is None or one > arrival), None)
    if departures and departure is None:
        times = f"departure {row.text('departure')!r} is not after arrival {row.text('arrival')!r}"
        raise CellError(f"{times}; correct or leave out the row")
    name = row.cells.get("session_id", f"row {row.line}")
    return ParkingSession(arrival, departure, row.cells.get("station_id", ""), name, car_of(name, row, seed, park))


def _moments(row: CsvRow, column: str, form: MomentForm) -> tuple[datetime, ...]:
    """What a cell can mean; nothing where it is empty."""
    if column not in row.cells:
        return ()
    try:
        return form.read(row.cells[column])
    except CellError as error:
        raise CellError(f"{column} {row.cells[column]!r} {error}") from error


def nothing_chosen(
    name: str, sessions: list[ParkingSession], stations: tuple[str, ...], day: date | None, last: date | None
) -> DemandError:
    """Why no session is chosen, and what the table has."""
    if not sessions:
        return DemandError(f"{name}: no sessions in the file")
    here = [session for session in sessions if session.is_at(stations)]
    if not here:
        known = sorted({session.station for session in sessions})
        return DemandError(f"{name}: no station {', '.join(stations)}; the file has {known[0]} to {known[-1]}")
    days = sorted({session.first.date() for session in here})
    when = f"on {day}" if day == last else f"from {day} to {last}"
    return DemandError(f"{name}: nobody arrives {when}; the file has {days[0]} to {days[-1]}")
