"""The site file of a container terminal: docs/terminal.md describes every key."""

import re
from dataclasses import dataclass, field, replace

from onboard.config.fleet import FleetReader
from onboard.config.problems import nearest
from onboard.config.reader import Common, TomlTable
from onboard.config.timing import read_timing
from onboard.contract.codes import KindCode
from onboard.core.site import Segment
from onboard.systems.terminal.missions_reader import read_blockages, read_missions, read_presses
from onboard.systems.terminal.site import Box, Entity, EntityKind, StationKind, Terminal
from onboard.ways.network import Network

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_.-]{0,15}")
#: Entity numbers are the tracks of tokens: 8 bits, without 0 and 255.
MOST_ENTITIES = 254
#: A box's number on the bus has 16 bits.
MOST_BOXES = 65_535


@dataclass
class NamedEntities:
    """Entities read so far with their tables, by name."""

    numbers: dict[str, int] = field(default_factory=dict)
    entities: dict[int, Entity] = field(default_factory=dict)
    tables: dict[int, TomlTable] = field(default_factory=dict)

    def add(
        self, table: TomlTable, kind: EntityKind, *, duration_us: int = 0, capacity: int = 0, length_mm: int = 0
    ) -> int:
        """One entity; its name is its own."""
        name = table.text("name")
        number = len(self.entities) + 1
        if name and not _NAME.fullmatch(name):
            table.bad("name", name, "not a name", "write a letter, then up to 15 letters, digits, dots, - or _")
        elif name in self.numbers:
            table.bad("name", name, "used twice", "give each lane, crossing, area and station a name of its own")
        if number > MOST_ENTITIES:
            table.bad("name", name, f"more than {MOST_ENTITIES} entities", "make the terminal smaller")
            return number
        self.numbers.setdefault(name, number)
        self.entities[number] = Entity(number, name, kind, duration_us, capacity, length_mm=length_mm)
        self.tables[number] = table
        return number

    def find(self, table: TomlTable, key: str, kinds: tuple[EntityKind, ...], name: str | None = None) -> int:
        """Number of the entity that a key names; 0 where it names none of these kinds."""
        asked = table.text(key) if name is None else name
        number = self.numbers.get(asked, 0)
        if number and self.entities[number].kind in kinds:
            return number
        if asked:
            known = [one.name for one in self.entities.values() if one.kind in kinds]
            words = " or ".join(kind.value for kind in kinds)
            table.bad(key, asked, f"no {words} of this name", nearest(asked, known))
        return 0


def read(root: TomlTable, common: Common) -> Terminal:
    """A terminal; every mistake is noted in ``root.problems``."""
    planning, vehicle = root.table("planning"), root.table("vehicle")
    speed_mm_s = vehicle.integer("speed_mm_s", 100, 20_000, 5_000)
    network = _read_network(root, speed_mm_s)
    fleet, homes = _read_machines(root, network)
    boxes = _read_boxes(root, network)
    desks = sorted(node for node, one in fleet.by_node.items() if one.kind is KindCode.DESK)
    vehicles = len(fleet.by_node) - len(desks)
    for kind, count in (("desks", len(desks)), ("vehicles", vehicles)):
        if not root.values.get(kind) and not count:
            root.bad(kind, None, f"no {kind.removesuffix('s')}", f"add at least one [[{kind}]] table")
    timing = read_timing(root.table("timing"), vehicles, len(fleet.by_node), common.bitrate)
    steward = desks[0] if desks else 0
    site = Terminal(
        name=common.name,
        digest=0,
        bitrate=common.bitrate,
        machines=dict(sorted(fleet.by_node.items())),
        timing=timing,
        stewards=dict.fromkeys(network.entities, steward),
        entities=network.entities,
        boxes=boxes,
        dock_us=vehicle.integer("dock_ms", 100, 600_000, 2_000) * 1000,
        handle_us=vehicle.integer("handle_ms", 100, 600_000, 2_000) * 1000,
        undock_us=vehicle.integer("undock_ms", 100, 600_000, 2_000) * 1000,
        gap_us=planning.integer("gap_ms", 100, 60_000, 1_000) * 1000,
        horizon_us=planning.integer("horizon_s", 0, 3_600, 60) * 1_000_000,
        patience_us=planning.integer("patience_s", 1, 3_600, 30) * 1_000_000,
        routes=planning.integer("routes", 1, 8, 3),
    )
    begins_s = _clock(planning)
    by_box = {box.name: number for number, box in enumerate(boxes, start=1)}
    site = replace(
        site,
        missions=read_missions(root, network, by_box, fleet, steward, begins_s),
        blockages=read_blockages(root, network),
        presses=read_presses(root, fleet),
        stewards=_read_stewards(root.table("stewards"), network, fleet, steward),
    )
    if root.problems.none_in("areas|lanes|stations|crossings|turns|vehicles", "name|node"):
        _check_ways(root, site, homes)
    return site


