"""One controller run against a recorded log: the frames of all others come as recorded.

The holon is driven as the shell drives it: one inbox, effects in order, a journal write holds up everything behind it,
one timer. So the same code decides the same, as long as the log begins with the machine's power-up and its journal
takes as long as it did then.
"""

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from onboard.contract.messages import CallForProposals
from onboard.core.behaviour import Behaviour, BehaviourFactory, Fleet
from onboard.core.effects import Actuate, Effect, Halt, Record, Report, Send, Tell
from onboard.core.frame import Frame
from onboard.core.mirror import Mirror
from onboard.core.negotiation import Estimator
from onboard.core.negotiation.events import NeededAnswers, Proposal
from onboard.core.site import Machine, Site
from onboard.holon.holon import Holon
from onboard.trace.candump import format_frame
from onboard.trace.frame_bits import INTERMISSION_BITS, frame_bits
from onboard.trace.raw import RawFrame
from onboard.wire.codec import Codec, Codecs
from onboard.wire.decoder import Decoder
from onboard.wire.runs import in_runs
from onboard.wire.untold import untold

#: What a durable write takes in the simulation, us; a board's own figure is an option.
JOURNAL_US = 4_000
#: Frames that were recorded in the last moments of a log may answer what it no longer shows, us.
_TAIL_US = 1_000_000


class Sent(NamedTuple):
    """A frame that the machine said, recorded or now."""

    time_us: int
    is_fleet: bool
    frame: Frame


@dataclass(frozen=True)
class Difference:
    """The first frame in which the machine would act differently; one of both is None where it says more, or less."""

    number: int
    recorded: Sent | None
    now: Sent | None


@dataclass
class Recording:
    """What a log holds for one machine: what it heard, in the order of time, and what it said on each bus."""

    heard: list[tuple[int, bool, Frame]] = field(default_factory=list)
    said_fleet: list[Sent] = field(default_factory=list)
    said_device: list[Sent] = field(default_factory=list)
    first_us: int = 0
    #: Length of the log's first frame: it was sent at power-up, and is stamped when it is over.
    first_bits: int = 0
    last_us: int = 0
    has_devices: bool = False


class RaisedCosts(BehaviourFactory):
    """A factory whose machines bid more than their own computation says: a change that must show in a replay."""

    def __init__(self, inner: BehaviourFactory, by: int) -> None:
        self._inner, self._by = inner, by
        self.fleet_type = inner.fleet_type

    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> Estimator:
        """The machine's own, with the costs of its bids raised."""
        return _Raised(self._inner.estimator(site, machine, mirror), self._by)

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> Behaviour:
        """The machine's steps, with its own estimator."""
        return self._inner.behaviour(fleet, estimator.inner if isinstance(estimator, _Raised) else estimator)


@dataclass
class _Raised:
    inner: Estimator
    by: int

    def floor(self, call: CallForProposals, now_us: int) -> int:
        return self.inner.floor(call, now_us)

    def lower_bound(self, call: CallForProposals, now_us: int) -> int | None:
        return self.inner.lower_bound(call, now_us)

    def estimate(self, call: CallForProposals, now_us: int) -> Proposal | NeededAnswers | None:
        found = self.inner.estimate(call, now_us)
        return found._replace(cost=found.cost + self.by) if isinstance(found, Proposal) else found


def record(frames: Iterable[RawFrame], machine: Machine, codecs: Codecs, fleet: str, system: str) -> Recording:
    """Sort a log out for a machine: ``fleet`` is the fleet bus's channel, its device bus is named after it."""
    from onboard.wire.dbc_file import CONTROLLER, device_layouts  # noqa: PLC0415  # takes a third of the start

    found = Recording()
    orders = {layout.name for layout in device_layouts(system) if CONTROLLER in layout.senders}
    for raw in frames:
        classic = raw.classic()
        # As our own logs keep it, whoever wrote this one: a machine without secrets prints and reads the same.
        frame = None if classic is None else untold(classic)
        if not found.first_us:
            found.first_us = raw.time_us
            found.first_bits = frame_bits(frame) - INTERMISSION_BITS if frame is not None else 0
        found.last_us = max(found.last_us, raw.time_us)
        if frame is None or frame.is_error or raw.channel not in (fleet, machine.name):
            continue
        is_own = frame.arbitration_id & 0xFF == machine.node_id
        if raw.channel == fleet and codecs.fleet.name_of(frame) is not None:
            _add(found.said_fleet if is_own else None, found, Sent(raw.time_us, True, frame))
        elif raw.channel == machine.name:
            found.has_devices = True
            is_order = is_own and codecs.device.name_of(frame) in orders
            _add(found.said_device if is_order else None, found, Sent(raw.time_us, False, frame))
    return found


def _add(recorded: list[Sent] | None, found: Recording, sent: Sent) -> None:
    if recorded is None:
        found.heard.append((sent.time_us, sent.is_fleet, sent.frame))
    else:
        recorded.append(sent)


