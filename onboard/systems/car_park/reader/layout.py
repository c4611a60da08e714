"""The ways of a car park as they are read: tracks, what stands beside them, where nobody may stand (rows P30, P31).

Floors 1 to n have an alley each by itself, with the floor's number; further alleys and the lobbies before lifts have
the numbers behind, in the order of the file. The model itself is ``onboard/ways/site.py``.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field

from onboard.config.reader import TomlTable, type_name
from onboard.config.toml_lines import path_text
from onboard.contract.codes import Side
from onboard.core.site import Segment, Station
from onboard.systems.car_park.reader.positions import ALLEY_NAME, ANY, BASE, Written, read_written
from onboard.ways.site import Track, TrackKind

SIDES = {"near": Side.NEAR, "far": Side.FAR}

#: Track numbers by kind, as on the wire.
FIRST_ALLEY, FIRST_LIFT, FIRST_SPUR, AFTER_SPURS = 1, 128, 192, 255
_FORM = 'a position such as "p(1,4)", which is floor 1, index 4'


def one_position(text: str) -> Written | None:
    """A text that means one position, without a side."""
    written = read_written(text)
    return written if written is not None and written.is_one and not written.side else None


@dataclass
class Layout:
    """What has been read so far.

    What is mistaken has a stand-in, as large as it can be, and what follows from it is not judged: ``known`` is False
    where the number of floors is, ``vague`` are the tracks whose length is, ``unsure`` the names that are (empty for an
    alley without a usable one), ``partly`` the names of alleys that are on other floors too, and ``shifted``
    the kinds of tracks behind floors' own whose numbers follow from something mistaken.
    ``named`` are the alleys by floor and name, ``level`` the floor of each track, ``lifts`` the tables of the lifts in
    the order of their tracks. ``taken`` says what stands at a station that is no place, ``kept`` why nobody may stand
    for long at a segment, ``floor_mm`` how high each floor lies above the lowest; ``low`` are the tables of floors that
    tell their own height. ``heading`` is in quarters of a turn from floors' own alleys, where links tell it. ``tables``
    are those of all tracks but floors' own alleys; of these, where a floor differs, ``floor_tables``, at 0
    what holds for all.
    """

    tracks: dict[int, Track] = field(default_factory=dict)
    named: dict[tuple[int, str], int] = field(default_factory=dict)
    level: dict[int, int] = field(default_factory=dict)
    sides: dict[int, frozenset[Side]] = field(default_factory=dict)
    taken: dict[Station, str] = field(default_factory=dict)
    kept: dict[Segment, str] = field(default_factory=dict)
    without: set[Station] = field(default_factory=set)
    lifts: list[TomlTable] = field(default_factory=list)
    floor_mm: dict[int, int] = field(default_factory=dict)
    low: dict[int, TomlTable] = field(default_factory=dict)
    heading: dict[int, int] = field(default_factory=dict)
    tables: dict[int, TomlTable] = field(default_factory=dict)
    pitch_mm: int = 2_400
    floor_tables: dict[int, TomlTable] = field(default_factory=dict)
    known: bool = True
    vague: set[int] = field(default_factory=set)
    unsure: set[str] = field(default_factory=set)
    partly: set[str] = field(default_factory=set)
    shifted: set[TrackKind] = field(default_factory=set)

    @property
    def floors(self) -> int:
        """How many floors there are, by their own alleys."""
        return sum(1 for _, name in self.named if name == BASE)

    def alleys(self) -> list[Track]:
        """The alleys that have names in the file, in the order in which they were read: no lobbies."""
        return [self.tracks[number] for number in self.named.values()]

    def add_alley(self, track: Track, floor: int, name: str, sides: frozenset[Side]) -> None:
        """An alley of a floor, with the sides on which it has places."""
        self.tracks[track.number] = track
        self.named[floor, name] = track.number
        self.level[track.number] = floor
        self.sides[track.number] = sides
        if name == BASE:
            self.heading[track.number] = 0

    def next_alley(self) -> int:
        """The lowest number that no alley has."""
        return 1 + max((number for number in self.tracks if number < FIRST_LIFT), default=0)

    def find(self, table: TomlTable, name: str, *, spurs: bool = False) -> Segment | None:
        """The segment named at a key; None, and a problem noted, where the site has no such alley or spur segment."""
        written = table.parsed(name, one_position, "a position", _FORM)
        return None if written is None else self.judged(table, name, written, spurs=spurs)

    def judged(
        self, table: TomlTable, name: str, written: Written, *, item: int | None = None, spurs: bool = False
    ) -> Segment | None:
        """The one segment that is meant at a key, or at one ``item`` of the list there; else None, and a problem."""
        value = table.values[name] if item is None else table.values[name][item]
        number, index = self._number(written), written.indices.first
        track = self.tracks.get(number) if number is not None else None
        if not self.can_judge(written) or (written.alley == BASE and self._is_shifted(written.floors.first)):
            return None
        if track is None or track.kind is TrackKind.LIFT or (track.kind is TrackKind.SPUR and not spurs):
            table.bad(name, value, "no such segment", self._known_alleys(written), item=item)
            return None
        if not 1 <= index <= track.length:
            if track.number not in self.vague:
                remedy = f"{self.words(track.number)} has 1 to {track.length}"
                table.bad(name, value, "no such segment", remedy, item=item)
            return None
        return Segment(track.number, index)

    def can_judge(self, written: Written) -> bool:
        """Whether what is meant is known: by no name of an alley, and on no floor, that is mistaken."""
        here = [name for floor, name in self.named if floor in written.floors]
        if written.alley in (BASE, ANY):
            return self.known or bool(here)
        is_named = any(name == written.alley for _, name in self.named)
        return (
            written.alley not in self.unsure
            and (is_named or "" not in self.unsure)
            and (written.alley in here or (self.known and written.alley not in self.partly))
        )

    def _is_shifted(self, number: int) -> bool:
        kind = TrackKind.SPUR if number >= FIRST_SPUR else TrackKind.ALLEY
        return number > self.floors and kind in self.shifted

    def _number(self, written: Written) -> int | None:
        """A floor's own alley by the floor's number; spurs and lobbies by their track's."""
        floor = written.floors.first
        return floor if written.alley == BASE else self.named.get((floor, written.alley))

    def _known_alleys(self, written: Written) -> str:
        floor = written.floors.first
        names = [name for at, name in self.named if at == floor and ALLEY_NAME.fullmatch(name)]
        if written.alley != BASE and 1 <= floor <= self.floors:
            return f"alleys of floor {floor}: its own{''.join(f', {name}' for name in names)}"
        return f"floors here: 1 to {self.floors}"

    def words(self, number: int) -> str:
        """A track in words, with its floor."""
        track, floor = self.tracks[number], f"floor {self.level.get(number, number)}"
        if track.kind is not TrackKind.ALLEY:
            return f"{track.kind.value} {number}"
        return floor if (self.level[number], BASE, number) in self._named() else f"{self.alley_name(number)} of {floor}"

    def alley_name(self, number: int) -> str:
        """A track in words, alike for all floors."""
        track = self.tracks[number]
        if track.kind is not TrackKind.ALLEY:
            return f"{track.kind.value} {number}"
        name = next((name for _, name, one in self._named() if one == number), None)
        if name is not None and ALLEY_NAME.fullmatch(name) is None:
            return name or "the floor's own alley"
        return "a lobby" if name is None else f"alley {name}"

    def _named(self) -> list[tuple[int, str, int]]:
        return [(floor, name, number) for (floor, name), number in self.named.items()]

    def meant(self, written: Written) -> list[Segment]:
        """All alley segments that are meant, by the order of the alleys."""
        return [
            Segment(number, index)
            for (floor, name), number in self.named.items()
            if floor in written.floors and written.alley in (name, ANY)
            for index in range(1, self.tracks[number].length + 1)
            if index in written.indices
        ]

    def stations(self, written: Written) -> set[Station]:
        """All stations that are meant, on sides that have places."""
        return {
            Station(*segment, side)
            for segment in self.meant(written)
            for side in self.sides[segment.track]
            if written.side in ("", "NF"[side])
        }

    def take(self, table: TomlTable, front: Segment | None, side: str, *, name: str = "at") -> Station | None:
        """Put something other than a place beside a segment, unless something else is there."""
        if front is None:
            return None
        station = Station(*front, SIDES[side])
        if station in self.taken:
            what_is_there = f"{self.taken[station]} is there already, on the {side} side"
            table.bad(name, table.values[name], what_is_there, "choose another side or position")
            return None
        self.taken[station] = path_text(table.path)
        return station

    def places(self) -> tuple[Station, ...]:
        """Every station beside an alley that is not left out and not taken, by alley, side and index."""
        free = self.taken.keys() | self.without
        return tuple(
            station
            for alley in self.alleys()
            for side in Side
            if side in self.sides[alley.number]
            for index in range(1, alley.length + 1)
            if (station := Station(alley.number, index, side)) not in free
        )

    def extent(self) -> str:
        """What floors and positions there are, in words."""
        floors = f"floors here: 1 to {self.floors}"
        longest = max((alley.length for alley in self.alleys() if alley.number not in self.vague), default=0)
        return f"{floors}, positions 1 to {longest}" if longest else floors


