"""Who plans to be on which segment, and on which lift, when: half-open windows ``[from, to)`` in bus us."""

from bisect import insort
from collections.abc import Hashable, Iterable, Sequence
from typing import NamedTuple

from onboard.core.site import Segment

#: End of a window that has no end: the machine stands there until it plans otherwise.
FOREVER = 1 << 62


class SlotWindow(NamedTuple):
    """Occupation of one segment during ``[from_us, to_us)``."""

    segment: Segment
    from_us: int
    to_us: int


class Use(NamedTuple):
    """Occupation of a lift's platform by ``owner``, from the body entering it to the body having left it.

    ``board_index`` and ``leave_index`` are the lift's indices (1 to the number of floors served) of the two floors.
    """

    lift_track: int
    board_index: int
    leave_index: int
    from_us: int
    to_us: int
    owner: int


class Interval(NamedTuple):
    """A safe interval ``[from_us, to_us)`` of one segment: nobody else plans to be there."""

    from_us: int
    to_us: int


class Planned:
    """Windows by segment and uses by lift, sorted by their start: what a search has to know of them."""

    def __init__(self, windows: dict[Segment, list[tuple[int, int, int]]], uses: dict[int, list[Use]]) -> None:
        self._windows = windows
        self._uses = uses

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

    def on(self, segment: Segment) -> Sequence[tuple[int, int, int]]:
        """Begin, end and owner of all windows on a segment, by their begins."""
        return self._windows.get(segment, ())

    def uses(self, lift_track: int, excluding: int) -> list[Use]:
        """Uses of one lift by all but ``excluding``, sorted by begin, end and owner."""
        return [use for use in self._uses.get(lift_track, ()) if use.owner != excluding]


