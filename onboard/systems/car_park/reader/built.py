"""What is proved of a whole building.

Its alleys meet where they should, nothing lies on a way, and every place can be reached from an entry and left to an
exit.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations

from onboard.config.reader import TomlTable
from onboard.core.site import Segment, Station
from onboard.systems.car_park.outlines import Box, Outlines
from onboard.systems.car_park.reader.layout import FIRST_LIFT, Layout
from onboard.systems.car_park.site import CarPark
from onboard.ways.floor_plan import Mismatch
from onboard.ways.room import reachable
from onboard.ways.site import Track, TrackKind

#: Places that one line names.
_NAMED = 3


def check_built(root: TomlTable, site: CarPark, layout: Layout) -> CarPark:
    """Note what cannot be built or reached; the site without the places that would lie on a way or on each other.

    Of two such places that of the alley stays which was read first. Where each floor is one alley nothing lies on
    anything, and everything can be reached unless an alley is one way.
    """
    outlines = Outlines(site)
    if _tell_mismatches(root, layout, outlines):
        return site
    if any(_is_more(track) for track in site.tracks.values()) or len(layout.alleys()) > layout.floors:
        _check_ways(root, layout, outlines)
        site = replace(site, places=tuple(_apart(outlines)))
        numbers = {place.number for place in site.places}
        site = replace(site, place_class={at: one for at, one in site.place_class.items() if at in numbers})
        _check_reached(root, site)
    elif any(track.one_way for track in site.tracks.values()):
        _check_reached(root, site)
    return site


def _tell_mismatches(root: TomlTable, layout: Layout, outlines: Outlines) -> bool:
    """Each alley and shaft that does not end where it is written to, on the first floor where it does not."""
    told = set()
    for one in outlines.plan.mismatches:
        lift = _lift_of(layout, one.track)
        names = (lift,) if lift else (layout.alley_name(one.track), layout.alley_name(one.beside.track))
        if names not in told:
            told.add(names)
            if lift:
                _tell_shaft(layout, layout.lifts[lift - FIRST_LIFT], one)
            else:
                _tell_end(root, layout, one)
    return bool(told)


def _lift_of(layout: Layout, track: int) -> int:
    """The lift that a track is, or before whose door it is the lobby; 0 for an alley."""
    tracks = {track} if track in layout.named.values() else {track, *_shafts_behind(layout, track)}
    return next((one for one in sorted(tracks) if layout.tracks[one].kind is TrackKind.LIFT), 0)


def _shafts_behind(layout: Layout, lobby: int) -> list[int]:
    return [
        one.number for one in layout.tracks.values() if one.kind is TrackKind.LIFT and Segment(lobby, 1) in one.joins
    ]


def _tell_end(root: TomlTable, layout: Layout, one: Mismatch) -> None:
    table = layout.tables.get(one.track, root)
    what = f"the end of {layout.words(one.track)} is at {one.here}, and {one.beside} at {one.there}"
    remedy = "change positions, pitch_mm, or where it begins or ends"
    table.bad("to" if "to" in table.values else "alleys", table.values.get("to"), what, remedy)


def _tell_shaft(layout: Layout, table: TomlTable, one: Mismatch) -> None:
    """A shaft is vertical: all its doors are at one place."""
    key = "doors" if "doors" in table.values else "end"
    floor = layout.level[one.beside.track]
    along_mm, across_mm = abs(one.here.x_mm - one.there.x_mm), abs(one.here.y_mm - one.there.y_mm)
    what = f"not one above the other: that of floor {floor} is off by {along_mm} mm along and {across_mm} mm across"
    remedy = "change doors, the lengths of alleys, or lobby_mm, or leave the floor out"
    table.bad(key, table.values.get(key), what, remedy)


def _is_more(track: Track) -> bool:
    """Whether a track is more than an alley by itself, a shaft, or a segment off an alley."""
    return (bool(track.ends) and track.kind is TrackKind.ALLEY) or (track.kind is TrackKind.SPUR and track.length > 1)


def _check_ways(root: TomlTable, layout: Layout, outlines: Outlines) -> None:
    """No way lies on another, or on a compartment; where tracks are joined they only touch."""
    site = outlines.site
    told = set()
    for level in reversed(outlines.levels):
        ways = [(layout.alley_name(number), outlines.track(number)) for number in outlines.tracks_on(level)]
        ways += [(f"lift {_lift_name(site, lift)}", outlines.platform(lift)) for lift in outlines.lifts_on(level)]
        bays = [
            (f"compartment {site.machines[node].name}", outlines.station(bay))
            for node, bay in site.compartments.items()
            if site.level(bay.track) == level
        ]
        for (one, box), (other, on) in combinations([*ways, *bays], 2):
            if box.overlaps(on) and (one, other) not in told:
                told.add((one, other))
                remedy = "move one, or make what is between them longer"
                root.bad("alleys", None, f"on floor {level} {other} lies on {one}", remedy)


def _lift_name(site: CarPark, lift: int) -> str:
    return next(one.name for one in site.machines.values() if one.home.track == lift)


def _apart(outlines: Outlines) -> Iterator[Station]:
    """The places that lie on no way, no compartment and no place that was read before."""
    site = outlines.site
    ways: dict[int, list[Box]] = {
        level: [
            *(outlines.track(number) for number in outlines.tracks_on(level)),
            *(outlines.platform(lift) for lift in outlines.lifts_on(level)),
            *(outlines.station(bay) for bay in site.compartments.values() if site.level(bay.track) == level),
        ]
        for level in outlines.levels
    }
    for place in site.places:
        box, there = outlines.station(place), ways[site.level(place.track)]
        if not any(box.overlaps(other) for other in there):
            there.append(box)
            yield place


def _check_reached(root: TomlTable, site: CarPark) -> None:
    """Every place from an entry, and from every place to an exit."""
    reach = reachable(site)
    remedy = "join its alley by a lift or another end, or turn one_way"
    if reach.lost_places:
        root.bad("floors", None, f"no way from an entry to {_some(reach.lost_places)}", remedy)
    if reach.no_way_out:
        root.bad("floors", None, f"no way to an exit from {_some(reach.no_way_out)}", remedy)


def _some(places: tuple[Station, ...]) -> str:
    more = len(places) - _NAMED
    return ", ".join(map(str, places[:_NAMED])) + (f" and {more} more" if more > 0 else "")
