"""A window of a day: the busiest hour of a demand, an hour by the clock, and the densest minutes of arrivals."""

from bisect import bisect_left, bisect_right
from dataclasses import dataclass
from datetime import datetime, timedelta

from bus_sim.demand import DemandError
from bus_sim.systems.car_park.demand import Demand

MINUTE_US = 60_000_000
HOUR_US = 60 * MINUTE_US
DAY_US = 24 * HOUR_US
#: Arrivals are densest in so long a time, us: the worst five minutes are reported by themselves.
BURST_US = 5 * MINUTE_US


@dataclass(frozen=True, slots=True)
class Window:
    """From ``begin_us`` (included) to ``end_us`` (left out), in us after the demand's time zero."""

    begin_us: int
    end_us: int

    def told(self, demand: Demand) -> str:
        """Both ends in local time, with the day where the demand has one and the window leaves its first."""
        zero = demand.zero or datetime(2000, 1, 1)  # noqa: DTZ001  # a demand without a date: only its clock is shown
        begin, end = (zero + timedelta(microseconds=time_us) for time_us in (self.begin_us, self.end_us))
        days = "%Y-%m-%d " if demand.zero is not None else ""
        return f"{begin:{days}%H:%M} to {end:{days if end.date() != begin.date() else ''}%H:%M}"


@dataclass(frozen=True, slots=True)
class Burst:
    """The densest minutes of arrivals: ``count`` cars from the first at ``begin_us`` on, in us after time zero."""

    begin_us: int
    count: int


def busiest_hour(demand: Demand) -> Window:
    """The 60 minutes with the most arrivals and departures; of equal ones the first.

    Looked for among those that begin on a full minute, so that a person can ask for the same by the clock. Raises
    ``DemandError`` where nobody comes.
    """
    if not demand.stays:
        raise DemandError("busiest hour: nobody comes at all; give other days or stalls")
    events = sorted(
        [stay.arrival_us for stay in demand.stays]
        + [stay.departure_us for stay in demand.stays if stay.departure_us is not None]
    )
    first = max(0, (events[0] - HOUR_US) // MINUTE_US)
    starts = range(first * MINUTE_US, events[-1] + 1, MINUTE_US)
    begin_us = max(starts, key=lambda start: (_count(events, start, start + HOUR_US), -start))
    return Window(begin_us, begin_us + HOUR_US)


def choose_window(demand: Demand, text: str) -> Window:
    """The window that a person asked for: ``busiest``, ``HH:MM`` (an hour) or ``HH:MM-HH:MM``, on the first day.

    With ``YYYY-MM-DDTHH:MM`` an hour of another day. An end that is not after its begin is on the next day. Raises
    ``DemandError`` for what is none of these, and for an hour before the demand's first day.
    """
    if text == "busiest":
        return busiest_hour(demand)
    begin, _, end = text.partition("-") if "T" not in text else (text, "", "")
    begin_us = _moment_us(demand, begin, text)
    if begin_us < 0:
        raise DemandError(f"{text}: before the first day, {demand.zero:%Y-%m-%d}")
    if not end:
        return Window(begin_us, begin_us + HOUR_US)
    end_us = _clock_us(end, text)
    return Window(begin_us, end_us if end_us > begin_us else end_us + DAY_US)


def densest(demand: Demand, within: Window | None = None, span_us: int = BURST_US) -> Burst | None:
    """The ``span_us`` with most arrivals, of equal ones the first; None where nobody comes (in the window)."""
    arrivals = sorted(stay.arrival_us for stay in demand.stays)
    if within is not None:
        arrivals = [time_us for time_us in arrivals if within.begin_us <= time_us < within.end_us]
    if not arrivals:
        return None
    begin_us = max(arrivals, key=lambda start: (_count(arrivals, start, start + span_us), -start))
    return Burst(begin_us, bisect_right(arrivals, begin_us + span_us - 1) - bisect_left(arrivals, begin_us))


def _count(times_us: list[int], begin_us: int, end_us: int) -> int:
    return bisect_left(times_us, end_us) - bisect_left(times_us, begin_us)


def _moment_us(demand: Demand, text: str, whole: str) -> int:
    if "T" not in text:
        return _clock_us(text, whole)
    if demand.zero is None:
        raise DemandError(f"{whole}: this demand has no date; write the hour as HH:MM")
    try:
        moment = datetime.fromisoformat(text)
    except ValueError as error:
        raise DemandError(f"{whole}: not a time; write it as 2019-07-24T06:30") from error
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=demand.zero.tzinfo)
    return round((moment - demand.zero).total_seconds()) * 1_000_000


def _clock_us(text: str, whole: str) -> int:
    hours, colon, minutes = text.strip().partition(":")
    if colon and hours.isdecimal() and minutes.isdecimal() and len(minutes) == 2 and int(minutes) < 60:
        time_us = int(hours) * HOUR_US + int(minutes) * MINUTE_US
        if time_us <= DAY_US:
            return time_us
    raise DemandError(f"{whole}: not a time of day; write an hour as 06:30 or busiest, a window as 06:30-08:00")