class Reservations(Planned):
    """Windows by segment and uses by lift, sorted by their start. Those of different owners may overlap.

    A mirror can be wrong.
    """

    def __init__(self) -> None:
        super().__init__({}, {})
        self._segments: dict[int, set[Segment]] = {}
        self._fixed: set[int] = set()
        #: What was worked out around all but one owner, by that and more: forgotten when another's windows change.
        self.kept: dict[tuple[int, Hashable], object] = {}

    def fix(self, owner: int) -> None:
        """``owner`` is an obstacle, which never gives way, until it is released."""
        self._fixed.add(owner)

    def reserve(self, owner: int, windows: Iterable[SlotWindow], uses: Iterable[Use] = ()) -> None:
        """Add windows and lift uses of ``owner`` (a node-ID). Raises ``ValueError`` where one has no length."""
        self._forget(owner)
        touched, by_segment = self._segments.setdefault(owner, set()), self._windows
        for window in windows:
            segment, from_us, to_us = window
            if from_us >= to_us:
                raise ValueError(f"window {window} of node {owner} has no length")
            known = by_segment.get(segment)
            if known is None:
                by_segment[segment] = [(from_us, to_us, owner)]
            else:
                insort(known, (from_us, to_us, owner))
            touched.add(segment)
        for use in uses:
            if use.from_us >= use.to_us or use.owner != owner:
                raise ValueError(f"use {use} has no length, or is not of node {owner}")
            insort(self._uses.setdefault(use.lift_track, []), use, key=_begin)

    def reserve_apart(self, owner: int, windows: Sequence[SlotWindow]) -> bool:
        """Add windows of ``owner``, which has none, unless one overlaps another node's: then False, and nothing is."""
        by_segment, found = self._windows, []
        for segment, from_us, to_us in windows:
            known = by_segment.get(segment)
            if known is None:
                known = by_segment[segment] = []
            for start_us, end_us, _ in known:
                if start_us < to_us and from_us < end_us:
                    return False
            found.append(known)
        self._forget(owner)
        for known, (_, from_us, to_us) in zip(found, windows, strict=True):
            insort(known, (from_us, to_us, owner))
        self._segments[owner] = {window[0] for window in windows}
        return True

    def release(self, owner: int) -> None:
        """Remove all windows and uses of ``owner``."""
        self._forget(owner)
        self._fixed.discard(owner)
        for lift_track, uses in self._uses.items():
            self._uses[lift_track] = [use for use in uses if use.owner != owner]
        by_segment = self._windows
        for segment in self._segments.pop(owner, ()):
            known = by_segment.pop(segment)
            # Most are its own alone, and no list is to be made for that; in a copy they may be gone, and others left.
            is_all = len(known) == 1 and known[0][2] == owner
            if not is_all and (kept := [window for window in known if window[2] != owner]):
                by_segment[segment] = kept

    def _forget(self, owner: int) -> None:
        if self.kept:
            self.kept = {key: found for key, found in self.kept.items() if key[0] == owner}

    def planned(self) -> Planned:
        """The same windows and uses, whenever one looks, without what is ``kept``.

        For what is kept itself: if it referred to where it is kept, only the collector of garbage could free it.
        """
        return Planned(self._windows, self._uses)

    def copy(self) -> "Reservations":
        """The same, to be changed by itself."""
        return self.with_way_given(FOREVER)

    def with_way_given(self, after_us: int) -> "Reservations":
        """A copy in which machines that stand for ever have given way by ``after_us``, and where they stand is free."""
        found = Reservations()
        found._uses = {lift_track: list(uses) for lift_track, uses in self._uses.items()}
        found._segments = {owner: set(segments) for owner, segments in self._segments.items()}
        found._fixed = set(self._fixed)
        for segment, windows in self._windows.items():
            kept = [
                (start, min(end, after_us) if end >= FOREVER and owner not in self._fixed else end, owner)
                for start, end, owner in windows
            ]
            found._windows[segment] = [window for window in kept if window[0] < window[1]]
        return found

    def apart(self, owner: int, tolerance_us: int) -> "Reservations":
        """A copy without begins and ends of others' windows, up to ``tolerance_us``, that lie in those of ``owner``.

        This very one where there are none. Plans that are told in whole milliseconds meet by their rounding, which
        counts as no conflict between plans ([P6], ``T_round``): who is followed at once would find no way around it.
        """
        mine = {segment: self._times(segment, owner) for segment in self._segments.get(owner, ())}
        rides = {lift_track: _rides(uses, owner) for lift_track, uses in self._uses.items()}
        touching = self._touching(owner, mine, rides, tolerance_us)
        if not touching:
            return self
        found = self.copy()
        for node in sorted(touching):
            windows = [
                SlotWindow(segment, *_less(time, mine.get(segment, []), tolerance_us))
                for segment in self._segments[node]
                for time in self._times(segment, node)
            ]
            uses = [
                Use(*use[:3], *_less(use[3:5], rides[lift_track], tolerance_us), node)
                for lift_track, all_uses in self._uses.items()
                for use in all_uses
                if use.owner == node
            ]
            found.release(node)
            found.reserve(
                node,
                (one for one in windows if one.from_us < one.to_us),
                (one for one in uses if one.from_us < one.to_us),
            )
            if node in self._fixed:
                found.fix(node)
        return found

    def _touching(
        self,
        owner: int,
        mine: dict[Segment, list[tuple[int, int]]],
        rides: dict[int, list[tuple[int, int]]],
        tolerance_us: int,
    ) -> set[int]:
        """Others of whose windows a begin or end is left out."""
        found = set()
        for segment, times in mine.items():
            for start_us, end_us, holder in self._windows[segment]:
                if holder != owner and _less((start_us, end_us), times, tolerance_us) != (start_us, end_us):
                    found.add(holder)
        for lift_track, times in rides.items():
            for use in self._uses[lift_track]:
                if use.owner != owner and _less(use[3:5], times, tolerance_us) != use[3:5]:
                    found.add(use.owner)
        return found

    def _times(self, segment: Segment, owner: int) -> list[tuple[int, int]]:
        return [(start_us, end_us) for start_us, end_us, holder in self._windows[segment] if holder == owner]

    def standing_in(self, owner: int, windows: Iterable[SlotWindow]) -> list[int]:
        """Nodes other than ``owner`` that stand for ever where one of ``windows`` is, in order."""
        found = set()
        for window in windows:
            for start_us, end_us, holder in self._windows.get(window.segment, ()):
                if holder != owner and end_us >= FOREVER and start_us < window.to_us:
                    found.add(holder)
        return sorted(found)

    def standing_since(self, owner: int) -> int | None:
        """When ``owner`` begins to stand for ever, by its plan; None where it never does."""
        starts = [
            start_us
            for segment in self._segments.get(owner, ())
            for start_us, end_us, holder in self._windows.get(segment, ())
            if holder == owner and end_us >= FOREVER
        ]
        return min(starts, default=None)

    def conflicts(self, owner: int, windows: Iterable[SlotWindow]) -> list[tuple[SlotWindow, int]]:
        """Each of ``windows`` that overlaps one of another node, with that node."""
        by_segment = self._windows
        return [
            (window, holder)
            for window in windows
            for start_us, end_us, holder in by_segment.get(window[0], ())
            if holder != owner and start_us < window[2] and window[1] < end_us
        ]

    def hinders(self, owner: int, windows: Iterable[SlotWindow], now_us: int) -> bool:
        """Whether one of ``windows`` of ``owner`` that is not over at ``now_us`` meets an obstacle."""
        if not self._fixed - {owner}:
            return False
        ahead = [window for window in windows if window.to_us > now_us]
        return any(holder in self._fixed for _, holder in self.conflicts(owner, ahead))

    def earliest_other_start(self, owner: int, segment: Segment, now_us: int) -> int | None:
        """Start of anybody else's first window on a segment that is not over at ``now_us``, or None."""
        starts = [s for s, end_us, holder in self._windows.get(segment, ()) if holder != owner and end_us > now_us]
        return min(starts) if starts else None

    def is_free(self, segment: Segment, now_us: int, *, excluding: int) -> bool:
        """Whether nobody but ``excluding`` has a window on a segment that is not over at ``now_us``."""
        return self.earliest_other_start(excluding, segment, now_us) is None


def _begin(use: Use) -> tuple[int, int, int]:
    return use.from_us, use.to_us, use.owner


def _less(span: tuple[int, int], mine: list[tuple[int, int]], tolerance_us: int) -> tuple[int, int]:
    """A time without its begin or end where that is in one of ``mine``, and is so little."""
    from_us, to_us = span
    for start_us, end_us in mine:
        if start_us <= from_us < end_us <= from_us + tolerance_us:
            from_us = end_us
        elif to_us - tolerance_us <= start_us < to_us <= end_us:
            to_us = start_us
    return from_us, to_us


def _rides(uses: list[Use], owner: int) -> list[tuple[int, int]]:
    return [(use.from_us, use.to_us) for use in uses if use.owner == owner]
