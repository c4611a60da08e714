"""A building whose floors are more than one alley, in a terminal: each floor from above, a slot a few columns wide."""

from rich.text import Text

from bus_sim.systems.car_park.car_labels import bay_letters, car_labels
from bus_sim.systems.car_park.slots import boxed, named, style, text_columns
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
#: Columns that one slot takes, widest first; the widest that fits is used.
_CELLS = (5, 3, 2, 1)

Spot = tuple[int, int]

_outlines: Kept[WaySite, Outlines] = Kept(lambda site: Outlines(car_park(site)))


def draw_plans(site: CarPark, view: SiteView, width: int) -> list[Text]:
    """All floors, the highest first, an empty line between two."""
    outlines = _outlines.of(site)
    plans = [_FloorPicture(outlines, view, level) for level in outlines.levels]
    wide = max(plan.columns for plan in plans)
    cell = next((one for one in _CELLS if _LABEL + wide * one <= width), _CELLS[-1])
    rows: list[Text] = []
    for plan in plans:
        rows += [*([Text("")] if rows else []), *plan.lines(cell)]
    return rows


class _FloorPicture:
    """What is at which spot of a floor, by column and row from the lower left; a slot is one of each."""

    def __init__(self, outlines: Outlines, view: SiteView, level: int) -> None:
        self.outlines, self.site, self.view, self.level = outlines, outlines.site, view, level
        box = outlines.level(level)
        self.left, self.low = box.left, box.low
        self.columns = round((box.right - box.left) / outlines.slot_mm)
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
        for number in self.outlines.tracks_on(self.level):
            mark = ":" if self.site.tracks[number].kind is TrackKind.SPUR else "."
            for index in range(1, self.site.tracks[number].length + 1):
                found[self._at(Segment(number, index))] = f"{mark:^{cell}}", "dim"
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
