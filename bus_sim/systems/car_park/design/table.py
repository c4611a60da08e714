"""A design as a person reads it, and as JSON."""

from collections.abc import Callable, Iterator
from math import inf, isfinite

from bus_sim.systems.car_park.design.measure import Mean, Outcome
from bus_sim.systems.car_park.design.search import KINDS, Design, DesignTarget, Judged

HEAD = "robots lifts compartments  95 % wait, s  days kept  cars an hour   fill  empty, h"
ONE = {"robots": "robot", "lifts": "lift", "compartments": "compartment"}


def lines(design: Design) -> list[str]:
    """The table of all options, the winner, what holds it back, and what the plant said."""
    text = [HEAD, *(_row(one, design) for one in design.judged)]
    text += [f"{size}: cannot be built: {why}" for size, why in design.impossible]
    if design.winner is None:
        return [
            *text,
            *_plant_lines(design),
            f"none keeps {target_words(design.target)}; give wider ranges, or ask for less",
        ]
    text.append(f"fewest: {design.winner.size} for {target_words(design.target)}")
    text += [*_bottleneck_lines(design), *_plant_lines(design), *_check_lines(design)]
    return text


def target_words(target: DesignTarget) -> str:
    """What was asked for, in words."""
    parts = [f"95 % of waits within {target.p95_s:g} s"]
    parts += [f"filled in {target.fill_h:g} h"] if target.fill_h < inf else []
    parts += [f"emptied in {target.empty_h:g} h"] if target.empty_h < inf else []
    return ", ".join(parts)


def _row(one: Judged, design: Design) -> str:
    kept = f"{one.kept(design.target, design.factor)} of {len(one.days)}"
    mark = " <- fewest" if one is design.winner else ""
    robots, lifts, compartments = one.size
    return (
        f"{robots:>6}{lifts:>6}{compartments:>13}{_interval(one.p95_s, 0):>15}{kept:>11}"
        f"{_interval(one.per_hour, 1):>15}{one.filled.fill_h:>7.2f}{one.filled.empty_h:>7.2f}{mark}"
    )


def _interval(mean: Mean, digits: int) -> str:
    """A mean and its 95 % interval."""
    if not isfinite(mean.value):
        return "not all served"
    return f"{mean.value:.{digits}f} +- {mean.half:.{digits}f}" if mean.count > 1 else f"{mean.value:.{digits}f}"


def _bottleneck_lines(design: Design) -> list[str]:
    found = design.bottleneck
    if found is None:
        return []
    busy = ", ".join(f"{kind} {found.busy[kind]:.0%}" for kind in KINDS)
    more = ", ".join(
        f"{ONE[kind]} {'cannot be built' if gain is None else f'{gain:+.0%}'}" for kind, gain in found.gains.items()
    )
    return [f"bottleneck: {found.kind} (busy under overload: {busy}; cars an hour with one more: {more})"]


def _plant_lines(design: Design) -> Iterator[str]:
    for one in design.judged:
        for outcome in one.in_plant:
            same = next(day for day in one.days if day.label == outcome.label)
            kept = "kept" if outcome.p95_s <= design.target.p95_s and not outcome.faults else "missed"
            yield f"plant: {one.size}, {outcome.label}: {kept}; {_beside(outcome, same)}"
            yield from (f"plant: {one.size}, {outcome.label}: FAULT {fault}" for fault in outcome.faults)


def _beside(plant: Outcome, model: Outcome) -> str:
    """The plant's waits, and how far off the model was."""
    return ", ".join(
        f"{word} {read(plant):.0f} s (model {off(read(plant), read(model))})" for word, read in MEASURES.items()
    )


#: Waits by which the model is judged.
MEASURES: dict[str, Callable[[Outcome], float]] = {
    "in": lambda one: one.wait_in.mean_s,
    "out": lambda one: one.wait_out.mean_s,
    "95 %": lambda one: one.p95_s,
}


def off(plant: float, model: float) -> str:
    """How far a figure of the model is from the plant's, in per cent."""
    return f"{model / plant - 1:+.0%}" if plant and isfinite(plant) and isfinite(model) else "-"


def _check_lines(design: Design) -> Iterator[str]:
    winner, plant = design.winner, design.plant_overload
    if design.factor != 1.0:
        yield f"waits of the model are taken {design.factor:.2f} times for what the plant said"
    if winner is not None and plant is not None:
        model = next(one for one in winner.overloads if one.label == plant.label)
        yield f"plant: overload: {plant.per_hour:.1f} cars an hour (model {off(plant.per_hour, model.per_hour)})"
    if winner is not None and design.plant_fill is not None:
        plant, model = design.plant_fill, winner.filled
        fill, empty = off(plant.fill_h, model.fill_h), off(plant.empty_h, model.empty_h)
        yield f"plant: filled in {plant.fill_h:.2f} h (model {fill}), emptied in {plant.empty_h:.2f} h (model {empty})"
    if design.unseen:
        worst = max(design.unseen, key=lambda one: one.p95_s)
        told = f"kept on {design.unseen_kept} of {len(design.unseen)}; worst {worst.label} with {worst.p95_s:.0f} s"
        yield f"days that the search had not seen, in the plant: {told}"


def to_json(design: Design) -> dict[str, object]:
    """The same as values; units in the keys, None for what is endless or was not asked."""
    winner = design.winner
    return {
        "target": {f"{key}": _finite(value) for key, value in design.target._asdict().items()},
        "options": [_judged_json(one, design) for one in design.judged],
        "impossible": [{**size._asdict(), "why": why} for size, why in design.impossible],
        "factor": design.factor,
        "winner": None if winner is None else winner.size._asdict(),
        "bottleneck": None if design.bottleneck is None else design.bottleneck._asdict(),
        "unseen": [_outcome_json(one) for one in design.unseen],
        "unseen_kept": design.unseen_kept,
        "plant_overload": None if design.plant_overload is None else _outcome_json(design.plant_overload),
        "plant_fill": None if design.plant_fill is None else _outcome_json(design.plant_fill),
    }


def _judged_json(one: Judged, design: Design) -> dict[str, object]:
    return {
        **one.size._asdict(),
        "p95_s": [_finite(one.p95_s.value), one.p95_s.half],
        "per_hour": [one.per_hour.value, one.per_hour.half],
        "kept": one.kept(design.target, design.factor),
        "days": [_outcome_json(day) for day in one.days],
        "filled": _outcome_json(one.filled),
        "in_plant": [_outcome_json(day) for day in one.in_plant],
    }


def _outcome_json(one: Outcome) -> dict[str, object]:
    return {
        "day": one.label,
        "wait_in_s": [one.wait_in.mean_s, one.wait_in.p95_s],
        "wait_out_s": [one.wait_out.mean_s, one.wait_out.p95_s],
        "per_hour": one.per_hour,
        "fill_h": one.fill_h,
        "empty_h": one.empty_h,
        "left": one.left,
        "faults": list(one.faults),
    }


def _finite(value: float) -> float | None:
    return value if isfinite(value) else None
