"""A day on a site: the demand is chosen, the run is made and shown, and its summary told."""

import asyncio
import time
from dataclasses import dataclass
from datetime import UTC, date, datetime, timedelta
from pathlib import Path

from rich.console import Console

from bus_sim.can.faults import Fault
from bus_sim.demand import Demand, DemandError
from bus_sim.run import FLEET, RunOptions, Simulation, build, run_until
from bus_sim.serve.bridge import Bridge, open_bridge, parse_bus_specs
from bus_sim.serve.socketcand import ServeError, SocketcandServer
from bus_sim.show import Clock, TerminalShow
from bus_sim.summary import RunSummary, Waiting, bus_figures, negotiation_figures, unserved
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.core.site import Site

#: The run begins so long before the first customer, us: the machines find their places first.
LEAD_US = 10_000_000
#: After the last customer the machines may finish what they do, us.
TAIL_US = 30_000_000
#: Somebody who waits so long after the last departure was lost, us: the run ends and says so.
PATIENCE_US = 2 * 3_600_000_000
#: Looks at the clock between pictures, us of virtual time.
STEP_US = 1_000_000


@dataclass(frozen=True)
class DayOptions:
    """What ``bus-sim run`` was asked for; see its help."""

    sessions: Path | None = None
    day: str | None = None
    stalls: tuple[str, ...] = ()
    one_car_s: float | None = None
    random_s: tuple[float, float] | None = None
    cars: int = 50
    seed: int = 1
    speed: float | None = None
    limit_s: float | None = None
    without: frozenset[str] = frozenset()
    faults: tuple[Fault, ...] = ()
    trace: Path | None = None
    devices: bool = False
    serve: str | None = None
    buses: tuple[str, ...] = ()
    quiet: bool = False


def choose_demand(options: DayOptions) -> Demand:
    """The stays to be played. Raises ``DemandError`` for a person's mistake."""
    if options.one_car_s is not None:
        return Demand.one_car(stay_s=options.one_car_s, seed=options.seed)
    if options.random_s is not None:
        return Demand.by_mean(*options.random_s, options.seed, count=options.cars)
    day = None
    if options.day is not None:
        try:
            day = date.fromisoformat(options.day)
        except ValueError as error:
            raise DemandError(f"--day {options.day}: not a day; write it as 2019-07-24") from error
    return Demand.from_sessions(options.sessions, stations=options.stalls, day=day, seed=options.seed)


def run_day(site: Site, options: DayOptions) -> RunSummary:
    """Play a demand on a site, show it, and answer with the figures.

    Raises ``DemandError`` and ``BusOpenError`` for a person's mistakes, before anything has run.
    """
    demand = choose_demand(options)
    unknown = options.without - {machine.name for machine in site.machines.values()}
    if unknown:
        known = ", ".join(machine.name for machine in site.machines.values())
        raise DemandError(f"--without {sorted(unknown)[0]}: no such machine; machines here: {known}")
    loop = VirtualTimeLoop(pace=options.speed)
    try:
        asyncio.set_event_loop(loop)
        return loop.run_until_complete(_play(site, options, demand, loop))
    finally:
        asyncio.set_event_loop(None)
        loop.close()


async def _play(site: Site, options: DayOptions, demand: Demand, loop: VirtualTimeLoop) -> RunSummary:
    first_us = min((stay.arrival_us for stay in demand.stays), default=0)
    last_us = max((stay.departure_us or stay.arrival_us for stay in demand.stays), default=0)
    origin_us = LEAD_US - first_us
    zero = (demand.zero or datetime(2000, 1, 1, tzinfo=UTC)) - timedelta(microseconds=origin_us)
    console = Console(quiet=options.quiet)
    if options.trace is not None:
        options.trace.parent.mkdir(parents=True, exist_ok=True)
    run_options = RunOptions(
        seed=options.seed,
        epoch_us=round(zero.timestamp() * 1_000_000),
        trace=options.trace,
        trace_devices=options.devices,
        faults=options.faults,
        without=options.without,
    )
    simulation = build(site, run_options, loop)
    console.print(
        f"site {site.name}, {len(demand.stays)} cars, seed {options.seed}, speed {options.speed or 'unlimited'}"
        + "".join(f", fault {fault}" for fault in options.faults),
        highlight=False,
    )
    simulation.plant.street.add_all(demand, origin_us)
    started_s = time.monotonic()
    async with Outside(simulation, options, console):
        simulation.start()
        limit_us = round(options.limit_s * 1_000_000) if options.limit_s else last_us + origin_us + PATIENCE_US
        clock = Clock(zero)
        with TerminalShow(site, simulation.view, clock, lambda: _figures(simulation), console) as show:
            await run_until(
                simulation,
                lambda: simulation.plant.street.is_over,
                limit_us,
                STEP_US,
                lambda: show.update(loop.now_us()),
            )
            if options.limit_s is None:
                await run_until(
                    simulation, lambda: False, loop.now_us() + TAIL_US, STEP_US, lambda: show.update(loop.now_us())
                )
    simulation.close()
    summary = summarise(simulation, time.monotonic() - started_s)
    for line in summary.lines():
        console.print(line, highlight=False, soft_wrap=True)
    return summary


