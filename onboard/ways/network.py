"""A site's segments as a directed graph: along tracks as they may be gone, through mouths, by lifts."""

from collections.abc import Collection, Iterable, Iterator
from functools import cached_property

from onboard.core.site import Segment
from onboard.ways.kept import Kept
from onboard.ways.site import TrackKind, WaySite

#: Sets of lost lifts, in each direction, whose steps are kept.
_MAX_KEPT = 8


class Network:
    """Built once for a site. Lifts that do not run are left out by the ``lost`` tracks of each question."""

    def __init__(self, site: WaySite) -> None:
        self._site = site
        self._on: dict[Segment, tuple[Segment, ...]] = {}
        self._kept_steps: dict[tuple[frozenset[int], bool], dict[Segment, tuple[Segment, ...]]] = {}
        for track in site.tracks.values():
            if track.kind is not TrackKind.LIFT:
                for index in range(1, track.length + 1):
                    self._on[Segment(track.number, index)] = tuple(self._next(Segment(track.number, index)))

    def _next(self, here: Segment) -> Iterator[Segment]:
        """Where one comes from a segment without a lift."""
        track = self._site.tracks[here.track]
        for index in (here.index - 1, here.index + 1):
            if track.goes(here.index, index):
                there = Segment(here.track, index)
                mouth = self._site.mouths.get(there)
                if mouth is not None:
                    yield mouth
                elif 1 <= index <= track.length:
                    yield there
        for end in self._site.links.get(here, ()):
            branch = self._site.tracks[end.track]
            if branch.goes(end.index, branch.inside(end.index).index):
                yield branch.inside(end.index)

    @cached_property
    def _back(self) -> dict[Segment, tuple[Segment, ...]]:
        found: dict[Segment, list[Segment]] = {}
        for here, ahead in self._on.items():
            for there in ahead:
                found.setdefault(there, []).append(here)
        return {here: tuple(before) for here, before in found.items()}

    def from_any(
        self, starts: Iterable[Segment], *, closed: Collection[Segment] = (), lost: Collection[int] = ()
    ) -> frozenset[Segment]:
        """Segments to which a carrier can come from any of ``starts``; not those that are closed, nor through them."""
        return self._search(starts, self._steps(frozenset(lost), is_back=False), closed)

    def to_any(
        self, goals: Iterable[Segment], *, closed: Collection[Segment] = (), lost: Collection[int] = ()
    ) -> frozenset[Segment]:
        """Segments from which a carrier can come to any of ``goals``."""
        return self._search(goals, self._steps(frozenset(lost), is_back=True), closed)

    def _search(
        self, starts: Iterable[Segment], steps: dict[Segment, tuple[Segment, ...]], closed: Collection[Segment]
    ) -> frozenset[Segment]:
        ahead = [start for start in starts if start in self._on]
        found: set[Segment] = set()
        while ahead:
            here = ahead.pop()
            if here not in found and here not in closed:
                found.add(here)
                ahead += steps[here]
        return frozenset(found)

    def _steps(self, lost: frozenset[int], *, is_back: bool) -> dict[Segment, tuple[Segment, ...]]:
        """Where one comes from each segment, or to it, with rides on the lifts that run; kept."""
        found = self._kept_steps.get((lost, is_back))
        if found is None:
            ways = self._back if is_back else self._on
            rides: dict[Segment, list[Segment]] = {}
            for boards, leaves in self._rides(lost):
                for sill in leaves if is_back else boards:
                    rides.setdefault(sill, []).extend(boards if is_back else leaves)
            found = {here: (*ways.get(here, ()), *rides.get(here, ())) for here in self._on}
            if len(self._kept_steps) >= _MAX_KEPT:
                self._kept_steps.clear()
            self._kept_steps[lost, is_back] = found
        return found

    def _rides(self, lost: Collection[int]) -> Iterator[tuple[list[Segment], list[Segment]]]:
        """Of each lift that runs the sills over which one boards, and over which one leaves."""
        for lift in self._site.lifts:
            sills = self._site.tracks[lift].joins if lift not in lost else ()
            boards = [sill for sill in sills if self._crosses(sill, is_boarding=True)]
            yield boards, [sill for sill in sills if self._crosses(sill, is_boarding=False)]

    def _crosses(self, sill: Segment, *, is_boarding: bool) -> bool:
        beyond = self._site.beyond(sill)
        way = (sill.index, beyond.index) if is_boarding else (beyond.index, sill.index)
        return self._site.tracks[sill.track].goes(*way)


_networks: Kept[WaySite, Network] = Kept(Network)


def network_of(site: WaySite) -> Network:
    """The network of a site, built at the first call for this very object."""
    return _networks.of(site)
