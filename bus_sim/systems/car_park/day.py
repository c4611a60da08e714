"""A day on a site, or a window of it: the demand is chosen, the run is made and shown, and its summary told."""

import asyncio
import signal
import time
from contextlib import AbstractAsyncContextManager, AsyncExitStack, nullcontext
from dataclasses import dataclass
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from bus_sim.by_hand import ByHand
from bus_sim.demand import LEVEL1_DAY, WHOLE_DAY, Demand, DemandError
from bus_sim.faults.arm import arm, check_targets, frame_faults
from bus_sim.faults.injection import AnyFault
from bus_sim.outside import Outside
from bus_sim.planted.bug import PlantedBug
from bus_sim.processes.fleet import ProcessFleet
from bus_sim.processes.plan import ProcessPlan
from bus_sim.publish import Publishing
from bus_sim.run import RunOptions, Simulation, build, run_until
from bus_sim.systems.car_park.show import Clock, TerminalShow
from bus_sim.systems.car_park.summary import BurstFigures, RunSummary, bus_figures, unserved
from bus_sim.virtual_time import VirtualTimeLoop
from bus_sim.window import BURST_US, Window, choose_window, densest, with_short_eve
from onboard.core.site import Site
from onboard.io.signals import ended_by
from onboard.trace.durations import Durations
from onboard.trace.indicators import Indicators
from onboard.ways.site import way_site

if TYPE_CHECKING:
    from bus_sim.web.page import Page

#: The run begins so long before the first customer, us: the machines find their places first.
LEAD_US = 10_000_000
#: After the last customer the machines may finish what they do, us.
TAIL_US = 30_000_000
#: Somebody who waits so long after the last departure was lost, us: the run ends and says so.
PATIENCE_US = 2 * 3_600_000_000
#: Looks at the clock between pictures, us of virtual time.
STEP_US = 1_000_000
#: A run that only a person ends, us: a century.
_FOREVER_US = 100 * 366 * 86_400 * 1_000_000
#: Without a terminal a window is told line by line, one in so long, us of virtual time.
WINDOW_LINE_US = 300_000_000


@dataclass(frozen=True)
class DayOptions:
    """What ``bus-sim run`` was asked for; see its help. ``speed`` is that of the window where there is one."""

    sessions: Path | None = None
    day: str | None = None
    stalls: tuple[str, ...] = ()
    one_car_s: float | None = None
    random_s: tuple[float, float] | None = None
    cars: int = 50
    window: str | None = None
    #: Of what was before the window only who is still inside is played, shortly before it.
    short_eve: bool = False
    seed: int = 1
    speed: float | None = None
    limit_s: float | None = None
    without: frozenset[str] = frozenset()
    faults: tuple[AnyFault, ...] = ()
    #: A mistake put into this run on purpose.
    planted_bug: PlantedBug | None = None
    trace: Path | None = None
    devices: bool = False
    serve: str | None = None
    buses: tuple[str, ...] = ()
    processes: ProcessPlan | None = None
    #: Cars come and go by keys of the terminal, and nobody comes otherwise.
    by_hand: bool = False
    #: Where the page is served, PORT or HOST:PORT; None for no page.
    web: str | None = None
    #: The broker that the site is published to, empty for one of the run's own; None for none. Goes with ``serve``.
    mqtt: str | None = None
    site_text: str = ""
    quiet: bool = False


def choose_demand(options: DayOptions, site: Site | None = None) -> Demand:
    """The stays to be played. Raises ``DemandError`` for a person's mistake.

    Unless told otherwise a site with several compartments gets the shipped day of all 52 stalls, any other that of
    level 1, which one compartment can serve.
    """
    if options.by_hand:
        return Demand(())
    if options.one_car_s is not None:
        return Demand.one_car(stay_s=options.one_car_s, seed=options.seed)
    if options.random_s is not None:
        return Demand.by_mean(*options.random_s, options.seed, count=options.cars)
    first, last = _days(options.day)
    shipped = WHOLE_DAY if site is not None and len(way_site(site).compartments) > 1 else LEVEL1_DAY
    return Demand.from_sessions(
        options.sessions, stations=options.stalls, day=first, until=last, shipped=shipped, seed=options.seed
    )


