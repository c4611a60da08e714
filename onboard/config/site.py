"""The site file: TOML text to a checked ``Site``. docs/site-file.md describes every key.

Default speeds are those of the SimPy car-park study named in the systems list (carrier 90 m/min, shuttle with car
45 m/min, lift 65 m/min, places of 2.4 m by 5.4 m, 2.5 m a level); accelerations and times are ours.
"""

import hashlib
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from onboard.config.problems import ConfigError, Problem, Problems
from onboard.config.reader import Table
from onboard.config.toml_lines import parse
from onboard.core.codes import MAX_NODE_ID, KindCode, Side
from onboard.core.site import Axis, CarLimits, Machine, Segment, Site, Station, Timing, Track, TrackKind

_STATION = re.compile(r"^p\(\s*(\d+)\s*,\s*(\d+)\s*\)([NF])$")
_SIDES = {"near": Side.NEAR, "far": Side.FAR}
_FIRST_LIFT = 128
_FIRST_SPUR = 192
_FRAME_BITS = 160


@dataclass
class _Draft:
    """What has been read so far, and where each machine and station was named first."""

    problems: Problems
    tracks: dict[int, Track] = field(default_factory=dict)
    machines: dict[int, Machine] = field(default_factory=dict)
    names: dict[str, int] = field(default_factory=dict)
    taken: dict[Station, str] = field(default_factory=dict)

    def has_segment(self, table: Table, name: str, where: tuple[int, int]) -> Segment | None:
        """The segment if the site has it; else a problem is noted. ``(0, 0)`` was a problem already."""
        if where == (0, 0):
            return None
        track = self.tracks.get(where[0])
        if track is None or track.kind is not TrackKind.ALLEY:
            known = ", ".join(str(n) for n, t in self.tracks.items() if t.kind is TrackKind.ALLEY)
            table.bad(name, table.values[name], "no such floor", f"floors here: {known}")
            return None
        if not 1 <= where[1] <= track.length:
            remedy = f"floor {where[0]} has positions 1 to {track.length}"
            table.bad(name, table.values[name], "no such position", remedy)
            return None
        return Segment(*where)

    def add_machine(self, table: Table, kind: KindCode, home: Segment, station: Station | None = None) -> None:
        """Name, node-ID and place of one machine, all unique."""
        name = table.text("name")
        node = table.integer("node", 1, MAX_NODE_ID)
        if name and name in self.names:
            table.bad("name", name, "used twice", "give each machine a name of its own")
        if node in self.machines:
            table.bad("node", node, f"node-ID of {self.machines[node].name} already", "give each machine its own")
            return
        if name and not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,15}", name):
            table.bad("name", name, "not usable in a DBC", "write a letter, then up to 15 letters, digits or _")
        if kind is KindCode.ROBOT:
            for other in self.machines.values():
                if other.kind is KindCode.ROBOT and other.home == home:
                    table.bad("home", str(home), f"home of {other.name} already", "choose a position of its own")
        self.names[name] = node
        self.machines[node] = Machine(node, name, kind, home, station)


