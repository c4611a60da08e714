"""The search: every option in the model, the cheapest that keeps the target in the plant, and its neighbours beside it.

Where the plant waits longer than the model, or less long, all options of the model are corrected by that and the
search goes on, until the cheapest that is left has kept the target in the plant.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import product
from math import ceil, inf
from typing import Any, NamedTuple, Protocol

from bus_sim.systems.car_park.design.days import DayPlan, Days, overload
from bus_sim.systems.car_park.design.measure import Mean, Outcome, Trial, fill_trial, modelled, modelled_fill, played
from bus_sim.systems.car_park.design.options import Option, Size, SizeError, option_of

#: A target that holds for so many of the days, 0 to 1, is kept: one day in twenty may be out of the ordinary.
KEPT_SHARE = 0.95
#: Seeds of the overload by which cars an hour are told.
OVERLOAD_SEEDS = (1, 2, 3)
#: Winners of the model that are played in the plant at most, one after the other.
MOST_WINNERS = 4
#: One more machine that brings less than this, 0 to 1, shows no bottleneck.
LEAST_GAIN = 0.02
KINDS = ("robots", "lifts", "compartments")


class ShownEngine(Protocol):
    """Plays trials and shows how far it is; results come as they are ready."""

    def __call__(self, what: str, function: Callable[[Any], Any], items: Sequence[Any], /) -> Iterator[Any]:
        """Results of ``function`` for all items; ``what`` is what the bar is called."""


class DesignTarget(NamedTuple):
    """What is asked for: 95 % of waits in, and of waits out, in s; filling and emptying in h. Endless: not asked."""

    p95_s: float
    fill_h: float = inf
    empty_h: float = inf


@dataclass
class Judged:
    """One option: what the model says of it, and the plant where it was played."""

    option: Option
    days: list[Outcome]
    overloads: list[Outcome]
    filled: Outcome
    in_plant: list[Outcome] = field(default_factory=list)

    @property
    def size(self) -> Size:
        """How many machines it has."""
        return self.option.size

    @property
    def p95_s(self) -> Mean:
        """The longer 95 % wait of a day, in the model, s."""
        return Mean.of([one.p95_s for one in self.days])

    @property
    def per_hour(self) -> Mean:
        """Cars an hour, in and out, under overload in the model."""
        return Mean.of([one.per_hour for one in self.overloads])

    def kept(self, target: DesignTarget, factor: float) -> int:
        """On how many days the model keeps the target, its waits multiplied by a factor."""
        return sum(one.p95_s * factor <= target.p95_s for one in self.days)

    def keeps(self, target: DesignTarget, factor: float) -> bool:
        """Whether the model keeps all of the target."""
        is_in_time = self.filled.fill_h <= target.fill_h and self.filled.empty_h <= target.empty_h
        return is_in_time and self.kept(target, factor) >= KEPT_SHARE * len(self.days)

    def keeps_in_plant(self, target: DesignTarget) -> bool:
        """Whether it was played in the plant and kept the target on each of its days."""
        return bool(self.in_plant) and all(one.p95_s <= target.p95_s and not one.faults for one in self.in_plant)


class Bottleneck(NamedTuple):
    """What holds the winner back: one more of this kind brings most cars an hour, as a part of those that there are.

    ``gains`` has each kind's, None where a site with one more cannot be made; ``busy`` shares of time under overload.
    """

    kind: str
    gains: dict[str, float | None]
    busy: dict[str, float]


@dataclass
class Design:
    """What was found: all options by their price, the winner if there is one, and what it was checked by."""

    target: DesignTarget
    judged: list[Judged]
    impossible: list[tuple[Size, str]]
    factor: float = 1.0
    winner: Judged | None = None
    bottleneck: Bottleneck | None = None
    unseen: list[Outcome] = field(default_factory=list)
    plant_overload: Outcome | None = None
    plant_fill: Outcome | None = None

    @property
    def unseen_kept(self) -> int:
        """On how many days that the search had not seen the winner kept its target in the plant."""
        return sum(one.p95_s <= self.target.p95_s and not one.faults for one in self.unseen)


@dataclass
class Search:
    """Options of one template by ranges of sizes; ``prices`` are those of a robot, a lift and a compartment."""

    template: str
    name: str
    ranges: tuple[Sequence[int], Sequence[int], Sequence[int]]
    prices: tuple[float, float, float]
    target: DesignTarget
    days: Days
    engine: ShownEngine
    plant_days: int = 1

    def run(self, *, has_plant: bool = True) -> Design:
        """Search, and play what was found unless ``has_plant`` is false."""
        options, impossible = self._options()
        design = Design(self.target, self._model(options), impossible)
        if not has_plant:
            design.winner = self._cheapest(design, set())
        else:
            self._play(design)
        if design.winner is not None:
            design.bottleneck = self._bottleneck(design.winner)
            if has_plant:
                self._check(design, design.winner)
        return design

    def _options(self) -> tuple[list[Option], list[tuple[Size, str]]]:
        options, impossible = [], []
        for size in sorted((Size(*one) for one in product(*self.ranges)), key=self._price):
            try:
                options.append(option_of(self.template, self.name, size))
            except SizeError as error:
                impossible.append((size, str(error)))
        return options, impossible

    def _price(self, size: Size) -> tuple[float, Size]:
        return sum(count * price for count, price in zip(size, self.prices, strict=True)), size

    # --- the model ---------------------------------------------------------------------------------------------

    def _model(self, options: Sequence[Option]) -> list[Judged]:
        """All options on all days, overloaded, and filled and emptied."""
        seen = {day.label for day in self.days.seen}
        trials = [Trial(one.size, one.text, day) for one in options for day in self._days_of(one)]
        found: dict[Size, list[Outcome]] = {one.size: [] for one in options}
        for outcome in self.engine("model", modelled, trials):
            found[outcome.size].append(outcome)
        fills = {one.size: one for one in self.engine("fill", modelled_fill, [(one.size, one.text) for one in options])}
        judged = []
        for option in options:
            outcomes = sorted(found[option.size], key=lambda one: one.label)
            days = [one for one in outcomes if one.label in seen]
            overloads = [one for one in outcomes if one.label not in seen]
            judged.append(Judged(option, days, overloads, fills[option.size]))
        return judged

    def _days_of(self, option: Option) -> list[DayPlan]:
        return [*self.days.seen, *(overload(option.site, seed) for seed in OVERLOAD_SEEDS)]

    def _cheapest(self, design: Design, without: set[Size]) -> Judged | None:
        """The cheapest that keeps the target in the model as it is corrected; of equal ones the shortest wait."""
        keeping = [one for one in design.judged if one.size not in without and one.keeps(self.target, design.factor)]
        return min(keeping, key=lambda one: (self._price(one.size)[0], one.p95_s.value), default=None)

    def _bottleneck(self, winner: Judged) -> Bottleneck:
        """Which kind's one more brings most cars an hour in the model, else who is busiest."""
        more: list[Option] = []
        for number in range(len(KINDS)):
            counts = list(winner.size)
            counts[number] += 1
            try:
                more.append(option_of(self.template, self.name, Size(*counts)))
            except SizeError:
                continue
        trials = [
            Trial(one.size, one.text, overload(winner.option.site, seed)) for one in more for seed in OVERLOAD_SEEDS
        ]
        per_hour: dict[Size, list[float]] = {}
        for outcome in self.engine("bottleneck", modelled, trials):
            per_hour.setdefault(outcome.size, []).append(outcome.per_hour)
        gains: dict[str, float | None] = dict.fromkeys(KINDS)
        for size, found in per_hour.items():
            kind = next(kind for kind, now, then in zip(KINDS, winner.size, size, strict=True) if now != then)
            gains[kind] = Mean.of(found).value / winner.per_hour.value - 1 if winner.per_hour.value else None
        busy = {kind: Mean.of([one.busy[kind] for one in winner.overloads]).value for kind in KINDS}
        best = max(KINDS, key=lambda kind: gains[kind] or 0.0)
        if (gains[best] or 0.0) < LEAST_GAIN:
            best = max(KINDS, key=lambda kind: busy[kind])
        return Bottleneck(best, gains, busy)

    # --- the plant ---------------------------------------------------------------------------------------------

    def _play(self, design: Design) -> None:
        """The cheapest in the plant, and the next after a correction, until one has kept the target there."""
        tried: set[Size] = set()
        for _ in range(MOST_WINNERS):
            found = self._cheapest(design, tried)
            if found is None or found.keeps_in_plant(self.target):
                design.winner = found
                break
            plans = self._hard_days(found)
            found.in_plant = list(
                self.engine("plant", played, [Trial(found.size, found.option.text, one) for one in plans])
            )
            design.factor = _factor(found)
            if found.keeps_in_plant(self.target):
                design.winner = found
                break
            tried.add(found.size)

    def _hard_days(self, judged: Judged) -> list[DayPlan]:
        """The hardest days that the model keeps the target on: the longest waits of the share that has to be kept."""
        within = sorted(judged.days, key=lambda one: one.p95_s)[: ceil(KEPT_SHARE * len(judged.days))]
        labels = {one.label for one in within[-self.plant_days :]}
        return [day for day in self.days.seen if day.label in labels]

    def _check(self, design: Design, winner: Judged) -> None:
        """Neighbours with one machine fewer and one more, the overload, the fill, and the days kept back."""
        plan = self._hard_days(winner)[-1]
        beside = [
            one for one in design.judged if sum(map(abs, _apart(one.size, winner.size))) == 1 and not one.in_plant
        ]
        trials = [Trial(one.size, one.option.text, plan) for one in beside]
        trials += [Trial(winner.size, winner.option.text, day) for day in self.days.unseen]
        trials.append(Trial(winner.size, winner.option.text, overload(winner.option.site, OVERLOAD_SEEDS[0])))
        if min(self.target.fill_h, self.target.empty_h) < inf:
            trials.append(fill_trial(winner.size, winner.option.text))
        unseen = {day.label for day in self.days.unseen}
        for outcome in self.engine("plant", played, trials):
            if outcome.size != winner.size:
                next(one for one in beside if one.size == outcome.size).in_plant.append(outcome)
            elif outcome.label in unseen:
                design.unseen.append(outcome)
            elif outcome.label.startswith("overload"):
                design.plant_overload = outcome
            else:
                design.plant_fill = outcome
        design.unseen.sort(key=lambda one: one.label)


def _apart(one: Size, other: Size) -> list[int]:
    return [a - b for a, b in zip(one, other, strict=True)]


def _factor(judged: Judged) -> float:
    """How much longer the plant's waits are than the model's on the same days."""
    by_label = {one.label: one.p95_s for one in judged.days}
    pairs = [(one.p95_s, by_label[one.label]) for one in judged.in_plant]
    factors = [plant / model for plant, model in pairs if model and plant < inf]
    return Mean.of(factors).value if factors else 1.0
