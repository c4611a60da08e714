"""Who plans to be on which segment when: half-open windows ``[from, to)`` in bus us, and the gaps between them."""

from bisect import insort
from collections.abc import Iterable
from typing import NamedTuple

from onboard.core.site import Segment

#: End of a window that has no end: the machine stands there until it plans otherwise.
FOREVER = 1 << 62


class Window(NamedTuple):
    """Occupation of one segment during ``[from_us, to_us)``."""

    segment: Segment
    from_us: int
    to_us: int


class Interval(NamedTuple):
    """A safe interval ``[from_us, to_us)`` of one segment: nobody else plans to be there."""

    from_us: int
    to_us: int


class Reservations:
    """Windows by segment, sorted by their start. Windows of different owners may overlap: a mirror can be wrong."""

    def __init__(self) -> None:
        self._windows: dict[Segment, list[tuple[int, int, int]]] = {}
        self._segments: dict[int, set[Segment]] = {}

    def reserve(self, owner: int, windows: Iterable[Window]) -> None:
        """Add windows of ``owner`` (a node-ID). Raises ``ValueError`` for an empty or reversed window."""
        touched = self._segments.setdefault(owner, set())
        for window in windows:
            if window.from_us >= window.to_us:
                raise ValueError(f"window {window} of node {owner} has no length")
            insort(self._windows.setdefault(window.segment, []), (window.from_us, window.to_us, owner))
            touched.add(window.segment)

    def release(self, owner: int) -> None:
        """Remove all windows of ``owner``."""
        for segment in self._segments.pop(owner, ()):
            kept = [window for window in self._windows[segment] if window[2] != owner]
            if kept:
                self._windows[segment] = kept
            else:
                del self._windows[segment]

    def safe_intervals(self, segment: Segment, owner: int, from_us: int) -> list[Interval]:
        """Gaps that the windows of all but ``owner`` leave from ``from_us`` on, in order; the last may be endless."""
        gaps: list[Interval] = []
        free_us = from_us
        for start_us, end_us, holder in self._windows.get(segment, ()):
            if holder == owner or end_us <= free_us:
                continue
            if start_us > free_us:
                gaps.append(Interval(free_us, start_us))
            free_us = end_us
        if free_us < FOREVER:
            gaps.append(Interval(free_us, FOREVER))
        return gaps

    def conflicts(self, owner: int, windows: Iterable[Window]) -> list[tuple[Window, int]]:
        """Each of ``windows`` that overlaps one of another node, with that node."""
        return [
            (window, holder)
            for window in windows
            for start_us, end_us, holder in self._windows.get(window.segment, ())
            if holder != owner and start_us < window.to_us and window.from_us < end_us
        ]

    def first_start(self, owner: int, segment: Segment, now_us: int) -> int | None:
        """Start of ``owner``'s first window on a segment that is not over at ``now_us``, or None."""
        starts = [s for s, end_us, holder in self._windows.get(segment, ()) if holder == owner and end_us > now_us]
        return min(starts) if starts else None

    def earliest_other_start(self, owner: int, segment: Segment, now_us: int) -> int | None:
        """Start of anybody else's first window on a segment that is not over at ``now_us``, or None."""
        starts = [s for s, end_us, holder in self._windows.get(segment, ()) if holder != owner and end_us > now_us]
        return min(starts) if starts else None

    def is_free(self, segment: Segment, now_us: int, *, excluding: int) -> bool:
        """Whether nobody but ``excluding`` has a window on a segment that is not over at ``now_us``."""
        return self.earliest_other_start(excluding, segment, now_us) is None
