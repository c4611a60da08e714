"""The comparison as a table: one row for each policy with its own bounds, over all runs in which nobody got stuck."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass

from bus_sim.systems.car_park.bounds.waiting import WaitBounds
from bus_sim.systems.car_park.compare.plays import Play
from bus_sim.systems.car_park.compare.policies import JointChoice
from onboard.trace.durations import Durations


@dataclass(frozen=True)
class PolicyRow:
    """One policy, and one choice of ``place`` where several are compared.

    ``bounds`` are of all visits together, as they went under this policy; shares are 0 to 1, metres those of all robots
    by customer who came in or out.
    """

    policy: str
    wait_in: Durations
    wait_out: Durations
    bounds: WaitBounds
    tasks_per_h: float
    empty_share: float
    messages_per_task: float
    loaded_m: float
    empty_m: float
    place: str = ""


@dataclass(frozen=True)
class ComparisonTable:
    """One part of the comparison. ``left_out`` tells, by seed, why a run counts for no policy."""

    title: str
    rows: tuple[PolicyRow, ...]
    left_out: tuple[str, ...]
    faults: tuple[str, ...]

    def to_json(self) -> dict[str, object]:
        """Plain values for ``json.dump``, with the three ratios of each row."""
        rows = [
            {
                **asdict(row),
                "to_joint_choice": self._to_joint_choice(row),
                "to_bays_alone": row.bounds.to_bays_alone,
                "to_free_flow": row.bounds.to_free_flow,
            }
            for row in self.rows
        ]
        return {"title": self.title, "rows": rows, "left_out": self.left_out, "faults": self.faults}

    def lines(self) -> list[str]:
        """The table in Markdown, waiting times in s; below it what was left out, and faults of the runs."""
        text = [
            f"{self.title}",
            "",
            "| who decides | in: mean / 95 % / max, s | out: mean / 95 % / max, s | all: mean, s | to joint choice "
            "| bays alone, s: times | free flow, s: times | tasks/h "
            "| metres a customer: loaded + empty | empty travel | messages a task |",
            "|---|---|---|---|---|---|---|---|---|---|---|",
        ]
        text += [self._line(row) for row in self.rows]
        text += ["", *(f"left out: {line}" for line in self.left_out)] if self.left_out else []
        return text + [f"FAULT {line}" for line in self.faults]

    def _to_joint_choice(self, row: PolicyRow) -> float | None:
        same = (one.bounds for one in self.rows if (one.policy, one.place) == (JointChoice.name, row.place))
        other = next(same, None)
        return row.bounds.waited_s / other.waited_s if other is not None and other.waited_s else None

    def _line(self, row: PolicyRow) -> str:
        ratio, bounds = self._to_joint_choice(row), row.bounds
        cells = [
            named(row.policy, row.place),
            _waits(row.wait_in),
            _waits(row.wait_out),
            f"{bounds.waited_s:.1f}",
            "" if ratio is None else f"{ratio:.2f}",
            f"{bounds.bays_alone_s:.1f}: {bounds.to_bays_alone:.2f}",
            f"{bounds.free_flow_s:.1f}: {bounds.to_free_flow:.2f}",
            f"{row.tasks_per_h:.1f}",
            f"{row.loaded_m:.1f} + {row.empty_m:.1f}",
            f"{row.empty_share:.0%}",
            f"{row.messages_per_task:.0f}",
        ]
        return f"| {' | '.join(cells)} |"


def tabulate(title: str, plays: Sequence[Play]) -> ComparisonTable:
    """All plays of one part as a table.

    A seed with a policy under which customers are still waiting at the end is left out for all: their waiting would
    be missing.
    """
    stuck = [one for one in plays if one.left]
    dropped = {one.seed for one in stuck}
    kept = [one for one in plays if one.seed not in dropped]
    rows = [_row(*name, [one for one in kept if (one.policy, one.place) == name]) for name in _names(plays)]
    return ComparisonTable(
        title,
        tuple(rows),
        tuple(f"seed {one.seed}, under {_name(one)} {one.left} customers were not served" for one in stuck),
        tuple(f"seed {one.seed}, {_name(one)}: {fault}" for one in plays for fault in one.faults),
    )


def _names(plays: Sequence[Play]) -> list[tuple[str, str]]:
    return list(dict.fromkeys((one.policy, one.place) for one in plays))


def _name(one: Play) -> str:
    return named(one.policy, one.place)


def named(policy: str, place: str) -> str:
    """Who decides, and by what places are chosen, where several are compared."""
    return f"{policy}; place {place}" if place else policy


def _row(policy: str, place: str, plays: Sequence[Play]) -> PolicyRow:
    people = max(1, sum(len(one.in_us) + len(one.out_us) for one in plays))
    tasks = sum(one.tasks for one in plays)
    hours = sum(one.seconds_s for one in plays) / 3600
    travel_mm, empty_mm = sum(one.travel_mm for one in plays), sum(one.empty_mm for one in plays)
    return PolicyRow(
        policy,
        Durations.of([us for one in plays for us in one.in_us]),
        Durations.of([us for one in plays for us in one.out_us]),
        WaitBounds.over(one.bounds for one in plays),
        tasks / hours if hours else 0.0,
        empty_mm / travel_mm if travel_mm else 0.0,
        sum(one.messages for one in plays) / tasks if tasks else 0.0,
        (travel_mm - empty_mm) / people / 1000,
        empty_mm / people / 1000,
        place,
    )


def _waits(waits: Durations) -> str:
    return f"{waits.mean_s:.1f} / {waits.p95_s:.1f} / {waits.max_s:.1f}" if waits.count else "nobody"
