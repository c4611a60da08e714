"""A building whose floors are more than one alley, in a terminal: each floor from above, a slot a few columns wide."""

from rich.text import Text

from bus_sim.systems.car_park.car_labels import bay_letters, car_labels
from bus_sim.systems.car_park.slots import AHEAD, AHEAD_STYLE, ahead, boxed, named, style, text_columns
from onboard.contract.codes import KindCode, Side
from onboard.core.site import Segment, Station
from onboard.systems.car_park.outlines import Outlines
from onboard.systems.car_park.site import CarPark, car_park
from onboard.trace.view import SiteView
from onboard.ways.kept import Kept
from onboard.ways.lifts import lift_at, sill
from onboard.ways.site import TrackKind, WaySite

#: Columns before a floor: its number.
_LABEL = 5
#: Columns between two floors beside each other.
_BETWEEN = 2
#: How a one-way alley's slots are marked, by where its index grows or falls to.
_TIPS = {(1, 0): ">", (-1, 0): "<", (0, 1): "^", (0, -1): "v"}
#: Columns that one slot takes, widest first; the widest that fits is used.
_CELLS = (5, 3, 2, 1)

Spot = tuple[int, int]

_outlines: Kept[WaySite, Outlines] = Kept(lambda site: Outlines(car_park(site)))


