"""A car park in the simulator: cars come and are fetched, by the clock of a real day or by chance."""

from argparse import Namespace
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, ClassVar, Final

from bus_sim.campaign.profiles import SPAN_S
from bus_sim.demand import DemandError
from bus_sim.faults import operators
from bus_sim.options import RunOptions
from bus_sim.systems.car_park import drives, people, power
from bus_sim.systems.car_park.day import ParkingDay, asked_day, brought_in, choose_demand, standing_in
from bus_sim.systems.car_park.demand import Arrivals
from bus_sim.systems.car_park.forged import ForgedRetrievals
from bus_sim.systems.car_park.plant.plant import Plant
from bus_sim.systems.car_park.planted.registry import find_bug
from bus_sim.systems.car_park.simulation import build
from bus_sim.systems.car_park.stage import ORIGIN_US, CarParkStage, ComingCustomers
from bus_sim.systems.car_park.stranger import factories_with
from bus_sim.systems.car_park.window import choose_window, with_short_eve
from bus_sim.systems.stranger import Stranger
from bus_sim.systems.system import HAND_SPEED, Action, Faulted, Occasion, SimulatedSystem
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.contract.codes import KindCode
from onboard.core.behaviour import BehaviourFactory
from onboard.core.site import Site
from onboard.systems.car_park.site import CarPark
from onboard.ways.site import BayUse

#: Simulated seconds a second while a window is shown: an hour in a minute.
WINDOW_SPEED = 60.0
#: What comes in a run of a campaign, and how far apart, s.
CARS, APART_S = 6, 120.0
#: When an attack begins, s after power-up: cars are coming, and some stand in the park.
ATTACKED_S = (60.0, 420.0)
#: The longest that a trial may take, s.
PATIENCE_S = 7_200.0
#: Who comes on an occasion.
_ON: Final[Mapping[Occasion, Arrivals]] = {
    # One car, fetched two minutes later.
    Occasion.ALONE: Arrivals(cars=1, mean_s=5.0, sigma_s=1.0, min_stay_s=120.0),
    # Three so close that two robots carry at the same time, and that some are fetched while others come.
    Occasion.OVERLAP: Arrivals(cars=3, mean_s=30.0, sigma_s=10.0, min_stay_s=60.0),
    # So close, and fetched so soon, that all kinds of work are under way.
    Occasion.BUSY: Arrivals(6, 15.0, 5.0, 30.0),
    Occasion.FEW: Arrivals(2, 30.0, 5.0, 60.0),
    Occasion.ATTACK: Arrivals(6, 90.0, 45.0),
    Occasion.NOBODY: Arrivals(0),
}


