"""Forty small cases that ship with their proven optima (``bus_sim/data/small_cases.json``), and the gap to them.

Twenty of two robots and four cars, twenty of three and six, each car in and out, at one compartment. ``bench/
small_cases.py`` makes the file; what stands in it can be solved anew.
"""

import json
from dataclasses import asdict, dataclass
from importlib.resources import files
from typing import NamedTuple

from bus_sim.systems.car_park.compare.plans import CasePlanner, Situation, after, fetch, park
from bus_sim.systems.car_park.compare.resolved import resolved_waiting_ms
from bus_sim.systems.car_park.compare.small_case import Case, Visitor, earliest_finish, play_case
from onboard.core.site import Station

#: The file, in ``bus_sim/data``.
NAME = "small_cases.json"
#: At most so much more waiting than with the case solved anew whenever somebody comes or asks is aimed at, on average.
AIM = 1.10


class BayTurn(NamedTuple):
    """One car at the bay, in or, the second time, out: the place, and the robot by its rank among all then."""

    car: int
    place: int
    robot: int


@dataclass(frozen=True)
class StoredCase:
    """A case, the least total waiting with everybody known beforehand and the plan for it, and solved anew (ms)."""

    name: str
    seed: int
    case: Case
    clairvoyant_ms: int
    resolved_ms: int
    plan: tuple[BayTurn, ...]

    @property
    def negotiated_ms(self) -> int:
        """The total waiting where each task is called for ahead, and goes to the robot that is through first."""
        return play_case(self.case, earliest_finish, ahead=True)

    @property
    def by_key_ms(self) -> int:
        """The same where tasks are called for with the key, and once the bay is locked."""
        return play_case(self.case, earliest_finish)

    def plan_ms(self) -> int:
        """The total waiting of the stored plan, played. Raises ``ValueError`` for one that does not serve everybody."""
        case, now, waited_ms = self.case, Situation.of(self.case), 0
        for turn in self.plan:
            stored = next((one for one in now.stored if one.car == turn.car), None)
            robot = now.robots[turn.robot]
            if stored is None and turn.place in {one.place for one in now.stored}:
                raise ValueError(f"case {self.name}: car {turn.car} is put into place {turn.place}, which is taken")
            if stored is None:
                service = park(case, now, turn.car, robot, turn.place)
                waited_ms += service.through_ms - case.visitors[turn.car].arrival_ms
            else:
                service = fetch(case, now, stored, robot)
                waited_ms += service.through_ms - (stored.asked_ms or 0)
            now = after(case, now, service)
        if now.coming or any(one.asked_ms is not None for one in now.stored):
            raise ValueError(f"case {self.name}: the plan leaves somebody waiting")
        return waited_ms

    @classmethod
    def solved(cls, name: str, seed: int, case: Case) -> "StoredCase":
        """A case with its optima, proven. Raises ``PlanError`` where that takes too long."""
        clairvoyant_ms, way = CasePlanner(case).best(Situation.of(case))
        now, plan = Situation.of(case), []
        for service in way:
            plan.append(BayTurn(service.car, service.place, now.robots.index(service.robot)))
            now = after(case, now, service)
        return cls(name, seed, case, clairvoyant_ms, resolved_waiting_ms(case), tuple(plan))

    def solved_anew(self) -> "StoredCase":
        """The same, proven once more. Raises ``PlanError`` where that takes too long."""
        return StoredCase.solved(self.name, self.seed, self.case)


def stored_cases() -> tuple[StoredCase, ...]:
    """All that ship, in the order of the file."""
    held = json.loads(files("bus_sim").joinpath("data", NAME).read_text(encoding="utf-8"))
    found = []
    for kind, layout in held["layouts"].items():
        for one in layout["cases"]:
            visitors = tuple(Visitor(*visitor) for visitor in one["visitors"])
            case = Case(
                visitors,
                tuple(Station.from_number(number) for number in layout["places"]),
                layout["bay"],
                tuple(layout["homes"]),
                tuple(tuple(row) for row in layout["way_ms"]),
                *(layout[name] for name in ("close_ms", "open_ms", "handle_ms", "react_ms")),
            )
            plan = tuple(BayTurn(*turn) for turn in one["plan"])
            name = f"{kind}, seed {one['seed']}"
            found.append(StoredCase(name, one["seed"], case, one["clairvoyant_ms"], one["resolved_ms"], plan))
    return tuple(found)


