"""A building as a picture: each floor from above, the highest first, and a section with the lifts; all to one scale."""

from collections.abc import Callable, Iterator
from functools import partial
from itertools import count

from onboard.contract.codes import KindCode
from onboard.core.site import Segment, Station
from onboard.systems.car_park.outlines import Box, Outlines, level_heights_mm
from onboard.systems.car_park.site import CarPark, SizeClass
from onboard.trace.chart.svg import SvgDrawing, colour
from onboard.ways.site import BayUse, TrackKind

#: px a mm, and of the narrowest slot at least, px: what is written has room. A picture is as wide as its floors.
_SCALE, _LEAST_SLOT = 0.02, 48.0
#: Room beside and between floors, a line of the head, and the narrowest picture, px.
_MARGIN, _GAP, _LINE, _LEAST_WIDTH = 60.0, 34.0, 18.0, 640.0
#: Edges have 3:1 on white, and what is written 4.5:1 on what it is written on.
_WAY, _EDGE, _LIFT, _BAY, _SPUR, _ROBOT = "#e4e4e4", "#7a7a7a", "#0072B2", "#D55E00", "#00835F", "#404040"
_ON_WAY, _ON_BAY = "#444444", "#8a3800"
#: Usual letters, the smallest, and those for which it is not read upwards, px; and the width of one by its height.
_LETTER, _LEAST_LETTER, _LEVEL_LETTER, _ASPECT = 11.0, 7.0, 9.0, 0.64
#: Positions between two that are numbered; between them, where nothing is written, are the tips of one-way alleys.
_NUMBERED, _TIP = 5, 3
#: Length of a bar that tells the scale, mm.
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
        self.scale = max(_SCALE, _LEAST_SLOT / self.outlines.slot_mm)
        self.width = max(_LEAST_WIDTH, (max(box.right for box in boxes) - self.left) * self.scale + 2 * _MARGIN)
        self.homes = {one.home: one.name for one in site.machines.values() if one.kind is KindCode.ROBOT}
        self.heights_mm = level_heights_mm(site)

    def draw(self) -> SvgDrawing:
        signs = list(self._signs())
        head = 2 * _LINE + 8 + _LINE * (1 + max(line for line, _, _ in signs))
        names = self._shaft_names()
        section = _LINE * (1 + max((row for _, row in names.values()), default=0))
        section += (max(self.heights_mm.values()) + self.site.floor_height_mm) * self.scale + _GAP
        plans = sum((box.high - box.low) * self.scale + _GAP for box in self.boxes.values())
        self.drawing = SvgDrawing(self.width, head + section + plans + 10, f"{self.site.name}: the building")
        self._head(signs)
        self._section(head + section - _GAP, names)
        top = head + section
        for level in self.levels:
            top = self._floor(level, top)
        return self.drawing

    # --- what the signs mean -----------------------------------------------------------------------------------

    def _head(self, signs: list[tuple[int, float, tuple[str, Callable[[float, float], None]]]]) -> None:
        self.drawing.text(10, 18, f"{self.site.name}: from above, the highest floor first", fill="#000000")
        right = 10 + _BAR_MM * self.scale
        self.drawing.line([(10, 30), (right, 30)], "#000000", width=2)
        self.drawing.text(right + 6, 34, "10 m")
        for line, x, (words, sign) in signs:
            y = 2 * _LINE + 8 + line * _LINE
            sign(x, y)
            self.drawing.text(x + 20, y + 9, words)

    def _signs(self) -> Iterator[tuple[int, float, tuple[str, Callable[[float, float], None]]]]:
        """Line and left edge, px, of each sign that is in the picture, what it means, and how it is drawn."""
        line, x = 0, 10.0
        for words, sign in self._meanings():
            wide = 40 + _LETTER * _ASPECT * len(words)
            if x > 10 and x + wide > self.width:
                line, x = line + 1, 10.0
            yield line, x, (words, sign)
            x += wide

    def _meanings(self) -> Iterator[tuple[str, Callable[[float, float], None]]]:
        tracks = list(self.site.tracks.values())
        yield "compartment", lambda x, y: self._frame(x, y, 12, 10, _BAY, 2)
        yield "robot at home", lambda x, y: self.drawing.area(_corners(x, y, 14, 10), _ROBOT, opacity=1)
        if self.site.lifts:
            yield "lift, its doors thick", self._door_sign
        if any(track.kind is TrackKind.SPUR for track in tracks):
            yield "spur: robots wait aside", lambda x, y: self._frame(x, y, 12, 10, _SPUR, 2)
        if any(track.ends for track in tracks):
            yield "robots turn here", lambda x, y: self.drawing.ring(x + 6, y + 5, 5, _SPUR, width=2)
        if any(track.one_way for track in tracks):
            yield "one way", lambda x, y: self.drawing.line([(x, y), (x + 8, y + 5), (x, y + 10)], "#000000", width=1.5)
        for number, one in enumerate(self.site.classes):
            yield _class_words(one), partial(self._class_sign, number)

    def _door_sign(self, x: float, y: float) -> None:
        self._frame(x, y, 12, 10, _LIFT, 2)
        self.drawing.line([(x + 12, y + 1), (x + 12, y + 9)], _LIFT, width=5)

    def _class_sign(self, number: int, x: float, y: float) -> None:
        self.drawing.area(_corners(x, y, 14, 10), colour(number), opacity=0.3)
        self._frame(x, y, 14, 10, _EDGE)
        self.drawing.text(x + 7, y + 9, str(number + 1), anchor="middle", size=9)

    # --- from the side -----------------------------------------------------------------------------------------

    def _section(self, foot: float, names: dict[int, tuple[str, int]]) -> None:
        """Floors as lines at their heights, lifts as shafts with a box at each stop."""
        for level, box in self.boxes.items():
            y = foot - self.heights_mm[level] * self.scale
            self.drawing.line([(self._x(box.left), y), (self._x(box.right), y)], _EDGE, width=1.5)
            self.drawing.text(_MARGIN - 8, y, f"floor {level}", anchor="end")
        for lift in self.site.lifts:
            self._shaft(lift, foot, *names[lift])

    def _shaft_names(self) -> dict[int, tuple[str, int]]:
        """Names of lifts, each with its row above the section: none lies on another."""
        taken: list[tuple[int, float, float]] = []
        found = {}
        for lift in self.site.lifts:
            box, name = self.outlines.platform(lift), self._name(lift)
            middle, half = self._x((box.left + box.right) / 2), _LETTER * _ASPECT * len(name) / 2
            left, right = middle - half, middle + half
            row = next(
                one for one in count() if not any(one == at and left < r and low < right for at, low, r in taken)
            )
            taken.append((row, left, right))
            found[lift] = name, row
        return found

    def _shaft(self, lift: int, foot: float, name: str, row: int) -> None:
        box, joins = self.outlines.platform(lift), self.site.tracks[lift].joins
        left, right = self._x(box.left), self._x(box.right)
        heights = sorted({self.heights_mm[self.site.level(sill.track)] for sill in joins})
        high = self.site.floor_height_mm * self.scale
        top, low = foot - heights[-1] * self.scale - high, foot - heights[0] * self.scale
        self.drawing.area([(left, top), (right, top), (right, low), (left, low)], _LIFT, opacity=0.12)
        for height_mm in heights:
            y = foot - height_mm * self.scale
            self._frame(left + 1, y - high + 2, right - left - 2, high - 3, _LIFT)
        y = foot - (max(self.heights_mm.values()) + self.site.floor_height_mm) * self.scale - 3
        self.drawing.text((left + right) / 2, min(top - 3, y) - _LINE * row, name, anchor="middle", fill=_LIFT)

    # --- from above --------------------------------------------------------------------------------------------

    def _floor(self, level: int, top: float) -> float:
        """One floor; where the next may begin, px."""
        box = self.boxes[level]
        self.foot = top + (box.high - box.low) * self.scale
        self.low = box.low
        self.drawing.text(10, top - 6, f"floor {level}, {self.heights_mm[level] / 1000:g} m", fill="#000000")
        self._ways(level)
        for place in self.site.places:
            if self.site.level(place.track) == level:
                self._place(place)
        for number in self.outlines.tracks_on(level):
            self._marks(number)
        for lift in self.outlines.lifts_on(level):
            self._platform(lift, level)
        for node, bay in self.site.compartments.items():
            if self.site.level(bay.track) == level:
                self._bay(node, bay)
        for home, name in self.homes.items():
            if self.site.level(home.track) == level:
                self._home(name, home)
        return self.foot + _GAP

    def _ways(self, level: int) -> None:
        """All edges first, all slots over them: an edge is left where nothing goes on."""
        parts = [
            (self.outlines.slot(sill).around(self.outlines.platform(lift)), False)
            for lift in self.outlines.lifts_on(level)
            for sill in self._sills(lift, level)
        ]
        for number in self.outlines.tracks_on(level):
            track = self.site.tracks[number]
            is_spur = track.kind is TrackKind.SPUR
            parts.append((self.outlines.track(number), is_spur))
            for index, mouth in track.ends:
                parts.append((self.outlines.slot(mouth).around(self.outlines.slot(track.inside(index))), False))
        for box, is_spur in parts:
            self._frame(*self._rectangle(box), _SPUR if is_spur else _EDGE, 4 if is_spur else 2)
        for box, _ in parts:
            self._fill(box, _WAY, 1.0)

    def _marks(self, number: int) -> None:
        """What is written on a track, where robots turn, and which way it goes."""
        track = self.site.tracks[number]
        for _, mouth in track.ends:
            slot = self.outlines.slot(mouth)
            self.drawing.ring(*self._middle(slot), 0.2 * self.outlines.slot_mm * self.scale, _SPUR, width=2)
        if track.one_way:
            self._arrows(number, track.one_way, track.length)
        if track.kind is TrackKind.SPUR:
            self._spur_name(number, track.length)
            return
        # A robot at home would lie on what is written in its slot.
        free = [index for index in range(1, track.length + 1) if Segment(number, index) not in self.homes]
        for index in free:
            x, y, _, high = self._rectangle(self.outlines.slot(Segment(number, index)))
            if index == free[0] or index % _NUMBERED == 0:
                words = f"p({number},{index})" if index == free[0] else str(index)
                self.drawing.text(x + 2, y + high - 3, words, fill=_ON_WAY, size=10)
            if index == free[0] and number in self.site.alley_names:
                self.drawing.text(x + 2, y + 11, self.site.alley_names[number], fill="#000000", halo=_WAY)

    def _spur_name(self, number: int, length: int) -> None:
        """Beyond the end, as a robot may stand in any of its segments."""
        line, (x, y) = self.outlines.plan.lines[number], self._middle(self.outlines.slot(Segment(number, length)))
        half, words = self.outlines.slot_mm * self.scale / 2, f"p({number},{length})"
        if line.dx:
            anchor = "start" if line.dx > 0 else "end"
            self.drawing.text(
                x + line.dx * (half + 4), y + 4, words, anchor=anchor, fill=_ON_WAY, size=9, halo="#ffffff"
            )
        else:
            beyond = -half - 4 if line.dy > 0 else half + 11
            self.drawing.text(x, y + beyond, words, anchor="middle", fill=_ON_WAY, size=9, halo="#ffffff")

    def _arrows(self, number: int, along: int, length: int) -> None:
        """Which way a one-way alley goes."""
        line = self.outlines.plan.lines[number]
        size = 0.2 * self.site.tracks[number].pitch_mm * self.scale
        for index in range(min(_TIP, length), length + 1, _NUMBERED):
            x, y = self._middle(self.outlines.slot(Segment(number, index)))
            dx, dy = line.dx * along * size, -line.dy * along * size
            tips = [(x - dx - dy, y - dy + dx), (x + dx, y + dy), (x - dx + dy, y - dy - dx)]
            self.drawing.line(tips, "#000000", width=1.5)

    def _place(self, place: Station) -> None:
        box = self.outlines.station(place)
        number = self.site.place_class.get(place.number, 0)
        if number:
            self._fill(box, colour(number - 1), 0.3)
            x, y = self._middle(box)
            self.drawing.text(x, y + 4, str(number), anchor="middle", size=9)
        self._frame(*self._rectangle(box), _EDGE)

    def _platform(self, lift: int, level: int) -> None:
        x, y, wide, high = self._rectangle(self.outlines.platform(lift))
        self.drawing.area(_corners(x, y, wide, high), "#ffffff", opacity=1)
        self._frame(x, y, wide, high, _LIFT, 2)
        self.drawing.line([(x, y), (x + wide, y + high)], _LIFT, width=0.4)
        self.drawing.line([(x, y + high), (x + wide, y)], _LIFT, width=0.4)
        for sill in self._sills(lift, level):
            self._door(self.outlines.slot(sill), (x, y, wide, high))
        self._name_in((x, y, wide, high), [self._name(lift)], _LIFT, halo="#ffffff")

    def _door(self, sill: Box, platform: tuple[float, float, float, float]) -> None:
        """A thick line within a platform, at its edge towards a sill."""
        x, y, wide, high = platform
        to_x, to_y = self._middle(sill)
        dx, dy = to_x - (x + wide / 2), to_y - (y + high / 2)
        if abs(dx) > abs(dy):
            edge = x + wide - 3 if dx > 0 else x + 3
            self.drawing.line([(edge, y + 0.2 * high), (edge, y + 0.8 * high)], _LIFT, width=6)
        else:
            edge = y + high - 3 if dy > 0 else y + 3
            self.drawing.line([(x + 0.2 * wide, edge), (x + 0.8 * wide, edge)], _LIFT, width=6)

    def _bay(self, node: int, bay: Station) -> None:
        x, y, wide, high = self._rectangle(self.outlines.station(bay))
        self.drawing.area(_corners(x, y, wide, high), "#ffffff", opacity=1)
        self.drawing.area(_corners(x, y, wide, high), _BAY, opacity=0.18)
        self._frame(x, y, wide, high, _BAY, 2)
        use = self.site.bay_uses.get(node, BayUse.BOTH)
        words = {BayUse.ENTRY: "in only", BayUse.EXIT: "out only", BayUse.BOTH: "in, out"}[use]
        self._name_in((x, y, wide, high), [self.site.machines[node].name, words], _ON_BAY)

    def _home(self, name: str, home: Segment) -> None:
        x, y = self._middle(self.outlines.slot(home))
        along, across = self.site.carrier_length_mm * self.scale / 2, 0.35 * self.outlines.slot_mm * self.scale
        wide, high = (along, across) if self.outlines.plan.lines[home.track].dx else (across, along)
        self.drawing.area(_corners(x - wide, y - high, 2 * wide, 2 * high), _ROBOT, opacity=1)
        box = (x - wide, y - high, 2 * wide, 2 * high)
        self._name_in(box, [name], "#ffffff", beside=_ROBOT, is_below=self.outlines.plan.lines[home.track].dy > 0)

    def _sills(self, lift: int, level: int) -> list[Segment]:
        return [sill for sill in self.site.tracks[lift].joins if self.site.level(sill.track) == level]

    def _name_in(
        self,
        box: tuple[float, float, float, float],
        lines: list[str],
        fill: str,
        *,
        halo: str | None = None,
        beside: str | None = None,
        is_below: bool = False,
    ) -> None:
        """Lines in the middle of a box: level, or upwards where it is high and they are long.

        With no room even so the first is above the box, or below, in the colour ``beside`` where it is given.
        """
        x, y, wide, high = box
        letters = _ASPECT * max(len(line) for line in lines)
        level, upright = (wide - 4) / letters, (high - 4) / letters
        is_level = level >= min(_LEVEL_LETTER, upright)
        size, middle, step = min(_LETTER, level if is_level else upright), x + wide / 2, _LETTER + 1
        if size < _LEAST_LETTER:
            outside = y + high + _LETTER if is_below else y - 3
            self.drawing.text(middle, outside, lines[0], anchor="middle", fill=beside or fill, halo="#ffffff")
        elif is_level:
            first = y + high / 2 + 4 - step * (len(lines) - 1) / 2
            for at, line in enumerate(lines):
                self.drawing.text(middle, first + step * at, line, anchor="middle", fill=fill, size=size, halo=halo)
        else:
            first = middle + 4 - step * (len(lines) - 1) / 2
            for at, line in enumerate(lines):
                self.drawing.text(
                    first + step * at,
                    y + high / 2,
                    line,
                    anchor="middle",
                    fill=fill,
                    size=size,
                    halo=halo,
                    upwards=True,
                )

    # --- px ----------------------------------------------------------------------------------------------------

    def _name(self, lift: int) -> str:
        return next(one.name for one in self.site.machines.values() if one.home.track == lift)

    def _x(self, x_mm: float) -> float:
        return _MARGIN + (x_mm - self.left) * self.scale

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


def _class_words(one: SizeClass) -> str:
    words = f"{one.name}: to {one.max_length_mm} mm long, {one.max_height_mm} mm high"
    words += f", {one.max_width_mm} mm wide" if one.max_width_mm else ""
    return f"{words}, {one.max_load_kg} kg" + (", to charge" if one.charging else "")
