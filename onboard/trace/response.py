"""Worst-case response times of the frames on one CAN bus: from the moment a node queues a frame to the frame's end.

Three bounds, all by busy periods; ``Stream`` says what may be queued:

- ``priority_bounds``: every node always offers its most urgent frame. Davis, Burns, Bril and Lukkien, "Controller Area
  Network (CAN) schedulability analysis: refuted, revisited and revised", Real-Time Systems 35 (2007), which corrects
  Tindell's analysis of 1994: all instances in a busy period count, not only the first.
- ``fifo_bounds``: a node's frames leave in the order in which they were queued. Davis, Kollmann, Pollex and Slomka,
  "Controller Area Network (CAN) schedulability analysis with FIFO queues", ECRTS 2011: one bound for all frames of a
  node, and frames of other nodes count for as long as they may have waited in their own queues.
- ``busy_period_us``: whatever the order is, a frame is out when the bus falls idle. Davis and Navet, "CAN
  schedulability analysis for messages with arbitrary deadlines in FIFO and work-conserving queues", WFCS 2012.

This project's nodes are FIFO nodes: Linux's ``mcp251x`` driver has one mailbox, and frames wait in order in the
socket's and driver's queues before it; a frame once handed to the kernel cannot be recalled. The simulated nodes are
the same.

Errors on the wire are not counted: each costs at most 31 bits and the frame again. All times are whole microseconds,
rounded up; inside, ticks of 1 / (bit rate) us, so that nothing is rounded twice.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

#: One bit time and one microsecond in ticks are ``_TICKS_PER_BIT`` and the bit rate.
_TICKS_PER_BIT = 1_000_000
#: Node of a stream that may come from whichever node it is, a frame at a time.
ANYBODY = 0
#: A busy period of more than this means that the bus never falls idle, us.
_NEVER_IDLE_US = 60_000_000


@dataclass(frozen=True, slots=True)
class Stream:
    """Frames of one message from one node: at most ``burst`` at once, then as many again after ``period_us``.

    ``node`` may be ``ANYBODY``. ``jitter_us``: how much a frame may be queued later than its time. ``priority``: as in
    arbitration, lowest first, unequal between nodes. ``bits``: longest frame with stuff bits and the three bits of
    intermission.
    Raises ``ValueError`` for a burst below 1, no bits, a period that is not above 0 or a negative jitter.
    """

    node: int
    name: str
    priority: int
    bits: int
    period_us: int
    burst: int = 1
    jitter_us: int = 0

    def __post_init__(self) -> None:
        """Refuse what is no stream."""
        if self.burst < 1 or self.bits < 1 or self.period_us < 1 or self.jitter_us < 0:
            raise ValueError(f"{self}: burst, bits and period_us must be above 0 and jitter_us not below")


@dataclass(frozen=True, slots=True)
class Bound:
    """Longest time from queueing to the end of the frame; None where it has none, as the bus cannot carry it all.

    Since the event that the frame is about, the stream's jitter comes on top.
    """

    stream: Stream
    response_us: int | None

    @property
    def is_met(self) -> bool:
        """Whether every frame is out before as many again of its stream may be queued (deadline = period)."""
        stream = self.stream
        deadline_us = (1 + stream.jitter_us // stream.period_us) * stream.period_us
        return self.response_us is not None and self.response_us <= deadline_us


class _Ticks:
    """Streams in ticks of 1 / (bit rate) us."""

    def __init__(self, streams: Iterable[Stream], bit_rate: int) -> None:
        if bit_rate < 1:
            raise ValueError(f"bit rate {bit_rate}: must be above 0")
        self.streams = tuple(streams)
        self.bit_rate = bit_rate
        self.limit = _NEVER_IDLE_US * bit_rate

    def period(self, stream: Stream) -> int:
        return stream.period_us * self.bit_rate

    def jitter(self, stream: Stream) -> int:
        return stream.jitter_us * self.bit_rate

    def length(self, stream: Stream) -> int:
        return stream.bits * _TICKS_PER_BIT

    def demand(self, stream: Stream, window: int) -> int:
        """Ticks that frames queued within a half-open window take."""
        if window <= 0:
            return 0
        return stream.burst * -(-(window + self.jitter(stream)) // self.period(stream)) * self.length(stream)

    def settle(self, start: int, demand: Callable[[int], int]) -> int | None:
        """Least fixed point of a growing ``demand`` at or above ``start``, None beyond the limit."""
        window = start
        while window <= self.limit:
            needed = demand(window)
            if needed <= window:
                return window
            window = needed
        return None

    def microseconds(self, ticks: int) -> int:
        return -(-ticks // self.bit_rate)


def utilisation(streams: Iterable[Stream], bit_rate: int) -> float:
    """Share of the bus that the streams take in the long run at most; above 1 there are no bounds."""
    return sum(s.burst * s.bits * 1e6 / (s.period_us * bit_rate) for s in streams)


def busy_period_us(streams: Iterable[Stream], bit_rate: int) -> int | None:
    """Longest time for which the bus is never idle: no frame responds later, whatever the order of the queues.

    None where the streams ask for more than the bus can carry.
    """
    ticks = _Ticks(streams, bit_rate)
    if utilisation(ticks.streams, bit_rate) > 1:
        return None
    found = ticks.settle(1, lambda window: sum(ticks.demand(stream, window) for stream in ticks.streams))
    return None if found is None else ticks.microseconds(found)


# --- priority queues -------------------------------------------------------------------------------------------------


def priority_bounds(streams: Iterable[Stream], bit_rate: int) -> list[Bound]:
    """Bounds where each node always offers its most urgent frame to arbitration (2007, equations 7 to 12)."""
    ticks = _Ticks(streams, bit_rate)
    return [Bound(stream, _priority_bound(ticks, stream)) for stream in ticks.streams]


def _priority_bound(ticks: _Ticks, mine: Stream) -> int | None:
    higher = [stream for stream in ticks.streams if stream.priority < mine.priority]
    lower = (ticks.length(stream) for stream in ticks.streams if stream.priority > mine.priority)
    blocking = max(lower, default=0)
    if utilisation([*higher, mine], ticks.bit_rate) > 1:
        return None
    busy = ticks.settle(
        ticks.length(mine), lambda window: blocking + sum(ticks.demand(one, window) for one in [*higher, mine])
    )
    if busy is None:
        return None
    worst, start = 0, 0
    for instance in range(-(-(busy + ticks.jitter(mine)) // ticks.period(mine))):
        # The last frame of each burst waits for all of its own before it.
        before = blocking + ((instance + 1) * mine.burst - 1) * ticks.length(mine)
        start = _start_of(ticks, max(start, before), before, higher)
        queued_at = max(0, instance * ticks.period(mine) - ticks.jitter(mine))
        worst = max(worst, start + ticks.length(mine) - queued_at)
    return ticks.microseconds(worst)


def _start_of(ticks: _Ticks, guess: int, before: int, higher: Sequence[Stream]) -> int:
    """When a frame starts; one queued a bit time later still takes part in its arbitration."""
    found = ticks.settle(
        guess, lambda window: before + sum(ticks.demand(one, window + _TICKS_PER_BIT) for one in higher)
    )
    assert found is not None, "a start lies inside its busy period"
    return found


# --- first-in first-out queues ---------------------------------------------------------------------------------------


def fifo_bounds(streams: Iterable[Stream], bit_rate: int) -> list[Bound]:
    """Bounds where each node's frames leave in the order in which they were queued: one for all streams of a node.

    Never above ``busy_period_us``. A frame of another node counts if it may win against the least urgent message of
    this node, and for as long as it may have waited; those waits are bounds of this analysis again, so all nodes are
    worked out together, from below, until nothing changes. One frame that has begun, of any other node, blocks.
    Streams of ``ANYBODY`` have the greatest bound of all nodes, and may be in the way of every frame.
    """
    ticks = _Ticks(streams, bit_rate)
    idle_after = busy_period_us(ticks.streams, bit_rate)
    if idle_after is None:
        return [Bound(stream, None) for stream in ticks.streams]
    ceiling = idle_after * bit_rate
    nodes = {stream.node for stream in ticks.streams} - {ANYBODY}
    responses = dict.fromkeys(sorted(nodes), 0)
    changed = bool(nodes)
    while changed:
        before = dict(responses)
        for node in responses:
            responses[node] = max(responses[node], min(ceiling, _fifo_response(ticks, node, responses, ceiling)))
        changed = before != responses
    responses[ANYBODY] = max(responses.values(), default=ceiling)
    return [Bound(stream, ticks.microseconds(responses[stream.node])) for stream in ticks.streams]


def _fifo_response(ticks: _Ticks, node: int, responses: dict[int, int], ceiling: int) -> int:
    own = [stream for stream in ticks.streams if stream.node == node]
    least_urgent = max(stream.priority for stream in own)
    shortest = min(ticks.length(stream) for stream in own)
    others = [stream for stream in ticks.streams if stream.node != node]
    rivals = [stream for stream in others if stream.priority < least_urgent or stream.node == ANYBODY]
    blocking = max((ticks.length(stream) for stream in others), default=0)
    waits = {stream: max(0, responses.get(stream.node, ceiling) - ticks.length(stream)) for stream in rivals}

    def response(queued_at: int) -> tuple[int, int]:
        """Of the last frame queued ``queued_at`` after the queue was last empty; and when that frame starts."""
        mine = sum(ticks.demand(stream, queued_at + 1) for stream in own)
        before = blocking + mine - shortest
        start = ticks.settle(
            before,
            lambda window: before + sum(ticks.demand(one, window + waits[one] + _TICKS_PER_BIT) for one in rivals),
        )
        if start is None:
            return ceiling, ceiling
        return start + shortest - queued_at, start

    worst, queued_at = 0, 0
    while True:
        found, start = response(queued_at)
        worst = max(worst, found)
        following = min(_next_release(ticks, stream, queued_at) for stream in own)
        if worst >= ceiling or following > start + shortest:
            return worst
        queued_at = following


def _next_release(ticks: _Ticks, stream: Stream, after: int) -> int:
    """When a stream that began at 0 with its full jitter queues again, later than ``after``."""
    number = (after + ticks.jitter(stream)) // ticks.period(stream) + 1
    return number * ticks.period(stream) - ticks.jitter(stream)
