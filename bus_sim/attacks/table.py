"""Results of attacks as a table and as JSON."""

from collections import Counter
from collections.abc import Sequence

from bus_sim.attacks.trials import MISSES, AttackResult, AttackVerdict, TrialSettings

#: In the order of the table's columns: the best first.
_COLUMNS = tuple(reversed(AttackVerdict))


def lines(head: str, attacks: Sequence[str], results: Sequence[AttackResult]) -> list[str]:
    """A row for each attack with its longest times, then a line for each run that misses a bar, then the sum."""
    came = Counter((result.attack, result.verdict) for result in results)
    used = [column for column in _COLUMNS if any(verdict is column for _, verdict in came)]
    width = max(24, len(head) + 2)
    counts = "".join(f"{column.value:>14}" for column in used)
    told = [f"{head:<{width}}{'harmless':>10}{counts}{'back s':>8}{'named s':>9}  as"]
    for attack in attacks:
        mine = [result for result in results if result.attack == attack]
        if mine:
            counts = "".join(f"{came[attack, column] or '.':>14}" for column in used)
            told.append(f"{attack:<{width}}{_harmless(mine):>10}{counts}{_longest(mine)}")
    told += [
        f"{result.attack}, seed {result.seed}, node {result.node}: {result.verdict.value}: {result.why}"
        for result in results
        if result.verdict in MISSES
    ]
    return [*told, f"{_harmless(results)} harmless; {', '.join(_sums(results))}"]


def _harmless(results: Sequence[AttackResult]) -> str:
    return f"{sum(result.is_harmless for result in results)}/{len(results)}"


def _sums(results: Sequence[AttackResult]) -> list[str]:
    counts = Counter(result.verdict for result in results)
    return [f"{verdict.value} {counts[verdict]}" for verdict in _COLUMNS if counts[verdict]]


def _longest(results: Sequence[AttackResult]) -> str:
    """Of those that were said and named: how long at most until service was back and until the word, and the words."""
    said = [result for result in results if result.said]
    back = [result.back_s for result in said if result.back_s is not None]
    named = [result.named_s for result in said if result.named_s is not None]
    words = Counter(result.named for result in said if result.named)
    shown = (f"{max(found):.1f}" if found else "." for found in (back, named))
    return "{:>8}{:>9}  ".format(*shown) + ", ".join(sorted(words))


def to_json(plan: TrialSettings, results: Sequence[AttackResult]) -> dict[str, object]:
    """The plan and one entry a run, as ``json.dump`` takes them; units stand in the keys."""
    runs = [{**result.to_json(), "harmless": result.is_harmless} for result in results]
    return {"site": plan.site, "node": plan.node, "insider": plan.is_insider, "runs": runs}
