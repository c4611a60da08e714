"""A design drawn: cars an hour and waiting over the number of each kind, the other kinds as the winner has them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isfinite

from bus_sim.systems.car_park.design.measure import Mean, Outcome
from bus_sim.systems.car_park.design.search import KINDS, Design, Judged
from bus_sim.systems.car_park.design.table import target_words
from onboard.trace.chart.svg import SvgDrawing, colour

WIDTH, HEIGHT = 1080, 640
LEFT, TOP, BOTTOM, GAP = 64, 74, 46, 26
#: Lines of a panel at most from bottom to top.
_MOST_LINES = 6
_STEPS = (1, 2, 5)
_GREY, _DARK = "#f3f3f3", "#222222"
#: Of what the model says, what the plant says, and the target.
_MODEL, _PLANT, _TARGET = colour(0), colour(1), colour(6)


def draw(design: Design, name: str) -> SvgDrawing:
    """Six panels; raises ``ValueError`` for a design without a winner, as nothing would be beside it."""
    if design.winner is None:
        raise ValueError("a design without a winner has no neighbours to draw")
    pen = SvgDrawing(WIDTH, HEIGHT, f"{name}: design")
    pen.text(LEFT, 24, f"{name}: fewest machines for {target_words(design.target)}: {design.winner.size}", size=15)
    _legend(pen)
    width, height = (WIDTH - LEFT - 16 - 2 * GAP) / 3, (HEIGHT - TOP - BOTTOM - GAP) / 2
    for column, kind in enumerate(KINDS):
        row = _along(design, column)
        left = LEFT + column * (width + GAP)
        for number, measure in enumerate(_MEASURES):
            box = _Box(left, TOP + number * (height + GAP), width, height)
            _FigurePanel(pen, box, row, column, measure, design).draw(
                names_axis=column == 0, kind=kind if number == 1 else "", winner=design.winner
            )
    return pen


def _legend(pen: SvgDrawing) -> None:
    pen.line([(LEFT, 46), (LEFT + 26, 46)], _MODEL, width=2)
    pen.text(LEFT + 32, 50, "model, with the 95 % interval of its mean")
    pen.ring(LEFT + 300, 46, 4, _PLANT, width=2)
    pen.text(LEFT + 312, 50, "plant: one run, below of the hardest day")
    pen.line([(LEFT + 580, 46), (LEFT + 606, 46)], _TARGET, dash="6 3")
    pen.text(LEFT + 612, 50, "target")
    pen.area([(LEFT + 680, 40), (LEFT + 692, 40), (LEFT + 692, 52), (LEFT + 680, 52)], colour(4), opacity=0.35)
    pen.text(LEFT + 698, 50, "fewest that keep it")


def _along(design: Design, column: int) -> list[Judged]:
    """The options that differ from the winner in one kind's number alone, in its order."""
    assert design.winner is not None, "looked at before"
    own = design.winner.size
    row = [one for one in design.judged if all(own[k] == one.size[k] for k in range(len(KINDS)) if k != column)]
    return sorted(row, key=lambda one: one.size[column])


@dataclass(frozen=True)
class _Measure:
    """One row of panels: what the model says of an option, what the plant says, and the target, None without one."""

    words: str
    model: Callable[[Judged], Mean]
    plant: Callable[[Judged, Design], list[float]]
    target: Callable[[Design], float | None]


def _plant_per_hour(one: Judged, design: Design) -> list[float]:
    found: Sequence[Outcome] = [design.plant_overload] if one is design.winner and design.plant_overload else []
    return [outcome.per_hour for outcome in found]


_MEASURES = (
    _Measure("cars an hour under overload", lambda one: one.per_hour, _plant_per_hour, lambda _: None),
    _Measure(
        "95 % wait of a day, s",
        lambda one: one.p95_s,
        lambda one, _: [outcome.p95_s for outcome in one.in_plant if isfinite(outcome.p95_s)],
        lambda design: design.target.p95_s,
    ),
)


@dataclass(frozen=True)
class _Box:
    """A rectangle in px."""

    left: float
    top: float
    width: float
    height: float


@dataclass
class _FigurePanel:
    """One panel on the paper."""

    pen: SvgDrawing
    box: _Box
    row: list[Judged]
    column: int
    measure: _Measure
    design: Design

    def draw(self, *, names_axis: bool, kind: str, winner: Judged) -> None:
        """Ground, scale, the winner's column, target, model and plant."""
        pen, box = self.pen, self.box
        bottom = box.top + box.height
        self._fill(box.left, box.left + box.width, _GREY, 1.0)
        x = self._x(winner.size[self.column])
        self._fill(x - 9, x + 9, colour(4), 0.35)
        for value in self._ticks():
            y = self._y(value)
            pen.line([(box.left, y), (box.left + box.width, y)], "#d0d0d0")
            if names_axis:
                pen.text(box.left - 6, y + 4, f"{value:g}", anchor="end")
        for one in self.row:
            pen.text(self._x(one.size[self.column]), bottom + 15, str(one.size[self.column]), anchor="middle")
        if kind:
            pen.text(box.left + box.width / 2, bottom + 33, kind, anchor="middle", size=13)
        if names_axis:
            pen.text(
                box.left - 46, box.top + box.height / 2, self.measure.words, anchor="middle", size=13, upwards=True
            )
        target = self.measure.target(self.design)
        if target is not None and target <= self._most():
            pen.line([(box.left, self._y(target)), (box.left + box.width, self._y(target))], _TARGET, dash="6 3")
        self._draw_values()

    def _draw_values(self) -> None:
        points = []
        for one in self.row:
            mean, x = self.measure.model(one), self._x(one.size[self.column])
            if isfinite(mean.value):
                points.append((x, self._y(mean.value)))
                low, high = max(0.0, mean.value - mean.half), mean.value + mean.half
                self.pen.line([(x, self._y(low)), (x, self._y(high))], _MODEL, width=1.4)
                self.pen.ring(*points[-1], 1.5, _MODEL, width=3)
        if points:
            self.pen.line(points, _MODEL, width=2)
        for one in self.row:
            for value in self.measure.plant(one, self.design):
                self.pen.ring(self._x(one.size[self.column]), self._y(value), 4, _PLANT, width=2)

    def _fill(self, left: float, right: float, fill: str, opacity: float) -> None:
        top, bottom = self.box.top, self.box.top + self.box.height
        self.pen.area([(left, top), (right, top), (right, bottom), (left, bottom)], fill, opacity=opacity)

    def _x(self, count: int) -> float:
        counts = [one.size[self.column] for one in self.row]
        span = max(counts) - min(counts)
        share = (count - min(counts)) / span if span else 0.5
        return self.box.left + 24 + share * (self.box.width - 48)

    def _y(self, value: float) -> float:
        return self.box.top + self.box.height * (1 - min(value, self._most()) / self._most())

    def _most(self) -> float:
        """The top of the scale, the same for all panels of a row: the highest value with room above it."""
        found = [1.0]
        for column in range(len(KINDS)):
            for one in _along(self.design, column):
                mean = self.measure.model(one)
                found += [mean.value + mean.half] if isfinite(mean.value) else []
                found += self.measure.plant(one, self.design)
        return 1.08 * max([*found, self.measure.target(self.design) or 0.0])

    def _ticks(self) -> list[float]:
        step, most = 1, self._most()
        while most / step > _MOST_LINES:
            power = 10 ** (len(str(step)) - 1)
            step = next(one * power for one in (*_STEPS, 10) if one * power > step)
        return [float(value) for value in range(0, int(most) + 1, step)]
