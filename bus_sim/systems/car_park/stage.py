"""A car park's run: customers come and go, of a whole day or by chance; what came of them."""

from collections import Counter
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING

from rich.console import Console

from bus_sim.systems.car_park.battery_figures import battery_figures
from bus_sim.systems.car_park.bay_times import BayTimes
from bus_sim.systems.car_park.bounds.visits import VisitLog
from bus_sim.systems.car_park.bounds.waiting import WaitBounds
from bus_sim.systems.car_park.by_hand import ByHand
from bus_sim.systems.car_park.demand import Demand, Stay
from bus_sim.systems.car_park.plant.bodies import random_car
from bus_sim.systems.car_park.plant.customer import Customer, CustomerEvent, CustomerState, VisitOutcome
from bus_sim.systems.car_park.plant.plant import Plant, is_told_off, looks_for_ticket
from bus_sim.systems.car_park.promised import PromiseFigures, seen_of
from bus_sim.systems.car_park.show import ConsoleShow, DayClock
from bus_sim.systems.car_park.simulation import Simulation
from bus_sim.systems.car_park.standing_cars import stand
from bus_sim.systems.car_park.summary import BurstFigures, RunSummary, bus_figures, unserved
from bus_sim.systems.car_park.window import BURST_US, DayWindow, densest
from bus_sim.systems.stage import EndedRun, PersonAtKeys, Show, SystemStage, Tally
from onboard.systems.car_park.site import CarPark
from onboard.trace.durations import Durations
from onboard.trace.indicators import Indicators
from onboard.ways.site import way_site

if TYPE_CHECKING:  # the page's libraries are an extra
    from bus_sim.web.run_source import RunSource

#: Customers come so long after power-up, us: the machines find their places first.
ORIGIN_US = 10_000_000
#: Somebody who waits so long after the last departure was lost, us: the run ends and says so.
PATIENCE_US = 2 * 3_600_000_000
#: Without a terminal a window is told line by line, one in so long, us of virtual time.
WINDOW_LINE_US = 300_000_000

#: A customer who is hurried does not walk or drive: these states end at once.
_HURRIED = (CustomerState.DRIVING_IN, CustomerState.WALKING_OUT)
#: Whoever is so sent away was told why.
_TOLD_WHY = (VisitOutcome.FULL, VisitOutcome.TOO_LARGE, VisitOutcome.NO_CHARGING, VisitOutcome.TICKET_UNKNOWN)


@dataclass(frozen=True)
class ComingCustomers:
    """Who comes when: ``origin_us`` is the loop time of the demand's time zero; ``window`` is what is shown of it.

    The cars of ``standing`` are inside when the power comes on.
    """

    demand: Demand
    origin_us: int = ORIGIN_US
    window: DayWindow | None = None
    by_hand: bool = False
    standing: tuple[Stay, ...] = ()

    @property
    def zero(self) -> datetime:
        """Local time of loop time 0."""
        return (self.demand.zero or datetime(2000, 1, 1, tzinfo=UTC)) - timedelta(microseconds=self.origin_us)


