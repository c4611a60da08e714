"""A campaign's results as a table and as JSON: faults injected by kind, against what came of the runs with them."""

from collections import Counter
from collections.abc import Sequence

from bus_sim.campaign.report import RunVerdict, TrialReport, kinds_of
from bus_sim.campaign.runner import CampaignSettings, TrialResult

#: In the order of the table's columns.
COLUMNS = (
    RunVerdict.SERVED,
    RunVerdict.TOLD,
    RunVerdict.HELD,
    RunVerdict.DELAYED,
    RunVerdict.LATE,
    RunVerdict.STOPPED,
    RunVerdict.APART,
    RunVerdict.NOT_LIVE,
    RunVerdict.NOT_SERVED,
    RunVerdict.HUNG,
    RunVerdict.CRASHED,
    RunVerdict.VIOLATION,
)


def lines(results: Sequence[TrialResult]) -> list[str]:
    """The table, then a line for every failure. A run counts in the row of every kind that it had."""
    injected: Counter[str] = Counter()
    came: Counter[tuple[str, RunVerdict]] = Counter()
    for result in results:
        kinds = kinds_of(result.report.scenario) or Counter({"(no fault)": 0})
        injected += kinds
        for kind in kinds:
            came[kind, result.report.verdict] += 1
        came["all runs", result.report.verdict] += 1
    rows = [*sorted({kind for kind, _ in came} - {"all runs"}), "all runs"]
    injected["all runs"] = sum(injected.values())
    head = f"{'faults':<18}{'injected':>9}" + "".join(f"{column.value:>16}" for column in COLUMNS)
    text = [head]
    for row in rows:
        counts = "".join(f"{came[row, column] or '.':>16}" for column in COLUMNS)
        text.append(f"{row:<18}{injected[row]:>9}{counts}")
    return text + _customers(results) + _recovery(results) + _failures(results)


def who(reports: Sequence[TrialReport]) -> str:
    """Whom the reports count: customers, or what a system calls its orders."""
    return reports[0].who if reports else TrialReport.who


def _customers(results: Sequence[TrialResult]) -> list[str]:
    reports = [result.report for result in results]
    served, told = sum(one.served for one in reports), sum(one.told for one in reports)
    full, waiting = sum(one.full for one in reports), sum(one.waiting for one in reports)
    everybody = served + told + waiting
    share = full / everybody if everybody else 0.0
    hours = sum(one.simulated_s for one in reports) / 3600
    refused = (
        f"; refused because the park was full: {full} ({100 * share:.1f} %)" if who(reports) == "customers" else ""
    )
    return [
        f"{len(reports)} runs, {hours:.1f} simulated hours, {everybody} {who(reports)}: served {served}, "
        f"told why {told}, left waiting {waiting}{refused}"
    ]


def longest_recovery(results: Sequence[TrialResult]) -> dict[str, tuple[int, int]]:
    """By measure: the longest time of all runs, us, and in how many runs it was seen."""
    found: dict[str, tuple[int, int]] = {}
    for result in results:
        for measure, us in result.report.recovery:
            longest_us, runs = found.get(measure, (0, 0))
            found[measure] = (max(longest_us, us), runs + 1)
    return dict(sorted(found.items()))


def _recovery(results: Sequence[TrialResult]) -> list[str]:
    return [
        f"  {measure:<22} at most {us / 1e6:8.3f} s (seen in {runs} runs)"
        for measure, (us, runs) in longest_recovery(results).items()
    ]


def _failures(results: Sequence[TrialResult]) -> list[str]:
    text = []
    for result in results:
        if result.shrunk is None:
            continue
        faults = "; ".join(str(fault) for fault in result.shrunk.faults) or "no fault at all"
        text.append(f"seed {result.seed}: {result.report.verdict.value}: {result.report.why()}")
        text.append(f"  least scenario: {faults}")
        text += [f"  {name}" for name in result.files]
    return text


def to_json(plan: CampaignSettings, results: Sequence[TrialResult]) -> dict[str, object]:
    """The plan and one entry a run, as ``json.dump`` takes them; units stand in the keys."""
    return {
        "site": plan.site,
        "profile": plan.profile,
        "seeds": [result.seed for result in results],
        "simulated_h": sum(result.report.simulated_s for result in results) / 3600,
        "recovery_us": {measure: us for measure, (us, _) in longest_recovery(results).items()},
        "verdicts": dict(Counter(result.report.verdict.value for result in results)),
        "runs": [
            {
                "seed": result.seed,
                "verdict": result.report.verdict.value,
                "faults": [str(fault) for fault in result.report.scenario.faults],
                "struck": dict(result.report.struck),
                "served": result.report.served,
                "told": result.report.told,
                "waiting": result.report.waiting,
                "longest_wait_s": result.report.longest_wait_s,
                "full": result.report.full,
                "violations": list(result.report.violations),
                "stalls": list(result.report.stalls),
                "halted": list(result.report.halted),
                "error": result.report.error,
                "least": [str(fault) for fault in result.shrunk.faults] if result.shrunk is not None else None,
                "files": list(result.files),
            }
            for result in results
        ],
    }
