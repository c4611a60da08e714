"""Logs in words: the fleet's messages by its contract, or any bus's frames by any DBC. Nothing is passed over."""

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterable, Iterator
from operator import add
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

    def _each(self, frames: Iterable[RawFrame]) -> Iterator[str]:
        known, prefix = self._known, self._screen.prefix
        for frame in frames:
            words = known.get(frame[2:9]) or self._new(frame, frame[2:9])
            if words is not None:
                yield prefix(frame.time_us, frame.channel) + words
            elif frame.is_error or frame.is_remote or frame.fd_flags is not None:
                yield self._screen.text(frame)

    def _together(self, block: "FrameBlock") -> Iterable[str]:
        """The lines of data frames: words first, those of new frames in the order of the log, then time and channel."""
        known, words = self._known, []
        for time_us, channel, key in zip(block.time_us.tolist(), block.names, block.keys, strict=True):
            words.append(known.get(key) or self._new(RawFrame(time_us, channel, *data_frame(key)), key))
        if None in words:
            block, words = (
                block.only([row for row, one in enumerate(words) if one is not None]),
                list(filter(None, words)),
            )
        return map(add, self._screen.prefixes(block), words)

    def _new(self, frame: RawFrame, key: object) -> str | None:
        words, is_fixed = self._say(frame)
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

    def report(self) -> list[str]:
        """What was no message, counted."""
        return self._listener.lines()

    def _say(self, frame: RawFrame) -> tuple[str | None, bool]:
        """None where it is not the last of a message, and where it is no data frame."""
        _, message, reason, _ = self._listener.hear(frame)
        if message is not None:
            return self._words.message(message), is_one_frame(message) and self._words.is_fixed(message)
        if reason is not None:
            return f"{log_frame(frame)}  ({reason.name.lower().replace('_', ' ')})", False
        return None, False


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


def _told(what: str, counts: Counter[str]) -> list[str]:
    if not counts:
        return []
    named = ", ".join(f"{name} {count}" for name, count in counts.most_common(_NAMED))
    more = f" and {len(counts) - _NAMED} more" if len(counts) > _NAMED else ""
    return [f"{what}: {counts.total()} frames ({named}{more})"]
