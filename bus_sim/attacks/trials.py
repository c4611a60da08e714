"""Attacks as trials: each is played on a site under a seed, and judged by the plant's oracle and by what became of all.

Harmless is an attack after which nothing had happened to any body, nobody was halted or held for good, and everybody
was served or told why. Beside it stands whether it was named, and whether service was back in time (watch.py).
"""

import math
import random
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from functools import partial
from typing import Any

from bus_sim.attacks.catalogue import ATTACKS
from bus_sim.attacks.watch import BACK_US, AttackWatch
from bus_sim.campaign.report import FAILURES, RunVerdict, TrialReport
from bus_sim.campaign.trial import play
from bus_sim.demand import DemandError
from bus_sim.engine import on_cores
from bus_sim.faults.injection import Injection
from bus_sim.faults.scenario import FaultScenario
from bus_sim.sites import find_site
from bus_sim.systems.registry import simulated_of
from bus_sim.systems.system import Coming
from onboard.contract.constants import MAX_NODE_ID
from onboard.core.site import Site

#: The attacker's node-ID where the site asks for no seals, and no machine has it.
STRANGER = 240
#: Right words for who speaks with a machine's own keys: that machine hears itself, or others do not believe it.
_OF_INSIDERS = frozenset(
    {"DUPLICATE_NODE_ID", "RIGHT_CLAIMED", "NOT_THE_HOLDER", "NOT_OF_KIND", "NOT_AUTHORISED", "REPLAYED"}
)


class AttackVerdict(StrEnum):
    """What came of an attack, the worst first; all but the first are harmless."""

    HARMFUL = "NOT HARMLESS"
    LATE_BACK = "back late"
    NOT_NAMED = "not named"
    LATE_NAMED = "named late"
    SILENT = "said nothing"
    WELL = "all well"


#: What misses a bar.
MISSES = (AttackVerdict.HARMFUL, AttackVerdict.LATE_BACK, AttackVerdict.NOT_NAMED, AttackVerdict.LATE_NAMED)


@dataclass(frozen=True)
class TrialSettings:
    """What all attacks of a command have in common; ``limit_s`` None: by the site's orders.

    ``node`` None: ``stranger_of`` the site; where it requires seals one of its machines, drawn by attack and seed.
    ``is_insider``: the attacker has the keys of that machine, too.
    """

    site: str
    node: int | None = None
    limit_s: float | None = None
    demand: Coming | None = None
    is_insider: bool = False
    #: The first and the last moment at which an attack may begin, s after power-up; None: by the site's orders.
    begin_s: tuple[float, float] | None = None


@dataclass(frozen=True)
class AttackResult:
    """What came of one attack under one seed; ``*_s`` in s, None: never. ``said``: the attacker's frames on the bus."""

    attack: str
    seed: int
    node: int
    verdict: AttackVerdict
    run: RunVerdict
    why: str
    said: int = 0
    named: str = ""
    named_s: float | None = None
    back_s: float | None = None
    served: int = 0
    told: int = 0
    waiting: int = 0
    longest_wait_s: float = 0.0
    violations: tuple[str, ...] = ()
    halted: tuple[str, ...] = ()
    error: str = ""

    @property
    def is_harmless(self) -> bool:
        """Whether the site got over it."""
        return self.verdict is not AttackVerdict.HARMFUL

    def to_json(self) -> dict[str, object]:
        """As ``json.dump`` takes it; the units are in the keys."""
        return asdict(self)

    @classmethod
    def from_json(cls, given: Mapping[str, Any]) -> "AttackResult":
        """What ``to_json`` gave. Raises ``ValueError`` and ``TypeError`` for anything else."""
        verdict, run = AttackVerdict(given["verdict"]), RunVerdict(given["run"])
        lines = {key: tuple(given[key]) for key in ("violations", "halted")}
        return cls(**{**given, **lines, "verdict": verdict, "run": run})