class Outside:
    """Everything that joins the buses from outside, for the time of a run."""

    def __init__(self, simulation: Simulation, options: DayOptions, console: Console) -> None:
        self._simulation = simulation
        self._options = options
        self._console = console
        self._server: SocketcandServer | None = None
        self._bridges: list[Bridge] = []

    async def __aenter__(self) -> None:
        if self._options.serve is not None or self._options.buses:
            # Somebody acknowledges from the start: a lone controller would repeat its first frame for ever.
            self._simulation.fleet.attach("gateway")
        if self._options.serve is not None:
            await self._serve(self._options.serve)
        bitrate = self._simulation.site.bitrate
        for settings in parse_bus_specs(self._options.buses, bitrate):
            bridge, _ = await open_bridge(self._simulation.fleet.attach(str(settings), None), settings)
            self._bridges.append(bridge)
            self._console.print(f"the fleet bus is on {settings}", highlight=False)

    async def __aexit__(self, *_: object) -> None:
        for bridge in self._bridges:
            await bridge.close()
        if self._server is not None:
            await self._server.close()

    async def _serve(self, address: str) -> None:
        host, _, port = address.rpartition(":")
        if not port.isdigit():
            raise ServeError(f"--serve {address}: must be HOST:PORT, such as 127.0.0.1:29536")
        epoch_us = self._simulation.options.epoch_us
        server = SocketcandServer(
            self._simulation.join, lambda time_us: epoch_us + time_us, host or "127.0.0.1", int(port)
        )
        bound = await server.start()
        self._server = server
        channels = ", ".join([FLEET, *(machine.name for machine in self._simulation.site.machines.values())])
        self._console.print(
            f"serving at {host or '127.0.0.1'}:{bound} (socketcand), channels {channels}", highlight=False
        )


def _figures(simulation: Simulation) -> str:
    street = simulation.plant.street.summary()
    load = simulation.fleet.statistics()
    return (
        f"cars in {street.parked}  out {street.served}  inside {street.inside}  waiting {unserved(street)}"
        f"  calls {simulation.view.calls_opened}  bids {simulation.view.bids}  bus load {load.mean_load:.2%}"
    )


def summarise(simulation: Simulation, wall_s: float) -> RunSummary:
    """All figures of a run that has ended."""
    street = simulation.plant.street.summary()
    calls, reopened, refused, bids = negotiation_figures(simulation.view)
    frames, errors, mean_load, worst_load = bus_figures(simulation.fleet.statistics())
    drops: dict[str, int] = {}
    halted = []
    for controller in simulation.controllers.values():
        for reason, count in controller.all_drops().items():
            drops[reason.name] = drops.get(reason.name, 0) + count
        if controller.holon.halted is not None:
            halted.append(f"{controller.holon.machine.name}: {controller.holon.halted}")
    trace = simulation.options.trace
    return RunSummary(
        simulation.site.name,
        simulation.options.seed,
        simulation.loop.now_us() / 1e6,
        wall_s,
        street.parked,
        street.served,
        street.inside,
        street.refused_full,
        street.refused_too_large,
        unserved(street),
        Waiting.of(street.in_wait_us),
        Waiting.of(street.out_wait_us),
        calls,
        reopened,
        refused,
        bids,
        sum(simulation.view.messages.values()),
        frames,
        errors,
        mean_load,
        worst_load,
        drops,
        tuple(str(violation) for violation in simulation.plant.oracle.finish()),
        tuple(halted),
        str(trace) if trace is not None else None,
    )
