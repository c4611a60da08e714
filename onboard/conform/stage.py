"""What a scene sees and says: frames and times as values. It waits by yielding what it waits for."""

from collections import defaultdict
from collections.abc import Callable, Generator
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeVar

from onboard.conform.checks import Findings, Shown
from onboard.contract.codes import KindCode, Reason
from onboard.contract.messages import Award, Diagnostic, Heartbeat, Message, Reference
from onboard.contract.runs import singles
from onboard.core.frame import Frame
from onboard.core.site import Machine, Site
from onboard.wire.codec import Codec
from onboard.wire.decoder import Decoder

M = TypeVar("M", bound=Message)
SECOND = 1_000_000
MS = 1_000
#: Bus time goes round 2^32 ms so long after the play began (duty F6): amid two calls at a time; where there is another
#: robot, amid what that is for.
_ROUND_US, _ROUND_WITH_RIVAL_US = 735 * SECOND, 1_500 * SECOND
#: The node of a tool under which the kit speaks for an operator.
OPERATOR = 251


class Wait(NamedTuple):
    """A scene goes on when ``done`` says so, at ``until_us`` at the latest."""

    until_us: int
    done: Callable[[], bool] | None = None


Play = Generator[Wait, None, None]
Heard = Generator[Wait, None, "Word | None"]


class PlatformRun(NamedTuple):
    """A platform is to move: of the lift with this node-ID, to this stop from 1 on, in so long from now."""

    node: int
    stop: int
    lasts_us: int


class Word(NamedTuple):
    """A message of the node under test, of a run each single one; ``time_us`` is the kit's clock."""

    time_us: int
    message: Any
    frame: Frame


def after_ms(one: int, other: int) -> int:
    """How long bus time ``one`` is behind ``other``, negative before it, by the nearest round (duty F6)."""
    return (one - other + 2**31) % 2**32 - 2**31


@dataclass(frozen=True, slots=True)
class Means:
    """What the kit can do beside speaking on the bus.

    ``power`` says that it can switch the node off and on; ``has_car`` that a car stands in the first compartment's bay,
    its output door open. ``late_us`` is how much later than its duty says a word may be heard.
    """

    power: bool = False
    has_car: bool = False
    wheelbase_mm: int = 2_870
    late_us: int = 15 * MS


