"""Logs in words: the fleet's messages by its contract, or any bus's frames by any DBC. Nothing is passed over."""

from collections import Counter
from collections.abc import Iterable, Iterator

from onboard.core.site import Site
from onboard.trace.dump.formats import Screen, log_frame
from onboard.trace.listener import Listener
from onboard.trace.raw import RawFrame
from onboard.trace.words import Words
from onboard.wire.codec import Codecs, is_one_frame
from onboard.wire.dbc_file import AnyDbc

#: Unknown identifiers that are named in the report; all are counted.
_NAMED = 8
#: All that a frame is but time, channel and direction: what always says the same is put into words once.
_Said = tuple[object, ...]
#: Frames whose words are remembered, some 200 bytes each; heartbeats come again for hours.
_KEPT = 1 << 16


class MessageLines:
    """One line a message of the fleet; a frame that is no part of one is shown raw with the reason."""

    def __init__(self, site: Site | None, codecs: Codecs, screen: Screen) -> None:
        self._words = Words(site)
        self._listener = Listener(codecs)
        self._screen = screen
        self._known: dict[_Said, str] = {}

    def all(self, frames: Iterable[RawFrame]) -> Iterator[str]:
        """The lines of frames: none for the first frames of a set."""
        known, say, prefix = self._known, self._said, self._screen.prefix
        for frame in frames:
            said = known.get(frame[2:9]) or say(frame)
            if said is not None:
                yield prefix(frame) + said
            elif not frame.is_data:
                yield self._screen.text(frame)

    def _said(self, frame: RawFrame) -> str | None:
        """The words of a frame; None where it is not the last of a message, and where it is no data frame."""
        _, message, reason, _ = self._listener.hear(frame)
        if message is not None:
            said = self._words.message(message)
            if is_one_frame(message) and self._words.is_fixed(message):
                _keep(self._known, frame, said)
            return said
        if reason is not None:
            return f"{log_frame(frame)}  ({reason.name.lower().replace('_', ' ')})"
        return None

    def report(self) -> list[str]:
        """What was no message, counted."""
        return self._listener.lines()


def _keep(known: dict[_Said, str], frame: RawFrame, said: str) -> None:
    if len(known) >= _KEPT:
        known.clear()
    known[frame[2:9]] = said


class DbcLines:
    """One line a frame: message and signals with units and value names, of the frames that a DBC knows."""

    def __init__(self, dbc: AnyDbc, screen: Screen) -> None:
        self._dbc = dbc
        self._screen = screen
        self._unknown: Counter[str] = Counter()
        self._short: Counter[str] = Counter()
        self._known: dict[_Said, str] = {}

    def all(self, frames: Iterable[RawFrame]) -> Iterator[str]:
        """The line of each frame."""
        known, prefix = self._known, self._screen.prefix
        for frame in frames:
            if frame.is_error or frame.is_remote:
                yield self._screen.text(frame)
            else:
                yield prefix(frame) + (known.get(frame[2:9]) or self._said(frame))

    def _said(self, frame: RawFrame) -> str:
        decoded = self._dbc.decode(frame.can_id, frame.data, is_extended=frame.is_extended)
        if decoded is None:
            self._unknown[log_frame(frame).partition("#")[0]] += 1
            return f"{log_frame(frame)}  (unknown identifier)"
        said = f"{decoded.name}: " + ", ".join(f"{name} {value}" for name, value in decoded.signals)
        if len(frame.data) < decoded.length:
            self._short[decoded.name] += 1
            return f"{said}  (short frame: {len(frame.data)} of {decoded.length} bytes)"
        _keep(self._known, frame, said)
        return said

    def report(self) -> list[str]:
        """Unknown identifiers and short frames, counted."""
        return _told("unknown identifiers", self._unknown) + _told("short frames", self._short)


def _told(what: str, counts: Counter[str]) -> list[str]:
    if not counts:
        return []
    named = ", ".join(f"{name} {count}" for name, count in counts.most_common(_NAMED))
    more = f" and {len(counts) - _NAMED} more" if len(counts) > _NAMED else ""
    return [f"{what}: {counts.total()} frames ({named}{more})"]
