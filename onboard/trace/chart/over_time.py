"""A diagram over time for any system: panels of rows, a line for what moves from row to row, bars for what lasts.

A system's folder says in ``diagram.py`` which rows it has, and what its messages draw; the class ``DIAGRAM`` there is a
``Diagram``. Everything is drawn from the fleet bus.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

from onboard.contract.messages import Message
from onboard.core.site import Site
from onboard.history.history import Fact, History
from onboard.systems.words import words_of
from onboard.trace.chart.svg import SvgDrawing, colour
from onboard.trace.listener import LoggedMessage

WIDTH, LEFT, RIGHT, TOP, BOTTOM, GAP = 1200, 90, 20, 46, 30, 14
#: Height of a row, pixels: the most, and what a panel has at most for all of its rows.
_ROW, _MOST_HEIGHT = 22.0, 620.0
#: Least height of a row that has its name beside it, pixels.
_LABEL = 12.0
#: Pixels of a letter, to tell whether a text fits into its bar.
_LETTER = 6.2
_STEPS_S = (1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1_200, 1_800, 3_600, 7_200, 14_400)
_MOST_TICKS = 14
#: The colour of what belongs to no machine.
NOBODYS = "#555555"


class Diagram(Protocol):
    """One system's diagram, made with (site, from_us, until_us); the last two None for all of the log."""

    #: Times of the log that are shown, us.
    first_us: int
    last_us: int

    def feed(self, logged: LoggedMessage) -> None:
        """Take up one message of the fleet bus."""

    def draw(self, start_us: int) -> SvgDrawing:
        """The log is over: the picture, its times since ``start_us``."""


@dataclass
class PanelLine:
    """One machine's way through the rows of a panel: (us, row), the first row 0; a row's middle is its number."""

    node: int
    points: list[tuple[int, float]]
    width: float = 2.0


@dataclass
class Bar:
    """What lasts: from row to row (their edges) and from us to us; ``node`` 0 for what is nobody's."""

    node: int
    low: float
    high: float
    begin_us: int
    end_us: int
    text: str = ""
    opacity: float = 0.4


@dataclass
class Panel:
    """Rows with names, an empty one has none, and what happens in them."""

    title: str
    rows: Sequence[str]
    lines: list[PanelLine] = field(default_factory=list)
    bars: list[Bar] = field(default_factory=list)


class Rows(ABC):
    """What the diagrams of all systems but those with tracks share. A system says ``take`` and ``end``."""

    #: What the kinds of bars mean, for the reader.
    legend = ""

    def __init__(self, site: Site, from_us: int | None, until_us: int | None) -> None:
        self.words = words_of(site)
        self.panels: list[Panel] = []
        self.first_us, self.last_us = 0 if from_us is None else from_us, 0
        self._name, self._machines = site.name, sorted(site.machines)
        self._until_us, self._is_begun = until_us, from_us is not None
        self.history = History(site)

    def feed(self, logged: LoggedMessage) -> None:
        """Take up one message of the fleet bus; what came before the time that is shown is heard all the same."""
        if self._until_us is not None and logged.time_us > self._until_us:
            return
        if not self._is_begun:
            self._is_begun, self.first_us = True, logged.time_us
        self.last_us = max(self.last_us, logged.time_us)
        fact = self.history.feed(logged.message, logged.time_us)
        self.words.hear(logged.message)
        self.take(logged.message, fact, logged.time_us)

    @abstractmethod
    def take(self, message: Message, fact: Fact | None, time_us: int) -> None:
        """Take up one message at ``time_us``, and what it told; each system's rows say which they draw."""

    def end(self, time_us: int) -> None:  # noqa: B027  # not every system has something that goes on
        """The log is over: what goes on ends with it."""

    def log_us(self, bus_ms: int, near_us: int) -> int:
        """The time of the log of a bus time in ms; ``near_us`` itself where nobody told bus time."""
        found = self.history.clock.log_us(bus_ms, near_us)
        return near_us if found is None else found

    def draw(self, start_us: int) -> SvgDrawing:
        """All panels, the machines by their colours."""
        self.end(self.last_us)
        heights = [min(_MOST_HEIGHT, _ROW * len(panel.rows)) for panel in self.panels]
        drawing = SvgDrawing(WIDTH, TOP + sum(heights) + GAP * len(heights) + BOTTOM, f"{self._name}: over time")
        numbers = {node: number for number, node in enumerate(self._machines)}
        shown = {line.node for panel in self.panels for line in panel.lines}
        shown |= {bar.node for panel in self.panels for bar in panel.bars}
        machines = [(self.words.machine(node), numbers[node]) for node in sorted(shown & set(numbers))]
        name_machines(drawing, machines, self.legend)
        top = float(TOP)
        for panel, height in zip(self.panels, heights, strict=True):
            _PanelSheet(drawing, panel, top, height, self.first_us, self.last_us, numbers).draw()
            top += height + GAP
        time_axis(drawing, self.first_us, self.last_us, start_us, top)
        return drawing


