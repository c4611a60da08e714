"""Systems to whose desks orders come: those of the site file, or as many as a seed draws; what became of them."""

import random
from argparse import Namespace
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, ClassVar, NamedTuple, Protocol

from bus_sim.demand import MOST_ORDERS, DemandError, Law, check_count
from bus_sim.devices.link import BusDeviceLink
from bus_sim.devices.timers import LoopTimers, Timers
from bus_sim.faults.bus import frame_faults
from bus_sim.options import RunOptions
from bus_sim.run import BusRun, buses_of, links_of
from bus_sim.systems.stage import SystemStage, Tally
from bus_sim.systems.system import HAND_SPEED, Faulted, Occasion, PlantT, SimulatedSystem, SiteT
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.contract.codes import KindCode

#: Faults begin so long after power-up, s: the machines have found each other, and the first orders are there.
BEGIN_S = 12.0
#: A run is given up after so many times what an order takes, and once more for each that is usual: they may all wait.
PATIENCE = 20
#: Kinds of fault that campaigns draw: those of the buses, of controllers and of their clocks that all machines know,
#: and persons who stop machines.
DRAWN = frozenset(
    {
        *("burst", "bit_errors", "lossy", "reorder", "bus_off", "partition", "overflow", "babble", "attack"),
        *("crash", "pause", "slow_node", "disk_full", "power_cut", "drift", "clock_jump"),
        *("held", "emergency_stop", "operate"),
    }
)


