"""Who comes to a car park in ``bus-sim run``: the day, the hour or the cars that a person asked for."""

from argparse import Namespace
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import date
from pathlib import Path

from bus_sim.demand import LONGEST_S, MOST_CARS, DemandError, Law, check_count
from bus_sim.systems.car_park.csv_rows import MOST_ROWS, CsvForm
from bus_sim.systems.car_park.demand import (
    LEVEL1_DAY,
    MINUTE_S,
    WHOLE_DAY,
    Announcements,
    Demand,
    Stay,
    with_more_inside,
)
from bus_sim.systems.car_park.mapping import table_form
from bus_sim.systems.car_park.sizes import broken_limits, misfits
from bus_sim.systems.car_park.window import with_eve
from onboard.config.arguments import whole
from onboard.config.problems import at_most
from onboard.core.site import Site
from onboard.systems.car_park.site import CarPark
from onboard.ways.site import BayUse, way_site

#: Word of ``--inside`` for the cars that the table itself says were there.
RECORDED = "recorded"
#: More cars than any site has places.
MOST_INSIDE = 100_000


@dataclass(frozen=True)
class ParkingDay:
    """Who comes, as the options of ``bus-sim run`` say it; see its help. ``window`` is what is shown of it."""

    sessions: Path | None = None
    #: Counts by the hour instead of sessions.
    counts: Path | None = None
    form: CsvForm = field(default_factory=CsvForm)
    #: So many more cars are inside at the start; ``overnight``: and who came before the day and was still there.
    inside: int = 0
    overnight: bool = False
    day: str | None = None
    stalls: tuple[str, ...] = ()
    one_car_s: float | None = None
    #: Mean and deviation of the intervals of arrivals; of departures too, unless ``random_out_s`` tells them.
    random_s: tuple[float, float] | None = None
    random_out_s: tuple[float, float] | None = None
    #: Who says beforehand when the car will be fetched; None: nobody.
    announced: Announcements | None = None
    cars: int = 50
    window: str | None = None
    #: Of what was before the window only who is still inside is played, shortly before it.
    short_eve: bool = False
    #: Cars come and go by keys of the terminal, and nobody comes otherwise.
    by_hand: bool = False


def choose_demand(day: ParkingDay, site: Site | None = None, seed: int = 1) -> Demand:
    """The stays to be played. Raises ``DemandError`` for a person's mistake.

    Unless told otherwise a site with several compartments gets the shipped day of all 52 stalls, any other that of
    level 1, which one compartment can serve.
    """
    found = _chosen(day, site, seed)
    return found if day.announced is None else day.announced.of(found, seed)


def _chosen(day: ParkingDay, site: Site | None, seed: int) -> Demand:
    if day.by_hand:
        return Demand(())
    if day.one_car_s is not None:
        return Demand.one_car(stay_s=day.one_car_s, seed=seed)
    if day.random_s is not None:
        return Demand.by_mean(*day.random_s, seed, count=day.cars, inside=day.inside, out=day.random_out_s)
    first, last = _days(day.day)
    if day.counts is not None:
        return Demand.from_counts(day.counts, day=first, until=last, seed=seed, form=day.form, inside=day.inside)
    shipped = WHOLE_DAY if site is not None and len(way_site(site).compartments) > 1 else LEVEL1_DAY
    demand = Demand.from_sessions(
        day.sessions,
        stations=day.stalls,
        day=first,
        until=last,
        shipped=shipped,
        seed=seed,
        form=day.form,
        overnight=day.overnight,
        park=site if isinstance(site, CarPark) else None,
    )
    return with_more_inside(demand, day.inside, seed)


def brought_in(demand: Demand, site: CarPark) -> Demand:
    """The demand as it is played: the cars inside at the start come before it, and who fits nowhere is told.

    Raises ``DemandError`` for more cars inside than there are places.
    """
    _check_room(demand, site)
    refused = misfits([stay.car for stay in (*demand.inside, *demand.stays)], site)
    played = with_eve(demand, len(site.fronts(BayUse.ENTRY, BayUse.BOTH)))
    return replace(played, remarks=(*played.remarks, *at_most(MOST_ROWS, refused)))


def standing_in(demand: Demand, site: CarPark) -> tuple[Stay, ...]:
    """The cars that stand inside as the power comes on. Raises ``DemandError`` where one does not fit everywhere."""
    _check_room(demand, site)
    if demand.inside and (site.place_class or any(broken_limits(one.car, site) for one in demand.inside)):
        raise DemandError(
            f"--inside {len(demand.inside)}: {site.name} has places that not every car fits; leave it out"
        )
    return demand.inside


