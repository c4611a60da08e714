"""The site file of a car park, of floors, alleys, lifts and compartments; docs/site-file.md describes every key."""

from dataclasses import replace

from onboard.config.fleet import FleetReader
from onboard.config.reader import Common, TomlTable
from onboard.config.timing import read_timing
from onboard.contract.codes import KindCode
from onboard.systems.car_park.constants import read_constants
from onboard.systems.car_park.layout import Layout, read_layout
from onboard.systems.car_park.machines import read_fleet, read_stewards
from onboard.systems.car_park.room import check_room
from onboard.systems.car_park.site import CarPark, RideCalls
from onboard.ways.site import TrackKind


def read(root: TomlTable, common: Common) -> CarPark:
    """A car park; every mistake is noted in ``root.problems``, and raised as ``ConfigError`` before room is counted."""
    problems, lift, bitrate = root.problems, root.table("lift"), common.bitrate
    floor_height_mm = lift.integer("floor_height_mm", 1000, 10_000, 2_500)
    layout = read_layout(root, floor_height_mm)
    fleet = read_fleet(root, layout)
    stewards = read_stewards(root.table("stewards"), layout, fleet)
    constants = read_constants(root, lift, layout.pitch_mm)
    robots = sum(1 for machine in fleet.by_node.values() if machine.kind is KindCode.ROBOT)
    timing = read_timing(root.table("timing"), robots, len(fleet.by_node), bitrate)
    negotiation = root.table("negotiation")
    rides = RideCalls(negotiation.choice("rides", [one.value for one in RideCalls], "after"))
    timing = replace(timing, sub_call_percent=negotiation.integer("sub_call_percent", 20, 80, 50))
    _check_whole(root, layout, fleet)
    root.check_unknown()
    problems.raise_if_any()
    site = CarPark(
        name=common.name,
        digest=0,
        bitrate=bitrate,
        tracks=layout.tracks,
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
    )
    if not common.crowded:
        check_room(root, site, fleet)
        problems.raise_if_any()
    return site


def _check_whole(root: TomlTable, layout: Layout, fleet: FleetReader) -> None:
    """What no single key tells: that cars can come in and be carried to every place."""
    for kind, table in ((KindCode.COMPARTMENT, "compartments"), (KindCode.ROBOT, "robots")):
        if not root.values.get(table):
            root.bad(table, None, f"no {kind.name.lower()}", f"add at least one [[{table}]] table")
    if root.problems.found:
        return
    places = layout.places()
    if not places:
        root.bad("floors", None, "no place for a car", "take entries out of floors.without or add positions")
    _check_joined(root, layout, fleet)


def _check_joined(root: TomlTable, layout: Layout, fleet: FleetReader) -> None:
    """That every floor can be reached from every other, so from every compartment and by every robot."""
    groups = _joined_floors(layout)
    for floors in groups:
        kinds = {machine.kind for machine in fleet.by_node.values() if _floor(layout, machine.home.track) in floors}
        missing = [kind.name.lower() for kind in (KindCode.COMPARTMENT, KindCode.ROBOT) if kind not in kinds]
        if missing:
            what = f"no {' and no '.join(missing)} can be reached from floor {min(floors)}"
            root.bad("lifts", None, what, f"join floor {min(floors)} to the others by a lift")
    if len(groups) > 1 and "lifts" not in root.wrong:
        what = f"no way from floor {min(groups[0])} to floor {min(groups[1])}"
        root.bad("lifts", None, what, "join them by a lift, or write a site file for each")


def _joined_floors(layout: Layout) -> list[set[int]]:
    """The floors in groups between which lifts go."""
    groups = [{alley.number} for alley in layout.alleys()]
    for track in layout.tracks.values():
        if track.kind is TrackKind.LIFT:
            served = {sill.track for sill in track.joins}
            joined = [group for group in groups if group & served]
            groups = [group for group in groups if not group & served] + [set().union(*joined)]
    return groups


def _floor(layout: Layout, track: int) -> int:
    joins = layout.tracks[track].joins
    return joins[0].track if joins else track
