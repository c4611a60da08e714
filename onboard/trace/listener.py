"""All messages of a log, whichever bus they were on: every channel is a listener of its own with both contracts."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from typing import Any, NamedTuple

from onboard.contract.codes import CONTRACT_VERSION, Reason
from onboard.contract.messages import Heartbeat, Message
from onboard.contract.runs import singles
from onboard.trace.raw import RawFrame
from onboard.wire.codec import Codecs
from onboard.wire.decoder import Decoder

#: Channels of a log that are told apart; a name more is taken for one of them.
MOST_CHANNELS = 300
#: Machines of another contract that are named in one line.
MOST_NAMED = 3


class LoggedFrame(NamedTuple):
    """One frame and what it came to: the message that it completes, or why it came to none; neither for a part."""

    frame: RawFrame
    message: Message | None
    reason: Reason | None
    is_fleet: bool


#: ``LoggedFrame`` from a tuple of all its fields: half the time of calling the class.
_logged: Callable[[Any], LoggedFrame] = partial(tuple.__new__, LoggedFrame)


class LoggedMessage(NamedTuple):
    """One whole message: time in us of the log, channel, and whether it was of the fleet bus's contract."""

    time_us: int
    channel: str
    message: Message
    is_fleet: bool


class Listener:
    """Decodes frame after frame. ``unknown`` counts data frames of no contract, by channel and identifier."""

    def __init__(self, codecs: Codecs) -> None:
        self.codecs = codecs
        self._whole = codecs.fleet.whole
        self.drops: Counter[Reason] = Counter()
        self.others: Counter[str] = Counter()
        #: Who speaks another contract, with its number.
        self.foreign: dict[int, int] = {}
        self._decoders: dict[str, tuple[Decoder, Decoder]] = {}

    def hear(self, frame: RawFrame) -> LoggedFrame:
        """Take up one frame. Never raises, whatever the frame."""
        if frame.is_extended and not (frame.is_remote or frame.is_error) and frame.fd_flags is None:
            # Most frames are whole messages, and no listener needs to remember anything for those.
            message = self._whole(frame.can_id, frame.data)
            if message is not None:
                self.note(message)
                return _logged((frame, message, None, True))
        classic = frame.classic()
        if classic is None or classic.is_error or classic.is_remote:
            kind = "CAN FD frames" if classic is None else "error frames" if classic.is_error else "remote frames"
            self.others[kind] += 1
            return LoggedFrame(frame, None, None, False)
        fleet, device = self._decoders_of(frame.channel)
        is_fleet = self.codecs.fleet.name_of(classic) is not None
        decoder = fleet if is_fleet else device
        message = decoder.feed(classic, frame.time_us)
        reason = None
        if decoder.drops:
            reason = next(iter(decoder.drops))
            self.drops.update(decoder.drops)
            decoder.drops.clear()
        return LoggedFrame(frame, message, reason, is_fleet)

    def note(self, message: Message) -> None:
        """Remember who speaks another contract: where layouts are others there, its words are read wrongly."""
        if type(message) is Heartbeat and message.contract != CONTRACT_VERSION:
            self.foreign[message.sender] = message.contract

    def messages(self, frames: Iterable[RawFrame]) -> Iterator[LoggedMessage]:
        """Whole messages only, in the order of the log."""
        for frame in frames:
            heard = self.hear(frame)
            if heard.message is not None:
                for word in singles(heard.message):
                    yield LoggedMessage(frame.time_us, frame.channel, word, heard.is_fleet)

    def lines(self) -> list[str]:
        """What came to nothing, one line for each reason."""
        words = [foreign_line(self.foreign)] if self.foreign else []
        words += [f"{kind}: {count}" for kind, count in sorted(self.others.items())]
        words += [
            f"frames that are no message ({reason.name.lower().replace('_', ' ')}): {count}"
            for reason, count in sorted(self.drops.items())
        ]
        unfinished = sum(decoder.unfinished for pair in self._decoders.values() for decoder in pair)
        return words + ([f"sets that were not whole at the end: {unfinished}"] if unfinished else [])

    def _decoders_of(self, channel: str) -> tuple[Decoder, Decoder]:
        found = self._decoders.get(channel)
        if found is None:
            if len(self._decoders) >= MOST_CHANNELS:
                return next(iter(self._decoders.values()))
            fleet, device = (Decoder(codec, is_only_one=True) for codec in self.codecs)
            found = self._decoders[channel] = fleet, device
        return found


def foreign_line(contracts: Mapping[int, int], name: Callable[[int], str] = "node {}".format) -> str:
    """That machines speak other contracts than this program reads: which, by sender, and what to do."""
    those = ", ".join(f"{name(node)} {number}" for node, number in sorted(contracts.items())[:MOST_NAMED])
    more = f" and {len(contracts) - MOST_NAMED} more" if len(contracts) > MOST_NAMED else ""
    told = f"contracts that this program does not read ({CONTRACT_VERSION} is its own): {those}{more}"
    return f"{told}; read the log with the version that wrote it"
