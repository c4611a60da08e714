"""Where a machine may stand for ever. Compartment fronts, lift platforms and sills never are (design, section 5)."""

from functools import lru_cache

from onboard.core.site import Segment, Site, TrackKind


@lru_cache(maxsize=16)
def _refuges(
    tracks: tuple[tuple[int, TrackKind, int, tuple[Segment, ...]], ...], kept: frozenset[Segment]
) -> frozenset[Segment]:
    found: set[Segment] = set()
    for number, kind, length, _ in tracks:
        if kind is not TrackKind.LIFT:
            found.update(Segment(number, index) for index in range(1, length + 1))
    return frozenset(found - kept)


def refuges(site: Site) -> frozenset[Segment]:
    """Alley and spur segments that block neither a compartment, nor a lift's sill, nor a spur's mouth.

    That a whole fleet fits (at most F - 1 carriers on F alleys without spurs) is checked where a site is loaded.
    """
    kept = {station.segment for station in site.compartments.values()}
    for track in site.tracks.values():
        if track.kind is not TrackKind.ALLEY:
            kept.update(track.joins)
    shape = tuple((t.number, t.kind, t.length, t.joins) for t in site.tracks.values())
    return _refuges(shape, frozenset(kept))