def load_site(path: Path) -> Site:
    """Read a site file. Raises ``ConfigError`` with every mistake, or with one problem where it cannot be read."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else "not UTF-8 text"
        problem = Problem(str(path), 0, "", None, f"cannot be read: {why}", "name an existing site file")
        raise ConfigError([problem]) from error
    return parse_site(text, str(path))


def parse_site(text: str, file: str) -> Site:
    """Check and build a site from TOML text; ``file`` is its name in messages. Raises ``ConfigError``."""
    problems = Problems(file)
    document = parse(text, file, problems)
    problems.raise_if_any()
    root = Table(document, problems, "", document.values)
    draft = _Draft(problems)
    head = root.table("site", required=True)
    name = head.text("name")
    bitrate = head.integer("bitrate", 10_000, 1_000_000, 500_000)
    floors = root.table("floors", required=True)
    _read_alleys(draft, floors)
    spurs = root.tables("spurs")
    tables = [head, floors, *spurs]
    tables += _read_lifts(draft, root)
    _read_spurs(draft, spurs, floors.integer("pitch_mm", 1000, 10_000, 2_400))
    tables += _read_compartments(draft, root)
    tables += _read_robots(draft, root)
    places = _read_places(draft, floors)
    stewards = _read_stewards(draft, root.table("stewards"))
    axes = _Axes.read(root, floors)
    timing_table = root.table("timing")
    robots = sum(1 for machine in draft.machines.values() if machine.kind is KindCode.ROBOT)
    timing = _read_timing(timing_table, robots, bitrate)
    tables += [timing_table, *axes.tables]
    _check_whole(draft, root, places)
    for table in (root, *tables):
        table.check_unknown()
    problems.raise_if_any()
    site = Site(
        name,
        1,
        bitrate,
        draft.tracks,
        tuple(places),
        dict(sorted(draft.machines.items())),
        stewards,
        axes.carrier,
        axes.carrier_length_mm,
        axes.carrier_clearance_mm,
        axes.shuttle,
        axes.shuttle_reach_mm,
        axes.lift,
        axes.floor_height_mm,
        axes.cars,
        timing,
    )
    return _with_digest(site)


def _read_alleys(draft: _Draft, floors: Table) -> None:
    count = floors.integer("count", 1, 127)
    positions = floors.integer("positions", 2, 127)
    pitch_mm = floors.integer("pitch_mm", 1000, 10_000, 2_400)
    lengths = dict.fromkeys(range(1, count + 1), positions)
    for override in floors.tables("floor"):
        number = override.integer("number", 1, 127)
        if number not in lengths:
            override.bad("number", number, "no such floor", f"floors here: 1 to {count}")
        lengths[number] = override.integer("positions", 2, 127, positions)
        override.check_unknown()
    for number, length in lengths.items():
        draft.tracks[number] = Track(number, TrackKind.ALLEY, length, pitch_mm)


def _read_lifts(draft: _Draft, root: Table) -> list[Table]:
    alleys = [number for number, track in draft.tracks.items() if track.kind is TrackKind.ALLEY]
    height_mm = root.table("lift").integer("floor_height_mm", 1000, 10_000, 2_500)
    tables = root.tables("lifts")
    for number, table in enumerate(tables, start=_FIRST_LIFT):
        served = table.integers("floors", 1, 127, alleys)
        end = table.choice("end", ["left", "right"])
        missing = [floor for floor in served if floor not in draft.tracks]
        if missing:
            table.bad("floors", missing, "no such floor", f"floors here: 1 to {max(alleys)}")
            served = [floor for floor in served if floor in draft.tracks]
        sills = tuple(Segment(floor, 1 if end == "left" else draft.tracks[floor].length) for floor in sorted(served))
        for other in draft.tracks.values():
            if other.kind is TrackKind.LIFT and set(other.joins) & set(sills):
                table.bad("end", end, "another lift is at this end", "put one lift at each end")
        draft.tracks[number] = Track(number, TrackKind.LIFT, len(sills), height_mm, sills)
        draft.add_machine(table, KindCode.LIFT, Segment(number, 1))
    return tables


def _read_spurs(draft: _Draft, tables: list[Table], pitch_mm: int) -> None:
    for number, table in enumerate(tables, start=_FIRST_SPUR):
        mouth = draft.has_segment(table, "at", table.segment("at"))
        if mouth is not None:
            draft.tracks[number] = Track(number, TrackKind.SPUR, 1, pitch_mm, (mouth,))


def _read_compartments(draft: _Draft, root: Table) -> list[Table]:
    tables = root.tables("compartments")
    for table in tables:
        front = draft.has_segment(table, "at", table.segment("at"))
        side = _SIDES[table.choice("side", list(_SIDES), "near")]
        station = Station(*front, side) if front is not None else Station(0, 0, side)
        if station in draft.taken:
            table.bad(
                "at", str(station), f"{draft.taken[station]} stands there already", "choose another side or position"
            )
        draft.taken[station] = table.text("name")
        draft.add_machine(table, KindCode.COMPARTMENT, station.segment, station)
    return tables


def _read_robots(draft: _Draft, root: Table) -> list[Table]:
    tables = root.tables("robots")
    fronts = {station.segment for station in draft.taken}
    for table in tables:
        home = draft.has_segment(table, "home", table.segment("home"))
        if home is not None and home in fronts:
            table.bad("home", str(home), "in front of a compartment", "choose a position that blocks nobody")
        draft.add_machine(table, KindCode.ROBOT, home or Segment(0, 0))
    return tables


def _read_places(draft: _Draft, floors: Table) -> list[Station]:
    sides = floors._get("sides", ["near", "far"], list, 'a list of "near" and "far"') or []
    for side in sides:
        if side not in _SIDES:
            floors.bad("sides", side, "unknown side", 'write "near", "far" or both')
    gaps = set()
    for text in floors._get("without", [], list, 'a list of places such as ["p(1,3)N"]') or []:
        found = _STATION.match(text) if isinstance(text, str) else None
        if found is None:
            floors.bad("without", text, "not a place", 'write places such as "p(1,3)N": floor 1, index 3, near side')
            continue
        gaps.add(Station(int(found.group(1)), int(found.group(2)), Side("NF".index(found.group(3)))))
    places = []
    for track in draft.tracks.values():
        if track.kind is TrackKind.ALLEY:
            for side in (Side.NEAR, Side.FAR):
                if side.name.lower() in sides:
                    stations = [Station(track.number, index, side) for index in range(1, track.length + 1)]
                    places += [one for one in stations if one not in draft.taken and one not in gaps]
    unknown = [
        gap for gap in gaps if gap.track not in draft.tracks or not 1 <= gap.index <= draft.tracks[gap.track].length
    ]
    for gap in sorted(unknown):
        floors.bad("without", str(gap), "no such place", "name a place of this site")
    return places


def _read_stewards(draft: _Draft, table: Table) -> dict[int, int]:
    """One fixed machine for each track: the named one, else the nearest by floor, then by node-ID."""
    fixed = [machine for machine in draft.machines.values() if machine.kind is not KindCode.ROBOT]
    stewards = {}
    for number, track in draft.tracks.items():
        key = str(number)
        floor = track.joins[0].track if track.joins else number
        if table.has(key):
            named = table.text(key)
            node = draft.names.get(named)
            if node is None or draft.machines[node].kind is KindCode.ROBOT:
                known = ", ".join(machine.name for machine in fixed)
                table.bad(key, named, "no fixed machine of this name", f"fixed machines here: {known}")
                continue
            stewards[number] = node
        elif fixed:
            nearest = min(fixed, key=lambda machine: (_floors_away(draft, machine, floor), machine.node_id))
            stewards[number] = nearest.node_id
    table.check_unknown()
    return stewards


def _floors_away(draft: _Draft, machine: Machine, floor: int) -> int:
    track = draft.tracks.get(machine.home.track)
    if track is not None and track.joins:
        return min(abs(sill.track - floor) for sill in track.joins)
    return abs(machine.home.track - floor)


@dataclass
class _Axes:
    """Speeds, lengths and limits of cars."""

    tables: list[Table]
    carrier: Axis
    carrier_length_mm: int
    carrier_clearance_mm: int
    shuttle: Axis
    shuttle_reach_mm: int
    lift: Axis
    floor_height_mm: int
    cars: CarLimits

    @classmethod
    def read(cls, root: Table, floors: Table) -> "_Axes":
        carrier, shuttle, lift, cars = (root.table(name) for name in ("carrier", "shuttle", "lift", "cars"))
        pitch_mm = floors.integer("pitch_mm", 1000, 10_000, 2_400)
        length_mm = carrier.integer("length_mm", 100, 10_000, min(2_300, pitch_mm - 100))
        if length_mm > pitch_mm:
            carrier.bad("length_mm", length_mm, f"longer than a segment ({pitch_mm} mm)", "make pitch_mm larger")
        limits = CarLimits(
            cars.integer("min_wheelbase_mm", 1500, 4050, 1_800),
            cars.integer("max_wheelbase_mm", 1500, 4050, 3_400),
            cars.integer("max_length_mm", 1000, 8000, 5_300),
            cars.integer("max_height_mm", 500, 4000, 2_100),
            cars.integer("max_load_kg", 100, 4000, 3_000),
        )
        if limits.min_wheelbase_mm > limits.max_wheelbase_mm:
            cars.bad("min_wheelbase_mm", limits.min_wheelbase_mm, "above max_wheelbase_mm", "exchange them")
        return cls(
            [carrier, shuttle, lift, cars],
            _axis(carrier, 1_500, 500),
            length_mm,
            carrier.integer("clearance_mm", 0, 20_000, 50),
            _axis(shuttle, 750, 500),
            shuttle.integer("reach_mm", 500, 8_000, 5_400),
            _axis(lift, 1_083, 500),
            lift.integer("floor_height_mm", 1000, 10_000, 2_500),
            limits,
        )


def _axis(table: Table, speed_mm_s: int, acceleration_mm_s2: int) -> Axis:
    return Axis(
        table.integer("speed_mm_s", 10, 20_000, speed_mm_s),
        table.integer("acceleration_mm_s2", 10, 20_000, acceleration_mm_s2),
    )


def _read_timing(table: Table, robots: int, bitrate: int) -> Timing:
    """Times in ms in the file. The default delay W is at least 3 N times the bus latency of two frames."""
    latency_us = 2 * _FRAME_BITS * 1_000_000 // bitrate
    delay_ms = max(300, -(-3 * robots * latency_us // 1000))
    values = {
        "call_window": table.integer("call_window_ms", 50, 60_000, 1_000),
        "bid_delay": table.integer("bid_delay_ms", 1, 60_000, delay_ms),
        "bid_half": table.integer("bid_half_ms", 1, 3_600_000, 10_000),
        "deadline_guard": table.integer("deadline_guard_ms", 0, 10_000, 20),
    }
    if values["bid_delay"] + values["deadline_guard"] >= values["call_window"]:
        table.bad(
            "bid_delay_ms", values["bid_delay"], "bids would come after the deadline", "make call_window_ms longer"
        )
    return Timing(
        values["call_window"] * 1000,
        values["bid_delay"] * 1000,
        values["bid_half"] * 1000,
        values["deadline_guard"] * 1000,
        table.integer("max_attempts", 1, 15, 5),
        table.integer("award_repeat_ms", 10, 10_000, 100) * 1000,
        table.integer("token_repeat_ms", 10, 10_000, 200) * 1000,
        table.integer("heartbeat_ms", 100, 60_000, 2_000) * 1000,
        table.integer("bus_time_ms", 100, 60_000, 5_000) * 1000,
        table.integer("door_ms", 100, 60_000, 3_000) * 1000,
        table.integer("grip_ms", 100, 60_000, 2_000) * 1000,
        table.integer("drive_refresh_ms", 10, 450, 200) * 1000,
    )


def _check_whole(draft: _Draft, root: Table, places: list[Station]) -> None:
    kinds = [machine.kind for machine in draft.machines.values()]
    if KindCode.ROBOT not in kinds:
        root.bad("robots", None, "no robot", "add at least one [[robots]] table")
    if KindCode.COMPARTMENT not in kinds:
        root.bad("compartments", None, "no compartment", "add at least one [[compartments]] table")
    if not places:
        root.bad("floors", None, "no place for a car", "give the floors sides and positions")


def _canonical(value: Any) -> Iterator[Any]:
    """Plain values in a fixed order, so that equal meaning gives equal text."""
    if isinstance(value, dict):
        yield [[key, list(_canonical(item))] for key, item in sorted(value.items())]
    elif isinstance(value, tuple | list):
        yield [list(_canonical(item)) for item in value]
    elif hasattr(value, "__dataclass_fields__"):
        yield [
            [name, list(_canonical(getattr(value, name)))] for name in value.__dataclass_fields__ if name != "digest"
        ]
    else:
        yield str(value)


def _with_digest(site: Site) -> Site:
    """SHA-256 over the canonical content, cut to 16 bits; 0 is kept for "none"."""
    text = json.dumps(list(_canonical(site)), separators=(",", ":"))
    digest = int.from_bytes(hashlib.sha256(text.encode()).digest()[:2], "big") or 1
    return Site(**{**{name: getattr(site, name) for name in site.__dataclass_fields__}, "digest": digest})
