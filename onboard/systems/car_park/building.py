"""A building as a picture: each floor from above, the highest first, and a section with the lifts; all to one scale."""

from onboard.contract.codes import KindCode
from onboard.core.site import Segment, Station
from onboard.systems.car_park.outlines import Box, Outlines
from onboard.systems.car_park.site import CarPark
from onboard.trace.chart.svg import SvgDrawing, colour
from onboard.ways.lifts import stop_mm
from onboard.ways.site import BayUse, TrackKind

#: Width of the whole and the room beside and between floors, px; a building of few positions is not blown up beyond
#: the most px a mm.
_WIDTH, _LEFT, _GAP, _HEAD = 1_200.0, 60.0, 34.0, 46.0
_MOST_SCALE = 0.02
_WAY, _PLACE, _LIFT, _BAY, _SPUR, _HOME = "#e4e4e4", "#9a9a9a", "#0072B2", "#D55E00", "#009E73", "#000000"
#: Positions between two that are numbered.
_NUMBERED = 5
#: Heights of a bar that tells the scale, mm.
_BAR_MM = 10_000


def draw(site: CarPark) -> SvgDrawing:
    """The picture of a site; raises nothing that its reader has not."""
    return _Building(site).draw()


class _Building:
    def __init__(self, site: CarPark) -> None:
        self.site = site
        self.outlines = Outlines(site)
        self.levels = self.outlines.levels
        self.boxes = {level: self.outlines.level(level) for level in self.levels}
        boxes = list(self.boxes.values())
        self.left = min(box.left for box in boxes)
        width_mm = max(box.right for box in boxes) - self.left
        self.scale = min(_MOST_SCALE, (_WIDTH - _LEFT - 30) / width_mm)
        #: Left edges of shafts that have their names: of those at one place the names lie above each other.
        self.named: list[float] = []
        self.heights_mm = _level_heights_mm(site, self.levels)

    def draw(self) -> SvgDrawing:
        section = (max(self.heights_mm.values()) + self.site.floor_height_mm) * self.scale + 2 * _GAP
        plans = sum((box.high - box.low) * self.scale + _GAP for box in self.boxes.values())
        self.drawing = SvgDrawing(_WIDTH, _HEAD + section + plans + 30, f"{self.site.name}: the building")
        self._head()
        top = _HEAD + self._section(_HEAD)
        for level in self.levels:
            top = self._floor(level, top)
        return self.drawing

    def _head(self) -> None:
        self.drawing.text(10, 18, f"{self.site.name}: from above, the highest floor first", fill="#000000")
        right = _LEFT + _BAR_MM * self.scale
        self.drawing.line([(_LEFT, 32), (right, 32)], "#000000", width=2)
        self.drawing.text(right + 6, 36, "10 m")
        at = right + 60
        for number, one in enumerate(self.site.classes):
            self.drawing.area(_corners(at, 27, 12, 10), colour(number), opacity=0.45)
            words = f"{one.name}: to {one.max_length_mm} mm, {one.max_height_mm} mm high"
            words += f", {one.max_width_mm} mm wide" if one.max_width_mm else ""
            words += ", charging" if one.charging else ""
            self.drawing.text(at + 16, 36, words)
            at += 40 + 6.2 * len(words)

    # --- from the side -----------------------------------------------------------------------------------------

    def _section(self, top: float) -> float:
        """Floors as lines at their heights, lifts as shafts with a box at each door; its height in px."""
        most_mm = max(self.heights_mm.values()) + self.site.floor_height_mm
        foot = top + most_mm * self.scale
        for level, box in self.boxes.items():
            y = foot - self.heights_mm[level] * self.scale
            self.drawing.line([(self._x(box.left), y), (self._x(box.right), y)], _PLACE, width=1.5)
            self.drawing.text(_LEFT - 8, y, f"floor {level}", anchor="end")
        for lift in self.site.lifts:
            self._shaft(lift, foot)
        return most_mm * self.scale + _GAP

    def _shaft(self, lift: int, foot: float) -> None:
        box, joins = self.outlines.platform(lift), self.site.tracks[lift].joins
        left, right = self._x(box.left), self._x(box.right)
        heights = sorted({self.heights_mm[self.site.level(sill.track)] for sill in joins})
        high = self.site.floor_height_mm * self.scale
        top, low = foot - heights[-1] * self.scale - high, foot - heights[0] * self.scale
        self.drawing.area([(left, top), (right, top), (right, low), (left, low)], _LIFT, opacity=0.12)
        for height_mm in heights:
            y = foot - height_mm * self.scale
            self._frame(left + 1, y - high + 2, right - left - 2, high - 3, _LIFT)
        self.named.append(left)
        above = 12 * (self.named.count(left) - 1)
        self.drawing.text((left + right) / 2, top - 3 - above, self._name(lift), anchor="middle", fill=_LIFT)

    # --- from above --------------------------------------------------------------------------------------------

    def _floor(self, level: int, top: float) -> float:
        """One floor; where the next may begin, px."""
        box = self.boxes[level]
        self.foot = top + (box.high - box.low) * self.scale
        self.low = box.low
        self.drawing.text(10, top - 6, f"floor {level}, {self.heights_mm[level] / 1000:g} m", fill="#000000")
        for lift in self.outlines.lifts_on(level):
            self._approach(lift, level)
        for number in self.outlines.tracks_on(level):
            self._way(number)
        for place in self.site.places:
            if self.site.level(place.track) == level:
                self._place(place)
        for lift in self.outlines.lifts_on(level):
            self._platform(lift, level)
        for node, bay in self.site.compartments.items():
            if self.site.level(bay.track) == level:
                self._bay(node, bay)
        for machine in self.site.machines.values():
            if machine.kind is KindCode.ROBOT and self.site.level(machine.home.track) == level:
                self._home(machine.name, machine.home)
        return self.foot + _GAP

    def _way(self, number: int) -> None:
        track = self.site.tracks[number]
        is_spur = track.kind is TrackKind.SPUR
        fill, opacity = (_SPUR, 0.25) if is_spur else (_WAY, 1.0)
        for index, mouth in () if is_spur else track.ends:
            self._fill(self.outlines.slot(mouth).around(self.outlines.slot(track.inside(index))), fill, opacity)
        self._fill(self.outlines.track(number), fill, opacity)
        for index in range(1, track.length + 1):
            x, y, _, high = self._rectangle(self.outlines.slot(Segment(number, index)))
            if index == 1 or (index % _NUMBERED == 0 and high > 9):
                words = f"p({number},1)" if index == 1 else str(index)
                self.drawing.text(x + 2, y + high - 2, words, fill="#555555")
        for index, mouth in track.ends:
            ends = (self.outlines.slot(mouth), self.outlines.slot(track.inside(index)))
            self.drawing.line([self._middle(box) for box in ends], _SPUR, width=2)
        if track.one_way:
            self._arrows(number, track.one_way, track.length)

    def _arrows(self, number: int, along: int, length: int) -> None:
        """Which way a one-way alley goes: a tip at every third slot."""
        line = self.outlines.plan.lines[number]
        size = 0.3 * self.site.tracks[number].pitch_mm * self.scale
        for index in range(1, length + 1, 3):
            x, y = self._middle(self.outlines.slot(Segment(number, index)))
            dx, dy = line.dx * along * size, -line.dy * along * size
            tips = [(x - dx - dy, y - dy + dx), (x + dx, y + dy), (x - dx + dy, y - dy - dx)]
            self.drawing.line(tips, _HOME, width=1.5)

    def _place(self, place: Station) -> None:
        box = self.outlines.station(place)
        number = self.site.place_class.get(place.number, 0)
        if number:
            self._fill(box, colour(number - 1), 0.3)
        self._frame(*self._rectangle(box), _PLACE, 0.7)

    def _approach(self, lift: int, level: int) -> None:
        """The way from each sill to a platform, below what is written on the alley."""
        for sill in self._sills(lift, level):
            self._fill(self.outlines.slot(sill).around(self.outlines.platform(lift)), _WAY, 1.0)

    def _platform(self, lift: int, level: int) -> None:
        x, y, wide, high = self._rectangle(self.outlines.platform(lift))
        for sill in self._sills(lift, level):
            boxes = (self.outlines.slot(sill), self.outlines.platform(lift))
            self.drawing.line([self._middle(box) for box in boxes], _LIFT, width=2)
        self.drawing.area(_corners(x, y, wide, high), "#ffffff", opacity=1)
        self._frame(x, y, wide, high, _LIFT, 2)
        self.drawing.line([(x, y), (x + wide, y + high)], _LIFT, width=0.4)
        self.drawing.line([(x, y + high), (x + wide, y)], _LIFT, width=0.4)
        self.drawing.text(x + wide / 2, y + high / 2 + 4, self._name(lift), anchor="middle", fill=_LIFT)

    def _bay(self, node: int, bay: Station) -> None:
        x, y, wide, high = self._rectangle(self.outlines.station(bay))
        self.drawing.area(_corners(x, y, wide, high), _BAY, opacity=0.18)
        self._frame(x, y, wide, high, _BAY, 2)
        use = self.site.bay_uses.get(node, BayUse.BOTH)
        words = {BayUse.ENTRY: "in", BayUse.EXIT: "out", BayUse.BOTH: "in, out"}[use]
        self.drawing.text(x + wide / 2, y + high / 2, self.site.machines[node].name, anchor="middle", fill=_BAY)
        self.drawing.text(x + wide / 2, y + high / 2 + 12, words, anchor="middle", fill=_BAY)

    def _home(self, name: str, home: Segment) -> None:
        x, y, wide, high = self._rectangle(self.outlines.slot(home))
        self.drawing.area(_corners(x + wide * 0.15, y + high * 0.15, wide * 0.7, high * 0.7), _HOME, opacity=0.75)
        self.drawing.text(x + wide / 2, y + high / 2 + 4, name, anchor="middle", fill="#ffffff")

    def _sills(self, lift: int, level: int) -> list[Segment]:
        return [sill for sill in self.site.tracks[lift].joins if self.site.level(sill.track) == level]

    # --- px ----------------------------------------------------------------------------------------------------

    def _name(self, lift: int) -> str:
        return next(one.name for one in self.site.machines.values() if one.home.track == lift)

    def _x(self, x_mm: float) -> float:
        return _LEFT + (x_mm - self.left) * self.scale

    def _rectangle(self, box: Box) -> tuple[float, float, float, float]:
        """Left, top, width and height of a box on the floor that is drawn."""
        y = self.foot - (box.high - self.low) * self.scale
        return self._x(box.left), y, (box.right - box.left) * self.scale, (box.high - box.low) * self.scale

    def _middle(self, box: Box) -> tuple[float, float]:
        x, y, wide, high = self._rectangle(box)
        return x + wide / 2, y + high / 2

    def _fill(self, box: Box, fill: str, opacity: float) -> None:
        self.drawing.area(_corners(*self._rectangle(box)), fill, opacity=opacity)

    def _frame(self, x: float, y: float, wide: float, high: float, stroke: str, width: float = 1) -> None:
        corners = _corners(x, y, wide, high)
        self.drawing.line([*corners, corners[0]], stroke, width=width)


def _corners(x: float, y: float, wide: float, high: float) -> list[tuple[float, float]]:
    return [(x, y), (x + wide, y), (x + wide, y + high), (x, y + high)]


def _level_heights_mm(site: CarPark, levels: list[int]) -> dict[int, int]:
    """How high each floor lies above the lowest, as lifts' stops tell; floors that none joins are as high as usual."""
    known: dict[int, int] = {}
    for level in reversed(levels):
        if level not in known:
            known[level] = (level - 1) * site.floor_height_mm
            _tell_above(site, known)
    low = min(known.values())
    return {level: height_mm - low for level, height_mm in known.items()}


def _tell_above(site: CarPark, known: dict[int, int]) -> None:
    """Add the heights of all floors that are joined to known ones, if over several lifts."""
    shafts = [
        {site.level(sill.track): stop_mm(site, lift, at) for at, sill in enumerate(site.tracks[lift].joins, start=1)}
        for lift in site.lifts
    ]
    while shaft := next((one for one in shafts if known.keys() & one.keys() and one.keys() - known.keys()), None):
        first = min(known.keys() & shaft.keys())
        for level, height_mm in shaft.items():
            known.setdefault(level, known[first] + height_mm - shaft[first])
