"""What no single key tells: that a building can be built, that cars can come in, and be carried to every place.

Where something is mistaken, what does not follow from it is judged all the same: the sound part of the ways is drawn;
whether alleys hang together is asked where all alleys and lifts are sound, what is reached and where machines rest
where compartments, and spurs, are sound as well.
"""

from onboard.config.fleet import FleetReader
from onboard.config.reader import TomlTable
from onboard.contract.codes import KindCode
from onboard.systems.car_park.reader.built import beside, check_plan, check_reached, joined_tracks
from onboard.systems.car_park.reader.layout import FIRST_LIFT, Layout
from onboard.systems.car_park.reader.machines import Bay
from onboard.systems.car_park.room import check_room
from onboard.systems.car_park.site import CarPark
from onboard.ways.site import BayUse, Track, TrackKind

#: Keys from which neither form nor place of a track follows: of floors and alleys, of machines.
_OF_WAYS = frozenset(["name", "count", "positions", "sides", "one_way", "without", "height_mm"])
_OF_MACHINES = frozenset(["name", "node"])
#: Tables from which it follows how all alleys hang together, and keys there from which it does not.
_ROADS = "floors|alleys|lifts"
_NOT_OF_ROADS = "name|node|sides|one_way|without|height_mm"
#: Keys from which it does not follow what is reached, and where machines rest.
_NOT_OF_REACH = "name|node|height_mm"
_NOT_OF_ROOM = "name|node|home"


def sound_tracks(root: TomlTable, layout: Layout) -> set[int]:
    """The tracks whose form and place are known: with no mistake of their own, and joined to such alone."""
    sound = {number for number, track in layout.tracks.items() if _is_sound(root, layout, track)}
    return joined_tracks(layout.tracks, sound)


def _is_sound(root: TomlTable, layout: Layout, track: Track) -> bool:
    number, table = track.number, layout.tables.get(track.number)
    of_all = {key for key in layout.floor_tables[0].wrong if not key.isdecimal()}
    if number in layout.vague or "floors" in root.wrong or not of_all <= _OF_WAYS:
        return False
    if track.kind is TrackKind.LIFT:
        return bool(track.joins) and layout.lifts[number - FIRST_LIFT].wrong <= _OF_MACHINES
    if table is None:
        return number not in layout.floor_tables or layout.floor_tables[number].wrong <= _OF_WAYS
    if "doors" in table.values:
        return table.wrong <= _OF_MACHINES
    has_ends = ("from" in table.values, "to" in table.values) == (track.low is not None, track.high is not None)
    return table.wrong <= _OF_WAYS and (has_ends or track.kind is TrackKind.SPUR)


def check_whole(
    root: TomlTable, layout: Layout, site: CarPark, fleet: FleetReader, bays: list[Bay], *, crowded: bool
) -> CarPark:
    """Note what is wrong with the whole; ``site`` has its sound tracks. The site without places that would overlap.

    ``crowded`` lets in more robots than find room to rest.
    """
    problems = root.problems
    _check_machines(root, bays)
    are_roads_sound = all(number in site.tracks for number, one in layout.tracks.items() if one.kind != TrackKind.SPUR)
    if are_roads_sound and problems.none_in(_ROADS, _NOT_OF_ROADS):
        if not layout.places():
            root.bad("floors", None, "no place for a car", "take entries out of floors.without or add positions")
        _check_joined(root, layout, site, fleet, bays)
    is_reach_known = are_roads_sound and problems.none_in(f"{_ROADS}|compartments", _NOT_OF_REACH)
    is_room_known = is_reach_known and problems.none_in("spurs|robots", _NOT_OF_ROOM)
    site = check_plan(root, site, layout)
    if is_reach_known:
        is_room_known = check_reached(root, site, layout) and is_room_known
    if is_room_known and not crowded:
        check_room(root, site, fleet)
    return site


def _check_machines(root: TomlTable, bays: list[Bay]) -> None:
    """That there are compartments and robots, and that cars come in and go out."""
    for kind, table in ((KindCode.COMPARTMENT, "compartments"), (KindCode.ROBOT, "robots")):
        if not root.values.get(table) and table not in root.wrong:
            root.bad(table, None, f"no {kind.name.lower()}", f"add at least one [[{table}]] table")
    if not bays or any("use" in bay.table.wrong for bay in bays):
        return
    for use, other in ((BayUse.ENTRY, BayUse.EXIT), (BayUse.EXIT, BayUse.ENTRY)):
        if all(bay.use is other for bay in bays):
            root.bad(
                "compartments", None, f"none for {use.value}", f'write use = "{use.value}", or none, at one of them'
            )


def _check_joined(root: TomlTable, layout: Layout, site: CarPark, fleet: FleetReader, bays: list[Bay]) -> None:
    """That every alley can be reached from every other, so from every compartment and by every robot."""
    groups = _groups(layout)
    told = set()
    homes = {
        KindCode.COMPARTMENT: {bay.station.track if bay.station is not None else 0 for bay in bays},
        KindCode.ROBOT: {
            home.track if "home" not in table.wrong and home.track in site.tracks else 0 for table, home in fleet.robots
        },
    }
    for tracks in groups:
        # One whose place is mistaken may be meant to be here; that there is none at all is told already.
        missing = [kind.name.lower() for kind, at in homes.items() if at and 0 not in at and at.isdisjoint(tracks)]
        if missing:
            here = layout.words(min(tracks))
            name = layout.alley_name(min(tracks))
            if name in told and not here.startswith("floor"):
                continue
            told.add(name)
            what = f"no {' and no '.join(missing)} can be reached from {here}"
            key = "lifts" if "lifts" in root.values else "alleys" if "alleys" in root.values else "floors"
            root.bad(key, None, what, f"join {here} to the others by a lift")
    if len(groups) > 1 and "lifts" not in root.wrong:
        what = f"no way from {layout.words(min(groups[0]))} to {layout.words(min(groups[1]))}"
        root.bad("lifts", None, what, "join them by a lift, or write a site file for each")


def _groups(layout: Layout) -> list[set[int]]:
    """The tracks in groups, between which one can drive or ride."""
    groups = [{alley.number} for alley in layout.alleys()]
    for track in layout.tracks.values():
        if not beside(track) <= layout.tracks.keys():
            continue
        here = beside(track) | {track.number}
        joined = [group for group in groups if group & here]
        groups = [group for group in groups if not group & here] + [here.union(*joined)]
    return groups
