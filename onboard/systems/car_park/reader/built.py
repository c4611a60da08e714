"""What is proved of a whole building.

Its alleys meet where they should, nothing lies on a way, and every place can be reached from an entry and left to an
exit.
"""

from collections.abc import Collection, Iterator, Mapping
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


def check_plan(root: TomlTable, site: CarPark, layout: Layout) -> CarPark:
    """Note what cannot be built; the site without the places that would lie on a way or on each other.

    Of two such places that of the alley stays which was read first. Where each floor is one alley nothing lies on
    anything. What hangs together by an end that is not where it is written to be is not judged further.
    """
    if not _has_alleys(site):
        return site
    outlines = _outlines(site, layout)
    mistaken = _tell_mismatches(root, layout, outlines)
    if not _is_plan(site, layout):
        return site
    sound = only_tracks(site, _hung_tracks(site.tracks, site.tracks.keys() - mistaken, layout.floors))
    if _has_alleys(sound):
        _check_ways(root, layout, outlines if sound.tracks == site.tracks else _outlines(sound, layout))
    site = replace(site, places=tuple(_apart(outlines)))
    numbers = {place.number for place in site.places}
    return replace(site, place_class={at: one for at, one in site.place_class.items() if at in numbers})


def _has_alleys(site: CarPark) -> bool:
    return any(track.kind is TrackKind.ALLEY for track in site.tracks.values())


def _is_plan(site: CarPark, layout: Layout) -> bool:
    """Whether something could lie on something: more than one alley a floor, or spurs of several segments."""
    return any(_is_more(track) for track in site.tracks.values()) or len(layout.alleys()) > layout.floors


def _outlines(site: CarPark, layout: Layout) -> Outlines:
    """The boxes of a part of the building, as wide as in the whole."""
    outlines = Outlines(site)
    outlines.slot_mm = min(track.pitch_mm for track in layout.tracks.values() if track.kind is TrackKind.ALLEY)
    return outlines


def only_tracks(site: CarPark, tracks: Collection[int]) -> CarPark:
    """A site of these tracks, and of what stands beside them."""
    return replace(
        site,
        tracks={number: track for number, track in site.tracks.items() if number in tracks},
        places=tuple(place for place in site.places if place.track in tracks),
        machines={node: one for node, one in site.machines.items() if one.home.track in tracks or one.station is None},
    )


def beside(track: Track) -> set[int]:
    """The tracks to which a track is joined."""
    return {mouth.track for mouth in (*track.joins, track.high) if mouth is not None}


def joined_tracks(tracks: Mapping[int, Track], sound: Collection[int]) -> set[int]:
    """Those of the sound tracks that are joined to sound ones alone, and so on."""
    left = set(sound)
    while loose := {number for number in left if not beside(tracks[number]) <= left}:
        left -= loose
    return left


def _hung_tracks(tracks: Mapping[int, Track], sound: Collection[int], floors: int) -> set[int]:
    """Those of them that hang together with the own alley of one of the floors, so that it is known where they lie."""
    left = joined_tracks(tracks, sound)
    hung = {number for number in left if number <= floors}
    while more := {
        number
        for number in left - hung
        if beside(tracks[number]) & hung or any(number in beside(tracks[one]) for one in hung)
    }:
        hung |= more
    return hung


def _tell_mismatches(root: TomlTable, layout: Layout, outlines: Outlines) -> set[int]:
    """Tell each alley and shaft that does not end where it is written to, on the first floor where it does not."""
    told, mistaken = set(), set()
    for one in outlines.plan.mismatches:
        lift = _lift_of(layout, one.track)
        mistaken |= {one.track, lift or one.track}
        names = (lift,) if lift else (layout.alley_name(one.track), layout.alley_name(one.beside.track))
        if names not in told:
            told.add(names)
            if lift:
                _tell_shaft(layout, layout.lifts[lift - FIRST_LIFT], one)
            else:
                _tell_end(root, layout, one)
    return mistaken


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


def check_reached(root: TomlTable, site: CarPark, layout: Layout) -> bool:
    """Note places that cannot be reached from an entry, or left to an exit; whether there are none.

    Where each floor is one alley that is driven both ways, everything is reached that hangs together.
    """
    if not _is_plan(site, layout) and not any(track.one_way for track in site.tracks.values()):
        return True
    reach = reachable(site)
    remedy = "join its alley by a lift or another end, or turn one_way"
    if reach.lost_places:
        root.bad("floors", None, f"no way from an entry to {_some(reach.lost_places)}", remedy)
    if reach.no_way_out:
        root.bad("floors", None, f"no way to an exit from {_some(reach.no_way_out)}", remedy)
    return not (reach.lost_places or reach.no_way_out)


def _some(places: tuple[Station, ...]) -> str:
    more = len(places) - _NAMED
    return ", ".join(map(str, places[:_NAMED])) + (f" and {more} more" if more > 0 else "")
