"""The site file: TOML text to a checked ``Site``. docs/site-file.md describes every key."""

import hashlib
import json
import re
from collections.abc import Collection, Mapping
from dataclasses import MISSING, Field, fields, is_dataclass, replace
from enum import Enum
from pathlib import Path
from typing import Any

from onboard.config.constants import read_constants, read_timing
from onboard.config.files import root_table
from onboard.config.machines import Fleet, read_fleet, read_stewards
from onboard.config.problems import Problems
from onboard.config.reader import Table
from onboard.config.shipped import site_source
from onboard.config.systems import READERS, Common
from onboard.core.codes import KindCode
from onboard.core.site import Site, TrackKind
from onboard.systems.car_park.layout import Layout, read_layout
from onboard.systems.car_park.room import check_room
from onboard.systems.car_park.site import CarPark, RideCalls

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,31}")


def load_site(path: Path) -> Site:
    """Read a site file, or a shipped site by its name (``site_source``).

    Raises ``ConfigError`` with every mistake, or with one problem where it cannot be read.
    """
    return parse_site(*site_source(path))


def parse_site(text: str, file: str, *, crowded: bool = False) -> Site:
    """Check and build a site from TOML text; ``file`` is its name in messages. Raises ``ConfigError``.

    ``crowded`` lets more robots in than can find refuges, and lets them be at home together: for studies of what they
    do in each other's way.
    """
    problems = Problems(file)
    root = root_table(text, problems)
    head = root.table("site", required=True)
    common = Common(_read_name(head), head.integer("bitrate", 10_000, 1_000_000, 500_000))
    system = head.choice("system", [CarPark.system, *READERS], CarPark.system)
    if system in READERS:
        site = READERS[system](root, common)
        root.check_unknown()
        problems.raise_if_any()
    else:
        site = _read_car_park(root, common, crowded=crowded)
    return replace(site, digest=site_digest(site))


def _read_car_park(root: Table, common: Common, *, crowded: bool) -> Site:
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
    if not crowded:
        check_room(root, site, fleet)
        problems.raise_if_any()
    return site


def site_digest(site: Site) -> int:
    """1 to 65535, over what a site is and not what comes to it; docs/site-file.md says how to compute it."""
    text = json.dumps(_meaning(site, {"digest", *site.demand}), sort_keys=True, separators=(",", ":"), default=_plain)
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:2], "big") or 1


def _meaning(value: object, left_out: Collection[str] = ()) -> object:
    """A value for JSON; dataclasses as dictionaries without the fields that have their defaults.

    So a field that a later version adds does not make strangers of the sites that do not use it.
    """
    if is_dataclass(value):
        own = ((one, getattr(value, one.name)) for one in fields(value) if one.name not in left_out)
        return {one.name: _meaning(content) for one, content in own if content != _default(one)}
    if isinstance(value, Mapping):
        return {key: _meaning(content) for key, content in value.items()}
    if isinstance(value, list | tuple):
        return [_meaning(content) for content in value]
    return value


def _default(one: Field[Any]) -> object:
    return one.default if one.default_factory is MISSING else one.default_factory()


def _plain(value: object) -> object:
    if isinstance(value, Enum):
        return value.value
    raise TypeError(f"a site holds a {type(value).__name__}, which has no canonical text")


def _read_name(head: Table) -> str:
    name = head.text("name")
    if name and not _NAME.fullmatch(name):
        head.bad("name", name, "not usable in a file name", "write up to 32 letters, digits, dots, - or _")
    return name


def _check_whole(root: Table, layout: Layout, fleet: Fleet) -> None:
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


def _check_joined(root: Table, layout: Layout, fleet: Fleet) -> None:
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
