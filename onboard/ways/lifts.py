"""Lifts as the planner and the tokens see them: sills, platforms, gates.

The platform of a lift is one body slot with one token. Its gate is a second token: a robot crosses the sill only while
it holds the gate, and the lift moves only while it holds it itself, so nothing is ever between floor and platform when
the platform moves. On an alley's axis the platform is the position before index 1 or behind the last.
"""

from onboard.contract.messages import Progress
from onboard.core.site import Segment
from onboard.ways.site import WaySite

#: Index of the platform's token on a lift's track, and of its gate's.
PLATFORM_INDEX = 0
GATE_INDEX = 255
#: A platform stands at a floor's mark within this, mm (fine sensor, dbc/device.dbc).
MARK_TOLERANCE_MM = 5
#: Lowest bits of its gate's version that a lift says with its place: 8 and 5 of them (dbc/fleet.dbc, Progress). They
#: come again after 8,192 moves of the gate, days later.
_LOW_BITS, _HIGH_BITS = 8, 5


def platform(lift_track: int) -> Segment:
    """The platform as a body slot."""
    return Segment(lift_track, PLATFORM_INDEX)


def gate(lift_track: int) -> Segment:
    """The right to cross the sill, or to move the platform."""
    return Segment(lift_track, GATE_INDEX)


def lift_tracks(site: WaySite) -> tuple[int, ...]:
    """All lifts of a site by their track numbers."""
    return site.lifts


def sill(site: WaySite, lift_track: int, lift_index: int) -> Segment:
    """The alley segment before a lift's platform at its floor ``lift_index``, 1 to the number of floors served."""
    return site.tracks[lift_track].joins[lift_index - 1]


def lift_index_of(site: WaySite, lift_track: int, floor: int) -> int | None:
    """The lift's index of a floor (an alley's track number), or None where it does not stop there."""
    for index, segment in enumerate(site.tracks[lift_track].joins, start=1):
        if segment.track == floor:
            return index
    return None


def platform_on(site: WaySite, lift_track: int, floor: int) -> Segment | None:
    """The platform as a position on a floor's alley: index 0 at the left end, length + 1 at the right; None: none."""
    lift_index = lift_index_of(site, lift_track, floor)
    return None if lift_index is None else site.beyond(sill(site, lift_track, lift_index))


def stop_mm(site: WaySite, lift_track: int, lift_index: int) -> int:
    """Height of a lift's stop above its first; two doors of one stop have the same."""
    track = site.tracks[lift_track]
    return track.heights_mm[lift_index - 1] if track.heights_mm else (lift_index - 1) * track.pitch_mm


def nearest_stop(site: WaySite, lift_track: int, height_mm: float) -> int:
    """The lift's index of the stop nearest to a height, the lower of two as near; the first of several doors."""
    track = site.tracks[lift_track]
    if not track.heights_mm:
        index = int((height_mm + track.pitch_mm // 2) // track.pitch_mm) + 1
        return max(1, min(track.length, index))
    away = [abs(height_mm - stop) for stop in track.heights_mm]
    return away.index(min(away)) + 1


def is_same_stop(site: WaySite, lift_track: int, one: int | None, other: int | None) -> bool:
    """Whether two indices of a lift are doors of one stop; None is no stop."""
    if one is None or other is None or one == other:
        return one is not None and one == other
    return bool(site.tracks[lift_track].heights_mm) and stop_mm(site, lift_track, one) == stop_mm(
        site, lift_track, other
    )


def lift_at(site: WaySite, position: Segment) -> int | None:
    """The lift whose platform is meant by an alley position before index 1 or behind the last; None for all others."""
    return site.platforms.get(position)


def under_gate(version: int) -> tuple[int, int]:
    """A version of the gate's token as a lift's ``Progress`` says it, in ``itinerary_version`` and ``leg``."""
    return version & ((1 << _LOW_BITS) - 1), version >> _LOW_BITS & ((1 << _HIGH_BITS) - 1)


def says_standing(word: Progress | None, gate_version: int) -> int | None:
    """The lift index at whose mark a lift said that it stands, under this version of its gate; None for no such word.

    The lift moves only while it holds the gate itself. So its word under the version by which it gave the gate away
    holds for as long as the gate is away, whatever any clock shows; a word under any other version proves nothing.
    """
    if word is None or (word.itinerary_version, word.leg) != under_gate(gate_version):
        return None
    is_still = word.speed_mm_s == 0 and abs(word.offset_mm) <= MARK_TOLERANCE_MM
    return word.index if is_still else None
