"""Performance indicators (row P55) from the fleet bus alone: a view of its history, live or from a log."""

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import asdict, dataclass

from onboard.contract.codes import KindCode
from onboard.contract.messages import BusTime, Heartbeat, Message
from onboard.core.site import Site
from onboard.history.history import Fact, History
from onboard.trace.activity import Activities, Activity, MachineActivity
from onboard.trace.durations import percentile
from onboard.trace.negotiations import ANSWER, NegotiationCounts, NegotiationFold

_HOUR_US = 3_600_000_000
#: Said by the clock and not because of a task.
PERIODIC = (BusTime.__name__, Heartbeat.__name__)


@dataclass(frozen=True)
class Rate:
    """Tasks done: how many, how many an hour over the whole time, and most in any 60 minutes."""

    count: int
    per_h: float
    best_hour: int


@dataclass(frozen=True)
class Slack:
    """Promised minus actual finishing time, s; above 0 is early. ``p95_s`` is what 95 % of the tasks had at least."""

    count: int
    mean_s: float
    p95_s: float
    worst_s: float


@dataclass(frozen=True)
class Utilisation:
    """One robot or lift. Shares of time, 0 to 1: ``with_task``; and the five activities, which make 1 together.

    ``empty_mm`` is travel without a car (robot) or without a robot aboard (lift).
    """

    machine: str
    with_task: float
    riding: float
    driving: float
    handling: float
    standing: float
    idle: float
    travel_mm: int
    empty_mm: int
    empty_share: float
    longest_wait_s: float


@dataclass(frozen=True)
class FleetIndicators:
    """All that the fleet bus tells. ``messages_per_task`` counts all but the periodic ones; 0 where no task was done.

    ``replans``: plans told anew beyond the first of a task, by what changed and why. ``give_ways``: another way taken
    because of another machine's plan, ways taken without a task, and calls to give way. ``robots_resting_mm`` is
    the part of the empty travel by which robots went to wait elsewhere.
    """

    seconds_s: float
    parked: Rate
    fetched: Rate
    tasks: int
    calls: int
    calls_per_task: float
    sub_calls: int
    opened_again: int
    refused: int
    bids: int
    bids_per_task: float
    messages: dict[str, int]
    messages_per_task: float
    replans: dict[str, int]
    give_ways: int
    slack: Slack
    machines: tuple[Utilisation, ...]
    robots_travel_mm: int
    robots_empty_mm: int
    robots_empty_share: float
    robots_resting_mm: int

    def to_json(self) -> dict[str, object]:
        """The fields as ``json.dump`` takes them; units stand in the keys."""
        return asdict(self)

    def lines(self) -> list[str]:
        """The indicators as a person reads them."""
        whys = ((count, *key.split(", ", 1)) for key, count in self.replans.items())
        replans = ", ".join(f"{count} other {what} ({why})" for count, what, why in whys) or "none"
        slack = self.slack
        empty = f"{self.robots_empty_share:.0%} without a car"
        empty += f", {self.robots_resting_mm / 1e3:,.0f} m to wait elsewhere" if self.robots_resting_mm else ""
        told = f"mean {slack.mean_s:+.1f} s   95 % at least {slack.p95_s:+.1f}   worst {slack.worst_s:+.1f}"
        text = [
            f"throughput   in {self.parked.per_h:.1f} cars/h (best hour {self.parked.best_hour})   "
            f"out {self.fetched.per_h:.1f} cars/h (best hour {self.fetched.best_hour})",
            f"a task       calls {self.calls_per_task:.2f}   bids {self.bids_per_task:.2f}   "
            f"messages {self.messages_per_task:.0f}   sub-calls in all {self.sub_calls}",
            f"plans anew   {replans}   give-ways {self.give_ways}",
            f"promises     promised minus actual: {told if slack.count else 'none'}   ({slack.count})",
            f"robots       travelled {self.robots_travel_mm / 1e3:,.0f} m, {empty}",
            "machine   busy riding driving handling standing   idle travel m empty max wait s",
        ]
        return text + [_line(machine) for machine in self.machines]


def _line(machine: Utilisation) -> str:
    shares = (machine.riding, machine.driving, machine.handling, machine.standing, machine.idle)
    return (
        f"{machine.machine:<8}{machine.with_task:>6.1%}"
        + "".join(f"{share:>{width}.1%}" for share, width in zip(shares, (7, 8, 9, 9, 7), strict=True))
        + f"{machine.travel_mm / 1000:>9,.0f}{machine.empty_share:>6.0%}{machine.longest_wait_s:>11.1f}"
    )