class CarParkStage(SystemStage[Plant]):
    """One run of a car park: its customers, its picture, and the figures of the specification."""

    who = "customers"
    step_us = 1_000_000
    #: After the last customer the machines may finish what they do, us.
    tail_us = 30_000_000
    #: A day is told whole, with all that the oracle saw in it.
    goes_on_broken = True
    #: A day ends by itself, whoever watches.
    goes_on_watched = False
    run: Simulation

    def __init__(self, run: Simulation, coming: ComingCustomers) -> None:
        super().__init__(run)
        self._coming = coming
        self._street = run.plant.street
        if coming.standing:
            stand(run, coming.standing, coming.origin_us)
        self._street.add_all(coming.demand, coming.origin_us)
        self._clock = DayClock(coming.zero)
        self._indicators = Indicators(run.site)
        self._bays = BayTimes(run.plant)
        self._visits = VisitLog(run.plant, run.options.seed)
        self._hurried: list[Customer] = []

    # --- how it stands -----------------------------------------------------------------------------------------

    @property
    def customers(self) -> list[Customer]:
        """All who have come or will come, in the order of their arrivals."""
        return self._street.customers

    def judge_end(self) -> None:
        """The oracle looks at the motions that are under way, and counts the cars."""
        self.plant.oracle.finish()

    def waits_since(self, time_us: int) -> int:
        """Customers who wait now and waited at ``time_us`` (loop time) already."""
        return sum(_waits_since(customer, time_us) for customer in self.customers)

    def waits_s(self) -> tuple[float | None, ...]:
        """Each customer's waiting at both ends of the stay, s; None for who was not served."""
        return tuple(map(_wait_s, self.customers))

    def tally(self) -> Tally:
        """Whoever has lost the ticket does not count as waiting: no machine can help there; nor who was told why."""
        customers, summary = self.customers, self._street.summary()
        outcomes = Counter(customer.visit.outcome for customer in customers)
        still = (CustomerState.COMING, CustomerState.PARKED, CustomerState.GONE)
        told_off = sum(map(is_told_off, customers))
        # Who looks for the ticket may have been told why before: that one is told.
        waiting = sum(one.state not in still and not (is_told_off(one) or looks_for_ticket(one)) for one in customers)
        return Tally(
            outcomes[VisitOutcome.SERVED] + outcomes[VisitOutcome.CANCELLED],
            sum(outcomes[one] for one in _TOLD_WHY) + told_off,
            waiting,
            max((*summary.in_wait_us, *summary.out_wait_us), default=0) / 1e6,
            outcomes[VisitOutcome.FULL],
        )

    # --- a machine under test ----------------------------------------------------------------------------------

    def bring(self, site: CarPark, node: int) -> None:
        """A customer who does not walk or drive brings a car; it is not fetched again."""
        if not self._hurried:
            for compartment in self.plant.compartments.values():
                compartment.watch(self._soon_hurry)
                compartment.watch_desk(lambda _text, _car: self._soon_hurry())
        stay = Stay(0, None, random_car(f"car {len(self._hurried) + 1}", self.run.options.seed))
        self._hurried.append(self._street.add(stay, self.run.loop.now_us()))

    def _soon_hurry(self) -> None:
        """After the step that is under way."""
        self.run.loop.call_soon(self._hurry)

    def _hurry(self) -> None:
        for customer in self._hurried:
            if customer.state in _HURRIED:
                customer.on(CustomerEvent.TIMER)

    # --- a person who watches ----------------------------------------------------------------------------------

    @property
    def limit_us(self) -> int:
        """``PATIENCE_US`` after the last arrival or departure of the demand, us of loop time."""
        stays = (*self._coming.standing, *self._coming.demand.stays)
        last_us = max((stay.departure_us or stay.arrival_us for stay in stays), default=0)
        return last_us + self._coming.origin_us + PATIENCE_US

    @property
    def shown_us(self) -> tuple[int, int] | None:
        """The window that was asked for, us of loop time; None for a whole day."""
        window, origin_us = self._coming.window, self._coming.origin_us
        return None if window is None else (window.begin_us + origin_us, window.end_us + origin_us)

    def head(self) -> list[str]:
        """One line: site, number of cars, seed, speed and faults."""
        options, stays = self.run.options, self._coming.demand.stays
        told = (
            f"site {self.run.site.name}, {len(stays)} cars, seed {options.seed}, speed {options.speed or 'unlimited'}"
        )
        return [told + "".join(f", fault {fault}" for fault in options.faults), *self._coming.demand.remarks]

    def warming_up(self, wall_s: float | None) -> str:
        """How many cars come before the window; afterwards how long they took, ``wall_s``."""
        window, demand = self._coming.window, self._coming.demand
        assert window is not None and self.shown_us is not None, "only what comes before a window is hurried"
        if wall_s is not None:
            speed = self.run.options.speed or "unlimited"
            return f"warmed up in {wall_s:.1f} s; now {window.described(demand)} at speed {speed}"
        before, until = sum(stay.arrival_us < window.begin_us for stay in demand.stays), self.shown_us[0]
        span = f"from {self._clock.at(0)} to {self._clock.at(until)}"
        return f"warm-up {span}, as fast as possible: {before} cars come before"

    def measure_from(self, now_us: int) -> None:
        """Indicators begin anew at ``now_us``, and the terminal gets a line more often."""
        super().measure_from(now_us)
        self._indicators.begin(now_us)
        self._bays.begin()
        self._show.every(WINDOW_LINE_US)

    def listen(self) -> None:
        """The indicators are made as it goes on: a day has too many messages to keep."""
        self.run.observers.append(self._indicators.feed)

    def show(self, console: Console) -> Show:
        """Floors, machines and events in a terminal; else a line of figures each hour."""
        self._show = ConsoleShow(way_site(self.run.site), self.run.view, self._clock, self._line, console)
        return self._show

    def _line(self) -> str:
        street, load, view = self._street.summary(), self.run.fleet.statistics(), self.run.view
        return (
            f"cars in {street.parked}  out {street.served}  inside {street.inside}  waiting {unserved(street)}"
            f"  calls {view.calls_opened}  bids {view.bids}  bus load {load.mean_load:.2%}"
        )

    def hand(self, console: Console) -> PersonAtKeys | None:
        """Keys i and o bring and fetch a car, where ``--by-hand`` was given; else None."""
        if not self._coming.by_hand:
            return None
        options = self.run.options
        return ByHand(self._street, options.seed, console, ends_with_pipe=options.web is None, zero=self._coming.zero)

    def source(self) -> "RunSource":
        """The run as the page shows it, with the local time of its day."""
        from bus_sim.systems.car_park.page import CarParkSource  # noqa: PLC0415  # its libraries are an extra

        return CarParkSource(self.run, self._coming.zero)

    def summary(self, ended: EndedRun) -> RunSummary:
        """Waiting, travel and bus load of the part that was measured, and why anybody was left."""
        run, now_us = self.run, self.run.loop.now_us()
        street, fleet = self._street.summary(ended.begin_us), self._indicators.figures(now_us)
        frames, errors, mean_load, worst_load = bus_figures(run.fleet.statistics())
        trace = run.options.trace
        drops: Counter[str] = Counter()
        for controller in run.controllers.values():
            drops.update({reason.name: count for reason, count in controller.all_drops().items()})
        return RunSummary(
            site=run.site.name,
            seed=run.options.seed,
            window=self._played(ended),
            simulated_s=(now_us - ended.begin_us) / 1e6,
            wall_s=ended.wall_s,
            cars_in=street.parked,
            cars_out=street.served,
            inside=street.inside,
            refused_full=street.refused_full,
            refused_too_large=street.refused_too_large,
            refused_no_charging=street.refused_no_charging,
            unserved=unserved(street),
            wait_in=Durations.of(street.in_wait_us),
            wait_out=Durations.of(street.out_wait_us),
            bounds=self._bounds(ended),
            wait_ready=Durations.of(street.ready_wait_us),
            burst=self._burst(ended),
            fleet=fleet,
            bays=self._bays.figures(),
            promises=PromiseFigures.of(seen_of((one.visit for one in self.customers), ended.begin_us)),
            batteries=battery_figures(self.run),
            messages=sum(fleet.messages.values()),
            frames=frames,
            error_frames=errors,
            bus_load_mean=mean_load,
            bus_load_worst_second=worst_load,
            wire_drops=dict(drops),
            violations=tuple(self.violations()),
            halted=(*self.halted, *ended.failures),
            trace=str(trace) if trace is not None else None,
        )

    def _bounds(self, ended: EndedRun) -> WaitBounds:
        visits = self._visits.visits(lambda moment_us: moment_us >= ended.begin_us)
        return WaitBounds.of(way_site(self.run.site), visits)

    def _played(self, ended: EndedRun) -> str | None:
        """What of the window the figures are of, as far as it was played; None for a whole run."""
        coming = self._coming
        if coming.window is None:
            return None
        begin_us = coming.window.begin_us if ended.is_warm else ended.begin_us - coming.origin_us
        played = DayWindow(begin_us, self.run.loop.now_us() - coming.origin_us).described(coming.demand)
        return played if ended.is_warm else f"warm-up, {played}"

    def _burst(self, ended: EndedRun) -> BurstFigures | None:
        coming = self._coming
        played = DayWindow(ended.begin_us - coming.origin_us, self.run.loop.now_us() - coming.origin_us)
        burst = densest(coming.demand, played if coming.window is not None else None)
        if burst is None:
            return None
        begin_us = burst.begin_us + coming.origin_us
        waits_us = self._street.in_waits_us(begin_us, begin_us + BURST_US)
        return BurstFigures(self._clock.at(begin_us), BURST_US / 1e6, burst.count, Durations.of(waits_us))


def _wait_s(customer: Customer) -> float | None:
    """What a customer waited in all, in and out; None for one who was not served."""
    visit = customer.visit
    if visit.in_wait_us is None or visit.out_wait_us is None:
        return None
    return (visit.in_wait_us + visit.out_wait_us) / 1e6


def _waits_since(customer: Customer, time_us: int) -> bool:
    """Whether a customer waits who waited at this time: to bring the car, or to have it back."""
    if customer.state is CustomerState.GONE or looks_for_ticket(customer):
        return False
    visit = customer.visit
    since_us = visit.arrived_us if visit.parked_us is None else visit.asked_us
    return since_us is not None and since_us <= time_us
