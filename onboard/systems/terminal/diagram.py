"""A terminal over time: rows for lanes from entry to end, for areas, crossings and stations; vehicles in them."""

from dataclasses import dataclass, field

from onboard.contract.codes import TokenKind
from onboard.contract.messages import Message, TokenGrant, TokenHeld
from onboard.contract.terminal import LaneState, PlanHead, PlanStep, StepReport, StepResult
from onboard.systems.terminal.site import EntityKind, Terminal
from onboard.trace.chart.over_time import Bar, Panel, PanelLine, Rows

#: A lane has as many rows as slots, but at most so many.
_MOST_ROWS = 4


@dataclass
class _DrawnVehicle:
    """One vehicle: its plan as far as it was told, and the step that it is at since when."""

    steps: dict[int, PlanStep] = field(default_factory=dict)
    version: int | None = None
    begin_ms: int = 0
    current: int = 0
    entity: int = 0
    since_us: int | None = None


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
        self._bodies = {node: _DrawnVehicle(entity=site.machines[node].home.track) for node in site.vehicles}
        self._held: dict[int, tuple[int, int]] = {}
        self._blocked: dict[int, int] = {}

    def take(self, message: Message, time_us: int) -> None:
        """Plans, reports on their steps, rights, lanes."""
        body = self._bodies.get(message.sender)
        match message:
            case PlanHead() if body is not None and message.version != body.version:
                is_same = body.version is not None and message.begin_ms == body.begin_ms
                body.version, body.begin_ms, body.steps = message.version, message.begin_ms, {}
                body.current = body.current if is_same else 0
            case PlanStep() if body is not None and message.version == body.version:
                body.steps[message.step] = message
            case StepReport() if body is not None and message.result is StepResult.DONE:
                self._on_done(message, body)
            case TokenHeld() if message.token_kind is TokenKind.SEGMENT and body is not None:
                self._let_go(message.token, time_us)
                self._held[message.token] = message.sender, time_us
            case TokenGrant() if message.token_kind is TokenKind.SEGMENT:
                self._let_go(message.token, time_us)
            case LaneState():
                self._on_lane(message, time_us)

    def _on_done(self, report: StepReport, body: _DrawnVehicle) -> None:
        if report.version != body.version or report.step + 1 <= body.current:
            return
        time_us = self.log_us(report.at_ms, self.last_us)
        self._passed(report.sender, body, time_us)
        body.current, body.since_us = report.step + 1, time_us
        following = body.steps.get(body.current)
        body.entity = following.entity if following is not None else report.entity

    def _passed(self, node: int, body: _DrawnVehicle, until_us: int) -> None:
        """One step was done: along a lane from its entry to its end, anywhere else in the middle."""
        since_us = self.first_us if body.since_us is None else body.since_us
        if body.entity not in self._places:
            return
        first, count = self._places[body.entity]
        is_lane = self._site.entities[body.entity].kind is EntityKind.LANE
        begin = end = self._beside(node, body.entity)
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
        for node, body in self._bodies.items():
            since_us = self.first_us if body.since_us is None else body.since_us
            row = self._beside(node, body.entity)
            self._panel.lines.append(PanelLine(node, [(since_us, row), (time_us, row)]))


DIAGRAM = TerminalDiagram
