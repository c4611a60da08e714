"""All rules over a whole log: frames in, findings out, in bounded memory; and how a verdict is told."""

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

from onboard.contract.codes import CONTRACT_VERSION, KindCode, MachineState, Reason
from onboard.contract.messages import BusTime, Heartbeat, Message
from onboard.contract.runs import singles
from onboard.core.frame import Frame
from onboard.core.site import Site
from onboard.systems.contract import codecs_for
from onboard.trace.candump_reader import CandumpReader, LogRecord
from onboard.trace.check.event import Finding, LogEvent
from onboard.trace.check.picture import SETTLING_US, BusPicture
from onboard.trace.check.rule import Rule
from onboard.trace.check.systems import rules_for
from onboard.trace.listener import foreign_line
from onboard.trace.raw import RawFrame, data_frame
from onboard.wire.codec import Codec
from onboard.wire.decoder import Decoder
from onboard.wire.speakers import why_unheard

if TYPE_CHECKING:
    from onboard.trace.columns.block import FrameBlock

#: Findings that are kept word for word; all are counted.
MOST_FINDINGS = 1_000
#: Channels of a log that are told apart; a name more is taken for one of them.
MOST_CHANNELS = 300
#: Signs of life that are remembered, half a kilobyte each: each machine of a site says some few for years.
MOST_KNOWN = 1 << 12
#: Rules look at the time this often, us of the log.
TICK_US = 1_000_000
#: Times of a log, or bus time, that go back by more than this begin another run, us.
BACK_US = 1_000_000

#: ``LogEvent`` from a tuple of all its fields: half the time of calling the class.
_event_of: Callable[[Any], LogEvent[Any]] = partial(tuple.__new__, LogEvent)


#: ``Frame`` from a tuple of all its fields: half the time of calling the class.
_frame_of: Callable[[Any], Frame] = partial(tuple.__new__, Frame)

#: Words that may tell that another run begins.
_OF_TIME = frozenset((BusTime, Heartbeat))
#: The handlers of rules that see messages of a class, and what takes those up in the picture.
_Route = tuple[tuple[Callable[[Any], None], ...], Callable[[Any, int], None] | None]


@dataclass
class LogVerdict:
    """What came of a log. ``unknown`` counts frames that came to no message, by reason; ``waits_us`` by node-ID.

    ``foreign`` has who speaks another contract, with its number.
    """

    rules: tuple[type[Rule], ...]
    left_out: dict[str, str] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)
    seen: Counter[str] = field(default_factory=Counter)
    unknown: Counter[str] = field(default_factory=Counter)
    foreign: dict[int, int] = field(default_factory=dict)
    frames: int = 0
    messages: int = 0
    runs: int = 1
    backwards: int = 0
    unjudged: int = 0
    waits_us: dict[int, int] = field(default_factory=dict)
    wait_limit_us: int | None = None

    @property
    def is_good(self) -> bool:
        """Whether no rule was broken."""
        return not self.counts

    def lines(self, name: Callable[[int], str] = str) -> list[str]:
        """The report: each rule with what it found, then the findings in the order of the log."""
        found = [
            f"{self.frames} frames, {self.messages} messages, {self.runs} run{'s' if self.runs > 1 else ''}",
            *(f"  {rule.name:<17} {self._told(rule)}" for rule in self.rules),
        ]
        found += [f"  {rule:<17} left out: {why}" for rule, why in self.left_out.items()]
        if self.wait_limit_us is not None and self.waits_us:
            waits = ", ".join(f"{name(node)} {us / 1e6:.1f} s" for node, us in sorted(self.waits_us.items()))
            found.append(f"longest waits: {waits}; limit {self.wait_limit_us / 1e6:.0f} s")
        if self.unknown:
            found.append("no message: " + ", ".join(f"{why} {count}" for why, count in sorted(self.unknown.items())))
        if self.foreign:
            found.append(foreign_line(self.foreign, name))
        if self.backwards:
            found.append(f"times going back: {self.backwards}")
        if self.unjudged:
            found.append(f"not judged, because the log does not tell enough: {self.unjudged}")
        found += [finding.line(name) for finding in self.findings]
        more = sum(self.counts.values()) - len(self.findings)
        return [*found, *([f"and {more} more"] if more > 0 else [])]

    def to_json(self) -> dict[str, Any]:
        """The same for programs; times in us."""
        return {
            "good": self.is_good,
            "frames": self.frames,
            "messages": self.messages,
            "runs": self.runs,
            "rules": {
                rule.name: {"broken": self.counts[rule.name], "seen": self.seen[rule.name]} for rule in self.rules
            },
            "left_out": self.left_out,
            "unknown": dict(self.unknown),
            "foreign": self.foreign,
            "unjudged": self.unjudged,
            "waits_us": self.waits_us,
            "wait_limit_us": self.wait_limit_us,
            "findings": [asdict(finding) for finding in self.findings],
        }

    def _told(self, rule: type[Rule]) -> str:
        if self.counts[rule.name]:
            return f"BROKEN {self.counts[rule.name]} times: {rule.title}"
        return f"{'held' if self.seen[rule.name] else 'nothing to judge'}: {rule.title}"


