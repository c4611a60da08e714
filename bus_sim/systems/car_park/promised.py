"""How promises to customers went: how many were kept, in the busiest five minutes too, and how wide they were."""

from bisect import bisect_left
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import median, quantiles
from typing import NamedTuple

from bus_sim.systems.car_park.plant.customer import CustomerVisit
from bus_sim.systems.car_park.window import BURST_US

#: Cut points of twentieths: the first and the last are the ends of the central 90 %.
_TWENTIETHS = 20


class PromiseSeen(NamedTuple):
    """What one customer was first told at the desk, and when the desk said that the car is there; us of loop time."""

    asked_us: int
    told_us: int
    ready_us: int
    spread_us: int
    there_us: int

    @property
    def is_kept(self) -> bool:
        """Whether the car was there within what was said."""
        return abs(self.there_us - self.ready_us) <= self.spread_us


@dataclass(frozen=True)
class PromiseFigures:
    """Promises of a run. Widths are of whole intervals; ``waits_width_s`` is that of the central 90 % of all waits."""

    count: int
    kept: float
    busiest_count: int
    busiest_kept: float
    width_s: float
    waits_width_s: float

    @classmethod
    def of(cls, seen: Sequence[PromiseSeen]) -> "PromiseFigures | None":
        """None where nothing was promised."""
        if not seen:
            return None
        busiest = busiest_minutes(seen)
        widths_us = [2 * one.spread_us for one in seen]
        return cls(
            len(seen), share_kept(seen), len(busiest), share_kept(busiest), median(widths_us) / 1e6, waits_width_s(seen)
        )

    def line(self) -> str:
        """One line of a run's summary."""
        burst = f"in the busiest 5 min {self.busiest_kept:.1%} of {self.busiest_count}"
        widths = f"median width {self.width_s:.1f} s, of the central 90 % of waits {self.waits_width_s:.1f}"
        return f"promised     {self.count} customers   kept {self.kept:.1%}, {burst}   {widths}"


def seen_of(visits: Iterable[CustomerVisit], since_us: int = 0) -> list[PromiseSeen]:
    """All who asked since a loop time, were told when, and whose car came; in the order in which they asked."""
    found = [
        PromiseSeen(one.asked_us, one.promised.read_us, one.promised.ready_us, one.promised.spread_us, one.ready_us)
        for one in visits
        if one.promised is not None and one.asked_us is not None and one.ready_us is not None
    ]
    return sorted(one for one in found if one.asked_us >= since_us)


def share_kept(seen: Sequence[PromiseSeen]) -> float:
    """Which share of some was kept; of none nothing was broken."""
    return sum(one.is_kept for one in seen) / len(seen) if seen else 1.0


def busiest_minutes(seen: Sequence[PromiseSeen]) -> Sequence[PromiseSeen]:
    """Those of the five minutes in which most asked, the first such ones; ``seen`` in the order of asking."""
    asked_us = [one.asked_us for one in seen]
    ends = [bisect_left(asked_us, begin_us + BURST_US) for begin_us in asked_us]
    first = max(range(len(seen)), key=lambda number: ends[number] - number, default=0)
    return seen[first : ends[first]] if seen else seen


def waits_width_s(seen: Sequence[PromiseSeen]) -> float:
    """How wide the central 90 % of waits are, from asking to the car being there, s; 0 for fewer than two."""
    waits_us = [one.there_us - one.asked_us for one in seen]
    if len(waits_us) < 2:
        return 0.0
    cuts = quantiles(waits_us, n=_TWENTIETHS, method="inclusive")
    return (cuts[-1] - cuts[0]) / 1e6
