"""Every way between two floors by lifts, as a list to choose from (row P37)."""

from typing import NamedTuple

from onboard.ways.lifts import lift_index_of, lift_tracks
from onboard.ways.site import WaySite


class Ride(NamedTuple):
    """One ride; floors are numbers of alleys."""

    lift_track: int
    from_floor: int
    to_floor: int


def lift_itineraries(site: WaySite, from_floor: int, to_floor: int, crossings: int = 1) -> list[tuple[Ride, ...]]:
    """All sequences of rides with at most ``crossings`` alleys crossed from one lift to another between them.

    The shortest first, then by lift tracks and floors. For F floors and a lift at each end of each there are, with one
    crossing, 2 + 2 (F - 2) between two floors (8 of 5, as in figure 7 of Pujo, Ounnar and Zanni 2006), and for one and
    the same floor the empty sequence and 2 (F - 1) detours.
    """
    found: list[tuple[Ride, ...]] = [()] if from_floor == to_floor else []
    begun: list[tuple[Ride, ...]] = [()]
    for _ in range(crossings + 1):
        begun = [(*rides, ride) for rides in begun for ride in _next_rides(site, rides, from_floor, to_floor)]
        found += [rides for rides in begun if rides[-1].to_floor == to_floor]
        begun = [rides for rides in begun if rides[-1].to_floor != to_floor]
    return found


def _next_rides(site: WaySite, rides: tuple[Ride, ...], from_floor: int, to_floor: int) -> list[Ride]:
    """Every ride by another lift than the last, to the goal or to a floor not seen before."""
    here = rides[-1].to_floor if rides else from_floor
    seen = {ride.from_floor for ride in rides} - {to_floor} | {here}
    return [
        Ride(lift_track, here, sill.track)
        for lift_track in lift_tracks(site)
        if lift_index_of(site, lift_track, here) is not None and not (rides and rides[-1].lift_track == lift_track)
        for sill in site.tracks[lift_track].joins
        if sill.track not in seen
    ]