def as_text(kinds: dict[str, list[StoredCase]]) -> str:
    """The file's text: for each kind its layout once, then a line for each case."""
    layouts = []
    for kind, cases in kinds.items():
        first = cases[0].case
        layout = {
            "places": [place.number for place in first.places],
            "bay": first.bay,
            "homes": first.homes,
            "way_ms": first.way_ms,
            **{name: getattr(first, name) for name in ("close_ms", "open_ms", "handle_ms", "react_ms")},
        }
        lines = [
            json.dumps(
                {
                    "seed": one.seed,
                    "visitors": one.case.visitors,
                    "clairvoyant_ms": one.clairvoyant_ms,
                    "resolved_ms": one.resolved_ms,
                    "plan": one.plan,
                }
            )
            for one in cases
        ]
        head = json.dumps(layout)[:-1]
        layouts.append(f'"{kind}": {head}, "cases": [\n' + ",\n".join(lines) + "\n]}")
    return '{"layouts": {\n' + ",\n".join(layouts) + "\n}}\n"


@dataclass(frozen=True)
class GapRow:
    """Cases of one kind: mean waiting of a visit (s), and the mean and most of the gaps, each a ratio of one case.

    ``negotiated`` is called for ahead, as sites do unless told otherwise; ``by_key`` not.
    """

    kind: str
    count: int
    clairvoyant_s: float
    resolved_s: float
    negotiated_s: float
    by_key_s: float
    mean_to_clairvoyant: float
    mean_to_resolved: float
    most_to_resolved: float
    by_key_to_resolved: float


@dataclass(frozen=True)
class GapTable:
    """The stored cases as a table; ``wrong`` names those of which another optimum was found than is stored."""

    rows: tuple[GapRow, ...]
    wrong: tuple[str, ...] = ()

    @classmethod
    def of(cls, cases: tuple[StoredCase, ...], wrong: tuple[str, ...] = ()) -> "GapTable":
        """A row for each kind and one for all."""
        kinds = list(dict.fromkeys(one.name.split(",")[0] for one in cases))
        rows = [_row(kind, [one for one in cases if one.name.startswith(f"{kind},")]) for kind in kinds]
        return cls((*rows, _row("all", list(cases))), wrong)

    @property
    def mean_to_resolved(self) -> float:
        """The mean gap over all cases, to be at most ``AIM``."""
        return self.rows[-1].mean_to_resolved

    def to_json(self) -> dict[str, object]:
        """The fields as ``json.dump`` takes them; units stand in the keys."""
        return asdict(self)

    def lines(self) -> list[str]:
        """The table in Markdown: mean waiting of a visit in s, and the gap of who negotiate."""
        text = [
            "stored cases at one compartment: who negotiate, beside optima that are proven, in the model's own times",
            "",
            "| robots x cars | cases | all known: s | solved anew at each arrival and ticket: s | negotiated: s "
            "| to all known | to solved anew: mean | most | negotiated by the key: s | to solved anew: mean |",
            "|---|---|---|---|---|---|---|---|---|---|",
        ]
        for row in self.rows:
            times = f"{row.clairvoyant_s:.1f} | {row.resolved_s:.1f} | {row.negotiated_s:.1f}"
            gaps = f"{row.mean_to_clairvoyant:.3f} | {row.mean_to_resolved:.3f} | {row.most_to_resolved:.3f}"
            by_key = f"{row.by_key_s:.1f} | {row.by_key_to_resolved:.3f}"
            text.append(f"| {row.kind} | {row.count} | {times} | {gaps} | {by_key} |")
        return text + [f"WRONG {line}" for line in self.wrong]


def _row(kind: str, cases: list[StoredCase]) -> GapRow:
    visits = sum(2 * len(one.case.visitors) for one in cases)
    gaps = [one.negotiated_ms / one.resolved_ms for one in cases]
    return GapRow(
        kind=kind,
        count=len(cases),
        clairvoyant_s=sum(one.clairvoyant_ms for one in cases) / 1e3 / visits,
        resolved_s=sum(one.resolved_ms for one in cases) / 1e3 / visits,
        negotiated_s=sum(one.negotiated_ms for one in cases) / 1e3 / visits,
        by_key_s=sum(one.by_key_ms for one in cases) / 1e3 / visits,
        mean_to_clairvoyant=sum(one.negotiated_ms / one.clairvoyant_ms for one in cases) / len(cases),
        mean_to_resolved=sum(gaps) / len(cases),
        most_to_resolved=max(gaps),
        by_key_to_resolved=sum(one.by_key_ms / one.resolved_ms for one in cases) / len(cases),
    )
