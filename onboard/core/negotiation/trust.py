"""Who is left out of an initiator's calls, because it won tasks and did not do them (docs/protocol.md, A8).

Who forfeits a task is out of its next calls; who does so several times, with nothing done in between, is out of all of
this initiator, each time for four times as long; a cut cable is one time. A task that is done ends that, or a restart.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from onboard.contract.codes import Criterion, KindCode
from onboard.contract.messages import LeftOut, Reference
from onboard.core.negotiation.bidding import cost_difference
from onboard.core.serial import to_bus_ms

#: How long who failed once is out of the calls for that task, us, doubled with each time: one call goes by without it.
OUT_OF_TASK_US = 120_000_000
#: How long who failed twice in a row is out of all calls, us, four times as long with each time more: others serve.
OUT_OF_ALL_US = 120_000_000
#: No longer than this, us: a machine that was repaired needs nobody to say so.
MOST_OUT_US = 3_600_000_000
#: So much later than was bid counts against the winner where others keep their dates, ms (customers, traffic: 30 s).
LATE_MS = 60_000
#: Weight of the newest task in a machine's mean lateness, one in so many: one bad task does not decide, four do.
MEAN_OF = 4
#: Most nodes that one ``LeftOut`` names (dbc/fleet.dbc), and most tasks in hand that are remembered.
MOST_NAMED = 6
MOST_TASKS = 64


@dataclass
class _Record:
    """What one machine's awards came to: fails in a row, when last, until when it is out, how late in the mean."""

    fails: int = 0
    failed_us: int | None = None
    out_until_us: int = 0
    late_ms: int | None = None


@dataclass
class Trust:
    """One initiator's memory of its winners. Times are bus us. ``able`` tells who of a kind could win now."""

    able: Callable[[KindCode | None], frozenset[int]] = lambda _kind: frozenset()
    _records: dict[int, _Record] = field(default_factory=dict)
    #: For each task in hand: who won it, and the finishing time that it bid (bus ms), None for other criteria.
    _given: dict[Reference, tuple[int, int | None]] = field(default_factory=dict)
    #: How often, and until when, a machine is out of the calls for one task.
    _out_of_task: dict[tuple[Reference, int], tuple[int, int]] = field(default_factory=dict)

    def given(self, task: Reference, winner: int, cost: int, criterion: Criterion) -> None:
        """A task was awarded at ``cost``, in the criterion's unit; beyond ``MOST_TASKS`` the oldest is forgotten."""
        self._given.pop(task, None)
        self._given[task] = winner, cost if criterion is Criterion.FINISH_TIME else None
        while len(self._given) > MOST_TASKS:
            del self._given[next(iter(self._given))]

    def excuse(self, node: int) -> None:
        """A machine is held: whatever it has in hand is late by nobody's word."""
        self._given = {task: (who, None if who == node else end) for task, (who, end) in self._given.items()}

    def winner(self, task: Reference) -> int | None:
        """Who was given a task that is neither done nor forfeited."""
        found = self._given.get(task)
        return None if found is None else found[0]

    def forfeited(self, task: Reference, now_us: int) -> None:
        """The winner of a task did not do it."""
        winner, _ = self._given.pop(task, (None, None))
        if winner is None:
            return
        times = self._out_of_task.get((task, winner), (0, 0))[0]
        self._out_of_task[task, winner] = times + 1, now_us + min(MOST_OUT_US, OUT_OF_TASK_US << times)
        while len(self._out_of_task) > MOST_TASKS:
            del self._out_of_task[next(iter(self._out_of_task))]
        self._fail(winner, now_us)

    def done(self, task: Reference, by: int, now_us: int) -> None:
        """A task is done: its winner's fails are forgotten, unless it was far later than it bid and others are not."""
        winner, promised_ms = self._given.pop(task, (by, None))
        self._out_of_task = {key: out for key, out in self._out_of_task.items() if key[0] != task}
        if winner != by:
            return
        record = self._records.setdefault(by, _Record())
        if promised_ms is not None:
            late_ms = max(0, cost_difference(to_bus_ms(now_us), promised_ms, Criterion.FINISH_TIME))
            before_ms = late_ms if record.late_ms is None else record.late_ms
            record.late_ms = before_ms + (late_ms - before_ms) // MEAN_OF
        if self._is_liar(by):
            self._fail(by, now_us)
        else:
            record.fails, record.out_until_us = 0, 0

    def left_out(
        self, task: Reference, now_us: int, *, last_attempt: bool, kind: KindCode | None = None
    ) -> frozenset[int]:
        """Whose bids for ``task`` do not count; in the last attempt only who failed in others too; never all."""
        nodes = {node for node, record in self._records.items() if now_us < record.out_until_us}
        of_task = () if last_attempt else self._out_of_task.items()
        nodes |= {node for (of, node), (_, until_us) in of_task if of == task and now_us < until_us}
        able = self.able(kind)
        return frozenset() if able and able <= nodes else frozenset(nodes)

    def _fail(self, node: int, now_us: int) -> None:
        record = self._records.setdefault(node, _Record())
        record.fails, record.failed_us = record.fails + (record.failed_us != now_us), now_us
        if record.fails > 1:
            record.out_until_us = now_us + min(MOST_OUT_US, OUT_OF_ALL_US << 2 * (record.fails - 2))

    def _is_liar(self, node: int) -> bool:
        """Whether it is late by far more than anybody else: where all are late, the park is full, not one a liar."""
        own_ms = self._records[node].late_ms or 0
        others = [one.late_ms for other, one in self._records.items() if other != node and one.late_ms is not None]
        return bool(others) and own_ms > LATE_MS + 2 * max(others)


def left_out_words(sender: int, call: int, nodes: frozenset[int]) -> Iterator[LeftOut]:
    """What is said before a call, six nodes a frame."""
    named = sorted(nodes)
    for start in range(0, len(named), MOST_NAMED):
        six = (*named[start : start + MOST_NAMED], *(0,) * MOST_NAMED)[:MOST_NAMED]
        yield LeftOut(sender, call, *six)