def read_floor_list(layout: Layout, table: TomlTable) -> list[int]:
    """Floors at the key ``floors``, rising, each once; all where it is missing, those that are right where it is not.

    Empty only where nothing can be made of a mistaken list.
    """
    here = list(range(1, layout.floors + 1))
    written = table.items("floors", "a list of floors such as [1, 2, 3]")
    if written is None:
        return [] if "floors" in table.wrong else here
    for number, floor in enumerate(written):
        if type(floor) is not int or (layout.known and floor not in here):
            what = "no such floor" if type(floor) is int else f"is {type_name(floor)}"
            table.bad("floors", floor, what, f"floors here: 1 to {len(here)}", item=number)
    right = sorted({floor for floor in here if floor in written})
    if "floors" not in table.wrong:
        if not written:
            table.bad("floors", written, "no floor at all", f"write such as {here}")
        elif written != sorted(set(written)):
            what = "has a floor twice" if len(set(written)) < len(written) else "not from the lowest to the highest"
            table.bad("floors", written, what, f"write {sorted(set(written))}")
    return right


def in_order(tracks: Iterable[Track]) -> dict[int, Track]:
    """Tracks by their numbers, the lowest first: alleys and lobbies, then lifts, then spurs."""
    return {track.number: track for track in sorted(tracks, key=lambda one: one.number)}
