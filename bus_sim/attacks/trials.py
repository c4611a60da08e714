"""Attacks as trials: each is played on a site under a seed, and judged by the plant's oracle and by what became of all.

Harmless is an attack after which nothing had happened to any body, nobody was halted or held for good, and everybody
was served or told why.
"""

import math
import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from bus_sim.attacks.catalogue import ATTACKS
from bus_sim.campaign.engine import on_cores
from bus_sim.campaign.report import FAILURES, TrialReport
from bus_sim.campaign.trial import play
from bus_sim.faults.injection import Injection
from bus_sim.faults.scenario import FaultScenario
from bus_sim.sites import find_site
from bus_sim.systems.registry import simulated_of
from bus_sim.systems.system import Coming
from onboard.core.site import Site


@dataclass(frozen=True)
class TrialSettings:
    """What all attacks of a command have in common; ``limit_s`` None: by the site's orders."""

    site: str
    node: int = 240
    limit_s: float | None = None
    demand: Coming | None = None


@dataclass(frozen=True)
class AttackResult:
    """What came of one attack under one seed."""

    attack: str
    seed: int
    report: TrialReport

    @property
    def is_harmless(self) -> bool:
        """Whether the site got over it."""
        return self.report.verdict not in FAILURES and not self.report.halted

    def why(self) -> str:
        """One line for a person."""
        return self.report.halted[0] if self.report.halted and not self.report.violations else self.report.why()


def scenario_of(plan: TrialSettings, site: Site, attack: str, seed: int) -> FaultScenario:
    """The attack as a scenario; always the same for the same arguments."""
    chance = random.Random(f"attack:{site.name}:{attack}:{seed}")
    system = simulated_of(site)
    limit_s = plan.limit_s or math.ceil(system.patience_s(site, plan.demand, seed))
    at_s, for_s = round(chance.uniform(*system.attacked_s(site, plan.demand, seed)), 3), ATTACKS[attack].for_s
    what = Injection("attack", {"name": attack, "at_s": at_s, "for_s": for_s, "node": plan.node, "seed": seed})
    return FaultScenario(plan.site, seed, limit_s, plan.demand, (what,))


def run_attack(plan: TrialSettings, number: tuple[str, int]) -> AttackResult:
    """Play one attack under one seed."""
    attack, seed = number
    site = find_site(plan.site)
    return AttackResult(attack, seed, play(site, scenario_of(plan, site, attack, seed)))


def run_attacks(plan: TrialSettings, attacks: Sequence[str], seeds: Sequence[int], jobs: int) -> Iterator[AttackResult]:
    """All attacks under all seeds, as their results come in."""
    return on_cores(jobs, partial(run_attack, plan), [(attack, seed) for attack in attacks for seed in seeds])
