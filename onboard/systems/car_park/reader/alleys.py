"""Floors, their alleys, what these are joined by at their ends, and spurs (rows P30, P31)."""

from onboard.config.reader import TomlTable
from onboard.config.toml_lines import path_text
from onboard.contract.codes import Side
from onboard.core.site import Segment, Station
from onboard.systems.car_park.reader.joints import ENDS, Joined, Joints
from onboard.systems.car_park.reader.layout import (
    AFTER_SPURS,
    FIRST_ALLEY,
    FIRST_LIFT,
    FIRST_SPUR,
    SIDES,
    Layout,
    in_order,
    read_floor_list,
)
from onboard.systems.car_park.reader.positions import ALLEY_NAME, ANY, BASE, Written, read_written
from onboard.systems.car_park.reader.shafts import read_lifts
from onboard.ways.site import Track, TrackKind

_MOST_ALLEYS = FIRST_LIFT - FIRST_ALLEY
_MOST_POSITIONS = 127
#: How a one-way alley is driven, by the word for it.
_ONE_WAY = {"both": 0, "rising": 1, "falling": -1}
_JOINED = 'a position such as "p(*,4)", beside which the alley ends'


def read_layout(root: TomlTable, lifts: list[TomlTable], floor_height_mm: int) -> Layout:
    """Floors, alleys, ``lifts`` and spurs of a site file; ``floor_height_mm`` is the usual one."""
    layout = Layout(lifts=lifts)
    floors = root.table("floors", required=True)
    layout.pitch_mm = floors.integer("pitch_mm", 1000, 10_000, layout.pitch_mm)
    _read_floors(layout, floors, floor_height_mm)
    tables = root.tables("alleys")
    joined = [one for table in tables for one in _read_alley(layout, table)]
    Joints(layout, joined).join()
    _read_without(layout, floors)
    read_lifts(layout, floor_height_mm)
    _read_spurs(layout, root.tables("spurs"))
    layout.tracks = in_order(layout.tracks.values())
    return layout


def _read_floors(layout: Layout, floors: TomlTable, floor_height_mm: int) -> None:
    """The alley that each floor has by itself."""
    layout.floor_tables[0] = floors
    count = floors.integer("count", 1, _MOST_ALLEYS)
    positions = floors.integer("positions", 2, _MOST_POSITIONS)
    sides = _read_sides(floors, frozenset(Side))
    one_way = _read_one_way(floors, 0)
    if "count" in floors.wrong:
        layout.known = False
        count = _floors_named(floors.document.values)
        floors.pass_over(str.isdecimal)
    above_mm = 0
    for number in range(FIRST_ALLEY, FIRST_ALLEY + count):
        length, own_sides, own_way, height_mm = positions, sides, one_way, floor_height_mm
        is_vague = "positions" in floors.wrong
        if floors.has(str(number)):
            floor = layout.floor_tables[number] = floors.table(str(number))
            length = floor.integer("positions", 2, _MOST_POSITIONS, positions)
            own_sides, own_way = _read_sides(floor, sides), _read_one_way(floor, one_way)
            height_mm = floor.integer("height_mm", 1000, 10_000, floor_height_mm)
            is_vague = "positions" in floor.wrong if floor.has("positions") else is_vague
            if "height_mm" in floor.values and "height_mm" not in floor.wrong:
                layout.low[number] = floor
        if is_vague or str(number) in floors.wrong:
            layout.vague.add(number)
            length = _MOST_POSITIONS
        track = Track(number, TrackKind.ALLEY, length, layout.pitch_mm, one_way=own_way)
        layout.add_alley(track, number, BASE, own_sides)
        layout.floor_mm[number] = above_mm
        above_mm += height_mm


def _floors_named(values: object) -> int:
    """The highest floor that any position in a file names: so many where their number is mistaken."""
    if isinstance(values, str):
        written = read_written(values)
        return written.floors.first if written is not None and written.floors.first < FIRST_LIFT else 1
    below = values.values() if isinstance(values, dict) else values if isinstance(values, list) else ()
    return max((1, *(_floors_named(one) for one in below)))


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


def _read_one_way(table: TomlTable, default: int) -> int:
    return _ONE_WAY[table.choice("one_way", list(_ONE_WAY), "both")] if table.has("one_way") else default


