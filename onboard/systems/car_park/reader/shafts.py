"""The shafts of a site file: at which floors a lift stops, and by which doors (rows P30, P31).

A door is at the end of an alley, or in a lobby: one segment beside an alley, in the stead of a place, where a robot
turns towards the lift. The machines in the shafts are read with the others.
"""

from typing import NamedTuple

from onboard.config.reader import TomlTable
from onboard.config.toml_lines import path_text
from onboard.core.site import Segment
from onboard.systems.car_park.reader.layout import FIRST_LIFT, FIRST_SPUR, SIDES, Layout, read_floor_list
from onboard.systems.car_park.reader.positions import ANY, BASE, Written, read_written
from onboard.ways.site import Track, TrackKind

_MOST_LIFTS = FIRST_SPUR - FIRST_LIFT
_DOOR = 'doors such as "p(*,1)" (at the end of an alley) or "p(*,7)F" (beside it)'
_FEWEST_STOPS, _MOST_DOORS = 2, 2
_SIDE_WORDS = {"N": "near", "F": "far"}


class _Door(NamedTuple):
    """A door as it is written: ``item`` of the list ``doors``, or of the key ``end`` where it is None."""

    item: int | None
    written: Written


def read_lifts(layout: Layout, floor_height_mm: int) -> None:
    """The tracks of all lifts, and the lobbies before them; ``floor_height_mm`` is the usual pitch of a shaft."""
    if len(layout.lifts) > _MOST_LIFTS:
        layout.lifts[-1].bad("name", None, f"{len(layout.lifts)} lifts", f"a site has at most {_MOST_LIFTS}")
        return
    for number, table in enumerate(layout.lifts, start=FIRST_LIFT):
        sills = _read_end(layout, table) if "doors" not in table.values else _read_doors(layout, table)
        heights = [layout.floor_mm[layout.level[sill.track]] for sill in sills if sill.track in layout.level]
        own = tuple(height - heights[0] for height in heights)
        usual = own == tuple(floor_height_mm * stop for stop in range(len(own)))
        layout.tracks[number] = Track(
            number, TrackKind.LIFT, len(sills), floor_height_mm, tuple(sills), heights_mm=() if usual else own
        )
        layout.kept |= dict.fromkeys(sills, f"the sill of {path_text(table.path)} is")


def _read_end(layout: Layout, table: TomlTable) -> list[Segment]:
    """Sills at the left or the right end of the alleys that floors have by themselves."""
    end = table.choice("end", ["left", "right"])
    floors = read_floor_list(layout, table) or list(range(1, layout.floors + 1))
    if len(floors) == 1 and layout.known and not table.wrong & {"end", "floors"}:
        _refuse_one_stop(table, "floors" if "floors" in table.values else "end", f"floor {floors[0]} alone")
    lengths = {floor: layout.tracks[layout.named[floor, BASE]].length for floor in floors}
    sills = [Segment(floor, 1 if end == "left" else lengths[floor]) for floor in floors]
    if "end" not in table.wrong:
        taken = next((sill for sill in sills if _is_taken(layout, sill)), None)
        if taken is not None:
            what = f"{_taken_by(layout, taken)} already"
            table.bad("end", end, what, "put one lift at each end of an alley")
    return sills


def _refuse_one_stop(table: TomlTable, name: str, where: str) -> None:
    table.bad(name, table.values[name], f"this lift would stop at {where}", "a lift joins two floors or more")


def _read_doors(layout: Layout, table: TomlTable) -> list[Segment]:
    """Sills behind written doors, floor by floor, in the order of the list on each."""
    if table.has("end"):
        table.bad("end", table.values["end"], "beside doors", "write one of both")
    floors = read_floor_list(layout, table)
    doors = []
    for item, text in enumerate(table.items("doors", f"a list of {_DOOR}") or ()):
        written = read_written(text)
        if written is None or not written.indices.is_one or written.alley == ANY:
            table.bad("doors", text, "not a door", f"write {_DOOR}", item=item)
        else:
            doors.append(_Door(item, written))
    # Judged also where no lobby can be made, because of another mistake.
    is_beside = any(door.written.side for door in doors)
    lobby_mm = table.integer("lobby_mm", 1000, 10_000, layout.pitch_mm) if is_beside else 0
    sure = [door for door in doors if layout.can_judge(door.written)]
    is_whole = len(sure) == len(doors) and layout.known and not table.wrong & {"doors", "floors"}
    sills: list[Segment] = []
    wrong_doors = "doors" in table.wrong
    for floor in floors:
        # What is mistaken on one floor is not told again for each.
        if wrong_doors is ("doors" in table.wrong):
            sills += _sills_on(layout, table, sure, floor, lobby_mm)
    if is_whole and "doors" not in table.wrong:
        _check_stops(layout, table, sills)
    if not is_whole or "doors" in table.wrong:
        layout.shifted.add(TrackKind.ALLEY)
    return sills if is_whole and not table.wrong & {"doors", "end"} else []