@dataclass(frozen=True)
class OrderArrivals:
    """So many orders at normal intervals of mean ``apart_s`` and half of it as deviation; 0: the site's own ones."""

    count: int
    apart_s: float

    def moments_ms(self, chance: random.Random) -> list[int]:
        """When each comes, ms after the first."""
        law, at_us, moments = Law(self.apart_s, self.apart_s / 2), 0, []
        for _ in range(self.count):
            moments.append(at_us // 1000)
            at_us += law.draw_us(chance)
        return moments

    def chance(self, site: str, seed: int) -> random.Random:
        """The source of everything that is drawn for one seed of a site."""
        return random.Random(f"orders:{site}:{seed}")

    def to_toml(self) -> list[str]:
        """The lines of a scenario file's section ``[orders]``: their number, and s between two."""
        return ["[orders]", f"count = {self.count}", f"apart_s = {self.apart_s:.15g}"]


@dataclass(frozen=True)
class OrderedSystem(SimulatedSystem[SiteT, PlantT]):
    """A system to which orders come.

    ``order_s`` is about what one order takes on a site: faults strike until the last one should be done. ``most`` are
    the orders of a seed where nothing else is asked for: as many as the machines can just carry out.
    """

    name: str
    #: The plant from the site, its timers, each machine's link to its device bus, and the seed.
    plant: Callable[[SiteT, Timers, dict[int, BusDeviceLink], int], PlantT]
    #: A run that is connected, and what came of it.
    staged: Callable[[BusRun[PlantT]], SystemStage[PlantT]]
    #: The site with orders that a seed draws. Raises ``DemandError`` for orders that it cannot have.
    draw: Callable[[SiteT, OrderArrivals, int], SiteT]
    #: When the last of the site's orders comes, s after power-up.
    last_s: Callable[[SiteT], float]
    order_s: Callable[[SiteT], float]
    most: Callable[[SiteT], OrderArrivals]
    worker: KindCode | None = None
    #: The parts of a run, connected.
    connected: Callable[..., BusRun[PlantT]] = BusRun
    #: How fast a run goes for somebody who looks on in a terminal, simulated seconds a second; None: at full speed.
    look_speed: float | None = None
    attacks: Mapping[str, type[Any]] = field(default_factory=dict)
    drawn: frozenset[str] | None = DRAWN

    section: ClassVar[str] = "orders"
    settings: ClassVar[Mapping[str, type]] = {"count": int, "apart_s": float}
    needed: ClassVar[Mapping[str, str]] = {"count": "12, or 0"}

    def stage(self, site: SiteT, options: RunOptions, loop: VirtualTimeLoop) -> SystemStage[PlantT]:
        """One run: plant and buses for the site with its drawn orders. Raises ``DemandError``."""
        drawn = self.with_orders(site, options.demand, options.seed)
        fleet, devices = buses_of(drawn, frame_faults(options.faults, drawn), loop)
        links = links_of(drawn, devices)
        plant = self.plant(drawn, LoopTimers(loop), links, options.seed)
        return self.staged(self.connected(drawn, options, loop, fleet, devices, plant, links))

    def asked(self, site: SiteT, args: Namespace, given: Mapping[str, object], *, live: bool) -> OrderArrivals | None:
        """The site's own; no option says another thing."""
        for name in given:
            option = f"--{name.removesuffix('_s').replace('_', '-')}"
            raise DemandError(
                f"{option}: is about cars that come and go by the clock of a day; {site.name} is a {site.called}, and "
                "its orders are those of its site file; leave it out"
            )
        return None

    def speed(self, demand: Any, *, web: bool, terminal: bool) -> float | None:
        """``HAND_SPEED`` where a page is served, the system's own where a person looks on, else unbounded."""
        return HAND_SPEED if web else self.look_speed if terminal else None

    def with_orders(self, site: SiteT, orders: OrderArrivals | None, seed: int) -> SiteT:
        """The site with what a seed brings. Raises ``DemandError`` for orders that it cannot bring."""
        if orders is None or not orders.count:
            return site
        check_count("orders", orders.count, MOST_ORDERS)
        Law(orders.apart_s, orders.apart_s / 2).check("apart")
        return self.draw(site, orders, seed)

    def read(self, given: Mapping[str, object]) -> OrderArrivals:
        """Orders by chance, as the section ``[orders]`` says it; 1 s apart unless told."""
        return OrderArrivals(**{"apart_s": 1.0, **given})  # type: ignore[arg-type]  # the reader checked each value's type

    def usual(self, site: SiteT, args: Mapping[str, float | None]) -> OrderArrivals:
        """Of what is not asked for, what is usual on the system."""
        if args.get("cars") is not None:
            raise DemandError(
                f"--cars {args['cars']}: {site.name} is a {site.called}, to which no cars come; write --orders"
            )
        usual, count, apart_s = self.most(site), args.get("orders"), args.get("apart")
        return OrderArrivals(
            usual.count if count is None else int(count), usual.apart_s if apart_s is None else apart_s
        )

    def on(self, occasion: Occasion, site: SiteT) -> OrderArrivals:
        """One, three that overlap, the site's own where it has none, or what is usual."""
        if occasion in (Occasion.ALONE, Occasion.NOBODY):
            return OrderArrivals(int(occasion is Occasion.ALONE), 1.0)
        return OrderArrivals(3, self.order_s(site) / 4) if occasion is Occasion.OVERLAP else self.most(site)

    def count(self, demand: OrderArrivals | None) -> str:
        """The number of orders in words; without a demand those of the site file."""
        return f"{demand.count} orders" if demand is not None and demand.count else "the site's own orders"

    def check(self, site: SiteT, demand: OrderArrivals | None, seed: int) -> None:
        """Draws the orders once. Raises ``DemandError`` for more than the site can be brought."""
        self.with_orders(site, demand, seed)

    def span_s(self, site: SiteT) -> tuple[float, float]:
        """When faults may begin, s after power-up: from the first order to where the last should be done."""
        return BEGIN_S, max(BEGIN_S, self.last_s(site)) + self.order_s(site)

    def faulted(self, site: SiteT, demand: OrderArrivals | None, seed: int, limit_s: float) -> Faulted:
        """Until the last order should be done."""
        span = self.span_s(self.with_orders(site, demand, seed))
        return Faulted(span, span[1])

    def attacked_s(self, site: SiteT, demand: OrderArrivals | None, seed: int) -> tuple[float, float]:
        """While orders come and are carried out."""
        return self.span_s(self.with_orders(site, demand, seed))

    def patience_s(self, site: SiteT, demand: OrderArrivals | None, seed: int) -> float:
        """The end of the last order, and time for ``PATIENCE`` and as many again as come usually, s."""
        drawn = self.with_orders(site, demand, seed)
        return self.span_s(drawn)[1] + (PATIENCE + self.most(drawn).count) * self.order_s(drawn)


class Answered(Protocol):
    """An order at a plant's counter: its last answer, and its times, us."""

    @property
    def result(self) -> Enum | None:
        """The counter's last word of it."""

    @property
    def begun_us(self) -> int:
        """When the order came, loop time in us."""

    @property
    def ended_us(self) -> int | None:
        """When it was over, loop time in us; None while it is not."""


class EndedOrder(NamedTuple):
    """One order at the end: whether it was carried out, or refused, or neither; its times, us."""

    done: bool
    refused: bool
    begun_us: int
    ended_us: int | None


def tally(entries: list[EndedOrder], expected: int, now_us: int) -> Tally:
    """Count orders; ``expected`` are all that the run brings, also those that have not come yet."""
    served, told = sum(one.done for one in entries), sum(one.refused for one in entries)
    waits_us = [(now_us if one.ended_us is None else one.ended_us) - one.begun_us for one in entries]
    return Tally(served, told, expected - served - told, max(waits_us, default=0) / 1e6)


def nothing_to_draw(site: str, what: str) -> DemandError:
    """The line for a site from which no order can be drawn."""
    return DemandError(f"{site}: no orders can be drawn for it, as it has {what}; write --orders 0 for its own")


def last_of(moments_ms: Iterable[int], origin_us: int) -> float:
    """When the last of the orders at these moments after ``origin_us`` comes, s after power-up."""
    return origin_us / 1e6 + max(moments_ms, default=0) / 1e3


def tally_of(entries: Iterable[Answered], done: Enum, refused: Enum, expected: int, now_us: int) -> Tally:
    """What became of orders that a counter answers: the last word of each is ``done``, ``refused`` or another."""
    ended = [EndedOrder(one.result is done, one.result is refused, one.begun_us, one.ended_us) for one in entries]
    return tally(ended, expected, now_us)