class Indicators:
    """Feed every message of the fleet bus in the order of the log; ask for the figures at any time."""

    def __init__(self, site: Site, begin_us: int = 0, history: History | None = None) -> None:
        self._site = site
        self._history = history if history is not None else History(site)
        self._begin_us = begin_us
        self._activities = Activities(site, self._history, begin_us)
        self._negotiations = NegotiationFold(self._history)

    def feed(self, message: Message, time_us: int) -> None:
        """Take up one message, where the history is these indicators' own."""
        self.take(message, self._history.feed(message, time_us), time_us)

    def take(self, message: Message, fact: Fact | None, time_us: int) -> None:
        """Take up one message, and what the history made of it."""
        self._negotiations.take(message, fact, time_us)
        self._activities.take(fact, time_us)

    def begin(self, time_us: int) -> None:
        """Measure from now on: open tasks, plans and places are kept, sums begin anew."""
        self._begin_us = time_us
        self._activities.settle_all(time_us)
        self._activities.begin(time_us)
        self._negotiations.begin()

    def figures(self, now_us: int) -> FleetIndicators:
        """The figures from the last ``begin`` up to now."""
        self._activities.settle_all(now_us)
        passed_us = max(1, now_us - self._begin_us)
        counts = self._negotiations.counts
        bodies = self._activities.bodies
        robots = [body for body in bodies.values() if body.kind is KindCode.ROBOT]
        travel_mm, empty_mm = sum(body.travel_mm for body in robots), sum(body.empty_mm for body in robots)
        tasks = len(counts.parked_us) + len(counts.fetched_us)
        busy = sum(count for name, count in counts.messages.items() if name not in PERIODIC)
        return FleetIndicators(
            seconds_s=passed_us / 1e6,
            parked=_rate(counts.parked_us, passed_us),
            fetched=_rate(counts.fetched_us, passed_us),
            tasks=tasks,
            calls=counts.calls,
            calls_per_task=_per(counts.calls, tasks),
            sub_calls=counts.sub_calls,
            opened_again=counts.opened_again,
            refused=counts.refused,
            bids=counts.bids,
            bids_per_task=_per(counts.bids, tasks),
            messages=dict(sorted(counts.messages.items())),
            messages_per_task=_per(busy, tasks),
            replans={f"{what}, {why}": count for (what, why), count in sorted(counts.replans.items())},
            give_ways=_give_ways(counts),
            slack=_slack(counts.slack_ms),
            machines=tuple(self._utilisation(body, passed_us) for body in bodies.values()),
            robots_travel_mm=travel_mm,
            robots_empty_mm=empty_mm,
            robots_empty_share=_per(empty_mm, travel_mm),
            robots_resting_mm=sum(body.resting_mm for body in robots),
        )

    def _utilisation(self, body: MachineActivity, passed_us: int) -> Utilisation:
        shares = {activity: body.spent_us[activity] / passed_us for activity in Activity}
        return Utilisation(
            self._site.machines[body.node].name,
            body.busy_us / passed_us,
            shares[Activity.RIDING],
            shares[Activity.DRIVING],
            shares[Activity.HANDLING],
            shares[Activity.STANDING],
            shares[Activity.IDLE],
            body.travel_mm,
            body.empty_mm,
            _per(body.empty_mm, body.travel_mm),
            body.longest_wait_us / 1e6,
        )


def _per(count: int, of: int) -> float:
    return count / of if of else 0.0


def _give_ways(counts: NegotiationCounts) -> int:
    return counts.replans["way", ANSWER] + counts.unasked_moves + counts.give_way_calls


def _rate(times_us: Sequence[int], passed_us: int) -> Rate:
    best = max((bisect_left(times_us, begin + _HOUR_US) - at for at, begin in enumerate(times_us)), default=0)
    return Rate(len(times_us), len(times_us) * _HOUR_US / passed_us, best)


def _slack(slack_ms: Sequence[int]) -> Slack:
    if not slack_ms:
        return Slack(0, 0.0, 0.0, 0.0)
    seconds = sorted(slack / 1000 for slack in slack_ms)
    return Slack(len(seconds), sum(seconds) / len(seconds), percentile(seconds, 0.05), seconds[0])
