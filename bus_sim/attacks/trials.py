"""Attacks as trials: each is played on a site under a seed, and judged by the plant's oracle and by what became of all.

Harmless is an attack after which nothing had happened to any body, nobody was halted or held for good, and everybody
was served or told why.
"""

import math
import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial

from bus_sim.attacks.catalogue import ATTACKS
from bus_sim.campaign.engine import on_cores
from bus_sim.campaign.report import FAILURES, Report
from bus_sim.campaign.systems import SYSTEMS, patience_s, span_s, with_orders
from bus_sim.campaign.trial import play
from bus_sim.faults.injection import Injection
from bus_sim.faults.scenario import Arrivals, Scenario
from bus_sim.sites import find_site
from bus_sim.systems.orders import Orders
from onboard.core.site import Site

#: When an attack on a car park begins, s after power-up: cars are coming, and some stand in the park.
PARK_SPAN_S = (60.0, 420.0)


@dataclass(frozen=True)
class Plan:
    """What all attacks of a command have in common; ``limit_s`` None: by the site's orders."""

    site: str
    node: int = 240
    limit_s: float | None = None
    arrivals: Arrivals = field(default_factory=Arrivals)
    orders: Orders | None = None


@dataclass(frozen=True)
class Result:
    """What came of one attack under one seed."""

    attack: str
    seed: int
    report: Report

    @property
    def is_harmless(self) -> bool:
        """Whether the site got over it."""
        return self.report.verdict not in FAILURES and not self.report.halted

    def why(self) -> str:
        """One line for a person."""
        return self.report.halted[0] if self.report.halted and not self.report.violations else self.report.why()


def scenario_of(plan: Plan, site: Site, attack: str, seed: int) -> Scenario:
    """The attack as a scenario; always the same for the same arguments."""
    chance = random.Random(f"attack:{site.name}:{attack}:{seed}")
    limit_s, span = plan.limit_s or 7_200.0, PARK_SPAN_S
    if site.system in SYSTEMS:
        drawn = with_orders(site, plan.orders, seed)
        limit_s, span = plan.limit_s or math.ceil(patience_s(drawn)), span_s(drawn)
    at_s, for_s = round(chance.uniform(*span), 3), ATTACKS[attack].for_s
    what = Injection("attack", {"name": attack, "at_s": at_s, "for_s": for_s, "node": plan.node, "seed": seed})
    return Scenario(plan.site, seed, limit_s, plan.arrivals, (what,), plan.orders)


def run_attack(plan: Plan, number: tuple[str, int]) -> Result:
    """Play one attack under one seed."""
    attack, seed = number
    site = find_site(plan.site)
    return Result(attack, seed, play(site, scenario_of(plan, site, attack, seed)))


def run_attacks(plan: Plan, attacks: Sequence[str], seeds: Sequence[int], jobs: int) -> Iterator[Result]:
    """All attacks under all seeds, as their results come in."""
    return on_cores(jobs, partial(run_attack, plan), [(attack, seed) for attack in attacks for seed in seeds])
