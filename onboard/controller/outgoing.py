"""What one machine says on the fleet bus, in order, and no more of it at a time than its budgets allow.

Frames of messages without a budget go at once, as they come. What is beyond a budget (``onboard/wire/pace.py``) waits
here, and with it whatever would come to nothing before it: a request or the digest of a heartbeat means nothing to
those who have not heard the itinerary. All that is more urgent than an itinerary by its identifier stands for itself
and passes: stops, grants, bus time, calls, awards and bids. So does a place: a grant of the slot that was left must not
come before it, and of a plan that is not heard yet it tells where the machine is all the same.

What waits is never more than its subjects: a plan that nobody has heard the beginning of gives way to the next one, a
heartbeat to a later one, and what waits already is not said twice.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from onboard.contract.codes import Grade
from onboard.contract.messages import Diagnostic, Heartbeat, Itinerary, Message, Progress, TokenRequest
from onboard.core.frame import Frame
from onboard.wire.codec import Codec
from onboard.wire.pace import HELD_US, Pace

_NODE_MASK = 0xFF


class Bucket:
    """One budget, kept as the time at which all that was said would have been said one by one."""

    def __init__(self, pace: Pace) -> None:
        self._apart_us = pace.apart_us
        self._ahead_us = (pace.burst - 1) * pace.apart_us
        self._even_us = 0

    @property
    def free_us(self) -> int:
        """From when on the next frame may go, loop us."""
        return self._even_us - self._ahead_us

    def take(self, now_us: int) -> bool:
        """Whether a frame may go now; it then counts."""
        if now_us < self.free_us:
            return False
        self._even_us = max(self._even_us, now_us) + self._apart_us
        return True


@dataclass(frozen=True, slots=True)
class _Waiting:
    frame: Frame
    message: Message
    since_us: int

    @property
    def subject(self) -> int:
        """The identifier without the node-ID."""
        return self.frame.arbitration_id & ~_NODE_MASK


class Outgoing:
    """The frames of one machine on their way to its bus. ``next_us`` is when to call ``release``, loop us, or None."""

    def __init__(self, codec: Codec, paces: Mapping[str, Pace], send: Callable[[Frame], object]) -> None:
        self.next_us: int | None = None
        #: Told every frame that is to be said, and every one that will not be, as a later one says more.
        self.on_said: Callable[[Frame, int], None] | None = None
        self.on_dropped: Callable[[Frame], None] | None = None
        #: A heartbeat that has waited, as it is to be said now: meanwhile mirrors have changed, and mine with them.
        self.renewed: Callable[[Heartbeat], Heartbeat] | None = None
        self._codec = codec
        self._send = send
        self._buckets = {codec.identifier_of(name): Bucket(pace) for name, pace in paces.items()}
        self._head = codec.identifier_of("ItineraryHead")
        self._plans = frozenset({self._head, codec.identifier_of("ItineraryLeg")})
        self._waiting: list[_Waiting] = []

    @property
    def is_telling(self) -> bool:
        """Whether a plan of this machine is told in part, or waits to be: nobody else can know it yet."""
        return any(one.subject in self._plans for one in self._waiting)

    def say(self, message: Message, now_us: int) -> None:
        """Send what may go now; the rest waits. Raises ``ValueError`` as ``Codec.encode``."""
        frames = self._codec.encode(message)
        if self.on_said is not None:
            for frame in frames:
                self.on_said(frame, now_us)
        subject = frames[0].arbitration_id & ~_NODE_MASK
        passes = subject < self._head or isinstance(message, Progress) or not self._waiting
        if subject not in self._buckets and passes:
            for frame in frames:
                self._send(frame)
            return
        since_us = self._make_room(message, now_us)
        if since_us is None:
            self._forget(frames)
            return
        self._waiting += [_Waiting(frame, message, since_us) for frame in frames]
        self.release(now_us)

    def release(self, now_us: int) -> None:
        """Send what has waited long enough, in the order in which it was said."""
        waiting, self._waiting, self.next_us = self._waiting, [], None
        held: set[int] = set()
        for one in waiting:
            if not self._may_go(one, held, now_us):
                self._waiting.append(one)
                held.add(self._head if one.subject in self._plans else one.subject)
            else:
                self._send(self._as_of_now(one, now_us))

    def _as_of_now(self, one: _Waiting, now_us: int) -> Frame:
        if self.renewed is None or not isinstance(one.message, Heartbeat) or one.since_us == now_us:
            return one.frame
        (frame,) = self._codec.encode(self.renewed(one.message))
        if frame != one.frame:
            self._forget([one.frame])
            if self.on_said is not None:
                self.on_said(frame, now_us)
        return frame

    def clear(self) -> None:
        """What waits is not said any more."""
        self._drop(lambda _: True)
        self.next_us = None

    def _may_go(self, one: _Waiting, held: set[int], now_us: int) -> bool:
        subject = one.subject
        if self._head in held:
            overdue_us = one.since_us + HELD_US
            if not isinstance(one.message, Heartbeat):
                return False
            if now_us < overdue_us:
                self._wish(overdue_us)
                return False
        bucket = self._buckets.get(subject)
        if subject in held:
            return False
        if bucket is None or bucket.take(now_us):
            return True
        self._wish(bucket.free_us)
        return False

    def _wish(self, when_us: int) -> None:
        self.next_us = when_us if self.next_us is None else min(self.next_us, when_us)

    def _make_room(self, message: Message, now_us: int) -> int | None:
        """Leave out what ``message`` makes needless; since when it waits, or None where it is needless itself."""
        if not self._waiting:
            return now_us
        if isinstance(message, Itinerary):
            if message.grade is not Grade.TENTATIVE:
                unheard = {id(one.message) for one in self._waiting if one.subject == self._head}
                self._drop(lambda one: id(one.message) in unheard and not _is_offer(one.message))
            return now_us
        if isinstance(message, Diagnostic):
            self._drop(lambda one: isinstance(one.message, Diagnostic) and one.message.reason is message.reason)
            return now_us
        if isinstance(message, Heartbeat):
            older = [one.since_us for one in self._waiting if isinstance(one.message, Heartbeat)]
            self._drop(lambda one: isinstance(one.message, Heartbeat))
            return min(older, default=now_us)
        if isinstance(message, TokenRequest):
            if any(one.message == message for one in self._waiting):
                return None
            self._drop(lambda one: isinstance(one.message, TokenRequest) and _is_old(one.message, message))
            return now_us
        # What vouches for all before it vouches for what was said since, too.
        self._drop(lambda one: one.message == message)
        return now_us

    def _drop(self, which: Callable[[_Waiting], bool]) -> None:
        self._forget([one.frame for one in self._waiting if which(one)])
        self._waiting = [one for one in self._waiting if not which(one)]

    def _forget(self, frames: Iterable[Frame]) -> None:
        if self.on_dropped is not None:
            for frame in frames:
                self.on_dropped(frame)


def _is_old(waits: TokenRequest, newer: TokenRequest) -> bool:
    """Whether nobody needs a request that waits: the newer one is for the same right, or for another plan."""
    if (waits.token_kind, waits.token) == (newer.token_kind, newer.token):
        return True
    return 0 not in (waits.itinerary_version, newer.itinerary_version) and (
        waits.itinerary_version != newer.itinerary_version
    )


def _is_offer(message: Message) -> bool:
    return isinstance(message, Itinerary) and message.grade is Grade.TENTATIVE
