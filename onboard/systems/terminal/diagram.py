"""A terminal over time: rows for lanes from entry to end, for areas, crossings and stations; vehicles in them."""

from onboard.contract.codes import TokenKind
from onboard.contract.messages import Message
from onboard.contract.terminal import LaneState
from onboard.history.history import Fact
from onboard.history.rights import RightTold
from onboard.systems.terminal.history import LaneTold, StepTold, terminal_history
from onboard.systems.terminal.site import EntityKind, Terminal
from onboard.trace.chart.over_time import Bar, Panel, PanelLine, Rows

#: A lane has as many rows as slots, but at most so many.
_MOST_ROWS = 4


class TerminalDiagram(Rows):
    """Vehicles by the steps that they report; a bar where a slot's right is held, or a lane is blocked."""

    legend = "line: on its way or at a station; bar: right held; grey bar: lane blocked"

    def __init__(self, site: Terminal, from_us: int | None, until_us: int | None) -> None:
        super().__init__(site, from_us, until_us)
        self._site = site
        names: list[str] = []
        #: First row of each entity, and how many it has.
        self._places: dict[int, tuple[int, int]] = {}
        for one in sorted(site.entities.values(), key=lambda one: (list(EntityKind).index(one.kind), one.number)):
            count = max(1, min(_MOST_ROWS, one.capacity)) if one.kind is EntityKind.LANE else 1
            self._places[one.number] = len(names), count
            names += [one.name, *[""] * (count - 1)]
        self._panel = Panel("entities", names)
        self.panels = [self._panel]
        self._vehicles = terminal_history(self.history).vehicles
        #: When each came to where it is.
        self._since_us: dict[int, int] = {}
        self._held: dict[int, tuple[int, int]] = {}
        self._blocked: dict[int, int] = {}

    def take(self, message: Message, fact: Fact | None, time_us: int) -> None:
        """Plans, reports on their steps, rights, lanes."""
        match fact:
            case StepTold(is_news=True):
                self._on_done(fact)
            case RightTold(kind=TokenKind.SEGMENT, giver=0) if fact.holder in self._vehicles:
                self._let_go(fact.number, time_us)
                self._held[fact.number] = fact.holder, time_us
            case RightTold(kind=TokenKind.SEGMENT) if fact.giver:
                self._let_go(fact.number, time_us)
            case LaneTold():
                self._on_lane(fact.word, time_us)

    def _on_done(self, told: StepTold) -> None:
        """One step was done: along a lane from its entry to its end, anywhere else in the middle."""
        node, until_us = told.report.sender, self.log_us(told.report.at_ms, self.last_us)
        since_us = self._since_us.get(node, self.first_us)
        self._since_us[node] = until_us
        if told.left not in self._places:
            return
        first, count = self._places[told.left]
        is_lane = self._site.entities[told.left].kind is EntityKind.LANE
        begin = end = self._beside(node, told.left)
        if is_lane:
            begin, end = first - 0.5, first + count - 0.5
        self._panel.lines.append(PanelLine(node, [(since_us, begin), (until_us, end)]))

    def _beside(self, node: int, entity: int) -> float:
        """Vehicles in one place stand side by side."""
        first, count = self._places.get(entity, (0, 1))
        vehicles = self._site.vehicles
        return first + (count - 1) / 2 + (vehicles.index(node) / max(1, len(vehicles) - 1) - 0.5) * 0.6

    def _let_go(self, token: int, time_us: int) -> None:
        node, since_us = self._held.pop(token, (0, 0))
        entity = self._site.entities.get(token >> 8)
        if not node or entity is None or entity.kind not in (EntityKind.LANE, EntityKind.CROSSING):
            return
        first, count = self._places[entity.number]
        slots = max(1, entity.capacity)
        low = first - 0.5 + count * ((token & 0xFF) - 1) / slots
        self._panel.bars.append(Bar(node, low, low + count / slots, since_us, time_us, opacity=0.3))

    def _on_lane(self, state: LaneState, time_us: int) -> None:
        if state.lane not in self._places:
            return
        if state.blocked:
            self._blocked.setdefault(state.lane, time_us)
        elif state.lane in self._blocked:
            self._block(state.lane, time_us)

    def _block(self, lane: int, time_us: int) -> None:
        first, count = self._places[lane]
        since_us = self._blocked.pop(lane)
        self._panel.bars.append(Bar(0, first - 0.5, first + count - 0.5, since_us, time_us, "blocked", 0.45))

    def end(self, time_us: int) -> None:
        """What goes on ends with the log; where a vehicle stands on its way is not known then."""
        for token in list(self._held):
            self._let_go(token, time_us)
        for lane in list(self._blocked):
            self._block(lane, time_us)
        for node, vehicle in self._vehicles.items():
            row = self._beside(node, vehicle.entity)
            self._panel.lines.append(PanelLine(node, [(self._since_us.get(node, self.first_us), row), (time_us, row)]))


DIAGRAM = TerminalDiagram