def stranger_of(site: Site) -> int:
    """``STRANGER``, or where a machine has that number the next that none has, going round at 250.

    Raises ``DemandError`` where each number is a machine's.
    """
    numbers = (*range(STRANGER, MAX_NODE_ID + 1), *range(1, STRANGER))
    free: int | None = next((number for number in numbers if number not in site.machines), None)
    if free is None:
        raise DemandError(f"{site.name}: each number from 1 to {MAX_NODE_ID} is a machine's, and leaves none to attack")
    return free


def scenario_of(plan: TrialSettings, site: Site, attack: str, seed: int) -> FaultScenario:
    """The attack as a scenario; always the same for the same arguments."""
    chance = random.Random(f"attack:{site.name}:{attack}:{seed}")
    system = simulated_of(site)
    limit_s = plan.limit_s or math.ceil(system.patience_s(site, plan.demand, seed))
    begin_s = plan.begin_s or system.attacked_s(site, plan.demand, seed)
    at_s, for_s = round(chance.uniform(*begin_s), 3), ATTACKS[attack].for_s
    is_of_site = plan.is_insider or site.seals == "required"
    node = plan.node or (chance.choice(sorted(site.machines)) if is_of_site else stranger_of(site))
    given: dict[str, str | int | float] = {"name": attack, "at_s": at_s, "for_s": for_s, "node": node, "seed": seed}
    given["keys"] = "stolen" if plan.is_insider else "none"
    return FaultScenario(plan.site, seed, limit_s, plan.demand, (Injection("attack", given),))


def run_attack(plan: TrialSettings, number: tuple[str, int]) -> AttackResult:
    """Play one attack under one seed."""
    attack, seed = number
    site = find_site(plan.site)
    scenario = scenario_of(plan, site, attack, seed)
    (what,) = scenario.faults
    assert isinstance(what, Injection)
    names = ATTACKS[attack].names | (_OF_INSIDERS if plan.is_insider else frozenset())
    watch = AttackWatch(what, names, fills_bus=ATTACKS[attack].fills_bus)
    report = play(site, scenario, watch=watch)
    return _judged(attack, seed, what.count("node"), report, watch)


def _judged(attack: str, seed: int, node: int, report: TrialReport, watch: AttackWatch) -> AttackResult:
    is_harmful = report.verdict in (*FAILURES, RunVerdict.HELD) or bool(report.halted)
    harm = report.halted[0] if report.halted and not report.violations else report.why()
    back, named = _seconds(watch.back_us), _seconds(watch.named_us)
    verdicts = (
        (is_harmful, AttackVerdict.HARMFUL, f"{report.verdict.value}: {harm}"),
        (not watch.is_back_in_time, AttackVerdict.LATE_BACK, f"back after {back} s, not within {BACK_US // 10**6}"),
        (not watch.said, AttackVerdict.SILENT, ""),
        (watch.named is None, AttackVerdict.NOT_NAMED, "no word on the bus names it"),
        (bool(watch.named) and not watch.is_named_in_time, AttackVerdict.LATE_NAMED, f"named after {named} s"),
        (True, AttackVerdict.WELL, ""),
    )
    found = [(verdict, why) for holds, verdict, why in verdicts if holds]
    return AttackResult(
        attack,
        seed,
        node,
        found[0][0],
        report.verdict,
        "; ".join(why for _, why in found if why) if watch.said else found[0][1],
        watch.said,
        watch.named or "",
        named,
        back,
        report.served,
        report.told,
        report.waiting,
        report.longest_wait_s,
        report.violations,
        report.halted,
        report.error,
    )


def _seconds(time_us: int | None) -> float | None:
    return None if time_us is None else round(time_us / 1e6, 1)


def run_attacks(plan: TrialSettings, numbers: Sequence[tuple[str, int]], jobs: int) -> Iterator[AttackResult]:
    """Attacks under seeds, as their results come in."""
    return on_cores(jobs, partial(run_attack, plan), numbers)
