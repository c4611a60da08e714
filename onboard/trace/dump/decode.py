"""Logs in words: the fleet's messages by its contract, or any bus's frames by any DBC. Nothing is passed over."""

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from onboard.core.site import Site
from onboard.trace.dump.formats import Screen, log_frame
from onboard.trace.listener import Listener
from onboard.trace.raw import RawFrame, data_frame
from onboard.trace.readers.open_log import Portion
from onboard.trace.words import Words
from onboard.wire.codec import Codecs, is_one_frame

if TYPE_CHECKING:
    from onboard.trace.columns.block import FrameBlock
    from onboard.wire.dbc_file import AnyDbc

#: Unknown identifiers that are named in the report; all are counted.
_NAMED = 8
#: Frames whose words are remembered, some 200 bytes each; heartbeats come again for hours.
_KEPT = 1 << 12


class _Lines(ABC):
    """Lines of time, channel and words. What is always said in the same words is put into words once."""

    def __init__(self, screen: Screen) -> None:
        self._screen = screen
        #: By all that a frame is but time, channel and direction.
        self._known: dict[object, str] = {}

    def of(self, portion: Portion) -> Iterable[str]:
        """The lines of some frames."""
        return self._each(portion.ones) if portion.block is None else self._together(portion.block)

    @abstractmethod
    def report(self) -> list[str]:
        """What came to no message, counted."""

    @abstractmethod
    def _say(self, frame: RawFrame) -> tuple[str | None, bool]:
        """The words of a frame that are its line, if it has any, and whether they are the same whenever it comes."""

    @abstractmethod
    def _say_whole(self, can_id: int, data: bytes, *, is_extended: bool) -> tuple[str, bool] | None:
        """The same of a data frame that needs no other frame to be understood; None where ``_say`` must look at it."""

    def _each(self, frames: Iterable[RawFrame]) -> Iterator[str]:
        known, prefix = self._known, self._screen.prefix
        for frame in frames:
            words = known.get(frame[2:9]) or self._kept(frame[2:9], self._say(frame))
            if words is not None:
                yield prefix(frame.time_us, frame.channel) + words
            elif frame.is_error or frame.is_remote or frame.fd_flags is not None:
                yield self._screen.text(frame)

    def _together(self, block: "FrameBlock") -> Iterable[str]:
        """The lines of data frames: words first, those of new frames in the order of the log, then time and channel."""
        known, new = self._known, self._new
        times, names = block.time_us.tolist(), block.names
        words = [
            known.get(key) or new(time_us, channel, key)
            for time_us, channel, key in zip(times, names, block.keys, strict=True)
        ]
        if (prefixes := self._screen.prefixes(block)) is not None:
            return [prefix + said for prefix, said in zip(prefixes, words, strict=True) if said is not None]
        prefix_of = self._screen.prefix
        rows = zip(times, names, words, strict=True)
        return (prefix_of(time_us, name) + said for time_us, name, said in rows if said is not None)

    def _new(self, time_us: int, channel: str, key: bytes) -> str | None:
        """The words of a data frame that are not known, by its key (``FrameBlock.keys``)."""
        can_id, data, is_extended = data_frame(key)
        whole = self._say_whole(can_id, data, is_extended=is_extended)
        said = whole or self._say(RawFrame(time_us, channel, can_id, data, is_extended))
        return self._kept(key, said) if said[1] else said[0]

    def _kept(self, key: object, said: tuple[str | None, bool]) -> str | None:
        words, is_fixed = said
        if is_fixed and words is not None:
            if len(self._known) >= _KEPT:
                self._known.clear()
            self._known[key] = words
        return words


class MessageLines(_Lines):
    """One line a message of the fleet; a frame that is no part of one is shown raw with the reason."""

    def __init__(self, site: Site | None, codecs: Codecs, screen: Screen) -> None:
        super().__init__(screen)
        self._words = Words(site)
        self._listener = Listener(codecs)
        self._whole = codecs.fleet.whole

    def report(self) -> list[str]:
        """What was no message, counted."""
        return self._listener.lines()

    def _say(self, frame: RawFrame) -> tuple[str | None, bool]:
        """None where it is not the last of a message, and where it is no data frame."""
        _, message, reason, _ = self._listener.hear(frame)
        if message is not None:
            words, is_fixed = self._words.said(message)
            return words, is_fixed and is_one_frame(message)
        if reason is not None:
            return f"{log_frame(frame)}  ({reason.name.lower().replace('_', ' ')})", False
        return None, False

    def _say_whole(self, can_id: int, data: bytes, *, is_extended: bool) -> tuple[str, bool] | None:
        """Most frames are whole messages, of which a listener remembers nothing else (``Listener.hear``)."""
        message = self._whole(can_id, data) if is_extended else None
        if message is None:
            return None
        self._listener.note(message)
        return self._words.said(message)


class DbcLines(_Lines):
    """One line a frame: message and signals with units and value names, of the frames that a DBC knows."""

    def __init__(self, dbc: "AnyDbc", screen: Screen) -> None:
        super().__init__(screen)
        self._dbc = dbc
        self._unknown: Counter[str] = Counter()
        self._short: Counter[str] = Counter()

    def report(self) -> list[str]:
        """Unknown identifiers and short frames, counted."""
        return _told("unknown identifiers", self._unknown) + _told("short frames", self._short)

    def _say(self, frame: RawFrame) -> tuple[str | None, bool]:
        """None for error and remote frames alone."""
        if frame.is_error or frame.is_remote:
            return None, False
        decoded = self._dbc.decode(frame.can_id, frame.data, is_extended=frame.is_extended)
        if decoded is None:
            self._unknown[log_frame(frame).partition("#")[0]] += 1
            return f"{log_frame(frame)}  (unknown identifier)", False
        said = f"{decoded.name}: {decoded.text}"
        if len(frame.data) < decoded.length:
            self._short[decoded.name] += 1
            return f"{said}  (short frame: {len(frame.data)} of {decoded.length} bytes)", False
        return said, True

    def _say_whole(self, can_id: int, data: bytes, *, is_extended: bool) -> tuple[str, bool] | None:
        """Most frames are of messages that are cut into signals as they are."""
        words = self._dbc.words(can_id, data, is_extended=is_extended)
        return None if words is None else (words, True)


def _told(what: str, counts: Counter[str]) -> list[str]:
    if not counts:
        return []
    named = ", ".join(f"{name} {count}" for name, count in counts.most_common(_NAMED))
    more = f" and {len(counts) - _NAMED} more" if len(counts) > _NAMED else ""
    return [f"{what}: {counts.total()} frames ({named}{more})"]
