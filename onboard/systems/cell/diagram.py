"""A cell over time: a row an arm, bars for what it does, and a line for each part that goes from arm to arm."""

from onboard.contract.cell import ArmPhase, PartAt
from onboard.contract.messages import Message, Reference
from onboard.history.history import Fact
from onboard.systems.cell.history import ArmTold, PartTold
from onboard.systems.cell.site import Cell
from onboard.trace.chart.over_time import Bar, Panel, PanelLine, Rows

#: What is shown as a bar, and how dark.
_OPACITY = {
    ArmPhase.TO_PART: 0.22,
    ArmPhase.TAKING: 0.4,
    ArmPhase.CARRYING: 0.6,
    ArmPhase.PUTTING: 0.4,
}


class CellDiagram(Rows):
    """Arms by their phases, and parts by who has them or put them down last."""

    legend = "light bar: goes to a part; dark bar: carries it; line: a part's way from arm to arm"

    def __init__(self, site: Cell, from_us: int | None, until_us: int | None) -> None:
        super().__init__(site, from_us, until_us)
        desks = [node for node in site.desks if node not in site.arms]
        order = [*desks, *site.arms]
        self._rows = {node: row for row, node in enumerate(order)}
        self._panel = Panel("arms", [self.words.machine(node) for node in order])
        self.panels = [self._panel]
        self._phases: dict[int, tuple[ArmPhase, int]] = {}
        self._carried: dict[int, Reference] = {}
        self._parts: dict[Reference, list[tuple[int, float]]] = {}

    def take(self, message: Message, fact: Fact | None, time_us: int) -> None:
        """Arms tell their phases; who has a part in its keeping tells where it is."""
        match fact:
            case ArmTold(word=word) if word.sender in self._rows:
                self._on_phase(word.sender, word.arm_phase, time_us)
            case PartTold(word=at) if at.sender in self._rows:
                self._on_part(at, time_us)

    def _on_phase(self, node: int, phase: ArmPhase, time_us: int) -> None:
        known, since_us = self._phases.get(node, (ArmPhase.IDLE, time_us))
        if known is phase and node in self._phases:
            return
        if known in _OPACITY:
            row, part = self._rows[node], self._carried.get(node)
            text = self.words.thing(part) if known is ArmPhase.CARRYING and part is not None else ""
            self._panel.bars.append(Bar(node, row - 0.35, row + 0.35, since_us, time_us, text, _OPACITY[known]))
        self._phases[node] = phase, time_us

    def _on_part(self, at: PartAt, time_us: int) -> None:
        # Along the upper edge of the bars, which have words in them.
        points, row = self._parts.setdefault(at.part, []), self._rows[at.sender] - 0.42
        if at.aboard:
            self._carried[at.sender] = at.part
        if points and points[-1][1] != row:
            points.append((time_us, points[-1][1]))
        points.append((time_us, row))

    def end(self, time_us: int) -> None:
        """What goes on ends with the log."""
        for node in list(self._phases):
            self._on_phase(node, ArmPhase.IDLE, time_us)
        self._panel.lines += [PanelLine(0, points, width=1.2) for points in self._parts.values()]


DIAGRAM = CellDiagram
