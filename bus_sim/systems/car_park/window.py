"""A window of a day: the busiest hour, the one in which cars come and go, any by the clock; and what came before."""

from bisect import bisect_left, bisect_right
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import datetime, timedelta

from bus_sim.demand import DemandError
from bus_sim.systems.car_park.demand import Demand

MINUTE_US = 60_000_000
HOUR_US = 60 * MINUTE_US
DAY_US = 24 * HOUR_US
#: Arrivals are densest in so long a time, us: the worst five minutes are reported by themselves.
BURST_US = 5 * MINUTE_US
#: On a short eve a car comes to each compartment for entry once in so long, us. Parking one takes half a minute and
#: the way back as long (bound in docs/figures.md), so nobody queues when the window begins.
EVE_US = 3 * MINUTE_US


@dataclass(frozen=True, slots=True)
class DayWindow:
    """From ``begin_us`` (included) to ``end_us`` (left out), in us after the demand's time zero."""

    begin_us: int
    end_us: int

    def described(self, demand: Demand) -> str:
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


def busiest_hour(demand: Demand) -> DayWindow:
    """The 60 minutes with the most arrivals and departures; of equal ones the first.

    Looked for among those that begin on a full minute, so that a person can ask for the same by the clock. Raises
    ``DemandError`` where nobody comes.
    """
    return _best_hour(demand, lambda come, go: (come + go, 0))


def two_way_hour(demand: Demand) -> DayWindow:
    """The 60 minutes in which cars come and go: the lesser of the two counts is greatest; of equal ones the busiest.

    Found as the busiest hour is, and the same as it where no hour has both. Raises ``DemandError`` where nobody comes.
    """
    return _best_hour(demand, lambda come, go: (min(come, go), come + go))


def _best_hour(demand: Demand, worth: Callable[[int, int], tuple[int, int]]) -> DayWindow:
    """The first of the hours whose counts of arrivals and departures are worth most."""
    both = (*demand.inside, *demand.stays)
    if not both:
        raise DemandError("busiest hour: nobody comes at all; give other days or stalls")
    come = sorted(stay.arrival_us for stay in demand.stays)
    go = sorted(stay.departure_us for stay in both if stay.departure_us is not None)
    first = max(0, (min([*come, *go], default=0) - HOUR_US) // MINUTE_US)
    starts = range(first * MINUTE_US, max([*come, *go], default=0) + 1, MINUTE_US)

    def key(start: int) -> tuple[tuple[int, int], int]:
        return worth(_count(come, start, start + HOUR_US), _count(go, start, start + HOUR_US)), -start

    begin_us = max(starts, key=key)
    return DayWindow(begin_us, begin_us + HOUR_US)


def with_short_eve(demand: Demand, window: DayWindow, entries: int) -> Demand:
    """The same window without the hours before it: who is inside when it begins came shortly before, one by one.

    Who has left by then does not come at all. Nobody comes sooner than they did, and the window itself is as it was.
    ``entries`` are the compartments at which cars come in.
    """
    before = [stay for stay in demand.stays if stay.arrival_us < window.begin_us]
    inside = [stay for stay in before if stay.departure_us is None or stay.departure_us >= window.begin_us]
    inside.sort(key=lambda stay: stay.arrival_us)
    every_us = EVE_US // max(1, entries)
    eve = [
        replace(stay, arrival_us=max(stay.arrival_us, window.begin_us - every_us * (len(inside) - at)))
        for at, stay in enumerate(inside)
    ]
    later = [stay for stay in demand.stays if stay.arrival_us >= window.begin_us]
    return replace(demand, stays=(*eve, *later))


def with_eve(demand: Demand, entries: int) -> Demand:
    """The cars that are inside at the start come before it, one by one: no machine knows a car that it has not seen."""
    if not demand.inside:
        return demand
    both = (*demand.inside, *demand.stays)
    moments = [stay.departure_us for stay in both if stay.departure_us is not None]
    begin_us = min([*moments, *(stay.arrival_us for stay in demand.stays)], default=0)
    every_us, count = EVE_US // max(1, entries), len(demand.inside)
    eve = [replace(one, arrival_us=begin_us - every_us * (count - at)) for at, one in enumerate(demand.inside)]
    who = "1 car is" if count == 1 else f"{count} cars are"
    told = f"{who} inside at the start, brought in before it, one in {every_us / 1e6:g} s"
    return replace(demand, stays=(*eve, *demand.stays), inside=(), remarks=(*demand.remarks, told))


def choose_window(demand: Demand, text: str) -> DayWindow:
    """The window that a person asked for: ``busiest``, ``two-way``, ``HH:MM`` (an hour) or ``HH:MM-HH:MM``.

    Times are of the first day. With ``YYYY-MM-DDTHH:MM`` an hour of another day. An end that is not after its begin is
    on the next day. Raises ``DemandError`` for what is none of these, and for an hour before the demand's first day.
    """
    if text == "busiest":
        return busiest_hour(demand)
    if text == "two-way":
        return two_way_hour(demand)
    begin, _, end = text.partition("-") if "T" not in text else (text, "", "")
    begin_us = _moment_us(demand, begin, text)
    if begin_us < 0:
        raise DemandError(f"{_option(text)}: before the first day, {demand.zero:%Y-%m-%d}")
    if not end:
        return DayWindow(begin_us, begin_us + HOUR_US)
    end_us = _clock_us(end, text)
    return DayWindow(begin_us, end_us if end_us > begin_us else end_us + DAY_US)


def densest(demand: Demand, within: DayWindow | None = None, span_us: int = BURST_US) -> Burst | None:
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
        raise DemandError(f"--hour {whole}: this demand has no date; write the hour as HH:MM")
    try:
        moment = datetime.fromisoformat(text)
    except ValueError as error:
        raise DemandError(f"--hour {whole}: not a time; write it as 2019-07-24T06:30") from error
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=demand.zero.tzinfo)
    return round((moment - demand.zero).total_seconds()) * 1_000_000


def _clock_us(text: str, whole: str) -> int:
    hours, colon, minutes = text.strip().partition(":")
    if colon and hours.isdecimal() and minutes.isdecimal() and len(minutes) == 2 and int(minutes) < 60:
        time_us = int(hours) * HOUR_US + int(minutes) * MINUTE_US
        if time_us <= DAY_US:
            return time_us
    told = _option(whole)
    raise DemandError(f"{told}: no time of day; write an hour as 06:30, busiest or two-way, a window as 06:30-08:00")


def _option(text: str) -> str:
    """The option with which a person wrote this window."""
    return f"--window {text}" if "-" in text and "T" not in text else f"--hour {text}"
