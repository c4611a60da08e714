"""How alleys are joined at their ends: the mouths beside which they begin and end, at right angles (row P31)."""

from dataclasses import dataclass, field, replace

from onboard.config.reader import TomlTable
from onboard.config.toml_lines import path_text
from onboard.contract.codes import Side
from onboard.core.site import Segment
from onboard.systems.car_park.reader.layout import SIDES, Layout
from onboard.systems.car_park.reader.positions import Written

#: The keys of an alley's two ends: position 1, and the last.
ENDS = ("from", "to")


@dataclass(frozen=True)
class Joined:
    """An alley on one floor, and what its ends are written to be beside, by their keys."""

    table: TomlTable
    number: int
    side: str
    ends: dict[str, Written | None]


@dataclass
class Joints:
    """All named alleys of a site file, and their ``mouths`` by track and end.

    ``heading`` is in quarters of a turn from that of floors' own alleys; ``alone`` are the alleys that hang together
    with none of these by their ends, but by a lift, and ``adrift`` those that hang together by a mistaken one.
    """

    layout: Layout
    joined: list[Joined]
    mouths: dict[tuple[int, str], Segment | None] = field(default_factory=dict)
    heading: dict[int, int] = field(default_factory=dict)
    alone: set[int] = field(default_factory=set)
    adrift: set[int] = field(default_factory=set)

    def join(self) -> None:
        """Tell the tracks their mouths, the layout what is no place for them; a mistake once, not on each floor."""
        tracks = self.layout.tracks
        for one in self.joined:
            low, high = (self._find_mouth(one, end) for end in ENDS)
            if low is not None or high is not None:
                joins = () if low is None else (low,)
                tracks[one.number] = replace(tracks[one.number], joins=joins, high=high, side=SIDES[one.side])
        self._find_headings()
        for one in self.joined:
            for end in ENDS:
                mouth = self.mouths[one.number, end]
                # How an alley lies follows from its first mouth: of one that is mistaken the other is not judged.
                is_sure = end == "from" or self.adrift.isdisjoint((one.number, *(mouth or ())[:1]))
                if mouth is not None and is_sure and end not in one.table.wrong:
                    self._take_mouth(one, end, mouth)

    def _find_mouth(self, one: Joined, end: str) -> Segment | None:
        mouth = self.mouths[one.number, end] = self._judged(one, end)
        return mouth

    def _judged(self, one: Joined, end: str) -> Segment | None:
        written = one.ends[end]
        if written is None or end in one.table.wrong:
            return None
        floor, value = self.layout.level[one.number], one.table.values[end]
        if floor not in written.floors:
            if self.layout.known:
                one.table.bad(end, value, f"not on floor {floor}", 'write "p(*,...)" for the same floor')
            return None
        mouth = self.layout.judged(one.table, end, written.on(floor))
        if mouth is not None and mouth.track == one.number:
            one.table.bad(end, value, "beside itself", "name another alley's position")
            return None
        return mouth

    def _find_headings(self) -> None:
        self.heading = dict(self.layout.heading)
        waiting = list(self.joined)
        while waiting:
            later = [one for one in waiting if not self._turn(one)]
            if len(later) == len(waiting):
                # Joined to others by a lift only, or by a mistaken end: a direction of its own.
                first = next((one for one in later if not any(self._mouths_of(one))), later[0])
                later.remove(first)
                self.heading[first.number] = 0
                self.alone.add(first.number)
            waiting = later
        told = {number: quarters for number, quarters in self.heading.items() if number not in self.alone | self.adrift}
        self.layout.heading = told

    def _turn(self, one: Joined) -> bool:
        """Whether the heading of an alley follows from those known: it goes off from its first mouth to its side."""
        low, high = self._mouths_of(one)
        mouth = low or high
        end = "from" if one.ends["from"] is not None else "to"
        if (one.ends[end] is not None and not self.mouths[one.number, end]) or (mouth and mouth.track in self.adrift):
            self.adrift.add(one.number)
        if mouth is not None and mouth.track in self.heading:
            away = self.heading[mouth.track] + (1 if SIDES[one.side] is Side.FAR else -1)
            self.heading[one.number] = (away if low is not None else away + 2) % 4
            if mouth.track in self.alone:
                self.alone.add(one.number)
        return one.number in self.heading

    def _mouths_of(self, one: Joined) -> tuple[Segment | None, Segment | None]:
        return self.mouths[one.number, "from"], self.mouths[one.number, "to"]

    def _take_mouth(self, one: Joined, end: str, mouth: Segment) -> None:
        """The end of an alley takes the stead of a place beside its mouth."""
        away = self.heading[one.number] + (0 if end == "from" else 2)
        quarters = (away - self.heading[mouth.track]) % 4
        if quarters % 2 == 0:
            what = f"would go on along {self.layout.words(mouth.track)}, not across it"
            one.table.bad(end, one.table.values[end], what, "join alleys at right angles")
            return
        self.layout.take(one.table, mouth, "far" if quarters == 1 else "near", name=end)
        self.layout.kept.setdefault(mouth, f"the mouth of {path_text(one.table.path)} is")
