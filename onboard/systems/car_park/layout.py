"""The tracks of a site: alleys, lifts and spurs, and the places beside the alleys (rows P30, P31)."""

import re
from dataclasses import dataclass, field

from onboard.config.reader import TomlTable, type_name
from onboard.config.toml_lines import path_text
from onboard.contract.codes import Side
from onboard.core.site import Segment, Station
from onboard.ways.site import Track, TrackKind

SIDES = {"near": Side.NEAR, "far": Side.FAR}
_PLACES = re.compile(r"p\(\s*(\*|\d{1,3})\s*,\s*(\d{1,3})\s*\)([NF]?)")

#: Track numbers by kind, as on the wire: alleys carry their floor's number.
FIRST_ALLEY, FIRST_LIFT, FIRST_SPUR, AFTER_SPURS = 1, 128, 192, 255
_MOST_FLOORS = FIRST_LIFT - FIRST_ALLEY
_MOST_POSITIONS = 127


@dataclass
class Layout:
    """What has been read so far.

    ``known`` is False where number or length of the alleys is mistaken: what refers to them is then not judged.
    ``lifts`` are the tables of the lifts, in the order of their tracks. ``taken`` says what stands at a station that
    is no place, ``kept`` why nobody may stand for long at a segment.
    """

    tracks: dict[int, Track] = field(default_factory=dict)
    sides: dict[int, frozenset[Side]] = field(default_factory=dict)
    taken: dict[Station, str] = field(default_factory=dict)
    kept: dict[Segment, str] = field(default_factory=dict)
    without: set[Station] = field(default_factory=set)
    lifts: list[TomlTable] = field(default_factory=list)
    pitch_mm: int = 2_400
    known: bool = True

    def alleys(self) -> list[Track]:
        """The alleys, in the order in which the tracks were read."""
        return [track for track in self.tracks.values() if track.kind is TrackKind.ALLEY]

    def find(self, table: TomlTable, name: str, *, spurs: bool = False) -> Segment | None:
        """The segment named at a key; None, and a problem noted, where the site has no such alley or spur segment."""
        segment = table.segment(name)
        if segment is None or not self.known:
            return None
        track = self.tracks.get(segment.track)
        if track is None or track.kind is TrackKind.LIFT or (track.kind is TrackKind.SPUR and not spurs):
            remedy = f"floors here: 1 to {len(self.alleys())}"
            table.bad(name, table.values[name], "no such segment", remedy)
            return None
        if not 1 <= segment.index <= track.length:
            where = f"floor {track.number}" if track.kind is TrackKind.ALLEY else f"spur {track.number}"
            table.bad(name, table.values[name], "no such segment", f"{where} has 1 to {track.length}")
            return None
        return segment

    def take(self, table: TomlTable, front: Segment | None, side: str) -> Station | None:
        """Put something other than a place beside a segment, unless something else is there."""
        if front is None:
            return None
        station = Station(*front, SIDES[side])
        if station in self.taken:
            what_is_there = f"{self.taken[station]} is there already, on the {side} side"
            table.bad("at", table.values["at"], what_is_there, "choose another side or position")
            return None
        self.taken[station] = path_text(table.path)
        return station

    def places(self) -> tuple[Station, ...]:
        """Every station beside an alley that is not left out and not taken, by floor, side and index."""
        free = self.taken.keys() | self.without
        return tuple(
            station
            for alley in self.alleys()
            for side in Side
            if side in self.sides[alley.number]
            for index in range(1, alley.length + 1)
            if (station := Station(alley.number, index, side)) not in free
        )


def read_layout(root: TomlTable, floor_height_mm: int) -> Layout:
    """Floors, lifts and spurs of a site file; ``floor_height_mm`` is the pitch of every shaft."""
    layout = Layout()
    floors = root.table("floors", required=True)
    layout.pitch_mm = floors.integer("pitch_mm", 1000, 10_000, layout.pitch_mm)
    _read_alleys(layout, floors)
    layout.known = layout.known and "floors" not in root.wrong
    _read_without(layout, floors)
    layout.lifts = root.tables("lifts")
    _read_lifts(layout, floor_height_mm)
    _read_spurs(layout, root.tables("spurs"))
    return layout


def _read_alleys(layout: Layout, floors: TomlTable) -> None:
    count = floors.integer("count", 1, _MOST_FLOORS)
    positions = floors.integer("positions", 2, _MOST_POSITIONS)
    sides = _read_sides(floors, frozenset(Side))
    layout.known = not floors.wrong & {"count", "positions"}
    if "count" in floors.wrong:
        floors.pass_over(str.isdecimal)
    for number in range(FIRST_ALLEY, FIRST_ALLEY + count):
        length, own_sides = positions, sides
        if floors.has(str(number)):
            floor = floors.table(str(number))
            length = floor.integer("positions", 2, _MOST_POSITIONS, positions)
            own_sides = _read_sides(floor, sides)
            layout.known = layout.known and "positions" not in floor.wrong
        layout.tracks[number] = Track(number, TrackKind.ALLEY, length, layout.pitch_mm)
        layout.sides[number] = own_sides


