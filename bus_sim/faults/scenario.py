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
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from bus_sim.demand import LONGEST_S, DemandError
from bus_sim.faults.arm import check_faults
from bus_sim.faults.injection import AnyFault, parse_injection
from bus_sim.sites import SiteNotFoundError, find_site
from bus_sim.systems.registry import simulated, simulated_names, simulated_of
from bus_sim.systems.system import Coming
from onboard.config.files import read_text
from onboard.config.problems import Problems, nearest, quoted
from onboard.config.toml_lines import parse
from onboard.core.site import Site


@dataclass(frozen=True)
class FaultScenario:
    """See the module. ``site`` is a name or a path as ``bus-sim run`` takes it."""

    site: str
    seed: int = 1
    limit_s: float = 7_200.0
    #: Who comes, in the words of the site's system; None: as it is where a file says nothing about it.
    demand: Coming | None = None
    faults: tuple[AnyFault, ...] = ()

    def with_faults(self, faults: Iterable[AnyFault]) -> "FaultScenario":
        """The same with other faults."""
        return replace(self, faults=tuple(faults))

    def to_toml(self, comment: str = "") -> str:
        """The text that ``load_scenario`` reads."""
        lines = [f"# {line}" for line in comment.splitlines()]
        lines += ["[scenario]", f"site = {quoted(self.site)}", f"seed = {self.seed}"]
        lines += [f"limit_s = {self.limit_s:.15g}", *self._who_comes()]
        for fault in self.faults:
            kind, _, settings = str(fault).partition(":")
            lines += ["", "[[fault]]", f"kind = {quoted(kind)}"]
            pairs = [part.split("=", 1) for part in settings.split(",") if part]
            lines += [f"{key} = {value if _is_number(value) else quoted(value)}" for key, value in pairs]
        return "\n".join(lines) + "\n"

    def _who_comes(self) -> list[str]:
        return [] if self.demand is None else ["", *self.demand.to_toml()]


def _is_number(text: str) -> bool:
    try:
        tomllib.loads(f"x = {text}")
    except tomllib.TOMLDecodeError:
        return False
    return text[:1].isdigit() or text[:1] == "-"


_HEAD: Mapping[str, type] = {"site": str, "seed": int, "limit_s": float}
_WORDS = {str: "a text in quotes", int: "a whole number from 0", float: f"a number above 0, and at most {LONGEST_S}"}


def load_scenario(path: Path) -> tuple[FaultScenario, Site]:
    """Read a scenario and its site. Raises ``ConfigError`` with one line for each mistake."""
    problems = Problems(str(path))
    text = read_text(path, "scenario")
    table = parse(text, str(path), problems).values
    problems.raise_if_any()
    return _ScenarioReader(problems, text, table).read()


class _ScenarioReader:
    """One file; all of its mistakes are told at once."""

    def __init__(self, problems: Problems, text: str, table: dict[str, object]) -> None:
        self._problems = problems
        self._lines = text.splitlines()
        self._table = table

    def read(self) -> tuple[FaultScenario, Site]:
        """Scenario and site, or ``ConfigError``."""
        sections = {one.section: one.settings for one in map(simulated, simulated_names())}
        for key in self._table:
            if key not in ("scenario", "fault", *sections):
                known = ["scenario", *sections, "fault"]
                self._problems.add(self._line(f"[{key}"), key, None, "is no part of a scenario", nearest(key, known))
        head = self._section("scenario", _HEAD)
        given = {name: self._section(name, sections[name]) for name in self._table if name in sections}
        faults, site = self._faults(), self._site(head.pop("site", None))
        demand = self._demand(site, given, int(str(head.get("seed", 1)))) if site is not None else None
        scenario = FaultScenario("", demand=demand, faults=tuple(faults), **head)  # type: ignore[arg-type]  # _section checked each value's type
        if site is not None:
            try:
                check_faults(faults, site)
            except DemandError as error:
                self._problems.add(self._line("[[fault"), "fault", None, str(error), "name one of the site's machines")
        self._problems.raise_if_any()
        assert site is not None
        found = self._table["scenario"]
        assert isinstance(found, dict)
        return replace(scenario, site=found["site"]), site

    def _demand(self, site: Site, given: Mapping[str, dict[str, object]], seed: int) -> Coming | None:
        """Who comes, in the section of the site's system: another one is noted, and what that system cannot bring."""
        system = simulated_of(site)
        section = system.section
        for key in given:
            if key != section:
                what, remedy = f"is nothing for a {site.called}", f"write [{section}], or leave it out"
                self._problems.add(self._line(f"[{key}"), key, None, what, remedy)
        if section not in given:
            return None
        line, table = self._line(f"[{section}"), self._table[section]
        for name, example in system.needed.items():
            if isinstance(table, dict) and name not in table:
                self._problems.add(line, f"{section}.{name}", None, "is missing", f"write {name} = {example}")
        if not system.needed.keys() <= given[section].keys():
            return None
        try:
            demand: Coming | None = system.read(given[section])
            system.check(site, demand, seed)
        except DemandError as error:
            self._problems.add(line, section, None, str(error), "correct it")
        else:
            return demand
        return None

    def _section(self, name: str, settings: Mapping[str, type]) -> dict[str, object]:
        section = self._table.get(name, {})
        line = self._line(f"[{name}")
        if not isinstance(section, dict):
            self._problems.add(line, name, section, "is no section", f"write [{name}]")
            return {}
        kept: dict[str, object] = {}
        for key, value in section.items():
            wanted = settings.get(key)
            if wanted is None:
                self._problems.add(line, f"{name}.{key}", value, "is no setting", nearest(key, list(settings)))
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
    return isinstance(value, int | float) and 0 < value <= LONGEST_S
