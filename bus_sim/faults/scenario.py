"""A scenario: a site, who comes, a seed and the faults that happen, in one TOML file.

::

    [scenario]
    site = "small"          # a shipped site, or a site file
    seed = 7
    limit_s = 7200          # the run ends then at the latest

    [demand]                # a car park: cars at intervals of a normal law, and fetched so
    cars = 6
    mean_s = 120
    sigma_s = 60
    min_stay_s = 200

    [orders]                # any other site: orders that the seed draws; without it the site's own
    count = 12
    apart_s = 20

    [[fault]]
    kind = "crash"
    target = "MR1"
    at_s = 80.5
"""

import tomllib
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path

from bus_sim.demand import Demand, DemandError
from bus_sim.faults.arm import check_targets
from bus_sim.faults.injection import AnyFault, parse_injection
from bus_sim.sites import SiteNotFoundError, find_site
from bus_sim.systems.orders import Orders
from bus_sim.systems.session import check_faults
from onboard.config.problems import ConfigError, Problems, nearest, quoted
from onboard.core.site import Site
from onboard.systems.car_park.site import CarPark


@dataclass(frozen=True)
class Arrivals:
    """Cars at normal intervals, in s, fetched at such intervals ``min_stay_s`` after their coming at the earliest."""

    cars: int = 6
    mean_s: float = 120.0
    sigma_s: float = 60.0
    min_stay_s: float = 200.0

    def demand(self, seed: int) -> Demand:
        """The stays of one seed. Raises ``DemandError`` for a law that is none."""
        return Demand.by_mean(self.mean_s, self.sigma_s, seed, count=self.cars, min_stay_s=self.min_stay_s)


@dataclass(frozen=True)
class Scenario:
    """See the module. ``site`` is a name or a path as ``bus-sim run`` takes it."""

    site: str
    seed: int = 1
    limit_s: float = 7_200.0
    arrivals: Arrivals = field(default_factory=Arrivals)
    faults: tuple[AnyFault, ...] = ()
    #: What the seed draws for a site that is no car park; None: nothing, as for a car park.
    orders: Orders | None = None

    def with_faults(self, faults: Iterable[AnyFault]) -> "Scenario":
        """The same with other faults."""
        return replace(self, faults=tuple(faults))

    def to_toml(self, comment: str = "") -> str:
        """The text that ``load_scenario`` reads."""
        lines = [f"# {line}" for line in comment.splitlines()]
        lines += ["[scenario]", f"site = {quoted(self.site)}", f"seed = {self.seed}"]
        lines += [f"limit_s = {self.limit_s:.15g}", "", *self._who_comes()]
        for fault in self.faults:
            kind, _, settings = str(fault).partition(":")
            lines += ["", "[[fault]]", f"kind = {quoted(kind)}"]
            pairs = [part.split("=", 1) for part in settings.split(",") if part]
            lines += [f"{key} = {value if _is_number(value) else quoted(value)}" for key, value in pairs]
        return "\n".join(lines) + "\n"

    def _who_comes(self) -> list[str]:
        arrivals, orders = self.arrivals, self.orders
        if orders is not None:
            return ["[orders]", f"count = {orders.count}", f"apart_s = {orders.apart_s:.15g}"]
        return [
            "[demand]",
            f"cars = {arrivals.cars}",
            f"mean_s = {arrivals.mean_s:.15g}",
            f"sigma_s = {arrivals.sigma_s:.15g}",
            f"min_stay_s = {arrivals.min_stay_s:.15g}",
        ]


def _is_number(text: str) -> bool:
    try:
        tomllib.loads(f"x = {text}")
    except tomllib.TOMLDecodeError:
        return False
    return text[:1].isdigit() or text[:1] == "-"


_SECTIONS = {
    "scenario": {"site": str, "seed": int, "limit_s": float},
    "demand": {"cars": int, "mean_s": float, "sigma_s": float, "min_stay_s": float},
    "orders": {"count": int, "apart_s": float},
}
_WORDS = {str: "a text in quotes", int: "a whole number from 0", float: "a number above 0"}


def load_scenario(path: Path) -> tuple[Scenario, Site]:
    """Read a scenario and its site. Raises ``ConfigError`` with one line for each mistake."""
    problems = Problems(str(path))
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        problems.add(0, "", None, f"cannot be read as UTF-8 text ({error})", "name a scenario file")
        raise ConfigError(problems.in_order()) from error
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        problems.add(0, "", None, f"is no TOML ({error})", "correct it there")
        raise ConfigError(problems.in_order()) from error
    return _Reader(problems, text, table).read()