class CarParkSystem(SimulatedSystem[CarPark, Plant]):
    """The car park in the simulator: a day of sessions, cars by chance, or one car by hand."""

    name = CarPark.system
    who = "customers"
    worker = KindCode.ROBOT
    actions: Mapping[str, Action] = {
        "sensor_stuck": drives.sensor_stuck,
        "sensor_wrong": drives.sensor_wrong,
        "actuator_slow": drives.actuator_slow,
        "actuator_halfway": drives.actuator_halfway,
        "lost_ticket": people.lost_ticket,
        "key_presses": people.key_presses,
        "cancel": people.cancel,
        "linger": people.linger,
        "oversize": people.oversize,
        "door_forced": people.door_forced,
        "moved": people.moved,
        "blocked": operators.blocked,
        "battery_drop": power.battery_drop,
        "battery_drain": power.battery_drain,
        "chargers_off": power.chargers_off,
    }
    attacks: Mapping[str, type[Any]] = {"orders": ForgedRetrievals}
    section = "demand"
    settings: ClassVar[Mapping[str, type]] = {"cars": int, "mean_s": float, "sigma_s": float, "min_stay_s": float}

    def draws(self, kind: str, site: CarPark) -> bool:
        """All that strikes: what is of batteries only where robots have them."""
        return power.strikes(kind, site)

    # --- a run -------------------------------------------------------------------------------------------------

    def stage(self, site: CarPark, options: RunOptions, loop: VirtualTimeLoop) -> CarParkStage:
        """One run; ``options.demand`` is a ``ParkingDay`` or ``Arrivals``. Raises ``DemandError``."""
        coming = _coming(site, options)
        dated = replace(options, epoch_us=round(coming.zero.timestamp() * 1_000_000))
        return CarParkStage(build(site, dated if isinstance(options.demand, ParkingDay) else options, loop), coming)

    def asked(self, site: CarPark, args: Namespace, given: Mapping[str, object], *, live: bool) -> ParkingDay:
        """The day that the options ask for. Raises ``DemandError`` for those that do not go together."""
        return asked_day(args, live=live)

    def speed(self, demand: ParkingDay, *, web: bool, terminal: bool) -> float | None:
        """An hour in a minute for a window, slower for a page or a hand at the keys, else unbounded."""
        return WINDOW_SPEED if demand.window is not None else HAND_SPEED if web or demand.by_hand else None

    def stranger(self, site: CarPark, target: int, how: Stranger) -> Callable[[Site, KindCode], BehaviourFactory]:
        """A robot that tells a plan for what it wins, as everybody plans around plans."""
        return factories_with(target, how)

    def planted(self, name: str) -> Callable[[Any], None]:
        """Puts the mistake so named into a run. Raises ``KeyError`` with the names that there are."""
        return find_bug(name).plant

    # --- who comes to a trial ----------------------------------------------------------------------------------

    def read(self, given: Mapping[str, object]) -> Arrivals:
        """Cars by chance, as a scenario file's section ``[demand]`` says it."""
        return Arrivals(**given)  # type: ignore[arg-type]  # the reader checked each value's type

    def usual(self, site: CarPark, args: Mapping[str, float | None]) -> Arrivals:
        """Cars in a campaign: ``CARS`` every ``APART_S`` s unless told otherwise. Raises ``DemandError``."""
        if args.get("orders") is not None:
            raise DemandError(f"--orders {args['orders']}: {site.name} is a car park; write --cars")
        cars, apart_s = args.get("cars"), args.get("apart") or APART_S
        return Arrivals(CARS if cars is None else int(cars), apart_s, apart_s / 2)

    def on(self, occasion: Occasion, site: CarPark) -> Arrivals:
        """A fixed number of cars and interval for each occasion, the same on all sites."""
        return _ON[occasion]

    def count(self, demand: Arrivals | None) -> str:
        """The number of cars in words; without a demand that of a campaign."""
        return f"{(demand or Arrivals()).cars} cars"

    def check(self, site: CarPark, demand: Arrivals | None, seed: int) -> None:
        """Draws the cars once. Raises ``DemandError`` for numbers that nobody can draw from."""
        (demand or Arrivals()).demand(seed)

    def faulted(self, site: CarPark, demand: Arrivals | None, seed: int, limit_s: float) -> Faulted:
        """At a rate until the last car is fetched, or has come where nobody fetches it."""
        stays = (demand or Arrivals()).demand(seed).stays
        moments = [max(one.arrival_us, one.departure_us or 0) for one in stays]
        until_s = min(limit_s, (ORIGIN_US + max(moments)) / 1e6)
        return Faulted(SPAN_S, until_s, [(ORIGIN_US + one.arrival_us) / 1e6 for one in stays])

    def attacked_s(self, site: CarPark, demand: Arrivals | None, seed: int) -> tuple[float, float]:
        """The same span on every site, from first to last moment, s after power-up."""
        return ATTACKED_S

    def patience_s(self, site: CarPark, demand: Arrivals | None, seed: int) -> float:
        """Two hours after power-up on every site, in s: cars of a campaign stay for minutes."""
        return PATIENCE_S


def _coming(site: CarPark, options: RunOptions) -> ComingCustomers:
    wanted = options.demand
    if not isinstance(wanted, ParkingDay):
        return ComingCustomers((wanted or Arrivals()).demand(options.seed))
    demand = choose_demand(wanted, site, options.seed)
    window = choose_window(demand, wanted.window) if wanted.window is not None else None
    standing = standing_in(demand, site) if wanted.random_s is not None else ()
    demand = replace(demand, inside=()) if standing else brought_in(demand, site)
    if window is not None and wanted.short_eve:
        demand = with_short_eve(demand, window, len(site.fronts(BayUse.ENTRY, BayUse.BOTH)))
    # The first to come, or what is shown, is so long after power-up.
    first_us = min((stay.arrival_us for stay in demand.stays), default=0)
    first_us = first_us if window is None else min(first_us, window.begin_us)
    return ComingCustomers(demand, ORIGIN_US - first_us, window, wanted.by_hand, standing)


SIMULATED = CarParkSystem()
