"""Seeds with a machine that bids and does not do what it wins, beside the same seeds without that machine."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from statistics import fmean

from bus_sim.campaign.judges import Judges
from bus_sim.engine import on_cores
from bus_sim.options import RunOptions
from bus_sim.run import run_until
from bus_sim.sites import find_site
from bus_sim.systems.registry import simulated_of
from bus_sim.systems.stranger import Stranger
from bus_sim.systems.system import Coming
from bus_sim.virtual_time import VirtualTimeLoop, run_on
from onboard.contract.messages import Halted
from onboard.core.site import Site

#: The mean wait of a seed may be so much longer than without the stranger, s.
MOST_LONGER_S = 30.0
#: Looks whether it is over, us.
STEP_US = 1_000_000


@dataclass(frozen=True)
class StrangerPlan:
    """What all seeds have in common; ``limit_s`` is the longest run."""

    site: str
    how: Stranger
    demand: Coming | None
    limit_s: float


@dataclass(frozen=True)
class StrangerOutcome:
    """What came of one run."""

    served: int
    told: int
    waiting: int
    #: What each who was served waited in all, s, None for the others; empty where a system does not tell.
    waits_s: tuple[float | None, ...]
    broken: tuple[str, ...]
    #: Whether a machine said on the bus that the stranger needs a person.
    is_person_asked: bool = False


@dataclass(frozen=True)
class Pair:
    """One seed: with the stranger, and without that machine."""

    seed: int
    strange: StrangerOutcome
    without: StrangerOutcome

    @property
    def longer_s(self) -> float:
        """By how much a wait is longer, in the mean of coming in and going out of those served in both runs."""
        pairs = zip(self.strange.waits_s, self.without.waits_s, strict=True)
        longer = [(one - other) / 2 for one, other in pairs if one is not None and other is not None]
        return fmean(longer) if longer else 0.0

    @property
    def is_good(self) -> bool:
        """Whether everybody was served as without it, soon enough, and nothing broke."""
        is_told = not self.strange.waiting or self.strange.is_person_asked
        served = self.strange.served >= self.without.served and is_told
        return served and not self.strange.broken and self.longer_s <= MOST_LONGER_S

    def line(self) -> str:
        """Served, told and waiting with the stranger, and the change of the mean wait in s, as one line."""
        one, other = self.strange, self.without
        told = f"served {one.served} ({other.served} without it), told why {one.told}, waiting {one.waiting}"
        head = f"{'' if self.is_good else 'FAILED '}seed {self.seed}: {told}, mean wait"
        head = head.replace("mean wait", "a person is asked for, mean wait") if one.is_person_asked else head
        return f"{head} {self.longer_s:+.1f} s; {'; '.join(one.broken)}".rstrip("; ")


def play_pairs(plan: StrangerPlan, seeds: range, jobs: int) -> Iterator[Pair]:
    """All seeds; each is played twice."""
    return on_cores(jobs, partial(play_pair, plan), seeds)


def play_pair(plan: StrangerPlan, seed: int) -> Pair:
    """Play one seed with the stranger, and again with that machine left out."""
    site = find_site(plan.site)
    return Pair(seed, _play(plan, site, seed, strange=True), _play(plan, site, seed, strange=False))


def _play(plan: StrangerPlan, site: Site, seed: int, *, strange: bool) -> StrangerOutcome:
    loop = VirtualTimeLoop()
    return run_on(loop, _run(plan, site, seed, loop, strange=strange))


async def _run(plan: StrangerPlan, site: Site, seed: int, loop: VirtualTimeLoop, *, strange: bool) -> StrangerOutcome:
    system = simulated_of(site)
    target = next(one for one in site.machines.values() if one.kind is system.worker)
    without = frozenset() if strange else frozenset({target.name})
    stage = system.stage(site, RunOptions(seed=seed, without=without, demand=plan.demand), loop)
    if strange:
        stage.run.factories = system.stranger(site, target.node_id, plan.how)
    # A device bus has several nodes, so that a frame is acknowledged though the controller is off.
    stage.run.devices[target.node_id].attach("terminal block", None)
    judges, asked = Judges(stage.run, disturbed=False), list[Halted]()
    stage.run.observers.append(lambda message, _: asked.append(message) if isinstance(message, Halted) else None)
    try:
        stage.run.start()
        await run_until(
            stage.run,
            lambda: stage.is_broken or judges.is_unsafe or stage.is_over,
            round(plan.limit_s * 1e6),
            STEP_US,
        )
    finally:
        stage.run.close()
    tally = stage.tally()
    waits = stage.waits_s()
    broken = (*stage.violations(), *(judges.finish()[0]))
    return StrangerOutcome(tally.served, tally.told, tally.waiting, waits, broken, _asks(asked, target.node_id))


def _asks(words: list[Halted], node: int) -> bool:
    return any(word.machine == node and word.needs_person for word in words)