@dataclass
class _PanelSheet:
    """One panel on the paper."""

    drawing: SvgDrawing
    panel: Panel
    top: float
    height: float
    first_us: int
    last_us: int
    numbers: dict[int, int]

    def draw(self) -> None:
        pen, right = self.drawing, WIDTH - RIGHT
        corners = [(LEFT, self.top), (right, self.top), (right, self.top + self.height), (LEFT, self.top + self.height)]
        pen.area([(float(x), y) for x, y in corners], "#f3f3f3", opacity=1)
        row = self.height / len(self.panel.rows)
        free = self.top
        for number, name in enumerate(self.panel.rows):
            y = self.y(number)
            if name and y - row / 2 >= free - 0.1:
                pen.text(LEFT - 4, y + 4, name, anchor="end", fill="#444444")
                free = y - row / 2 + max(row, _LABEL)
            if number:
                pen.line([(LEFT, self.y(number - 0.5)), (right, self.y(number - 0.5))], "#e2e2e2", width=0.6)
        pen.text(8, self.top - 3, self.panel.title, fill="#444444")
        for bar in self.panel.bars:
            self._bar(bar)
        for line in self.panel.lines:
            self._line(line)

    def x(self, time_us: float) -> float:
        share = (time_us - self.first_us) / max(1, self.last_us - self.first_us)
        return LEFT + (WIDTH - LEFT - RIGHT) * min(1.0, max(0.0, share))

    def y(self, row: float) -> float:
        return self.top + self.height * (row + 0.5) / len(self.panel.rows)

    def _colour(self, node: int) -> str:
        return colour(self.numbers[node]) if node in self.numbers else NOBODYS

    def _bar(self, bar: Bar) -> None:
        if bar.end_us <= self.first_us or bar.begin_us >= self.last_us:
            return
        x1, x2 = self.x(bar.begin_us), self.x(bar.end_us)
        y1, y2 = self.y(bar.low), self.y(bar.high)
        corners = [(x1, y1), (x2, y1), (x2, y2), (x1, y2)]
        self.drawing.area(corners, self._colour(bar.node), opacity=bar.opacity, note=bar.text)
        if bar.text and len(bar.text) * _LETTER < x2 - x1 and y2 - y1 >= _LABEL:
            self.drawing.text(x1 + 3, (y1 + y2) / 2 + 4, bar.text)

    def _line(self, line: PanelLine) -> None:
        points = [(self.x(time_us), self.y(row)) for time_us, row in line.points if time_us >= self.first_us]
        before = [row for time_us, row in line.points if time_us < self.first_us]
        if before and points:
            points.insert(0, (self.x(self.first_us), self.y(before[-1])))
        if len(points) > 1:
            if line.node in self.numbers:
                self.drawing.way(points, self.numbers[line.node], width=line.width)
            else:
                self.drawing.line(points, NOBODYS, width=line.width)


def by_distance(far: Sequence[Sequence[float]]) -> list[int]:
    """Numbers in a row, so that neighbours are near: by the ways to the two that are farthest from each other."""
    one = max(range(len(far)), key=lambda number: far[0][number])
    two = max(range(len(far)), key=lambda number: far[one][number])
    return sorted(range(len(far)), key=lambda number: (far[one][number] - far[two][number], number))


def name_machines(drawing: SvgDrawing, machines: list[tuple[str, int]], legend: str) -> None:
    """Machines by name and number, in their colours, and what bands or bars mean behind them."""
    x = float(LEFT)
    for name, number in machines:
        drawing.way([(x, 14), (x + 24, 14)], number, width=2.5)
        drawing.text(x + 28, 18, name)
        x += 44 + 8 * len(name)
    drawing.text(x + 10, 18, legend)


def time_axis(drawing: SvgDrawing, first_us: int, last_us: int, start_us: int, bottom: float) -> None:
    """Seconds since ``start_us`` along the top."""
    scale = (WIDTH - LEFT - RIGHT) / max(1, last_us - first_us)
    step_s = next((step for step in _STEPS_S if (last_us - first_us) / 1e6 / step <= _MOST_TICKS), _STEPS_S[-1])
    second = -(-(first_us - start_us) // (step_s * 1_000_000)) * step_s
    while start_us + second * 1_000_000 <= last_us:
        x = LEFT + (start_us + second * 1_000_000 - first_us) * scale
        drawing.line([(x, TOP - 4), (x, bottom - GAP)], "#cccccc", width=0.6)
        drawing.text(x, TOP - 8, f"{second} s", anchor="middle", fill="#666666")
        second += step_s
