"""How many machines can rest on any network at the same time, where, and what can be reached at all.

The rule is that of ``onboard.ways.rests``: all come from every compartment to every place and back. At most one machine
rests on a track; the places of its own track it serves, or lets others past by going to another rest.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from onboard.core.site import Segment, Station
from onboard.ways.kept import Kept
from onboard.ways.occupancy import standing_segments
from onboard.ways.rests import Rest, cut_off
from onboard.ways.site import BayUse, TrackKind, WaySite
from onboard.ways.slots import slots_of

_NEEDED = "is needed by all, so nobody may stand there for ever"


@dataclass(frozen=True)
class Reach:
    """Places to which no car comes from an entry, and those from which none comes to an exit, in the site's order."""

    lost_places: tuple[Station, ...]
    no_way_out: tuple[Station, ...]


@dataclass(frozen=True)
class Room:
    """Where machines can rest together: by track the segments of which any one may be taken; and why not elsewhere."""

    stretches: dict[int, tuple[Segment, ...]]
    refused: tuple[tuple[int, str], ...]

    @property
    def slots(self) -> tuple[Segment, ...]:
        """One resting place on each track, in the order of the tracks."""
        return tuple(self.stretches[track][0] for track in sorted(self.stretches))


def reachable(site: WaySite) -> Reach:
    """What the ways of a site lead to with nobody in the way."""
    network = slots_of(site)
    comes = network.from_any(site.fronts(BayUse.ENTRY, BayUse.BOTH))
    goes = network.to_any(site.fronts(BayUse.EXIT, BayUse.BOTH))
    return Reach(
        tuple(place for place in site.places if place.segment not in comes),
        tuple(place for place in site.places if place.segment in comes and place.segment not in goes),
    )


def resting_room(site: WaySite) -> Room:
    """The resting places of a site of any form, worked out once; see ``onboard.ways.refuges`` for straight ones."""
    return _rooms.of(site)


class _Finder:
    """Takes tracks up one after the other, spurs first: they are made for it."""

    def __init__(self, site: WaySite) -> None:
        self.site = site
        self.network = slots_of(site)
        self.fronts = site.fronts(*BayUse)
        self.kept = kept_free(site)
        self.needed = {station.segment for station in site.places} | set(self.fronts)
        self.taken: dict[int, list[tuple[Segment, ...]]] = {}

    def find(self) -> Room:
        tracks = [track.number for track in self.site.tracks.values() if track.kind is not TrackKind.LIFT]
        refused = []
        for track in sorted(tracks, key=lambda one: (self.site.tracks[one].kind is not TrackKind.SPUR, one)):
            stretch = self._best(track)
            if stretch is None:
                refused.append((track, self._why_not(track)))
            else:
                self.taken[track] = [stretch]
        for track, stretches in self.taken.items():
            stretches += [one for one in self._stretches(track) if one not in stretches and not self._cuts(track, one)]
        found = {track: tuple(one for stretch in self.taken[track] for one in stretch) for track in sorted(self.taken)}
        return Room(found, tuple(sorted(refused)))

    def _best(self, track: int) -> tuple[Segment, ...] | None:
        """The stretch between junctions that hides the fewest places of its own track, and cuts nothing else off."""
        if track in {front.track for front in self.fronts}:
            return None
        found = [
            (self._hidden(stretch[0]), -len(stretch), number, stretch)
            for number, stretch in enumerate(self._stretches(track))
            if not self._cuts(track, stretch)
        ]
        return min(found)[3] if found else None

    def _stretches(self, track: int) -> Iterator[tuple[Segment, ...]]:
        stretch: list[Segment] = []
        for index in range(1, self.site.tracks[track].length + 1):
            here = Segment(track, index)
            if self.kept.isdisjoint(standing_segments(self.site, here)):
                stretch.append(here)
            elif stretch:
                yield tuple(stretch)
                stretch = []
        if stretch:
            yield tuple(stretch)

    def _cuts(self, track: int, stretch: tuple[Segment, ...]) -> frozenset[Segment]:
        """What would be needed and could not be reached with a machine there, the resting ones themselves included.

        All stretches that were taken up are closed at once, though one on each track will be at most: so it holds
        whichever they are in.
        """
        taken = {**self.taken, track: [*self.taken.get(track, ()), stretch]}
        rests = [
            Rest(
                places=tuple(one[0] for one in stretches),
                body=frozenset(slot for one in stretches for slot in standing_segments(self.site, one[0])),
                beside=frozenset(one for one in self.needed if one.track == number),
            )
            for number, stretches in taken.items()
        ]
        elsewhere = [one for one in self.needed if one.track not in taken]
        return cut_off(self.network, self.fronts[:1], rests, elsewhere)

    def _hidden(self, resting: Segment) -> int:
        ground = self.network.ground(self.fronts[:1], closed=set(standing_segments(self.site, resting)))
        return sum(1 for one in self.needed if one.track == resting.track and one not in ground)

    def _why_not(self, track: int) -> str:
        if track in {front.track for front in self.fronts}:
            return f"a compartment is there: it {_NEEDED}"
        stretches = list(self._stretches(track))
        if not stretches:
            return "every segment is a sill, a mouth or before a compartment"
        cut = self._cuts(track, stretches[0])
        return f"a machine at {stretches[0][0]} would cut off {', '.join(map(str, sorted(cut)[:3]))}" + (
            f" and {len(cut) - 3} more" if len(cut) > 3 else ""
        )


def kept_free(site: WaySite) -> frozenset[Segment]:
    """Where nobody may stand for ever on any site: before compartments, on sills, in mouths."""
    kept = {*site.fronts(*BayUse), *site.links}
    for lift in site.lifts:
        kept.update(site.tracks[lift].joins)
    return frozenset(kept)


_rooms: Kept[WaySite, Room] = Kept(lambda site: _Finder(site).find())
