"""Small cases: our protocol and others beside the exact optimum, on the abstract problem and in the plant."""

from collections.abc import Callable
from dataclasses import asdict, dataclass

from bus_sim.systems.car_park.compare.optimum import least_waiting_ms
from bus_sim.systems.car_park.compare.plays import MIP, POLICIES, play
from bus_sim.systems.car_park.compare.policies import AnyFirst, NearestFirst
from bus_sim.systems.car_park.compare.small_case import Case, Rule, any_robot, earliest_finish, nearest, play_case
from bus_sim.systems.car_park.demand import Demand
from onboard.core.site import Site

#: Cars of a case, each in and out: six tasks.
CARS = 3
#: Intervals of arrivals and of departures, mean and deviation in s, and the shortest stay: close enough to wait.
IN_S, OUT_S, STAY_S = (45.0, 20.0), (60.0, 30.0), 60.0

#: What decides on the abstract problem. One compartment tells one task at a time: no joint choice is to be made there.
RULES: dict[str, Callable[[int], Rule]] = {
    MIP: lambda _: earliest_finish,
    NearestFirst.name: lambda _: nearest,
    AnyFirst.name: any_robot,
}


@dataclass(frozen=True)
class SmallCase:
    """One case: mean waiting of a visit (s) in the optimum, and by policy on the abstract problem and in the plant."""

    seed: int
    optimum_s: float
    abstract_s: dict[str, float]
    plant_s: dict[str, float]


def small_demand(seed: int) -> Demand:
    """Who comes in the case of a seed."""
    return Demand.by_mean(*IN_S, seed, count=CARS, out=OUT_S, min_stay_s=STAY_S)


def solve_case(site: Site, seed: int) -> SmallCase:
    """The optimum of one case and what came of it otherwise. Raises ``OptimumError`` and ``ValueError``.

    Raises ``RuntimeError`` where a policy left somebody waiting.
    """
    demand = small_demand(seed)
    case = Case.of(site, demand, seed)
    visits = sum(1 + (stay.departure_us is not None) for stay in demand.stays)
    plant_s = {}
    for policy in POLICIES:
        one = play(site, demand, policy, seed)
        if one.left or one.faults:
            raise RuntimeError(f"seed {seed}, {policy}: {one.left} customers were not served, faults {one.faults}")
        plant_s[policy] = sum(one.in_us + one.out_us) / 1e6 / visits
    abstract_s = {name: play_case(case, rule(seed)) / 1e3 / visits for name, rule in RULES.items()}
    return SmallCase(seed, least_waiting_ms(case) / 1e3 / visits, abstract_s, plant_s)


@dataclass(frozen=True)
class SmallTable:
    """All cases of one site that are small enough for the exact optimum."""

    site: str
    cases: tuple[SmallCase, ...]

    def to_json(self) -> dict[str, object]:
        """The fields as ``json.dump`` takes them; units stand in the keys."""
        return asdict(self)

    def lines(self) -> list[str]:
        """The table in Markdown: mean waiting of a visit, and its ratio to the optimum."""
        count = len(self.cases)
        least_s = sum(one.optimum_s for one in self.cases) / count
        text = [
            f"{self.site}: {count} small cases of {CARS} cars in and out; the optimum knows everybody beforehand",
            "",
            "| who decides | abstract: mean, s | to optimum | in the plant: mean, s | to optimum |",
            "|---|---|---|---|---|",
            f"| exact optimum | {least_s:.1f} | 1.00 | | |",
        ]
        for policy in POLICIES:
            cells = [policy]
            for known in ([one.abstract_s for one in self.cases], [one.plant_s for one in self.cases]):
                mean_s = sum(one[policy] for one in known) / count if policy in known[0] else None
                cells += ["", ""] if mean_s is None else [f"{mean_s:.1f}", f"{mean_s / least_s:.2f}"]
            text.append(f"| {' | '.join(cells)} |")
        return text