def draw_plans(site: CarPark, view: SiteView, width: int, room: int | None = None) -> list[Text]:
    """All floors, the highest first, an empty line between two: in ``room`` lines if they have room there in any way.

    Slots are as wide as they can be; rather than leave floors out they are narrower, and floors beside each other. Of
    what has no room even so the highest lines are left out, and the floor that is cut has its number where it begins.
    """
    outlines = _outlines.of(site)
    plans = [_FloorPicture(outlines, view, level) for level in outlines.levels]
    slots = max(plan.columns for plan in plans)
    cells = [one for one in _CELLS if _LABEL + slots * one <= width] or [_CELLS[-1]]
    rows: list[tuple[Text, list[int]]] = []
    for cell in cells:
        many = max(1, width // (_LABEL + slots * cell + _BETWEEN)) if room is not None else 1
        rows = _beside(plans, cell, 1)
        rows = rows if room is None or len(rows) <= room else _beside(plans, cell, many)
        if room is None or len(rows) <= room:
            return [row for row, _ in rows]
    shown = rows[len(rows) - max(1, room or 1) :]
    first, levels = shown[0]
    if first.plain[:_LABEL].strip() == "" and levels:
        first = Text.assemble(f"{levels[0]:>2}".ljust(_LABEL), first[_LABEL:], no_wrap=True, overflow="crop")
    return [first, *[row for row, _ in shown[1:]]]


def _beside(plans: list["_FloorPicture"], cell: int, many: int) -> list[tuple[Text, list[int]]]:
    """Lines with so many floors beside each other, each with the numbers of its floors; empty ones between."""
    rows: list[tuple[Text, list[int]]] = []
    for begin in range(0, len(plans), many):
        group = plans[begin : begin + many]
        lines = [plan.lines(cell) for plan in group]
        rows += [(Text(""), [])] if rows else []
        for number in range(max(len(one) for one in lines)):
            line = Text("", no_wrap=True, overflow="crop")
            for column, one in enumerate(lines):
                part = one[number] if number < len(one) else Text(" " * len(one[0].plain))
                line.append_text(Text(" " * _BETWEEN) + part if column else part)
            rows.append((line, [plan.level for plan in group]))
    return rows


class _FloorPicture:
    """What is at which spot of a floor, by column and row from the lower left; a slot is one of each."""

    def __init__(self, outlines: Outlines, view: SiteView, level: int) -> None:
        self.outlines, self.site, self.view, self.level = outlines, outlines.site, view, level
        box = outlines.level(level)
        # A shaft is in one column on all floors.
        boxes = [outlines.level(one) for one in outlines.levels]
        self.left, self.low = min(one.left for one in boxes), box.low
        self.columns = round((max(one.right for one in boxes) - self.left) / outlines.slot_mm)
        self.rows = round((box.high - box.low) / outlines.slot_mm)

    def lines(self, cell: int) -> list[Text]:
        """The floor in ``cell`` columns a slot, its number before the first line; empty rows are left out."""
        found = {**self._places(cell), **self._ways(cell), **self._platforms(cell), **self._machines(cell)}
        rows = sorted({row for _, row in found}, reverse=True)
        lines = []
        for number, row in enumerate(rows):
            line = Text(
                f"{self.level:>2}".ljust(_LABEL) if number == 0 else " " * _LABEL, no_wrap=True, overflow="crop"
            )
            for column in range(self.columns + 1):
                words, how = found.get((column, row), (" " * cell, ""))
                line.append(words, style=how)
            lines.append(line)
        return lines

    def _spot(self, x_mm: float, y_mm: float) -> Spot:
        slot_mm = self.outlines.slot_mm
        return round((x_mm - self.left) / slot_mm - 0.5), round((y_mm - self.low) / slot_mm - 0.5)

    def _at(self, segment: Segment) -> Spot:
        box = self.outlines.slot(segment)
        return self._spot((box.left + box.right) / 2, (box.low + box.high) / 2)

    def _ways(self, cell: int) -> dict[Spot, tuple[str, str]]:
        found = {}
        planned = ahead(self.view)
        for number in self.outlines.tracks_on(self.level):
            track, line = self.site.tracks[number], self.outlines.plan.lines[number]
            mark = ":" if track.kind is TrackKind.SPUR else "."
            if track.one_way:
                mark = _TIPS[line.dx * track.one_way, line.dy * track.one_way]
            for index in range(1, self.site.tracks[number].length + 1):
                slot = Segment(number, index)
                words = (f"{AHEAD:^{cell}}", AHEAD_STYLE) if slot in planned else (f"{mark:^{cell}}", "dim")
                found[self._at(slot)] = words
        return found

    def _places(self, cell: int) -> dict[Spot, tuple[str, str]]:
        """Places and compartments, each in the spot next to its slot."""
        taken = self.view.history.loads.standing()
        labels = car_labels(taken.values(), bay_letters(self.site.compartments), text_columns(cell))
        found = {}
        bays = set(self.site.compartments.values())
        for station in (*self.site.places, *bays):
            if self.site.level(station.track) == self.level:
                car = taken.get(station.number)
                empty = "I/O" if station in bays else ""
                words = boxed(labels[car] if car else empty, "[]" if station in bays else "||", cell)
                how = "bold magenta" if station in bays else "cyan" if car else "dim"
                found[self._beside(station)] = words, how
        return found

    def _beside(self, station: Station) -> Spot:
        column, row = self._at(station.segment)
        line = self.outlines.plan.lines[station.track]
        across = 1 if station.side is Side.FAR else -1
        return column - line.dy * across, row + line.dx * across

    def _platforms(self, cell: int) -> dict[Spot, tuple[str, str]]:
        found = {}
        for lift in self.outlines.lifts_on(self.level):
            at = self.view.history.places.by_node[self.site.stewards[lift]].segment.index
            is_here = self.site.level(sill(self.site, lift, at).track) == self.level
            box = self.outlines.platform(lift)
            spot = self._spot((box.left + box.right) / 2, (box.low + box.high) / 2)
            found[spot] = (boxed("=", "[]", cell), "bold yellow") if is_here else (f"{':':^{cell}}", "dim")
        return found

    def _machines(self, cell: int) -> dict[Spot, tuple[str, str]]:
        found = {}
        for node, place in self.view.history.places.by_node.items():
            machine = self.site.machines.get(node)
            if machine is not None and machine.kind is KindCode.ROBOT and self._is_here(place.segment):
                found[self._at(place.segment)] = named(self.view, node, cell), style(self.view, [node])
        return found

    def _is_here(self, segment: Segment) -> bool:
        """On this floor; aboard a lift where its platform is."""
        lift = lift_at(self.site, segment)
        if lift is None:
            return self.site.level(segment.track) == self.level
        at = self.view.history.places.by_node[self.site.stewards[lift]].segment.index
        return self.site.level(sill(self.site, lift, at).track) == self.level
