"""Which parts of a site can be reached from its compartments, and what is cut off without a lift or behind a machine.

Along an alley one moves from segment to segment, between alleys by a lift whose platform stops at both sills. A machine
that stands at a segment lets nobody past (rows P30, P38).
"""

from collections.abc import Collection

from onboard.core.site import Segment, Station
from onboard.ways.lifts import lift_tracks
from onboard.ways.site import TrackKind, WaySite

#: Sites whose passages are kept in one process: one in a machine, some in a test run.
_MAX_KEPT = 16


def reached(site: WaySite, *, lost: Collection[int] = (), standing: Collection[Segment] = ()) -> frozenset[Segment]:
    """Alley segments that a carrier can get to from any compartment's front.

    ``lost`` are tracks of lifts that do not run, ``standing`` segments where other machines stand for ever; these are
    not reached themselves.
    """
    rides = [site.tracks[lift].joins for lift in lift_tracks(site) if lift not in lost]
    ahead = [station.segment for station in site.compartments.values()]
    found: set[Segment] = set()
    while ahead:
        here = ahead.pop()
        if here in found or here in standing or not 1 <= here.index <= site.tracks[here.track].length:
            continue
        found.add(here)
        ahead += [Segment(here.track, here.index - 1), Segment(here.track, here.index + 1)]
        for sills in rides:
            if here in sills:
                ahead += sills
    return frozenset(found)


def stranded_by(site: WaySite, lift_track: int) -> tuple[Station, ...]:
    """The places that cannot be reached from any compartment when a lift is lost, in the order of the site's places."""
    found = reached(site, lost=(lift_track,))
    return tuple(place for place in site.places if place.segment not in found)


def hidden_by(site: WaySite, standing: Collection[Segment], lost: Collection[int] = ()) -> tuple[Station, ...]:
    """Places that can be reached, but only after machines at ``standing`` have given way; those before them included.

    ``lost`` are tracks of lifts that do not run.
    """
    free, behind = reached(site, lost=lost), reached(site, lost=lost, standing=standing)
    return tuple(place for place in site.places if place.segment in free and place.segment not in behind)


def passages(site: WaySite) -> frozenset[int]:
    """Alleys that are the only way to another: a machine standing there for ever would cut that one off.

    They are no refuges (design, section 5: every other needed place stays reachable). Worked out once for each site.
    """
    kept = _kept.get(id(site))
    # A kept answer holds its site, so an identity in use is never that of another site.
    if kept is None:
        if len(_kept) >= _MAX_KEPT:
            del _kept[next(iter(_kept))]
        kept = _kept[id(site)] = site, _find_passages(site)
    return kept[1]


_kept: dict[int, tuple[WaySite, frozenset[int]]] = {}


def _find_passages(site: WaySite) -> frozenset[int]:
    everywhere = reached(site)
    found = set()
    for track in site.tracks.values():
        if track.kind is TrackKind.ALLEY:
            closed = {Segment(track.number, index) for index in range(1, track.length + 1)}
            if reached(site, standing=closed) | closed < everywhere:
                found.add(track.number)
    return frozenset(found)
