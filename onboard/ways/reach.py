"""Which parts of a site can be reached from its compartments, and what is cut off without a lift or behind a machine.

Along an alley one moves from segment to segment, to another through a mouth, or by a lift whose platform stops at both
sills. A machine that stands at a segment lets nobody past (rows P30, P38).
"""

from collections.abc import Collection

from onboard.core.site import Segment, Station
from onboard.ways.kept import Kept
from onboard.ways.site import BayUse, TrackKind, WaySite
from onboard.ways.slots import slots_of


def reached(site: WaySite, *, lost: Collection[int] = (), standing: Collection[Segment] = ()) -> frozenset[Segment]:
    """Alley segments that a carrier can get to from the front of any compartment by which cars come in.

    ``lost`` are tracks of lifts that do not run, ``standing`` segments where other machines stand for ever; these are
    not reached themselves.
    """
    starts = site.fronts(BayUse.ENTRY, BayUse.BOTH)
    found = slots_of(site, lost).from_any(starts, closed=standing)
    return frozenset(here for here in found if site.tracks[here.track].kind is TrackKind.ALLEY)


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
    return _passages.of(site)


def _find_passages(site: WaySite) -> frozenset[int]:
    everywhere = reached(site)
    found = set()
    for track in site.tracks.values():
        if track.kind is TrackKind.ALLEY:
            closed = {Segment(track.number, index) for index in range(1, track.length + 1)}
            if reached(site, standing=closed) | closed < everywhere:
                found.add(track.number)
    return frozenset(found)


_passages: Kept[WaySite, frozenset[int]] = Kept(_find_passages)