@dataclass
class Stage:
    """One play. Scenes speak by ``say`` and ``put``, hear by ``hears`` and judge by ``judge``."""

    site: Site
    node: int
    codec: Codec
    means: Means
    findings: Findings
    now_us: int = 0
    begin_us: int = 0
    #: By how much bus time has been set on.
    jumped_us: int = 0
    #: Frames that are to be sent, and power that is to be switched.
    out: list[Frame] = field(default_factory=list)
    power: list[bool] = field(default_factory=list)
    #: Platforms that are to be moved.
    rides: list[PlatformRun] = field(default_factory=list)
    #: The kit has switched the node off.
    is_off: bool = False
    words: dict[type[Message], list[Word]] = field(default_factory=lambda: defaultdict(list))
    #: Frames of the node under test that are no message, with why.
    wrong: list[tuple[Shown, Reason]] = field(default_factory=list)
    #: Tasks that the fleet has awarded to the node.
    awarded: set[Reference] = field(default_factory=set)
    #: In which epoch the site is: that of the node's first heartbeat, until rights are made anew.
    epoch: int = -1
    #: When the node was last heard.
    heard_us: int = 0
    #: Told every word of the node.
    hearers: list[Callable[[Word], None]] = field(default_factory=list)
    #: Called at the end of the play: the last say of what judges all the time.
    closers: list[Callable[[], None]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.decoder = Decoder(self.codec)
        self.machine: Machine = self.site.machines[self.node]
        fixed = sorted(node for node, one in self.site.machines.items() if one.station is not None)
        #: The lift that the kit plays, 0 where there is none.
        self.lift = next((node for node, one in self.site.machines.items() if one.kind is KindCode.LIFT), 0)
        #: The first compartment: it calls, is the bus time and the steward; and another, 0 where there is none.
        self.caller = min(fixed)
        self.stranger = next(node for node in range(250, 0, -1) if node not in self.site.machines)
        self.other = next((node for node in fixed if node != self.caller), 0)
        #: Another robot that the kit plays, 0 where there is none.
        robots = (node for node, one in self.site.machines.items() if one.kind is self.machine.kind)
        self.rival = next((node for node in robots if node != self.node), 0)

    # --- in ------------------------------------------------------------------------------------------------------

    def hear(self, frame: Frame) -> None:
        """A frame of the bus."""
        if frame.arbitration_id & 0xFF != self.node:
            return
        self.heard_us = self.now_us
        part = self.codec.decode_part(frame)
        if isinstance(part, Reason):
            self.wrong.append((self.shown(frame), part))
            return
        message = self.decoder.feed(frame, self.now_us)
        for one in {id(part): part, id(message): message}.values():
            for single in singles(one) if one is not None else ():
                word = Word(self.now_us, single, frame)
                self.words[type(single)].append(word)
                if isinstance(single, Heartbeat) and self.epoch < 0:
                    self.epoch = single.epoch
                for tell in self.hearers:
                    tell(word)

    def since(self, kind: type[Message], begin_us: int) -> list[Word]:
        """What the node said of a kind from a time on."""
        found = []
        for word in reversed(self.words[kind]):
            if word.time_us < begin_us:
                break
            found.append(word)
        return found[::-1]

    def said_since(self, begin_us: int) -> list[Word]:
        """All that it said from a time on, in the order of time."""
        found = [one for words in self.words.values() for one in words if one.time_us >= begin_us]
        return sorted(found, key=lambda one: one.time_us)

    def last(self, kind: type[Message]) -> Word | None:
        """What it said last of a kind."""
        words = self.words[kind]
        return words[-1] if words else None

    # --- waiting -------------------------------------------------------------------------------------------------

    def pause(self, seconds: float) -> Play:
        """Let so much time go by."""
        yield Wait(self.now_us + round(seconds * SECOND))

    def hears(
        self,
        kind: type[Message],
        where: Callable[[Any], bool] = lambda _: True,
        within_s: float = 5.0,
        since_us: int | None = None,
    ) -> Heard:
        """The first word of a kind that fits, from now or ``since_us`` on; None where none comes in time."""
        begin_us = self.now_us if since_us is None else since_us

        def find() -> Word | None:
            return next((one for one in self.since(kind, begin_us) if where(one.message)), None)

        if find() is None:
            yield Wait(self.now_us + round(within_s * SECOND), lambda: find() is not None)
        return find()

    def until(self, done: Callable[[], bool], within_s: float) -> Generator[Wait, None, bool]:
        """Whether it came to be so in time."""
        if not done():
            yield Wait(self.now_us + round(within_s * SECOND), done)
        return done()

    # --- out -----------------------------------------------------------------------------------------------------

    def say(self, *messages: Message) -> None:
        """On the fleet bus, at once."""
        for message in messages:
            if isinstance(message, Award) and message.winner == self.node:
                self.awarded.add(message.task)
            self.out.extend(self.codec.encode(message))

    def put(self, *frames: Frame) -> None:
        """Frames as they are, wrong ones too."""
        self.out.extend(frames)

    def switch(self, *, on: bool) -> None:
        """The node's power. While it is off nobody else acknowledges a frame: what is said then comes late."""
        self.power.append(on)
        self.is_off = not on

    # --- judging -------------------------------------------------------------------------------------------------

    def shown(self, frame: Frame, time_us: int | None = None) -> Shown:
        """A frame as evidence, heard now or at ``time_us``."""
        return Shown((self.now_us if time_us is None else time_us) - self.begin_us, frame)

    def judge(self, name: str, is_kept: object, why: str, *words: Word | None) -> None:
        """A check was reached; ``why`` says what was seen instead."""
        frames = tuple(self.shown(one.frame, one.time_us) for one in words if one is not None)
        self.findings.by_name[name].judge(why, frames, is_kept=bool(is_kept))

    def none_of(self, name: str, words: list[Word], why: str) -> None:
        """The node said nothing of this kind, as it should."""
        self.judge(name, not words, why, *words)

    def count_of(self, reason: Reason) -> int:
        """What the node last told of its drops for a reason, in its life of now."""
        beats = self.words[Heartbeat]
        born_us = next(
            (a.time_us for a, b in zip(beats[-2::-1], beats[:0:-1], strict=True) if a.message.boot != b.message.boot), 0
        )
        told = [one.message.count for one in self.since(Diagnostic, born_us) if one.message.reason is reason]
        return told[-1] if told else 0

    # --- time ----------------------------------------------------------------------------------------------------

    @property
    def bus_us(self) -> int:
        """Bus time: the kit gives it, and not from 0 on."""
        return self.bus_us_at(self.now_us) + self.jumped_us

    def bus_us_at(self, now_us: int) -> int:
        """What it is at a time of the kit's clock before it is set on."""
        round_us = _ROUND_WITH_RIVAL_US if self.rival else _ROUND_US
        return now_us - self.begin_us + (1000 << 32) - round_us

    def unrolled_ms(self, ms: int) -> int:
        """Bus time as frames tell it, by the round that is nearest to now: such times can be compared (duty F6)."""
        now_ms = self.bus_us // 1000
        return now_ms + after_ms(ms, now_ms)

    def bus_ms(self, us: int | None = None) -> int:
        """Bus time in ms as frames tell it."""
        return -(-(self.bus_us if us is None else us) // 1000) & 0xFFFFFFFF