def _read_alley(layout: Layout, table: TomlTable) -> list[Joined]:
    """An alley, on each of its floors one; where its name is mistaken, by one that nothing can mean."""
    name = table.text("name")
    if name and ALLEY_NAME.fullmatch(name) is None:
        table.bad("name", name, "not usable in a position", "write a letter, then up to 7 letters, digits or _")
        layout.unsure.add("")
    elif name and any(name == other for _, other in layout.named):
        table.bad("name", name, "used twice", "give each alley a name of its own")
        layout.unsure.add(name)
    elif not name:
        layout.unsure.add("")
    name = path_text(table.path) if "name" in table.wrong else name
    floors = read_floor_list(layout, table)
    if "floors" in table.wrong:
        layout.partly.add(name)
        layout.shifted.add(TrackKind.ALLEY)
    positions = table.integer("positions", 1, _MOST_POSITIONS)
    pitch_mm = table.integer("pitch_mm", 1000, 10_000, layout.pitch_mm)
    sides, one_way = _read_sides(table, frozenset(Side)), _read_one_way(table, 0)
    side = table.choice("side", list(SIDES), "far")
    ends = {end: table.parsed(end, _beside, "a position", _JOINED) if table.has(end) else None for end in ENDS}
    found = []
    for floor in floors:
        number = layout.next_alley()
        if number >= FIRST_LIFT:
            table.bad("floors", table.values.get("floors"), f"alley {number}", f"a site has at most {_MOST_ALLEYS}")
            break
        if "positions" in table.wrong:
            layout.vague.add(number)
            positions = _MOST_POSITIONS
        track = Track(number, TrackKind.ALLEY, positions, pitch_mm, level=floor, one_way=one_way)
        layout.add_alley(track, floor, name, sides)
        layout.tables[number] = table
        found.append(Joined(table, number, side, ends))
    return found


def _beside(text: str) -> Written | None:
    """One index of one alley, on one floor or on all."""
    written = read_written(text)
    fits = written is not None and written.indices.is_one and written.alley != ANY and not written.side
    return written if fits else None


def _read_without(layout: Layout, floors: TomlTable) -> None:
    """Positions without a place: ``p(1,3)N``, both sides ``p(1,3)``, on all floors ``p(*,3)``, a range ``p(1,3-5)``."""
    for number, text in enumerate(floors.items("without", 'a list of places such as ["p(1,3)N"]') or ()):
        written = read_written(text)
        if written is None:
            form = 'write places such as "p(1,3)N" (near side), "p(1,3)" (both sides) or "p(*,3)" (all floors)'
            floors.bad("without", text, "not a place", form, item=number)
        elif layout.can_judge(written):
            gone = layout.stations(written)
            if not gone:
                floors.bad("without", text, "no such place", layout.extent(), item=number)
            layout.without |= gone


def _read_spurs(layout: Layout, tables: list[TomlTable]) -> None:
    number = FIRST_SPUR
    for table in tables:
        side = table.choice("side", list(SIDES), "far")
        length = table.integer("length", 1, _MOST_POSITIONS, 1)
        if "length" in table.wrong:
            # Whatever stands in it is not judged by it.
            length = _MOST_POSITIONS
        for station in _mouths(layout, table, side):
            if number >= AFTER_SPURS:
                what = f"{number - FIRST_SPUR + 1} spurs"
                table.bad("at", None, what, f"a site has at most {AFTER_SPURS - FIRST_SPUR}")
                return
            mouth = station.segment if station is not None else Segment(0, 0)
            if station is not None and mouth in layout.kept:
                table.bad("at", table.values["at"], f"{layout.kept[mouth]} there", "choose another position")
            layout.kept.setdefault(mouth, f"the mouth of {path_text(table.path)} is")
            layout.tracks[number] = Track(number, TrackKind.SPUR, length, layout.pitch_mm, (mouth,), side=SIDES[side])
            layout.level[number] = layout.level.get(mouth.track, 0)
            layout.tables[number] = table
            number += 1


def _mouths(layout: Layout, table: TomlTable, side: str) -> list[Station | None]:
    """Where a spur goes off: one, or one on each floor of ``p(*,4)``; None for each that is mistaken."""
    written = table.parsed("at", _beside, "a position", 'a position such as "p(1,4)", which is floor 1, index 4')
    if written is None or not (written.is_one or layout.known):
        layout.shifted.add(TrackKind.SPUR)
    if written is None:
        return [None]
    if written.is_one:
        return [layout.take(table, layout.judged(table, "at", written), side)]
    found = layout.meant(written) if layout.can_judge(written) else []
    if not found:
        layout.shifted.add(TrackKind.SPUR)
    if layout.can_judge(written) and not found:
        table.bad("at", table.values["at"], "no such segment", layout.extent())
    return [layout.take(table, segment, side) if "at" not in table.wrong else None for segment in found]