def _clock(planning: TomlTable) -> int:
    """Seconds of the day at which the run begins; dates by the clock count from there."""
    text = planning.text("begins", "00:00")
    found = re.fullmatch(r"([01]?\d|2[0-3]):([0-5]\d)", text)
    if found is None:
        planning.bad("begins", text, "not a time of day", 'write hours and minutes such as "16:00"')
        return 0
    return int(found.group(1)) * 3600 + int(found.group(2)) * 60


def _read_network(root: TomlTable, speed_mm_s: int) -> NamedEntities:
    network = NamedEntities()
    for table in root.tables("lanes"):
        length_mm = table.integer("length_mm", 1_000, 5_000_000)
        network.add(
            table,
            EntityKind.LANE,
            length_mm=length_mm,
            duration_us=length_mm * 1_000_000 // speed_mm_s,
            capacity=table.integer("capacity", 1, 200, 1),
        )
    for table in root.tables("crossings"):
        network.add(
            table,
            EntityKind.CROSSING,
            duration_us=table.integer("duration_ms", 100, 3_600_000) * 1000,
            # No limit is unsafe for bodies (decision on flag 8).
            capacity=table.integer("capacity", 1, 16, 1),
        )
    for table in root.tables("areas"):
        network.add(table, EntityKind.AREA, duration_us=table.integer("duration_ms", 100, 3_600_000) * 1000)
    for table in root.tables("stations"):
        number = network.add(table, EntityKind.STATION, capacity=1)
        kind = StationKind(table.choice("kind", [one.value for one in StationKind], StationKind.STACK.value))
        room = table.integer("room", 1, 1_000, 4)
        if number in network.entities:
            network.entities[number] = replace(network.entities[number], station=kind, room=room)
    if not network.entities:
        root.bad("areas", None, "no entity", "add [[lanes]], [[crossings]], [[areas]] and [[stations]] tables")
    for number, table in network.tables.items():
        _join(network, number, table)
    return network


def _join(network: NamedEntities, number: int, table: TomlTable) -> None:
    """What an entity leads to, and the durations of single ways through it."""
    entity = network.entities[number]
    if entity.kind is EntityKind.STATION:
        area = network.find(table, "area", (EntityKind.AREA,))
        network.entities[number] = replace(entity, area=area, leads_to=(area,) if area else ())
        if area:
            joined = network.entities[area]
            network.entities[area] = replace(joined, leads_to=(*joined.leads_to, number))
        return
    kinds = (EntityKind.LANE, EntityKind.CROSSING, EntityKind.AREA)
    names = table.items("leads_to", "a list of names")
    if not names:
        table.bad("leads_to", None, "leads nowhere", 'write a list of names such as ["C1"]')
    leads = []
    for item, name in enumerate(names or []):
        found = network.find(table, "leads_to", kinds, name) if isinstance(name, str) else 0
        if not isinstance(name, str):
            table.bad("leads_to", name, "not a name", "write a text in quotes", item=item)
        elif found:
            leads.append(found)
    if entity.kind is EntityKind.LANE and len(leads) > 1:
        table.bad("leads_to", names, "a lane is one-way and has one end", "name one crossing or area")
    turns = []
    for turn in table.tables("turns"):
        before, after = network.find(turn, "from", kinds), network.find(turn, "to", kinds)
        turns.append((before, after, turn.integer("duration_ms", 100, 3_600_000) * 1000))
    # Stations of an area may have been joined before.
    stations = tuple(one for one in network.entities[number].leads_to if one not in leads)
    network.entities[number] = replace(network.entities[number], leads_to=(*leads, *stations), turns=tuple(turns))


