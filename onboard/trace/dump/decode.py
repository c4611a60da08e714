"""Logs in words: the fleet's messages by its contract, or any bus's frames by any DBC. Nothing is passed over."""

from collections import Counter
from collections.abc import Iterator

from onboard.core.site import Site
from onboard.trace.dump.formats import Screen, log_frame
from onboard.trace.listener import Listener
from onboard.trace.raw import RawFrame
from onboard.trace.words import Words
from onboard.wire.codec import Codecs
from onboard.wire.dbc_file import AnyDbc

#: Unknown identifiers that are named in the report; all are counted.
_NAMED = 8


class MessageLines:
    """One line a message of the fleet; a frame that is no part of one is shown raw with the reason."""

    def __init__(self, site: Site | None, codecs: Codecs, screen: Screen) -> None:
        self._words = Words(site)
        self._listener = Listener(codecs)
        self._screen = screen

    def of(self, frame: RawFrame) -> Iterator[str]:
        """The lines of a frame: none for the first frames of a set."""
        heard = self._listener.hear(frame)
        if heard.message is not None:
            yield self._screen.prefix(frame) + self._words.message(heard.message)
        elif heard.reason is not None:
            yield f"{self._screen.prefix(frame)}{log_frame(frame)}  ({heard.reason.name.lower().replace('_', ' ')})"
        elif frame.is_error or frame.is_remote or frame.fd_flags is not None:
            yield self._screen.text(frame)

    def report(self) -> list[str]:
        """What was no message, counted."""
        return self._listener.lines()


class DbcLines:
    """One line a frame: message and signals with units and value names, of the frames that a DBC knows."""

    def __init__(self, dbc: AnyDbc, screen: Screen) -> None:
        self._dbc = dbc
        self._screen = screen
        self._unknown: Counter[str] = Counter()
        self._short: Counter[str] = Counter()

    def of(self, frame: RawFrame) -> Iterator[str]:
        """The line of a frame."""
        if frame.is_error or frame.is_remote:
            yield self._screen.text(frame)
            return
        decoded = self._dbc.decode(frame.can_id, frame.data, is_extended=frame.is_extended)
        if decoded is None:
            self._unknown[log_frame(frame).partition("#")[0]] += 1
            yield f"{self._screen.prefix(frame)}{log_frame(frame)}  (unknown identifier)"
            return
        said = ", ".join(f"{name} {value}" for name, value in decoded.signals)
        note = ""
        if len(frame.data) < decoded.length:
            self._short[decoded.name] += 1
            note = f"  (short frame: {len(frame.data)} of {decoded.length} bytes)"
        yield f"{self._screen.prefix(frame)}{decoded.name}: {said}{note}"

    def report(self) -> list[str]:
        """Unknown identifiers and short frames, counted."""
        return _told("unknown identifiers", self._unknown) + _told("short frames", self._short)


def _told(what: str, counts: Counter[str]) -> list[str]:
    if not counts:
        return []
    named = ", ".join(f"{name} {count}" for name, count in counts.most_common(_NAMED))
    more = f" and {len(counts) - _NAMED} more" if len(counts) > _NAMED else ""
    return [f"{what}: {counts.total()} frames ({named}{more})"]
