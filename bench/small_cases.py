"""The forty small cases with their proven optima, made anew.

    python bench/small_cases.py [--write FILE | --plant]

Of each kind the first twenty seeds of which the clairvoyant optimum and all those on the way are proven within
``MOST_LOOKS`` looks. The ways are those of the shipped site ``small``, its places nearest to the bay, and for three
robots a third one that begins where the first does. Prints the table of ``bus-sim compare --parts stored``.
``--plant`` plays those of two robots, which are the site's own, in the plant instead. Deterministic.
"""

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from bus_sim.sites import find_site
from bus_sim.systems.car_park.compare import plans
from bus_sim.systems.car_park.compare.plays import MIP, play
from bus_sim.systems.car_park.compare.small_case import Case
from bus_sim.systems.car_park.compare.stored_cases import GapTable, StoredCase, as_text, stored_cases
from bus_sim.systems.car_park.demand import Demand

SITE = "small"
#: Cases of each kind, and the seeds among which they are looked for.
CASES, SEEDS = 20, range(1, 200)
#: Effort for one optimum: about ten seconds.
MOST_LOOKS = 300_000


class Kind(NamedTuple):
    """Robots, cars, places; intervals of arrivals and of departures, mean and deviation, and the shortest stay, s."""

    robots: int
    cars: int
    places: int
    in_s: tuple[float, float]
    out_s: tuple[float, float]
    stay_s: float

    @property
    def name(self) -> str:
        """As it is told: robots x cars."""
        return f"{self.robots}x{self.cars}"

    def demand(self, seed: int) -> Demand:
        """Who comes in the case of a seed."""
        return Demand.by_mean(*self.in_s, seed, count=self.cars, out=self.out_s, min_stay_s=self.stay_s)

    def case(self, seed: int) -> Case:
        """The case of a seed, its ways cut to the places and robots of this kind."""
        whole = Case.of(find_site(SITE), self.demand(seed), seed)
        robots = [whole.homes[number % len(whole.homes)] for number in range(self.robots)]
        kept = [*range(self.places), whole.bay, *robots]
        return replace(
            whole,
            places=whole.places[: self.places],
            bay=self.places,
            homes=tuple(range(self.places + 1, self.places + 1 + self.robots)),
            way_ms=tuple(tuple(whole.way_ms[here][there] for there in kept) for here in kept),
        )


KINDS = (Kind(2, 4, 8, (45.0, 20.0), (60.0, 30.0), 240.0), Kind(3, 6, 6, (75.0, 20.0), (80.0, 30.0), 300.0))


def solved(kind: Kind) -> list[StoredCase]:
    """The first cases of a kind that are proven."""
    found: list[StoredCase] = []
    for seed in SEEDS:
        if len(found) == CASES:
            break
        try:
            found.append(StoredCase.solved(f"{kind.name}, seed {seed}", seed, kind.case(seed)))
            print(f"{found[-1].name}: {found[-1].clairvoyant_ms} ms", file=sys.stderr, flush=True)
        except plans.PlanError as error:
            print(f"{kind.name}, seed {seed}, left out: {error}", file=sys.stderr, flush=True)
    return found


def play_in_the_plant(kind: Kind) -> None:
    """The stored cases of a kind with machines, bus and doors; what is waited beside the stored optima."""
    to_resolved, to_clairvoyant = [], []
    for case in stored_cases():
        if not case.name.startswith(f"{kind.name},"):
            continue
        one = play(find_site(SITE), kind.demand(case.seed), MIP, case.seed)
        waited_ms = sum(one.in_us + one.out_us) / 1e3
        to_resolved.append(waited_ms / case.resolved_ms)
        to_clairvoyant.append(waited_ms / case.clairvoyant_ms)
        print(f"{case.name}: {to_resolved[-1]:.3f} times the case solved anew, {one.bounds.line()}", flush=True)
    for what, found in (("the case solved anew", to_resolved), ("all known", to_clairvoyant)):
        print(f"{kind.name} in the plant: {sum(found) / len(found):.3f} times {what}, {max(found):.3f} at most")


def main() -> None:
    """Solve, tell, and write if asked to."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", type=Path, metavar="FILE", help="write the cases there")
    parser.add_argument("--plant", action="store_true", help="play the stored cases of two robots in the plant instead")
    args = parser.parse_args()
    if args.plant:
        play_in_the_plant(KINDS[0])
        return
    plans.MOST_LOOKS = MOST_LOOKS
    kinds = {kind.name: solved(kind) for kind in KINDS}
    print("\n".join(GapTable.of(tuple(one for cases in kinds.values() for one in cases)).lines()))
    if args.write is not None:
        args.write.write_text(as_text(kinds), encoding="utf-8")


if __name__ == "__main__":
    main()
