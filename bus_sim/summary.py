"""What a run came to: customers, waiting, negotiation and bus, as a table and as JSON."""

from dataclasses import asdict, dataclass

import numpy as np

from bus_sim.can.statistics import BusStatistics
from bus_sim.plant.street import Summary as StreetSummary
from onboard.core.codes import CallResult
from onboard.trace.view import SiteView


@dataclass(frozen=True)
class Waiting:
    """Waiting times in s: how many were measured, mean, standard deviation, percentiles, longest."""

    count: int
    mean_s: float
    sigma_s: float
    p50_s: float
    p95_s: float
    p99_s: float
    max_s: float

    @classmethod
    def of(cls, times_us: tuple[int, ...]) -> "Waiting":
        """From single waiting times in us; zeros where there are none."""
        if not times_us:
            return cls(0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        seconds = np.asarray(times_us, dtype=float) / 1e6
        p50, p95, p99 = (float(value) for value in np.percentile(seconds, [50, 95, 99]))
        return cls(len(times_us), float(seconds.mean()), float(seconds.std()), p50, p95, p99, float(seconds.max()))


@dataclass(frozen=True)
class RunSummary:
    """All figures of one run. Loads are fractions of the bit rate, times are in s."""

    site: str
    seed: int
    simulated_s: float
    wall_s: float
    cars_in: int
    cars_out: int
    inside: int
    refused_full: int
    refused_too_large: int
    unserved: int
    wait_in: Waiting
    wait_out: Waiting
    calls: int
    calls_reopened: int
    calls_refused: int
    bids: int
    messages: int
    frames: int
    error_frames: int
    bus_load_mean: float
    bus_load_worst_second: float
    wire_drops: dict[str, int]
    violations: tuple[str, ...]
    halted: tuple[str, ...]
    trace: str | None

    def to_json(self) -> dict[str, object]:
        """Plain values for ``json.dump``."""
        return asdict(self)

    @property
    def is_good(self) -> bool:
        """Nothing broke, nobody stopped, everybody was served or told why."""
        return not self.violations and not self.halted and not self.unserved

    def lines(self) -> list[str]:
        """The summary as a person reads it."""
        speed = self.simulated_s / self.wall_s if self.wall_s else 0.0
        text = [
            f"site {self.site}, seed {self.seed}: {_clock(self.simulated_s)} simulated in {self.wall_s:.1f} s "
            f"({speed:,.0f} times real time)",
            f"cars         in {self.cars_in}   out {self.cars_out}   inside {self.inside}   refused: full "
            f"{self.refused_full}, too large {self.refused_too_large}   waiting now {self.unserved}",
            f"waiting in   {_waiting(self.wait_in)}",
            f"waiting out  {_waiting(self.wait_out)}",
            f"calls        {self.calls}   opened again {self.calls_reopened}   refused {self.calls_refused}   "
            f"bids {self.bids} ({self.bids / self.calls if self.calls else 0:.2f} a call)",
            f"fleet bus    {self.messages:,} messages   {self.frames:,} frames   load mean {self.bus_load_mean:.2%}, "
            f"worst second {self.bus_load_worst_second:.2%}   error frames {self.error_frames}",
        ]
        if self.wire_drops:
            drops = ", ".join(f"{reason} {count}" for reason, count in sorted(self.wire_drops.items()))
            text.append(f"dropped      {drops}")
        text += [f"HALTED       {line}" for line in self.halted]
        text += [f"VIOLATION    {line}" for line in self.violations]
        if self.trace is not None:
            text.append(f"trace        {self.trace}")
        return text


def _clock(seconds: float) -> str:
    whole = round(seconds)
    return (
        f"{whole // 3600} h {whole % 3600 // 60:02d} min" if whole >= 3600 else f"{whole // 60} min {whole % 60:02d} s"
    )


def _waiting(waiting: Waiting) -> str:
    if not waiting.count:
        return "nobody"
    return (
        f"mean {waiting.mean_s:.1f} s   sigma {waiting.sigma_s:.1f}   50 % {waiting.p50_s:.1f}   "
        f"95 % {waiting.p95_s:.1f}   99 % {waiting.p99_s:.1f}   max {waiting.max_s:.1f}   ({waiting.count})"
    )


def negotiation_figures(view: SiteView) -> tuple[int, int, int, int]:
    """Calls opened, opened again, refused in the end, and bids, as heard on the bus."""
    closed = view.calls_closed
    return view.calls_opened, closed[CallResult.REOPENED], closed[CallResult.REFUSED], view.bids


def unserved(street: StreetSummary) -> int:
    """Customers who still wait for something at the end."""
    return street.queueing + street.asking


def bus_figures(statistics: BusStatistics) -> tuple[int, int, float, float]:
    """Frames, error frames, mean and worst load."""
    return statistics.frames, statistics.error_frames, statistics.mean_load, statistics.worst_second_load