class ReplayDriver:
    """A holon, its inbox, its journal and its one timer, in the time of the log."""

    def __init__(self, holon: Holon, codecs: Codecs, origin_us: int, journal_us: int = JOURNAL_US) -> None:
        """``origin_us`` of the log is where the machine's own clock begins."""
        self.halted = ""
        self._holon = holon
        holon.listen(codecs.fleet.speakers)
        self._codecs = codecs
        self._decoders = (Decoder(codecs.fleet), Decoder(codecs.device))
        holon.wire_drops = tuple(one.drops for one in self._decoders)
        self._origin_us = origin_us
        self._journal_us = journal_us
        self._inbox: deque[tuple[int, bool, Frame]] = deque()
        self._outbox: deque[Effect] = deque()
        self._written_us: int | None = None
        self._timer_us: int | None = None
        self._now_us = 0

    def run(self, heard: Iterable[tuple[int, bool, Frame]], last_us: int) -> Iterator[Sent]:
        """What the machine says to what it hears, until ``last_us`` of the log."""
        self._outbox.extend(in_runs(self._holon.start(0)))
        yield from self._work_off()
        for time_us, is_fleet, frame in heard:
            local_us = time_us - self._origin_us
            yield from self._pass_time(local_us)
            self._now_us = max(self._now_us, local_us)
            self._inbox.append((local_us, is_fleet, frame))
            yield from self._work_off()
        yield from self._pass_time(last_us - self._origin_us)

    def _pass_time(self, until_us: int) -> Iterator[Sent]:
        """Everything that is due before ``until_us``: the end of a journal write, then the timer."""
        while not self.halted:
            due_us = self._written_us if self._written_us is not None else self._timer_us
            if due_us is None or due_us >= until_us:
                return
            self._now_us = max(self._now_us, due_us)
            if self._written_us is not None:
                if self._timer_us is not None and self._timer_us <= self._written_us:
                    # The shell's timer did nothing while it wrote; it is set anew.
                    self._timer_us = None
                self._written_us = None
            else:
                self._timer_us = None
                self._outbox.extend(in_runs(self._holon.wake(self._now_us)))
            yield from self._work_off()

    def _work_off(self) -> Iterator[Sent]:
        while self._written_us is None and not self.halted:
            if self._outbox:
                yield from self._perform(self._outbox.popleft())
            elif self._inbox:
                self._take(*self._inbox.popleft())
            else:
                break
        if self._written_us is None:
            self._set_timer()

    def _take(self, time_us: int, is_fleet: bool, frame: Frame) -> None:
        message = self._decoders[0 if is_fleet else 1].feed(frame, time_us)
        if message is None:
            return
        if is_fleet:
            self._outbox.extend(in_runs(self._holon.receive(message, time_us)))
        elif message.sender == self._holon.node_id:
            self._outbox.extend(in_runs(self._holon.sense(message, time_us)))

    def _perform(self, effect: Effect) -> Iterator[Sent]:
        match effect:
            case Send(message):
                for frame in self._codecs.fleet.encode(message):
                    yield Sent(self._now_us + self._origin_us, True, frame)
            case Actuate(message) | Tell(message):
                for frame in self._codecs.device.encode(message):
                    yield Sent(self._now_us + self._origin_us, False, frame)
            case Record():
                self._written_us = self._now_us + self._journal_us
            case Report():
                pass
            case Halt(why):
                self.halted = why

    def _set_timer(self) -> None:
        """One timer for the holon's next wish; a later wish leaves an earlier timer in place."""
        due_us = self._holon.next_wake()
        if due_us is not None and (self._timer_us is None or due_us < self._timer_us):
            self._timer_us = max(due_us, self._now_us)


def compare(recording: Recording, sent: Iterable[Sent]) -> tuple[int, Difference | None]:
    """How many frames were the same, and the first that is not. Each bus has an order of its own."""
    recorded = {True: deque(recording.said_fleet), False: deque(recording.said_device)}
    same = 0
    for now in sent:
        if not now.is_fleet and not recording.has_devices:
            continue
        waiting = recorded[now.is_fleet]
        if not waiting:
            if now.time_us > recording.last_us - _TAIL_US:
                continue
            return same, Difference(same + 1, None, now)
        then = waiting.popleft()
        if then.frame != now.frame:
            return same, Difference(same + 1, then, now)
        same += 1
    left = [one for waiting in recorded.values() for one in waiting if one.time_us < recording.last_us - _TAIL_US]
    return same, Difference(same + 1, min(left), None) if left else None


def in_words(sent: Sent | None, codec: Codec) -> str:
    """A frame of the machine as candump writes it, with its message's name."""
    if sent is None:
        return "nothing"
    name = codec.name_of(sent.frame) or "?"
    return f"{format_frame(sent.frame)} ({name})"
