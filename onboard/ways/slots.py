"""A site's slots as a network: along tracks as they may be gone, through mouths, by lifts; ways in mm."""

from collections.abc import Collection, Iterator

from onboard.core.site import Segment
from onboard.ways.kept import Kept
from onboard.ways.network import Network
from onboard.ways.site import TrackKind, WaySite

#: Sets of lost lifts whose networks are kept.
_MAX_KEPT = 8


class _Slots:
    """The networks of one site, by the lifts that do not run."""

    def __init__(self, site: WaySite) -> None:
        self._site = site
        self._kept: dict[frozenset[int], Network[Segment]] = {}

    def network(self, lost: frozenset[int]) -> Network[Segment]:
        """The network without some lifts, made at the first call."""
        found = self._kept.get(lost)
        if found is None:
            if len(self._kept) >= _MAX_KEPT:
                self._kept.clear()
            ways = {here: [*self._next(here)] for here in self._slots()}
            for sill, rides in self._rides(lost):
                ways[sill] += rides
            found = self._kept[lost] = Network(ways)
        return found

    def _slots(self) -> Iterator[Segment]:
        for track in self._site.tracks.values():
            if track.kind is not TrackKind.LIFT:
                yield from (Segment(track.number, index) for index in range(1, track.length + 1))

    def _next(self, here: Segment) -> Iterator[tuple[Segment, int]]:
        """Where one comes from a slot without a lift."""
        track = self._site.tracks[here.track]
        for index in (here.index - 1, here.index + 1):
            if track.goes(here.index, index):
                there = Segment(here.track, index)
                mouth = self._site.mouths.get(there)
                if mouth is not None:
                    yield mouth, track.pitch_mm
                elif 1 <= index <= track.length:
                    yield there, track.pitch_mm
        for end in self._site.links.get(here, ()):
            branch = self._site.tracks[end.track]
            if branch.goes(end.index, branch.inside(end.index).index):
                yield branch.inside(end.index), branch.pitch_mm

    def _rides(self, lost: Collection[int]) -> Iterator[tuple[Segment, list[tuple[Segment, int]]]]:
        """From each sill over which one boards a lift that runs to those over which one leaves it."""
        site = self._site
        for lift in site.lifts:
            track = site.tracks[lift]
            heights_mm = track.heights_mm or tuple(stop * track.pitch_mm for stop in range(track.length))
            stops = [*zip(track.joins, heights_mm, strict=True)] if lift not in lost else []
            leaves = [(sill, mm) for sill, mm in stops if self._crosses(sill, is_boarding=False)]
            for sill, from_mm in stops:
                if self._crosses(sill, is_boarding=True):
                    pitch_mm = site.tracks[sill.track].pitch_mm
                    # Over both sills and up or down.
                    yield sill, [(there, 2 * pitch_mm + abs(to_mm - from_mm)) for there, to_mm in leaves]

    def _crosses(self, sill: Segment, *, is_boarding: bool) -> bool:
        beyond = self._site.beyond(sill)
        way = (sill.index, beyond.index) if is_boarding else (beyond.index, sill.index)
        return self._site.tracks[sill.track].goes(*way)


_slots: Kept[WaySite, _Slots] = Kept(_Slots)


def slots_of(site: WaySite, lost: Collection[int] = ()) -> Network[Segment]:
    """The slots of a site and the ways between them, without the lifts of the tracks ``lost``; kept for the site."""
    return _slots.of(site).network(frozenset(lost))
