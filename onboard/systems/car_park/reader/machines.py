"""The machines of a car park's site file, and who is steward of what."""

from collections import deque
from typing import NamedTuple

from onboard.config.fleet import FleetReader
from onboard.config.reader import TomlTable
from onboard.config.toml_lines import path_text
from onboard.contract.codes import KindCode
from onboard.core.site import Machine, Segment, Station
from onboard.systems.car_park.reader.built import beside
from onboard.systems.car_park.reader.layout import FIRST_LIFT, SIDES, Layout
from onboard.ways.site import BayUse, Track

_NOWHERE = Segment(0, 0)
#: Where a robot is whose home is mistaken: somewhere on the site, so that all else can be judged.
STAND_IN = Segment(1, 1)


class Bay(NamedTuple):
    """A compartment's table; its machine, odd where that is mistaken; where it is, or None; what it is for."""

    table: TomlTable
    node: int
    station: Station | None
    use: BayUse


def read_fleet(root: TomlTable, layout: Layout) -> tuple[FleetReader, list[Bay]]:
    """Lifts, compartments and robots of a site file; and the compartments as they are written."""
    fleet = FleetReader()
    bays: list[Bay] = []
    for number, table in enumerate(layout.lifts, start=FIRST_LIFT):
        fleet.add(table, KindCode.LIFT, Segment(number, 1))
    for table in root.tables("compartments"):
        side = table.choice("side", list(SIDES), "near")
        station = layout.take(table, layout.find(table, "at"), side)
        if station is not None:
            layout.kept.setdefault(station.segment, f"the front of {path_text(table.path)} is")
        use = BayUse(table.choice("use", [one.value for one in BayUse], BayUse.BOTH.value))
        machine = fleet.add(table, KindCode.COMPARTMENT, station.segment if station is not None else _NOWHERE, station)
        bays.append(Bay(table, machine.node_id, station, use))
    for table in root.tables("robots"):
        home = _read_home(table, layout, fleet)
        fleet.robots.append((table, home))
        fleet.add(table, KindCode.ROBOT, home)
    return fleet, bays


def _read_home(table: TomlTable, layout: Layout, fleet: FleetReader) -> Segment:
    """Where a robot stands at first, as it may stand there for ever: on no sill, front or mouth, and by itself."""
    home = layout.find(table, "home", spurs=True)
    if home is None:
        return STAND_IN
    if home in layout.kept:
        remedy = "choose a segment where a robot may stand for ever"
        table.bad("home", table.values["home"], f"{layout.kept[home]} there", remedy)
        return STAND_IN
    if home in fleet.homes:
        what = f"home of {fleet.homes[home]} already"
        table.bad("home", table.values["home"], what, "give each robot a segment of its own")
    fleet.homes.setdefault(home, path_text(table.path))
    return home


def read_stewards(table: TomlTable, layout: Layout, fleet: FleetReader) -> dict[int, int]:
    """Node-ID of the steward of each track: the one named, else the nearest fixed machine.

    Nearest is the lift for its own shaft, and otherwise by floors away, then by tracks on the way, then by node-ID: of
    a floor with many alleys no single machine keeps all cars.
    """
    fixed = fleet.fixed()
    stewards = {}
    joined = _joined(layout)
    if not layout.known or layout.shifted:
        table.pass_over(str.isdecimal)
    for number, track in layout.tracks.items():
        if not table.has(str(number)):
            if fixed:
                stewards[number] = _nearest(layout, joined, fixed, track).node_id
            continue
        name = table.text(str(number))
        machine = fleet.by_name.get(name)
        if machine in fixed and machine is not None:
            stewards[number] = machine.node_id
        elif name and (machine is not None or not fleet.is_odd(name)):
            known = ", ".join(one.name for one in fixed)
            table.bad(str(number), name, "no fixed machine of this name", f"fixed machines here: {known}")
    return stewards


def _nearest(layout: Layout, joined: dict[int, set[int]], fixed: list[Machine], track: Track) -> Machine:
    """Of the fixed machines the fewest floors away that with the fewest tracks on the way, then the lowest node-ID."""
    floors = {one.node_id: _distance(layout, one, track) for one in fixed}
    near = [one for one in fixed if floors[one.node_id] == min(floors.values())]
    hops = _hops(joined, track.number) if len(near) > 1 else {}
    return min(near, key=lambda one: (hops.get(one.home.track, len(joined)), one.node_id))


def _distance(layout: Layout, machine: Machine, track: Track) -> int:
    """Floors between a fixed machine and a track; -1 between a lift and its own shaft."""
    if machine.home.track == track.number:
        return -1
    return min(
        abs(one - other) for one in _floors(layout, machine.home.track) for other in _floors(layout, track.number)
    )


def _joined(layout: Layout) -> dict[int, set[int]]:
    """The tracks that each track touches."""
    joined: dict[int, set[int]] = {number: set() for number in layout.tracks}
    for number, track in layout.tracks.items():
        for other in beside(track) & joined.keys():
            joined[number].add(other)
            joined[other].add(number)
    return joined


def _hops(joined: dict[int, set[int]], number: int) -> dict[int, int]:
    """How many tracks further each track is than this one, of those that hang together with it."""
    hops, queue = {number: 0}, deque([number])
    while queue:
        one = queue.popleft()
        for other in sorted(joined[one] - hops.keys()):
            hops[other] = hops[one] + 1
            queue.append(other)
    return hops


def _floors(layout: Layout, number: int) -> list[int]:
    """The floors of a track; a lift's are those at which it stops."""
    track = layout.tracks.get(number)
    if track is None or number in layout.level:
        return [layout.level.get(number, number)]
    return [layout.level.get(sill.track, sill.track) for sill in track.joins] or [number]