def _days(text: str | None) -> tuple[date | None, date | None]:
    """First and last day of ``D`` or ``D1..D2``."""
    if text is None:
        return None, None
    first, _, last = text.partition("..")
    try:
        days = date.fromisoformat(first), date.fromisoformat(last or first)
    except ValueError as error:
        raise DemandError(
            f"--day {text}: not a day; write it as 2019-07-24, several as 2019-07-24..2019-07-26"
        ) from error
    if days[1] < days[0]:
        raise DemandError(f"--day {text}: the last day is before the first; turn them round")
    return days


def run_day(site: Site, options: DayOptions) -> RunSummary:
    """Play a demand on a site, show it, and answer with the figures.

    Raises ``DemandError`` and ``BusOpenError`` for a person's mistakes, before anything has run.
    """
    demand = choose_demand(options, site)
    window = choose_window(demand, options.window) if options.window is not None else None
    if window is not None and options.short_eve:
        demand = with_short_eve(demand, window, len(way_site(site).compartments))
    unknown = options.without - set(names_of(site))
    if unknown:
        known = ", ".join(names_of(site))
        raise DemandError(f"--without {sorted(unknown)[0]}: no such machine; machines here: {known}")
    try:
        check_targets(options.faults, site)
    except ValueError as error:
        raise DemandError(f"--fault: {error}") from error
    loop = VirtualTimeLoop(pace=options.speed)
    try:
        asyncio.set_event_loop(loop)
        return loop.run_until_complete(_Day(site, options, demand, window, loop).play())
    finally:
        asyncio.set_event_loop(None)
        loop.close()


def names_of(site: Site) -> list[str]:
    """All machines' names, in the order of their node-IDs."""
    return [machine.name for machine in site.machines.values()]