def _sills_on(layout: Layout, table: TomlTable, doors: list[_Door], floor: int, lobby_mm: int) -> list[Segment]:
    here = [door for door in doors if floor in door.written.floors]
    if len(here) > _MOST_DOORS:
        table.bad("doors", table.values["doors"], f"{len(here)} doors on floor {floor}", "a lift has one or two")
        return []
    return [sill for door in here if (sill := _sill(layout, table, door, floor, lobby_mm)) is not None]


def _check_stops(layout: Layout, table: TomlTable, sills: list[Segment]) -> None:
    written = table.values["doors"]
    stops = {layout.level[sill.track] for sill in sills}
    if len(stops) < _FEWEST_STOPS:
        _refuse_one_stop(table, "doors", f"floor {min(stops)} alone" if stops else "no floor")
    elif len({sill.track for sill in sills}) < len(sills):
        table.bad("doors", written, "two doors on one alley", "a lift stops at an alley once")
    elif len({layout.heading[sill.track] % 2 for sill in sills if sill.track in layout.heading}) > 1:
        what = "the alleys there lie across each other, and a lift does not turn"
        table.bad("doors", written, what, "choose doors of alleys in one direction")


def _sill(layout: Layout, table: TomlTable, door: _Door, floor: int, lobby_mm: int) -> Segment | None:
    """The segment before the lift: an alley's free end, or the lobby beside it."""
    written = door.written.on(floor)
    before = layout.judged(table, "doors", written, item=door.item)
    if before is None:
        return None
    if written.side:
        return _lobby(layout, table, before, _SIDE_WORDS[written.side], lobby_mm)
    track = layout.tracks[before.track]
    if track.number in layout.vague and before.index > 1:
        return before
    value = table.values["doors"][door.item]
    if before.index not in (1, track.length):
        what = f"in the middle of {layout.words(track.number)}"
        table.bad(
            "doors", value, what, "write N or F behind it for a lift beside the alley, or end it there", item=door.item
        )
    elif _is_joined(track, before.index):
        what = f"{layout.words(track.number)} goes on there"
        table.bad("doors", value, what, "choose the end of an alley that is joined to no other", item=door.item)
    elif _is_taken(layout, before):
        what = f"{_taken_by(layout, before)} already"
        table.bad("doors", value, what, "put one lift at each end of an alley", item=door.item)
    else:
        return before
    return None


def _is_joined(track: Track, index: int) -> bool:
    """Whether no end of the track at an index is free for a platform."""
    low_free = index == 1 and not track.joins
    return not low_free and not (index == track.length and track.high is None)


def _is_taken(layout: Layout, sill: Segment) -> bool:
    return any(track.kind is TrackKind.LIFT and sill in track.joins for track in layout.tracks.values())


def _taken_by(layout: Layout, sill: Segment) -> str:
    return f"{layout.kept[sill]} at {sill}"


def _lobby(layout: Layout, table: TomlTable, mouth: Segment, side: str, lobby_mm: int) -> Segment | None:
    """One segment that goes off an alley, with the lift's door at its far end."""
    station = layout.take(table, mouth, side, name="doors")
    number = layout.next_alley()
    if station is None:
        return None
    if number >= FIRST_LIFT:
        table.bad("doors", table.values["doors"], f"alley or lobby {number}", f"a site has at most {FIRST_LIFT - 1}")
        return None
    floor = layout.level[mouth.track]
    layout.tracks[number] = Track(number, TrackKind.ALLEY, 1, lobby_mm, (mouth,), side=SIDES[side], level=floor)
    layout.level[number] = floor
    layout.tables[number] = table
    layout.sides[number] = frozenset()
    if mouth.track in layout.heading:
        layout.heading[number] = layout.heading[mouth.track] + 1
    layout.kept.setdefault(mouth, f"the mouth of {path_text(table.path)} is")
    return Segment(number, 1)
