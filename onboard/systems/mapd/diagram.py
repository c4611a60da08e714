"""A floor over time: of a map two panels, columns and rows; of a network its cells, neighbours near each other."""

from onboard.contract.messages import Message
from onboard.history.history import Fact
from onboard.systems.mapd.history import CellTold
from onboard.systems.mapd.site import Mapd
from onboard.trace.chart.over_time import Panel, PanelLine, Rows, by_distance

#: Widths of lines: without a load, and with one.
_EMPTY, _LOADED = 1.2, 3.2


class MapdDiagram(Rows):
    """Robots by the cells of their steps."""

    legend = "thick line: with a load"

    def __init__(self, site: Mapd, from_us: int | None, until_us: int | None) -> None:
        super().__init__(site, from_us, until_us)
        #: For each panel the row of each cell.
        self._rows: list[list[float]] = []
        floor = site.floor
        if site.rows:
            wide = len(site.rows[0])
            self.panels = [
                Panel("columns", [str(column) for column in range(wide)]),
                Panel("rows", [str(row) for row in range(len(site.rows))]),
            ]
            self._rows.append([float(cell % wide) for cell in range(floor.size)])
            self._rows.append([float(cell // wide) for cell in range(floor.size)])
        else:
            order = by_distance([[float(far) for far in floor.steps_to(cell)] for cell in range(floor.size)])
            named = {*site.endpoints, *site.homes.values()}
            self.panels = [Panel("cells", [floor.names[cell] if cell in named else "" for cell in order])]
            self._rows.append([float(order.index(cell)) for cell in range(floor.size)])
        self._lines: dict[int, list[PanelLine]] = {}

    def take(self, message: Message, fact: Fact | None, time_us: int) -> None:
        """A robot has come to its next cell."""
        if not isinstance(fact, CellTold):
            return
        word = fact.word
        width = _LOADED if word.loaded else _EMPTY
        lines = self._lines.get(word.sender, [])
        spots = [rows[word.cell] for rows in self._rows]
        for line, spot in zip(lines, spots, strict=False):
            line.points.append((time_us, spot))
        if lines and lines[0].width == width:
            return
        lines = self._lines[word.sender] = [PanelLine(word.sender, [(time_us, spot)], width) for spot in spots]
        for panel, line in zip(self.panels, lines, strict=True):
            panel.lines.append(line)

    def end(self, time_us: int) -> None:
        """Robots stay where they came last."""
        for lines in self._lines.values():
            for line in lines:
                line.points.append((time_us, line.points[-1][1]))


DIAGRAM = MapdDiagram
