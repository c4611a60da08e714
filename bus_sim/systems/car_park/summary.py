"""What a run came to: customers, waiting, fleet indicators and bus, as a table and as JSON (row P55)."""

from dataclasses import asdict, dataclass
from textwrap import wrap

from bus_sim.can.statistics import BusStatistics
from bus_sim.systems.car_park.battery_figures import BatteryFigures, battery_lines
from bus_sim.systems.car_park.bay_times import BayFigures, bay_lines
from bus_sim.systems.car_park.bounds.waiting import WaitBounds
from bus_sim.systems.car_park.plant.street import StreetSummary
from bus_sim.systems.car_park.promised import PromiseFigures
from onboard.trace.durations import Durations
from onboard.trace.indicators import FleetIndicators

#: Of less than this no figure means anything, s: machines have not all said where they are.
SHORTEST_S = 1.0


@dataclass(frozen=True)
class BurstFigures:
    """The densest minutes of arrivals: from when on (local time), how many came in how long, and how they waited."""

    begins: str
    span_s: float
    count: int
    wait_in: Durations


@dataclass(frozen=True)
class RunSummary:
    """All figures of one run, or of its window alone. Loads are fractions of the bit rate, times are in s.

    ``fleet`` is what the bus tells; cars, refusals, waiting, ``bays`` and ``batteries`` are what the plant saw. Who
    still waits at the end is in ``unserved`` and not in the waiting times, nor in their ``bounds``.
    """

    site: str
    seed: int
    window: str | None
    simulated_s: float
    wall_s: float
    cars_in: int
    cars_out: int
    inside: int
    refused_full: int
    refused_too_large: int
    refused_no_charging: int
    unserved: int
    wait_in: Durations
    wait_out: Durations
    bounds: WaitBounds
    wait_ready: Durations
    burst: BurstFigures | None
    fleet: FleetIndicators
    bays: tuple[BayFigures, ...]
    promises: PromiseFigures | None
    batteries: tuple[BatteryFigures, ...]
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
        """The fields as ``json.dump`` takes them; units stand in the keys."""
        return asdict(self)

    @property
    def is_good(self) -> bool:
        """Nothing broke, nobody stopped, and at the end of a whole run everybody was served or told why."""
        return not self.violations and not self.halted and (self.window is not None or not self.unserved)

    def lines(self, width: int | None = None) -> list[str]:
        """The summary as a person reads it, folded where a terminal's ``width`` is given."""
        text = self._figures()
        if width is None:
            return text
        return [part for line in text for part in (wrap(line, width, subsequent_indent=" " * 13) or [""])]

    def _figures(self) -> list[str]:
        if self.simulated_s < SHORTEST_S:
            return [f"site {self.site}, seed {self.seed}: ended in its first second; no figures"]
        text = [self._head(), *self._customers(), *self._bus(), *self.fleet.lines(), *bay_lines(self.bays)]
        text += battery_lines(self.batteries)
        if self.wire_drops:
            drops = ", ".join(f"{reason} {count}" for reason, count in sorted(self.wire_drops.items()))
            text.append(f"dropped      {drops}")
        text += [f"HALTED       {line}" for line in self.halted]
        text += [f"VIOLATION    {line}" for line in self.violations]
        if self.trace is not None:
            text.append(f"trace        {self.trace}")
        return text

    def _head(self) -> str:
        speed = self.simulated_s / self.wall_s if self.wall_s else 0.0
        what = "simulated" if self.window is None else f"({self.window}) shown"
        return (
            f"site {self.site}, seed {self.seed}: {_clock(self.simulated_s)} {what} in {self.wall_s:.1f} s "
            f"({speed:,.0f} times real time)"
        )

    def _customers(self) -> list[str]:
        unchargeable = f", no place to charge {self.refused_no_charging}" if self.refused_no_charging else ""
        text = [
            f"cars         in {self.cars_in}   out {self.cars_out}   inside {self.inside}   refused: full "
            f"{self.refused_full}, too large {self.refused_too_large}{unchargeable}   waiting now {self.unserved}",
            f"waiting in   {self.wait_in}",
            f"waiting out  {self.wait_out}",
            f"car ready    {self.wait_ready}",
        ]
        if self.bounds.visits:
            text.append(f"all waiting  {self.bounds.line()}")
        burst = self.burst
        if burst is not None and burst.count > 1:
            text.append(
                f"worst {burst.span_s / 60:.0f} min  from {burst.begins} on {burst.count} cars came; "
                f"waiting in {burst.wait_in}"
            )
        if self.promises is not None:
            text.append(self.promises.line())
        return text

    def _bus(self) -> list[str]:
        fleet = self.fleet
        return [
            f"calls        {fleet.calls}   opened again {fleet.opened_again}   refused {fleet.refused}   "
            f"bids {fleet.bids} ({fleet.bids / fleet.calls if fleet.calls else 0:.2f} a call)",
            f"fleet bus    {self.messages:,} messages   {self.frames:,} frames   load mean {self.bus_load_mean:.2%}, "
            f"worst second {self.bus_load_worst_second:.2%}   error frames {self.error_frames}",
        ]


def _clock(seconds: float) -> str:
    whole = round(seconds)
    return (
        f"{whole // 3600} h {whole % 3600 // 60:02d} min" if whole >= 3600 else f"{whole // 60} min {whole % 60:02d} s"
    )


def unserved(street: StreetSummary) -> int:
    """Customers who still wait for something at the end."""
    return street.queueing + street.asking


def bus_figures(statistics: BusStatistics) -> tuple[int, int, float, float]:
    """Frames, error frames, mean and worst load."""
    return statistics.frames, statistics.error_frames, statistics.mean_load, statistics.worst_second_load