class _Reader:
    """One file; all of its mistakes are told at once."""

    def __init__(self, problems: Problems, text: str, table: dict[str, object]) -> None:
        self._problems = problems
        self._lines = text.splitlines()
        self._table = table

    def read(self) -> tuple[Scenario, Site]:
        """Scenario and site, or ``ConfigError``."""
        for key in self._table:
            if key not in (*_SECTIONS, "fault"):
                self._problems.add(
                    self._line(f"[{key}"), key, None, "is no part of a scenario", nearest(key, [*_SECTIONS, "fault"])
                )
        head, demand, orders = self._section("scenario"), self._section("demand"), self._section("orders")
        faults = self._faults()
        site = self._site(head.pop("site", None))
        wanted = self._orders(site, orders)
        scenario = Scenario("", arrivals=Arrivals(**demand), faults=tuple(faults), orders=wanted, **head)  # type: ignore[arg-type]  # _section checked each value's type
        try:
            scenario.arrivals.demand(scenario.seed)
        except DemandError as error:
            self._problems.add(self._line("[demand"), "demand", None, str(error), "correct it")
        if site is not None:
            try:
                (check_targets if site.system == CarPark.system else check_faults)(tuple(faults), site)
            except ValueError as error:
                self._problems.add(self._line("[[fault"), "fault", None, str(error), "name one of the site's machines")
        self._problems.raise_if_any()
        assert site is not None
        found = self._table["scenario"]
        assert isinstance(found, dict)
        return replace(scenario, site=found["site"]), site

    def _orders(self, site: Site | None, section: dict[str, object]) -> Orders | None:
        """Cars come to car parks, orders to all other sites: the wrong section is noted, and one without a count."""
        if site is None:
            return None
        is_park = site.system == CarPark.system
        right, wrong = ("demand", "orders") if is_park else ("orders", "demand")
        if wrong in self._table:
            what, remedy = f"is nothing for a {site.system}", f"write [{right}], or leave it out"
            self._problems.add(self._line(f"[{wrong}"), wrong, None, what, remedy)
        given = self._table.get("orders")
        if is_park or given is None:
            return None
        if isinstance(given, dict) and "count" not in given:
            self._problems.add(self._line("[orders"), "orders.count", None, "is missing", "write count = 12, or 0")
        return Orders(**{"count": 0, "apart_s": 1.0, **section})  # type: ignore[arg-type]  # _section checked each value's type

    def _section(self, name: str) -> dict[str, object]:
        section = self._table.get(name, {})
        line = self._line(f"[{name}")
        if not isinstance(section, dict):
            self._problems.add(line, name, section, "is no section", f"write [{name}]")
            return {}
        kept: dict[str, object] = {}
        for key, value in section.items():
            wanted = _SECTIONS[name].get(key)
            if wanted is None:
                self._problems.add(line, f"{name}.{key}", value, "is no setting", nearest(key, list(_SECTIONS[name])))
            elif not _fits(value, wanted):
                self._problems.add(line, f"{name}.{key}", value, "has the wrong value", f"must be {_WORDS[wanted]}")
            else:
                kept[key] = value
        return kept

    def _site(self, name: object) -> Site | None:
        line = self._line("[scenario")
        if not isinstance(name, str):
            self._problems.add(line, "scenario.site", None, "is missing", 'name a site, such as site = "small"')
            return None
        try:
            return find_site(name)
        except SiteNotFoundError as error:
            self._problems.add(line, "scenario.site", name, str(error), "name a shipped site or a site file")
            return None

    def _faults(self) -> list[AnyFault]:
        entries = self._table.get("fault", [])
        if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
            self._problems.add(self._line("[fault"), "fault", None, "is no list of faults", "write [[fault]] for each")
            return []
        lines = [number for number, line in enumerate(self._lines, start=1) if line.strip().startswith("[[fault]]")]
        faults = []
        for index, row in enumerate(entries):
            settings = ",".join(f"{key}={value}" for key, value in row.items() if key != "kind")
            try:
                faults.append(parse_injection(f"{row.get('kind', '')}:{settings}"))
            except ValueError as error:
                line = lines[index] if index < len(lines) else 0
                self._problems.add(line, f"fault {index + 1}", None, str(error), "correct it")
        return faults

    def _line(self, beginning: str) -> int:
        found = (number for number, line in enumerate(self._lines, start=1) if line.strip().startswith(beginning))
        return next(found, 0)


def _fits(value: object, wanted: type) -> bool:
    if isinstance(value, bool):
        return False
    if wanted is str:
        return isinstance(value, str)
    if wanted is int:
        return isinstance(value, int) and value >= 0
    return isinstance(value, int | float) and value > 0