class Checks:
    """Feed a log's frames, or messages, in order; then ``finish``.

    ``disturbed``: frames may have been lost on purpose, so rules that need all of them are left out. Without a site
    the rules that need one are left out. Contract and rules are those of the site's system where none are given.
    """

    def __init__(
        self,
        site: Site | None,
        *,
        disturbed: bool = False,
        fleet: Codec | None = None,
        device: Codec | None = None,
        rules: tuple[type[Rule], ...] | None = None,
    ) -> None:
        self._site = site
        self._disturbed = disturbed
        both = codecs_for(site)
        self._codecs = (fleet or both.fleet, device or both.device)
        self._unheard: dict[tuple[type[Message], int], Reason] = {}
        #: Messages of this run that rules were shown, by class.
        self._seen: Counter[type[Message]] = Counter()
        self._whole = self._codecs[0].whole
        self._beat_bits = _beat_bits(self._codecs[0])
        #: Signs of life that no rule looks at, by their keys (``FrameBlock.apart``).
        self._beats: dict[bytes, Heartbeat] = {}
        self._decoders: dict[str, tuple[Decoder, Decoder]] = {}
        rules = rules_for(site) if rules is None else rules
        self.verdict = LogVerdict(tuple(rule for rule in rules if not self._why_not(rule)))
        self.verdict.left_out = {rule.name: why for rule in rules if (why := self._why_not(rule))}
        self._last_us: int | None = None
        self._excused_us = 0
        self._clocks_until_us = 0
        #: The newest bus time that each machine told, us, and who was started since it did last.
        self._bus_time_us: dict[int, int] = {}
        self._started: set[int] = set()
        self._begin()

    def _why_not(self, rule: type[Rule]) -> str:
        if rule.needs_site and self._site is None:
            return "needs the site file"
        return "holds only where no frame is lost" if rule.undisturbed and self._disturbed else ""

    def _begin(self) -> None:
        """Another run: nothing is known."""
        self._picture = BusPicture(self._site, disturbed=self._disturbed)
        self._picture.excused_us = self._excused_us
        self._picture.clock_settles_us = self._clocks_until_us
        self._rules = [rule(self._picture, self._keep) for rule in self.verdict.rules]
        self._ticks = [rule.tick for rule in self._rules if type(rule).tick is not Rule.tick]
        self._handlers: dict[type[Message], list[Callable[[Any], None]]] = {}
        self._routes: dict[type[Message], _Route] = {}
        self._names: dict[type[Message], list[str]] = {}
        for rule in self._rules:
            for kind, handler in rule.handlers().items():
                self._handlers.setdefault(kind, []).append(handler)
                self._names.setdefault(kind, []).append(rule.name)
        #: When rules look at the time again; 0: at once.
        self._tick_us = 0

    def excuse(self, until_us: int) -> None:
        """Until then, us of the log, machines are broken on purpose: rules of liveness begin to count there."""
        self._excused_us = self._picture.excused_us = max(self._excused_us, until_us)

    def excuse_clocks(self, until_us: int) -> None:
        """Until then, us of the log, clocks are wrong on purpose.

        A deadline is over when its machine thinks so, and bus time that goes back is no other run.
        """
        self._clocks_until_us = self._picture.clock_settles_us = until_us + SETTLING_US

    def feed(self, time_us: int, channel: str, frame: Frame) -> None:
        """One frame of a log; ``channel`` tells buses apart, and may be any name."""
        self.verdict.frames += 1
        if frame.is_error:
            self.verdict.unknown["ERROR_FRAME"] += 1
            return
        is_long = frame.is_extended and not frame.is_remote
        message = (self._whole(frame.arbitration_id, frame.data) if is_long else None) or self._completed(
            time_us, channel, frame
        )
        if message is not None:
            self.feed_message(time_us, message, channel, frame)

    def _completed(self, time_us: int, channel: str, frame: Frame) -> Message | None:
        """The message that a frame completes which is none by itself, or is one of a device bus."""
        fleet, device = self._decoders_of(channel)
        decoder = fleet if self._codecs[0].name_of(frame) is not None else device
        message = decoder.feed(frame, time_us)
        if message is None and decoder.drops:
            self._count_drops(decoder)
        return message

    def feed_message(self, time_us: int, message: Message, channel: str = "", frame: Frame | None = None) -> None:
        """One whole message, with the frame that completed it where there is one."""
        why = self._unheard.get((type(message), message.sender))
        if why is None:
            why = self._why_unheard(message)
        if why is Reason.NONE:
            for word in singles(message):
                self._judge(time_us, word, channel, frame)
        else:
            self.verdict.unknown[why.name] += 1

    def feed_block(self, block: "FrameBlock") -> None:
        """A stretch of a log by columns: the same as its frames one by one, but what was said before is known."""
        if block.others:
            for raw in block.frames():
                self.feed_raw(raw)
            return
        keys, others = block.apart(*self._beat_bits)
        self.verdict.frames += len(block)
        last_us, tick_us, picture, alive = self._last_us or 0, self._tick_us, self._picture, 0
        for time_us, channel, key in zip(block.time_us.tolist(), block.names, keys, strict=True):
            if key is None:
                self._feed_data(time_us, channel, next(others))
            elif (beat := self._beats.get(key) or self._learn(key)) is None:
                self._feed_data(time_us, channel, data_frame(key))
            elif last_us <= time_us and picture.beats.get(beat.sender) is beat:
                # It tells only that its sender lives: half of most logs.
                self._last_us = last_us = time_us
                if time_us >= tick_us:
                    tick_us = self._look(time_us)
                picture.heard_us[beat.sender] = picture.now_us = time_us
                alive += 1
                continue
            else:
                self._judge(time_us, beat, channel, None)
            last_us, tick_us, picture = self._last_us or 0, self._tick_us, self._picture
        self.verdict.messages += alive

    def _feed_data(self, time_us: int, channel: str, data_frame: tuple[int, bytes, bool]) -> None:
        """One data frame that is counted already: identifier, data, whether the identifier is a long one."""
        can_id, data, is_extended = data_frame
        frame = _frame_of((can_id, data, is_extended, False, False, 0))
        # Most frames are whole messages: nothing of other frames is needed for those.
        message = (self._whole(can_id, data) if is_extended else None) or self._completed(time_us, channel, frame)
        if message is not None:
            self.feed_message(time_us, message, channel, frame)

    def feed_raw(self, raw: RawFrame) -> None:
        """One frame of a log, of whatever kind."""
        frame = raw.classic()
        if frame is None:
            self.verdict.unknown["CAN FD frame"] += 1
        else:
            self.feed(raw.time_us, raw.channel, frame)

    def _learn(self, key: bytes) -> Heartbeat | None:
        """A sign of life without its mirror's digest; None where each is to be looked at anew: by rules, or as a start.

        None, too, for what is no message, and for who is not heard.
        """
        can_id, data, _ = data_frame(key)
        beat = self._whole(can_id, data)
        if not isinstance(beat, Heartbeat) or Heartbeat in self._handlers or beat.state is MachineState.STARTING:
            return None
        if self._why_unheard(beat) is not Reason.NONE:
            return None
        if len(self._beats) >= MOST_KNOWN:
            self._beats.clear()
        self._beats[key] = beat
        return beat

    def _judge(self, time_us: int, message: Message, channel: str, frame: Frame | None) -> None:
        """A message that the site listens to: every rule that reads such messages, and the picture, see it."""
        kind = type(message)
        last_us = self._last_us
        if last_us is None or time_us < last_us or (kind in _OF_TIME and _is_of_time(message)):
            time_us = self._orderly(time_us, message)
        self._last_us = time_us
        self.verdict.messages += 1
        picture = self._picture
        if time_us >= self._tick_us:
            self._look(time_us)
        handlers, take = self._routes.get(kind) or self._route(kind)
        if handlers:
            self._seen[kind] += 1
            event: LogEvent[Message] = _event_of((time_us, message, channel, frame))
            for handler in handlers:
                handler(event)
        picture.now_us = time_us
        if take is not None:
            take(message, time_us)

    def _look(self, time_us: int) -> int:
        """Rules look at the time; when they are to do so again."""
        self._picture.now_us = time_us
        for tick in self._ticks:
            tick(time_us)
        self._tick_us = time_us + TICK_US
        return self._tick_us

    def _route(self, kind: type[Message]) -> _Route:
        found = self._routes[kind] = tuple(self._handlers.get(kind, ())), self._picture.taken.get(kind)
        return found

    def _why_unheard(self, message: Message) -> Reason:
        """Why nobody of the site listens: by class and sender, so worked out once for each."""
        if self._site is None:
            return Reason.NONE
        why = why_unheard(message, self._site.machines, self._codecs[0].speakers)
        self._unheard[type(message), message.sender] = why
        return why

    def finish(self) -> LogVerdict:
        """The log has ended: judge what is still open, and tell the verdict."""
        self._end()
        for decoders in self._decoders.values():
            for decoder in decoders:
                self._count_drops(decoder)
        return self.verdict

    def _end(self) -> None:
        for kind, count in self._seen.items():
            self.verdict.seen.update(dict.fromkeys(self._names[kind], count))
        self._seen.clear()
        for rule in self._rules:
            rule.tick(self._last_us or 0)
            rule.finish(self._last_us or 0)
            if rule.limit_us:
                self.verdict.wait_limit_us = rule.limit_us
                for node, waited_us in rule.longest_us.items():
                    self.verdict.waits_us[node] = max(self.verdict.waits_us.get(node, 0), waited_us)
        self.verdict.unjudged += self._picture.unjudged
        beats = self._picture.beats.items()
        self.verdict.foreign |= {node: beat.contract for node, beat in beats if beat.contract != CONTRACT_VERSION}

    def _orderly(self, time_us: int, message: Message) -> int:
        """The time to go by: a little back is held, much back is another run, as is bus time that starts anew."""
        last_us = self._last_us
        back_us = 0 if last_us is None else last_us - time_us
        anew = isinstance(message, BusTime | Heartbeat) and self._is_anew(time_us, message)
        if back_us > BACK_US or anew:
            self._end()
            self.verdict.runs += 1
            self._begin()
        elif back_us > 0:
            self.verdict.backwards += 1
            time_us = last_us or 0
        return time_us

    def _is_anew(self, time_us: int, message: BusTime | Heartbeat) -> bool:
        """Whether bus time began anew, going back or standing still while the log goes on.

        A word of the same life that is late only was held up: with one other machine on the bus, and that one off,
        nobody acknowledges frames, and the word waits until it is back. So do those of all, of a bus that was dead.
        """
        if isinstance(message, Heartbeat):
            if message.state is MachineState.STARTING:
                self._started.add(message.sender)
            return False
        before_us, offset_us = self._bus_time_us.get(message.sender, -1), self._picture.offset_us
        self._bus_time_us[message.sender] = message.bus_time_us
        is_held_up = message.bus_time_us > before_us and message.sender not in self._started
        self._started.discard(message.sender)
        is_late = offset_us is not None and time_us - message.bus_time_us - offset_us > BACK_US
        return is_late and not is_held_up and time_us >= self._clocks_until_us

    def _keep(self, finding: Finding) -> None:
        self.verdict.counts[finding.rule] += 1
        if len(self.verdict.findings) < MOST_FINDINGS:
            self.verdict.findings.append(finding)

    def _decoders_of(self, channel: str) -> tuple[Decoder, Decoder]:
        found = self._decoders.get(channel)
        if found is None:
            if len(self._decoders) >= MOST_CHANNELS:
                return next(iter(self._decoders.values()))
            fleet, device = (Decoder(codec, is_only_one=True) for codec in self._codecs)
            found = self._decoders[channel] = fleet, device
        return found

    def _count_drops(self, decoder: Decoder) -> None:
        for reason, count in decoder.drops.items():
            self.verdict.unknown[reason.name] += count
        decoder.drops.clear()


def _beat_bits(fleet: Codec) -> tuple[int, int]:
    """The identifier of signs of life, and the bits of their data in which only the mirror's digest stands.

    Data as one little-endian number: no rule reads that digest, and it changes all the time.
    """
    beat = Heartbeat(1, 0, 1, 0, 1, KindCode.ANY, MachineState.STARTING, 0)
    (one,), (other,) = fleet.encode(beat), fleet.encode(replace(beat, mirror_digest=0xFFFF))
    bits = int.from_bytes(one.data, "little") ^ int.from_bytes(other.data, "little")
    return fleet.identifier_of(Heartbeat.__name__), bits


def _is_of_time(message: Message) -> bool:
    return not isinstance(message, Heartbeat) or message.state is MachineState.STARTING


def check_records(records: Iterable[LogRecord], checks: Checks) -> LogVerdict:
    """Judge a whole log, such as a ``CandumpReader`` gives it."""
    for record in records:
        checks.feed(record.time_us, record.channel, record.frame)
    verdict = checks.finish()
    if isinstance(records, CandumpReader):
        for fault, count in records.faults.items():
            verdict.unknown[fault.value] += count
    return verdict