def _read_machines(root: TomlTable, network: NamedEntities) -> tuple[FleetReader, dict[int, TomlTable]]:
    fleet, homes = FleetReader(), {}
    for table in root.tables("desks"):
        fleet.add(table, KindCode.DESK, Segment(0, 0))
    bays: dict[int, int] = {}
    for table in root.tables("vehicles"):
        area = network.find(table, "home", (EntityKind.AREA,))
        bays[area] = bays.get(area, 0) + 1
        fleet.add(table, KindCode.VEHICLE, Segment(area, bays[area]))
        homes[area] = table
    return fleet, homes


def _read_boxes(root: TomlTable, network: NamedEntities) -> tuple[Box, ...]:
    found: dict[str, Box] = {}
    standing: dict[int, int] = {}
    for table in root.tables("boxes"):
        station = network.find(table, "station", (EntityKind.STATION,))
        kind = table.text("type", "T1")
        for item, name in enumerate(table.items("names", "a list of names") or []):
            if not isinstance(name, str) or not _NAME.fullmatch(name):
                table.bad("names", name, "not a name", 'write names such as "B1"', item=item)
            elif name in found:
                table.bad("names", name, "used twice", "give each box a name of its own", item=item)
            else:
                found[name] = Box(name, kind, station)
                standing[station] = standing.get(station, 0) + 1
        if station and standing.get(station, 0) > network.entities[station].room:
            room = network.entities[station].room
            table.bad("names", standing[station], f"station has room for {room}", "make room larger or name fewer")
    if len(found) > MOST_BOXES:
        root.bad("boxes", len(found), f"more than {MOST_BOXES} boxes", "name fewer")
    return tuple(found.values())


def _read_stewards(table: TomlTable, network: NamedEntities, fleet: FleetReader, first: int) -> dict[int, int]:
    """Which desk holds the rights to which entity at first: the one named, else the lowest."""
    stewards = dict.fromkeys(network.entities, first)
    for name in sorted(network.numbers):
        if table.has(name):
            desk = fleet.by_name.get(table.text(name))
            if desk is not None and desk.kind is KindCode.DESK:
                stewards[network.numbers[name]] = desk.node_id
            elif desk is not None or not fleet.is_odd(table.text(name)):
                known = [one.name for one in fleet.by_node.values() if one.kind is KindCode.DESK]
                table.bad(name, table.values[name], "no desk of this name", nearest(str(table.values[name]), known))
    return stewards


def _check_ways(root: TomlTable, site: Terminal, homes: dict[int, TomlTable]) -> None:
    """That every station can be reached from every home, and every area left for every station."""
    stations = [one for one in site.entities.values() if one.kind is EntityKind.STATION]
    if not stations:
        root.bad("stations", None, "no station", "add at least one [[stations]] table")
    areas = sorted(set(homes) | {one.area for one in stations})
    network = _network(site)
    for origin in areas:
        reached = network.from_any((origin,))
        lost = [one.name for one in stations if one.number not in reached]
        if lost:
            what = f"no way from {site.entities[origin].name} to {lost[0]}"
            root.bad("lanes", None, what, f"join {lost[0]} by leads_to, or take it out")
            return


def _network(site: Terminal) -> Network[int]:
    """Entities and where they lead to; what a crossing takes depends on where it goes, and is not asked here."""
    return Network({number: [(after, 1) for after in one.leads_to] for number, one in site.entities.items()})
