"""One site on one day, in the model and in the plant: the same figures of both, and means with their intervals."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import inf, sqrt
from typing import NamedTuple

from bus_sim.systems.car_park.compare.plays import MIP, play
from bus_sim.systems.car_park.design.days import DayPlan, fill_and_empty
from bus_sim.systems.car_park.design.model import DayModel
from bus_sim.systems.car_park.design.options import Size
from onboard.config.site import parse_site
from onboard.systems.car_park.site import CarPark, car_park
from onboard.trace.durations import Durations

#: Tasks an hour are counted without so many at both ends, where work begins and runs out.
ENDS = 10
#: Between a full park and the first who asks, in the model's time to fill, and besides, us.
SETTLED, SETTLED_US = 1.3, 600_000_000
#: Two-sided 95 % quantiles of Student's t by degrees of freedom (tables); beyond the last that of the normal law.
STUDENT_T = (12.71, 4.30, 3.18, 2.78, 2.57, 2.45, 2.36, 2.31, 2.26, 2.23, 2.20, 2.18, 2.16, 2.14, 2.13, 2.12, 2.11)
MANY_T = 2.0


class Trial(NamedTuple):
    """A site file's text, and the day it is tried on."""

    size: Size
    text: str
    day: DayPlan


class Outcome(NamedTuple):
    """What came of a trial: waiting and cars an hour; ``left`` were not served, ``faults`` broke an invariant."""

    size: Size
    label: str
    wait_in: Durations
    wait_out: Durations
    per_hour: float
    fill_h: float
    empty_h: float
    left: int
    busy: dict[str, float]
    faults: tuple[str, ...] = ()

    @property
    def p95_s(self) -> float:
        """The longer of the two 95 % waits, s; endless where somebody was not served."""
        return inf if self.left else max(self.wait_in.p95_s, self.wait_out.p95_s)


@dataclass(frozen=True)
class Mean:
    """A mean with the half width of its 95 % interval; endless where one value is, and nothing known of one alone."""

    value: float
    half: float
    count: int

    @classmethod
    def of(cls, values: Sequence[float]) -> "Mean":
        """Of independent values: Student's interval."""
        count = len(values)
        mean = sum(values) / count if count else 0.0
        if count < 2 or mean == inf:
            return cls(mean, 0.0, count)
        sigma = sqrt(sum((one - mean) ** 2 for one in values) / (count - 1))
        t = STUDENT_T[count - 2] if count - 2 < len(STUDENT_T) else MANY_T
        return cls(mean, t * sigma / sqrt(count), count)


@lru_cache(maxsize=64)
def _site(text: str) -> CarPark:
    """Kept, as the ways of a site are worked out once for this very object."""
    return car_park(parse_site(text, "option.toml"))


def modelled(trial: Trial) -> Outcome:
    """A trial in the model: milliseconds."""
    site, day = _site(trial.text), trial.day
    found = DayModel(site, day.demand, day.seed).play()
    asked = sum(stay.departure_us is not None for stay in day.demand.stays)
    left = found.refused + asked - len(found.out_us)
    return _outcome(trial, (found.in_us, found.out_us), (found.parked_us, found.gone_us), left, found.busy)


def played(trial: Trial) -> Outcome:
    """A trial in the plant, with all machines on their bus: a minute."""
    site, day = _site(trial.text), trial.day
    found = play(site, day.demand, MIP, day.seed)
    outcome = _outcome(
        trial, (found.in_us, found.out_us), (found.parked_us, found.gone_us), found.left + found.refused, {}
    )
    return outcome._replace(faults=found.faults)


def fill_trial(size: Size, text: str) -> Trial:
    """A park filled and emptied: all ask when it is full by the model, with time to spare."""
    site = _site(text)
    filled = DayModel(site, fill_and_empty(site, None).demand, 1).play()
    leave_us = round(max(filled.parked_us, default=0) * SETTLED) + SETTLED_US
    return Trial(size, text, fill_and_empty(site, leave_us))


def modelled_fill(size_and_text: tuple[Size, str]) -> Outcome:
    """How long it takes to fill and to empty a site, in the model."""
    return modelled(fill_trial(*size_and_text))


def _outcome(
    trial: Trial,
    waits_us: tuple[Sequence[int], Sequence[int]],
    through_us: tuple[Sequence[int], Sequence[int]],
    left: int,
    busy: dict[str, float],
) -> Outcome:
    parked_us, gone_us = through_us
    stays = trial.day.demand.stays
    first_us = min((stay.arrival_us for stay in stays), default=0)
    leave_us = min((stay.departure_us for stay in stays if stay.departure_us is not None), default=0)
    through = sorted([*parked_us, *gone_us])[ENDS : -ENDS or None]
    span_us = through[-1] - through[0] if len(through) > 1 else 0
    return Outcome(
        trial.size,
        trial.day.label,
        Durations.of(waits_us[0]),
        Durations.of(waits_us[1]),
        (len(through) - 1) * 3.6e9 / span_us if span_us else 0.0,
        (max(parked_us, default=first_us) - first_us) / 3.6e9,
        (max(gone_us, default=leave_us) - leave_us) / 3.6e9,
        left,
        busy,
    )