def _check_room(demand: Demand, site: CarPark) -> None:
    if len(demand.inside) > len(site.places):
        cars = f"{len(demand.inside)} cars inside at the start"
        raise DemandError(f"{cars}: {site.name} has {len(site.places)} places; name a larger site, or fewer cars")


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


def asked_day(args: Namespace, *, live: bool) -> ParkingDay:
    """The day that the options ask for. Raises ``DemandError`` for those that do not go together."""
    _check_numbers(args)
    window = _window(args, live=live)
    if args.by_hand and (window is not None or args.speed == "max"):
        what = f"--speed {args.speed}" if window is None else "--hour, --window"
        raise DemandError(f"{what}: does not go with --by-hand, which is at a person's pace; leave it out")
    if live and args.without and window is not None:
        raise DemandError(
            f"--without {args.without[0]}: a window's warm-up is hurried, and a controller in another process lives at "
            "the clock's pace; leave out --hour and --window"
        )
    check_together(args, ("one_car", "random", "by_hand"))
    if args.counts is not None and args.stalls:
        raise DemandError(f"--stalls {args.stalls}: does not go with --counts, which knows no stalls; leave it out")
    inside, overnight = asked_inside(args)
    return ParkingDay(
        sessions=args.sessions,
        counts=args.counts,
        form=table_form(args),
        inside=inside,
        overnight=overnight,
        day=args.day,
        stalls=tuple(name for name in args.stalls.split(",") if name),
        one_car_s=args.one_car,
        random_s=tuple(args.random) if args.random is not None else None,
        random_out_s=tuple(args.random_out) if args.random_out is not None else None,
        announced=_announced(args),
        cars=args.cars,
        window=window,
        short_eve=True,
        by_hand=args.by_hand,
    )


def _announced(args: Namespace) -> Announcements | None:
    if args.announce is None:
        return None
    share, minutes = args.announce
    announced = Announcements(share, minutes * MINUTE_S)
    announced.check()
    if args.by_hand:
        given = f"--announce {share:g} {minutes:g}"
        raise DemandError(f"{given}: does not go with --by-hand, where key f does it; leave it out")
    return announced


def asked_inside(args: Namespace) -> tuple[int, bool]:
    """How many are inside at the start, and whether who was recorded is. Raises ``DemandError`` for anything else."""
    text = args.inside
    if text is None:
        return 0, False
    if text == RECORDED:
        if args.day is None or args.counts is not None:
            raise DemandError(f"--inside {text}: who came before the day; add --day D and --sessions FILE")
        return 0, True
    cars = whole(text)
    if cars is None or cars > MOST_INSIDE:
        raise DemandError(f"--inside {text}: must be a number of cars from 0 to {MOST_INSIDE}, or {RECORDED}")
    return cars, False


def check_together(args: Namespace, others: Sequence[str] = ()) -> None:
    """Raise ``DemandError`` for two options that say differently who comes; ``others`` besides the tables by name."""
    drawn = [f"--{name.replace('_', '-')}" for name in others if getattr(args, name) not in (None, False)]
    if args.counts is not None and (args.sessions is not None or drawn):
        raise DemandError(f"{['--sessions', *drawn][args.sessions is None]}: does not go with --counts; leave one out")
    counted = [name for name in drawn if name != "--random" or args.inside == RECORDED]
    if args.inside is not None and counted:
        raise DemandError(f"--inside {args.inside}: does not go with {counted[0]}; leave one of them out")


def _check_numbers(args: Namespace) -> None:
    """Refuse what no demand can be made of, by the option's name."""
    if args.one_car is not None and not 0 <= args.one_car <= LONGEST_S:
        raise DemandError(f"--one-car {args.one_car:g}: must be seconds from 0 to {LONGEST_S}")
    check_count("--cars", args.cars, MOST_CARS)
    for option, law in (("--random", args.random), ("--random-out", args.random_out)):
        if law is not None:
            Law(*law).check(option)
    if args.random_out is not None and args.random is None:
        raise DemandError("--random-out: departures alone; say with --random how cars arrive")


def _window(args: Namespace, *, live: bool) -> str | None:
    """The window asked for; without a site and anything that asks for a whole run the two-way hour."""
    if args.hour not in {None, "two-way"} and "-" in args.hour and "T" not in args.hour:
        raise DemandError(f"--hour {args.hour}: one time of day, such as 06:30; a window is --window {args.hour}")
    if args.window is not None and "-" not in args.window:
        raise DemandError(f"--window {args.window}: must be FROM-TO, such as 06:30-09:00")
    asked: str | None = args.hour or args.window
    whole = args.site is not None or args.one_car is not None or args.random is not None or args.limit_s is not None
    whole = whole or args.by_hand
    return asked if asked is not None or whole or live or args.without else "two-way"
