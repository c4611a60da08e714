"""The comparison as a table: one row for each policy and one for the bound, over all runs in which nobody got stuck."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass

from bus_sim.systems.car_park.compare.plays import Play
from bus_sim.systems.car_park.compare.policies import JointChoice
from onboard.trace.durations import Durations

BOUND = "free-flow bound"


@dataclass(frozen=True)
class PolicyRow:
    """One policy, or the bound, which has waiting times only. Waiting is of all visits together; shares are 0 to 1."""

    policy: str
    wait_in: Durations
    wait_out: Durations
    waiting_s: float
    tasks_per_h: float | None = None
    empty_share: float | None = None
    messages_per_task: float | None = None


@dataclass(frozen=True)
class ComparisonTable:
    """One part of the comparison. ``left_out`` tells, by seed, why a run counts for no policy."""

    title: str
    rows: tuple[PolicyRow, ...]
    left_out: tuple[str, ...]
    faults: tuple[str, ...]

    def to_json(self) -> dict[str, object]:
        """Plain values for ``json.dump``, with the two ratios of each row."""
        rows = [
            {**asdict(row), "to_joint_choice": self._ratio(row, JointChoice.name), "to_bound": self._ratio(row, BOUND)}
            for row in self.rows
        ]
        return {"title": self.title, "rows": rows, "left_out": self.left_out, "faults": self.faults}

    def lines(self) -> list[str]:
        """The table in Markdown, waiting times in s; below it what was left out, and faults of the runs."""
        text = [
            f"{self.title}",
            "",
            "| who decides | in: mean / 95 % / max, s | out: mean / 95 % / max, s | all: mean, s | to joint choice "
            "| to bound | tasks/h | empty travel | messages a task |",
            "|---|---|---|---|---|---|---|---|---|",
        ]
        text += [self._line(row) for row in self.rows]
        text += ["", *(f"left out: {line}" for line in self.left_out)] if self.left_out else []
        return text + [f"FAULT {line}" for line in self.faults]

    def _ratio(self, row: PolicyRow, name: str) -> float | None:
        other = next((one for one in self.rows if one.policy == name), None)
        return row.waiting_s / other.waiting_s if other is not None and other.waiting_s else None

    def _line(self, row: PolicyRow) -> str:
        ratios = [self._ratio(row, name) for name in (JointChoice.name, BOUND)]
        cells = [
            row.policy,
            _waits(row.wait_in),
            _waits(row.wait_out),
            f"{row.waiting_s:.1f}",
            *("" if ratio is None else f"{ratio:.2f}" for ratio in ratios),
            "" if row.tasks_per_h is None else f"{row.tasks_per_h:.1f}",
            "" if row.empty_share is None else f"{row.empty_share:.0%}",
            "" if row.messages_per_task is None else f"{row.messages_per_task:.0f}",
        ]
        return f"| {' | '.join(cells)} |"


def tabulate(
    title: str, plays: Sequence[Play], bounds_us: dict[int, tuple[Sequence[int], Sequence[int]]]
) -> ComparisonTable:
    """All plays of one part as a table; ``bounds_us`` are the least waiting times in and out, by seed.

    A seed with a policy under which customers are still waiting at the end is left out for all: their waiting would
    be missing.
    """
    stuck = [one for one in plays if one.left]
    dropped = {one.seed for one in stuck}
    kept = [one for one in plays if one.seed not in dropped]
    rows = [_row(policy, [one for one in kept if one.policy == policy]) for policy in dict.fromkeys(_names(plays))]
    least = [bounds for seed, bounds in bounds_us.items() if seed not in dropped]
    least_in_us = [time_us for ins_us, _ in least for time_us in ins_us]
    least_out_us = [time_us for _, outs_us in least for time_us in outs_us]
    rows.append(_bare(BOUND, least_in_us, least_out_us))
    return ComparisonTable(
        title,
        tuple(rows),
        tuple(f"seed {one.seed}, under {one.policy} {one.left} customers were not served" for one in stuck),
        tuple(f"seed {one.seed}, {one.policy}: {fault}" for one in plays for fault in one.faults),
    )


def _names(plays: Sequence[Play]) -> list[str]:
    return [one.policy for one in plays]


def _bare(policy: str, in_us: Sequence[int], out_us: Sequence[int]) -> PolicyRow:
    return PolicyRow(policy, Durations.of(in_us), Durations.of(out_us), Durations.of([*in_us, *out_us]).mean_s)


def _row(policy: str, plays: Sequence[Play]) -> PolicyRow:
    bare = _bare(policy, [us for one in plays for us in one.in_us], [us for one in plays for us in one.out_us])
    tasks = sum(one.tasks for one in plays)
    hours = sum(one.seconds_s for one in plays) / 3600
    travel_mm = sum(one.travel_mm for one in plays)
    return PolicyRow(
        policy,
        bare.wait_in,
        bare.wait_out,
        bare.waiting_s,
        tasks / hours if hours else 0.0,
        sum(one.empty_mm for one in plays) / travel_mm if travel_mm else 0.0,
        sum(one.messages for one in plays) / tasks if tasks else 0.0,
    )


def _waits(waits: Durations) -> str:
    return f"{waits.mean_s:.1f} / {waits.p95_s:.1f} / {waits.max_s:.1f}" if waits.count else "nobody"