def _read_sides(table: TomlTable, default: frozenset[Side]) -> frozenset[Side]:
    words = table.items("sides", 'a list such as ["near", "far"]')
    if words is None:
        return default
    sides = set()
    for number, word in enumerate(words):
        if not isinstance(word, str) or word not in SIDES:
            table.bad("sides", word, "not a side", 'write "near", "far" or both', item=number)
        else:
            sides.add(SIDES[word])
    return frozenset(sides)


def _read_without(layout: Layout, floors: TomlTable) -> None:
    """Positions without a place: ``p(1,3)N``, both sides ``p(1,3)``, on all floors ``p(*,3)``."""
    for number, text in enumerate(floors.items("without", 'a list of places such as ["p(1,3)N"]') or ()):
        found = _PLACES.fullmatch(text) if isinstance(text, str) else None
        if found is None:
            form = 'write places such as "p(1,3)N" (near side), "p(1,3)" (both sides) or "p(*,3)" (all floors)'
            floors.bad("without", text, "not a place", form, item=number)
        elif layout.known:
            gone = _matching(layout, *found.groups())
            if not gone:
                floors.bad("without", text, "no such place", _extent(layout), item=number)
            layout.without |= gone


def _matching(layout: Layout, floor: str, index: str, side: str) -> set[Station]:
    return {
        Station(alley.number, int(index), one)
        for alley in layout.alleys()
        if floor == "*" or alley.number == int(floor)
        for one in layout.sides[alley.number]
        if 1 <= int(index) <= alley.length and side in ("", "NF"[one])
    }


def _extent(layout: Layout) -> str:
    longest = max(alley.length for alley in layout.alleys())
    return f"floors here: 1 to {len(layout.alleys())}, positions 1 to {longest}"


def _read_lifts(layout: Layout, floor_height_mm: int) -> None:
    """Only the shafts; the machines in them are read with the others."""
    if len(layout.lifts) > FIRST_SPUR - FIRST_LIFT:
        layout.lifts[-1].bad(
            "name", None, f"{len(layout.lifts)} lifts", f"a site has at most {FIRST_SPUR - FIRST_LIFT}"
        )
        return
    for number, table in enumerate(layout.lifts, start=FIRST_LIFT):
        end = table.choice("end", ["left", "right"])
        floors = _read_served(layout, table)
        if len(floors) == 1 and layout.known and not table.wrong:
            name = "floors" if "floors" in table.values else "end"
            what = f"this lift would stop at floor {floors[0]} alone"
            table.bad(name, table.values[name], what, "a lift joins two floors or more")
        sills = tuple(Segment(floor, 1 if end == "left" else layout.tracks[floor].length) for floor in floors)
        shared = [sill for sill in sills if sill in layout.kept]
        if shared and "end" not in table.wrong:
            what = f"{layout.kept[shared[0]]} at {shared[0]} already"
            table.bad("end", end, what, "put one lift at each end of an alley")
        layout.kept |= dict.fromkeys(sills, f"the sill of {path_text(table.path)} is")
        layout.tracks[number] = Track(number, TrackKind.LIFT, len(sills), floor_height_mm, sills)


def _read_served(layout: Layout, table: TomlTable) -> list[int]:
    """Floors that a lift serves, rising without a gap: a shaft has one segment for each, equally far apart."""
    here = [alley.number for alley in layout.alleys()]
    written = table.items("floors", "a list of floors such as [1, 2, 3]")
    if written is None or not layout.known:
        return here
    for number, floor in enumerate(written):
        if type(floor) is not int or floor not in here:
            what = "no such floor" if type(floor) is int else f"is {type_name(floor)}"
            table.bad("floors", floor, what, f"floors here: 1 to {len(here)}", item=number)
    if "floors" in table.wrong:
        return here
    whole = list(range(min(written), max(written) + 1)) if written else []
    if not written or sorted(written) != whole:
        left_out = ", ".join(str(floor) for floor in whole if floor not in written)
        what = f"leaves out floor {left_out}" if left_out else "has a floor twice" if written else "no floor at all"
        table.bad("floors", written, f"{what}; a lift stops at every floor of its shaft", f"write {whole or here}")
        return here
    if written != whole:
        table.bad("floors", written, "not from the lowest to the highest", f"write {whole}")
        return here
    return list(written)


def _read_spurs(layout: Layout, tables: list[TomlTable]) -> None:
    if len(tables) > AFTER_SPURS - FIRST_SPUR:
        tables[-1].bad("at", None, f"{len(tables)} spurs", f"a site has at most {AFTER_SPURS - FIRST_SPUR}")
        return
    for number, table in enumerate(tables, start=FIRST_SPUR):
        side = table.choice("side", list(SIDES), "far")
        station = layout.take(table, layout.find(table, "at"), side)
        mouth = station.segment if station is not None else Segment(0, 0)
        if station is not None and mouth in layout.kept:
            table.bad("at", table.values["at"], f"{layout.kept[mouth]} there", "choose another position")
        layout.kept.setdefault(mouth, f"the mouth of {path_text(table.path)} is")
        layout.tracks[number] = Track(number, TrackKind.SPUR, 1, layout.pitch_mm, (mouth,))
