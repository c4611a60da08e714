"""Where a machine may stand for ever. Compartment fronts, lift platforms and sills never are (design, section 5)."""

from collections.abc import Iterable
from functools import lru_cache

from onboard.core.site import Segment
from onboard.ways.kept import Kept
from onboard.ways.reach import passages
from onboard.ways.room import kept_free, resting_room
from onboard.ways.site import TrackKind, WaySite


@lru_cache(maxsize=16)
def _refuges(
    tracks: tuple[tuple[int, TrackKind, int, tuple[Segment, ...]], ...], kept: frozenset[Segment]
) -> frozenset[Segment]:
    found: set[Segment] = set()
    for number, kind, length, _ in tracks:
        if kind is not TrackKind.LIFT:
            found.update(Segment(number, index) for index in range(1, length + 1))
    return frozenset(found - kept)


def refuges(site: WaySite) -> frozenset[Segment]:
    """Alley and spur segments that block neither a compartment, nor a lift's sill, nor a mouth.

    That a whole fleet fits (at most F - 1 carriers on F alleys without spurs) is checked where a site is loaded.
    """
    kept = kept_free(site)
    shape = tuple((t.number, t.kind, t.length, t.joins) for t in site.tracks.values())
    return _refuges(shape, kept)


def open_refuges(site: WaySite, standing: Iterable[Segment]) -> frozenset[Segment]:
    """Those refuges in which one more machine may end while others stand for ever at ``standing``.

    Where there are several floors: no alley before compartments, so that the street alley stays free for all, no alley
    that is the only way to another unless the robot is the only one, and neither an alley nor a spur in which another
    stands: at most one in each. One floor leaves that choice only where each robot has a spur; otherwise every refuge
    is open there, as the machines can pass each other nowhere else.

    Where alleys turn, branch or meet, those of the site's resting places on whose track nobody stands.
    """
    if site.is_charted:
        return _rest(site, frozenset(segment.track for segment in standing))
    alleys = [track.number for track in site.tracks.values() if track.kind is TrackKind.ALLEY]
    if len(alleys) == 1 and not 1 < len(site.robots) <= len(site.spurs):
        return refuges(site)
    street = {station.track for station in site.compartments.values()}
    # With compartments on all floors, the lowest of them has to be the one that stays free.
    closed = (street if street < set(alleys) else {min(alleys)}) | {segment.track for segment in standing}
    if len(site.robots) > 1:
        closed |= passages(site)
    return _without(refuges(site), frozenset(closed))


def _rest(site: WaySite, taken: frozenset[int]) -> frozenset[Segment]:
    if len(site.robots) <= 1:
        return refuges(site)
    return _without(_rests.of(site), taken)


def _find_rests(site: WaySite) -> frozenset[Segment]:
    return frozenset(slot for stretch in resting_room(site).stretches.values() for slot in stretch)


_rests: Kept[WaySite, frozenset[Segment]] = Kept(_find_rests)


@lru_cache(maxsize=256)
def _without(found: frozenset[Segment], closed: frozenset[int]) -> frozenset[Segment]:
    """Kept, so that a search meets the same set again and what it has worked out for it."""
    return frozenset(segment for segment in found if segment.track not in closed)