class _Day:
    """One run from its first second to its summary."""

    def __init__(
        self, site: Site, options: DayOptions, demand: Demand, window: Window | None, loop: VirtualTimeLoop
    ) -> None:
        first_us = min((stay.arrival_us for stay in demand.stays), default=0)
        if window is not None:
            first_us = min(first_us, window.begin_us)
        self._options = options
        self._demand = demand
        self._window = window
        self._loop = loop
        self._origin_us = LEAD_US - first_us
        self._zero = (demand.zero or datetime(2000, 1, 1, tzinfo=UTC)) - timedelta(microseconds=self._origin_us)
        self._console = Console(quiet=options.quiet)
        self._begin_us = 0
        self._begin_s = 0.0
        self._indicators = Indicators(site)
        self._simulation = self._build(site)
        self._hand: ByHand | None = None
        self._is_interrupted = False
        #: Whether the window has begun: figures are of it alone, and of the warm-up where it was ended in that.
        self._is_warm = False
        plan = options.processes
        self._processes = (
            ProcessFleet(self._simulation, plan, options.without, self._console) if plan is not None else None
        )

    def _build(self, site: Site) -> Simulation:
        options = self._options
        if options.trace is not None:
            options.trace.parent.mkdir(parents=True, exist_ok=True)
        run_options = RunOptions(
            seed=options.seed,
            epoch_us=round(self._zero.timestamp() * 1_000_000),
            trace=options.trace,
            trace_devices=options.devices,
            faults=frame_faults(options.faults, site),
            without=options.without if options.processes is None else frozenset(names_of(site)),
        )
        simulation = build(site, run_options, self._loop)
        simulation.observers.append(self._indicators.feed)
        if options.planted_bug is not None:
            options.planted_bug.plant(simulation)
        return simulation

    async def play(self) -> RunSummary:
        """The whole run."""
        simulation, options, console = self._simulation, self._options, self._console
        console.print(
            f"site {simulation.site.name}, {len(self._demand.stays)} cars, seed {options.seed}, "
            f"speed {options.speed or 'unlimited'}" + "".join(f", fault {fault}" for fault in options.faults),
            highlight=False,
        )
        simulation.plant.street.add_all(self._demand, self._origin_us)
        arm(simulation, options.faults)
        self._begin_s = time.monotonic()
        outside = Outside(simulation, options.serve, options.buses, console)
        clock = Clock(self._zero)
        show = TerminalShow(way_site(simulation.site), simulation.view, clock, lambda: _figures(simulation), console)
        async with AsyncExitStack() as stack:
            # A signal ends a run as its end does: with its figures, a log that is whole, and no process left behind.
            stack.enter_context(ended_by(self._loop, self._interrupt))
            stack.callback(simulation.close)
            if options.web is not None:
                show.address = (await stack.enter_async_context(self._page(options.web))).address
            if self._window is None:
                await stack.enter_async_context(outside)
                await stack.enter_async_context(self._publishing(outside))
                simulation.start()
                stack.enter_context(show)
                if options.by_hand:
                    by_pipe = options.web is None
                    hand = ByHand(simulation.plant.street, options.seed, console, ends_with_pipe=by_pipe)
                    self._hand = stack.enter_context(hand)
                if self._processes is not None:
                    assert outside.served is not None, "the options with processes name an address"
                    stack.push_async_callback(self._processes.stop)
                    await self._processes.start(*outside.served)
                await self._to_the_end(show)
            else:
                simulation.start()
                stack.enter_context(show)
                await self._warm_up(self._window, show)
                if self._is_warm:
                    # Guests come for the window: they could not follow a warm-up that is hurried.
                    await stack.enter_async_context(outside)
                    await stack.enter_async_context(self._publishing(outside))
                    await self._through(self._window, show)
        wall_s = time.monotonic() - self._begin_s
        summary = self._summarise(wall_s)
        for line in summary.lines(console.width if console.is_terminal else None):
            console.print(line, highlight=False, soft_wrap=True)
        return summary

    def _publishing(self, outside: Outside) -> AbstractAsyncContextManager[object]:
        options = self._options
        if options.mqtt is None:
            return nullcontext()
        assert outside.served is not None, "the options with a broker name an address"
        return Publishing(self._simulation.site, options.site_text, options.mqtt, outside.served, self._console)

    def _page(self, where: str) -> "Page":
        from bus_sim.systems.car_park.page import CarParkSource  # noqa: PLC0415  # its libraries are an extra
        from bus_sim.web.page import Page  # noqa: PLC0415  # as above

        return Page(CarParkSource(self._simulation, self._zero), where, self._console)

    async def _until(self, limit_us: int, show: TerminalShow, *, or_over: bool = False) -> None:
        street = self._simulation.plant.street
        await run_until(
            self._simulation,
            lambda: self._is_ended() or (or_over and self._hand is None and street.is_over),
            limit_us,
            STEP_US,
            lambda: show.update(self._loop.now_us()),
        )

    def _interrupt(self, number: signal.Signals) -> None:
        if number is not signal.SIGINT:
            self._console.print(f"{number.name}: ending", highlight=False)
        self._is_interrupted = True
        self._loop.resume()

    def _is_ended(self) -> bool:
        """Whether a person, or a process that died, has ended the run."""
        ended = [one.is_over for one in (self._hand, self._processes) if one is not None]
        return self._is_interrupted or any(ended)

    async def _to_the_end(self, show: TerminalShow) -> None:
        if self._options.limit_s is not None:
            await self._until(round(self._options.limit_s * 1_000_000), show, or_over=True)
            return
        if self._hand is not None:
            await self._until(_FOREVER_US, show)
            return
        last_us = max((stay.departure_us or stay.arrival_us for stay in self._demand.stays), default=0)
        await self._until(last_us + self._origin_us + PATIENCE_US, show, or_over=True)
        await self._until(self._loop.now_us() + TAIL_US, show)

    async def _warm_up(self, window: Window, show: TerminalShow) -> None:
        """Everything before the window, as fast as possible; then measuring begins anew."""
        begin_us = window.begin_us + self._origin_us
        before = sum(stay.arrival_us < window.begin_us for stay in self._demand.stays)
        clock = Clock(self._zero)
        self._console.print(
            f"warm-up from {clock.at(0)} to {clock.at(begin_us)}, as fast as possible: {before} cars come before",
            highlight=False,
            soft_wrap=True,
        )
        self._loop.set_pace(None)
        await self._until(begin_us, show)
        if self._is_ended():
            return
        self._is_warm = True
        now_us = self._loop.now_us()
        self._indicators.begin(now_us)
        self._simulation.fleet.restart_statistics()
        self._console.print(
            f"warmed up in {time.monotonic() - self._begin_s:.1f} s; now {window.told(self._demand)} "
            f"at speed {self._options.speed or 'unlimited'}",
            highlight=False,
            soft_wrap=True,
        )
        self._begin_us = now_us
        self._begin_s = time.monotonic()
        self._loop.set_pace(self._options.speed)

    async def _through(self, window: Window, show: TerminalShow) -> None:
        show.every(WINDOW_LINE_US)
        end_us = window.end_us + self._origin_us
        if self._options.limit_s is not None:
            end_us = min(end_us, self._begin_us + round(self._options.limit_s * 1_000_000))
        await self._until(end_us, show)

    # --- figures -----------------------------------------------------------------------------------------------

    def _summarise(self, wall_s: float) -> RunSummary:
        simulation, now_us = self._simulation, self._loop.now_us()
        street = simulation.plant.street.summary(self._begin_us)
        fleet = self._indicators.figures(now_us)
        frames, errors, mean_load, worst_load = bus_figures(simulation.fleet.statistics())
        drops: dict[str, int] = {}
        halted = []
        for controller in simulation.controllers.values():
            for reason, count in controller.all_drops().items():
                drops[reason.name] = drops.get(reason.name, 0) + count
            if controller.holon.halted is not None:
                halted.append(f"{controller.holon.machine.name}: {controller.holon.halted}")
        if self._processes is not None:
            halted += self._processes.failures
        trace = self._options.trace
        return RunSummary(
            site=simulation.site.name,
            seed=self._options.seed,
            window=self._shown(now_us),
            simulated_s=(now_us - self._begin_us) / 1e6,
            wall_s=wall_s,
            cars_in=street.parked,
            cars_out=street.served,
            inside=street.inside,
            refused_full=street.refused_full,
            refused_too_large=street.refused_too_large,
            unserved=unserved(street),
            wait_in=Durations.of(street.in_wait_us),
            wait_out=Durations.of(street.out_wait_us),
            burst=self._burst(),
            fleet=fleet,
            messages=sum(fleet.messages.values()),
            frames=frames,
            error_frames=errors,
            bus_load_mean=mean_load,
            bus_load_worst_second=worst_load,
            wire_drops=drops,
            violations=tuple(str(violation) for violation in simulation.plant.oracle.finish()),
            halted=tuple(halted),
            trace=str(trace) if trace is not None else None,
        )

    def _shown(self, now_us: int) -> str | None:
        """What of the window the figures are of, as far as it was played; None for a whole run."""
        if self._window is None:
            return None
        begin_us = self._window.begin_us if self._is_warm else self._begin_us - self._origin_us
        played = Window(begin_us, now_us - self._origin_us).told(self._demand)
        return played if self._is_warm else f"warm-up, {played}"

    def _burst(self) -> BurstFigures | None:
        played = Window(self._begin_us - self._origin_us, self._loop.now_us() - self._origin_us)
        burst = densest(self._demand, played if self._window is not None else None)
        if burst is None:
            return None
        begin_us = burst.begin_us + self._origin_us
        waits_us = self._simulation.plant.street.in_waits_us(begin_us, begin_us + BURST_US)
        return BurstFigures(Clock(self._zero).at(begin_us), BURST_US / 1e6, burst.count, Durations.of(waits_us))


def _figures(simulation: Simulation) -> str:
    street = simulation.plant.street.summary()
    load = simulation.fleet.statistics()
    return (
        f"cars in {street.parked}  out {street.served}  inside {street.inside}  waiting {unserved(street)}"
        f"  calls {simulation.view.calls_opened}  bids {simulation.view.bids}  bus load {load.mean_load:.2%}"
    )
