"""The site file of a car park, of floors, alleys, lifts and compartments; docs/site-file.md describes every key."""

import re
from dataclasses import replace

from onboard.config.fleet import FleetReader
from onboard.config.problems import Problems
from onboard.config.reader import Common, TomlTable
from onboard.config.timing import read_timing
from onboard.contract.codes import KindCode
from onboard.systems.car_park.reader.alleys import read_layout
from onboard.systems.car_park.reader.built import check_built
from onboard.systems.car_park.reader.classes import check_heights, read_classes
from onboard.systems.car_park.reader.constants import read_constants
from onboard.systems.car_park.reader.layout import Layout
from onboard.systems.car_park.reader.machines import read_fleet, read_stewards
from onboard.systems.car_park.reader.positions import BASE
from onboard.systems.car_park.room import check_room
from onboard.systems.car_park.site import CallAt, CarPark, RideCalls
from onboard.ways.site import BayUse, charted

#: Keys from which ways and machines follow, and one from which only the place of a robot does.
_OF_WAYS = re.compile(r"(floors|alleys|lifts|spurs|compartments|robots)\b|$")
_HOME = re.compile(r"robots\[\d+\]\.home")


def read(root: TomlTable, common: Common) -> CarPark:
    """A car park; every mistake is noted in ``root.problems``, and raised as ``ConfigError``.

    What is proved of the whole is told with them where ways and machines could be read.
    """
    problems, lift, bitrate = root.problems, root.table("lift"), common.bitrate
    floor_height_mm = lift.integer("floor_height_mm", 1000, 10_000, 2_500)
    layout = read_layout(root, floor_height_mm)
    fleet, uses = read_fleet(root, layout)
    stewards = read_stewards(root.table("stewards"), layout, fleet)
    constants = read_constants(root, lift, min(track.pitch_mm for track in layout.alleys()))
    classes, place_class = read_classes(root, layout, constants)
    check_heights(layout, constants.cars, classes, place_class)
    robots = sum(1 for machine in fleet.by_node.values() if machine.kind is KindCode.ROBOT)
    timing = read_timing(root.table("timing"), robots, len(fleet.by_node), bitrate)
    negotiation = root.table("negotiation")
    rides = RideCalls(negotiation.choice("rides", [one.value for one in RideCalls], "planned"))
    call_at = CallAt(negotiation.choice("call_at", [one.value for one in CallAt], "key"))
    tells_offers = negotiation.choice("offers", ["kept", "told"], "kept") == "told"
    timing = replace(timing, sub_call_percent=negotiation.integer("sub_call_percent", 20, 80, 50))
    root.check_unknown()
    _check_whole(root, layout, fleet, uses)
    if not _ways_are_read(problems):
        problems.raise_if_any()
    site = CarPark(
        name=common.name,
        digest=0,
        bitrate=bitrate,
        tracks=charted(layout.tracks),
        places=layout.places(),
        machines=dict(sorted(fleet.by_node.items())),
        stewards=stewards,
        carrier=constants.carrier,
        carrier_length_mm=constants.carrier_length_mm,
        carrier_clearance_mm=constants.carrier_clearance_mm,
        carrier_turn_us=constants.carrier_turn_us,
        shuttle=constants.shuttle,
        shuttle_reach_mm=constants.shuttle_reach_mm,
        lift=constants.lift,
        floor_height_mm=floor_height_mm,
        cars=constants.cars,
        timing=timing,
        rides=rides,
        call_at=call_at,
        tells_offers=tells_offers,
        bay_uses=uses,
        classes=classes,
        place_class=place_class,
        alley_names={number: name for (_, name), number in layout.named.items() if name != BASE},
    )
    site = check_built(root, site, layout)
    if not common.crowded and _ways_are_read(problems):
        check_room(root, site, fleet)
    problems.raise_if_any()
    return site


def _ways_are_read(problems: Problems) -> bool:
    """Whether no mistake was found in what the ways follow from; a robot whose home is mistaken has a stand-in."""
    return not any(_OF_WAYS.match(one.key) and not _HOME.fullmatch(one.key) for one in problems.found)


def _check_whole(root: TomlTable, layout: Layout, fleet: FleetReader, uses: dict[int, BayUse]) -> None:
    """What no single key tells: that cars can come in and be carried to every place."""
    for kind, table in ((KindCode.COMPARTMENT, "compartments"), (KindCode.ROBOT, "robots")):
        if not root.values.get(table):
            root.bad(table, None, f"no {kind.name.lower()}", f"add at least one [[{table}]] table")
    if not _ways_are_read(root.problems):
        return
    bays = [uses.get(node, BayUse.BOTH) for node, one in fleet.by_node.items() if one.kind is KindCode.COMPARTMENT]
    for use, other in ((BayUse.ENTRY, BayUse.EXIT), (BayUse.EXIT, BayUse.ENTRY)):
        if all(one is other for one in bays):
            root.bad(
                "compartments", None, f"none for {use.value}", f'write use = "{use.value}", or none, at one of them'
            )
    places = layout.places()
    if not places:
        root.bad("floors", None, "no place for a car", "take entries out of floors.without or add positions")
    _check_joined(root, layout, fleet)


def _check_joined(root: TomlTable, layout: Layout, fleet: FleetReader) -> None:
    """That every alley can be reached from every other, so from every compartment and by every robot."""
    groups = _joined_tracks(layout)
    told = set()
    for tracks in groups:
        kinds = {machine.kind for machine in fleet.by_node.values() if machine.home.track in tracks}
        missing = [kind.name.lower() for kind in (KindCode.COMPARTMENT, KindCode.ROBOT) if kind not in kinds]
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


def _joined_tracks(layout: Layout) -> list[set[int]]:
    """The tracks in groups, between which one can drive or ride."""
    groups = [{alley.number} for alley in layout.alleys()]
    for track in layout.tracks.values():
        beside = {mouth.track for mouth in (*track.joins, track.high) if mouth is not None} | {track.number}
        joined = [group for group in groups if group & beside]
        groups = [group for group in groups if not group & beside] + [beside.union(*joined)]
    return groups
