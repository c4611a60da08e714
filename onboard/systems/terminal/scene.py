"""The terminal's plan: vehicles on the lanes along their plans, boxes at stations, blocked lanes, slots held.

The fleet bus tells which elementary action a vehicle is at, and when it should be over; where its device bus is heard
as well, the slot that it is in counts.
"""

from dataclasses import dataclass, field

from onboard.contract.codes import TokenKind
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import CarAt, Message
from onboard.contract.terminal import Action, MoveMode
from onboard.contract.terminal_device import MoveState
from onboard.history.history import Fact
from onboard.history.loads import LoadTold
from onboard.systems.terminal.chart import BAY, MARGIN, chart_of
from onboard.systems.terminal.history import LaneTold, LegTold, RouteTold, StepTold, VehicleSeen, terminal_history
from onboard.systems.terminal.site import EntityKind, Terminal
from onboard.trace.scene.scene import NEARLY, Json, Spot, along, part, shape, spot_on, still
from onboard.trace.view import SiteView

_DRIVING = Action.GOTO


@dataclass
class _SeenVehicle:
    """How one vehicle is drawn: the entity where it is shown, since when, and how it moves meanwhile."""

    entity: int
    since_us: int = 0
    slot: int = 0
    is_still: bool = False
    path: list[list[float]] = field(default_factory=list)


class TerminalScene:
    """Fed beside ``view``, which knows the calls."""

    def __init__(self, site: Terminal, view: SiteView) -> None:
        self.site = site
        self.view = view
        self.words = view.words
        self._clock = view.history.clock
        self._rights = view.history.rights
        self._bodies = {node: _SeenVehicle(site.machines[node].home.track) for node in site.vehicles}
        self._seen = terminal_history(view.history)
        self._boxes = {number: box.station for number, box in enumerate(site.boxes, start=1)}
        chart = chart_of(site)
        self._spots, self._corners, self._lines = chart.spots, chart.corners, chart.lines
        for node, body in self._bodies.items():
            body.path = still(self._bay(node, body.entity))

    # --- the drawing -------------------------------------------------------------------------------------------

    def layout(self) -> Json:
        """The network; lanes are lines, crossings points, areas and stations rectangles."""
        shapes, width, height = [], 0.0, 0.0
        for one in self.site.entities.values():
            name = str(one.number)
            match one.kind:
                case EntityKind.LANE:
                    shapes.append(shape(name, "lane", one.name, self._lines[one.number], slots=one.capacity))
                case EntityKind.CROSSING:
                    shapes.append(shape(name, "node", one.name, [self._spots[one.number]]))
                case EntityKind.AREA | EntityKind.STATION:
                    corners = self._corners[one.number]
                    kind = "area" if one.kind is EntityKind.AREA else "station"
                    shapes.append(shape(name, kind, one.name, corners, room=one.room))
                    width, height = max(width, corners[1][0]), max(height, corners[1][1])
        for one in self.site.entities.values():
            for other in one.leads_to:
                if other in self._spots and one.number in self._spots and not self._is_lane(one.number, other):
                    ends = [self._spots[one.number], self._spots[other]]
                    shapes.append(shape(f"{one.number}-{other}", "link", "", ends))
        width = max([width, *(x for x, _ in self._spots.values())]) + MARGIN
        height = max([height, *(y for _, y in self._spots.values())]) + MARGIN
        lanes = [one.name for one in self.site.entities.values() if one.kind is EntityKind.LANE]
        return {"plan": {"width": width, "height": height, "shapes": shapes}, "blockable": lanes}

    def _is_lane(self, *numbers: int) -> bool:
        return any(self.site.entities[number].kind is EntityKind.LANE for number in numbers)

    # --- in ----------------------------------------------------------------------------------------------------

    def take(self, message: Message, fact: Fact | None, time_us: int) -> None:
        """Follow vehicles, lanes, boxes and missions for the plan."""
        match fact:
            case RouteTold(goes_on=False):
                begin_us = self._clock.log_us(self._seen.vehicles[fact.node].begin_ms, time_us)
                self._bodies[fact.node].since_us = begin_us or time_us
            case LegTold(step=step) if step.step == self._seen.vehicles[step.sender].current:
                self._go(step.sender, time_us)
            case StepTold(report=report, is_news=True):
                self._bodies[report.sender].since_us = self._clock.log_us(report.at_ms, time_us) or time_us
                self._go(report.sender, time_us)
            case LaneTold(word=word, is_news=True):
                words = "is blocked" if word.blocked else "is free again"
                self.view.say(time_us, f"{self.words.place(word.lane)} {words}")
            case LoadTold(word=word):
                self._on_box(word)

    def _on_box(self, word: CarAt) -> None:
        """The newest at a station is the last in its row."""
        if self._boxes.pop(word.car.number, None) is not None:
            self._boxes[word.car.number] = 0 if word.station == ANY_STATION else word.station

    def feed_device(self, node: int, message: Message, time_us: int) -> None:
        """Follow a drive's slot and motion, where its bus is heard."""
        body = self._bodies.get(node)
        if body is None or not isinstance(message, MoveState):
            return
        is_still = message.mode is not MoveMode.MOVING
        if (message.entity, message.slot, is_still) == (body.entity, body.slot, body.is_still):
            return
        body.is_still = is_still
        if message.entity in self.site.entities and message.slot:
            body.entity, body.slot = message.entity, message.slot
            self._in_slot(node, body, time_us, at_end=message.at_end or is_still)

    def _go(self, node: int, time_us: int) -> None:
        """The step in hand begins."""
        body, vehicle = self._bodies[node], self._seen.vehicles[node]
        step = vehicle.step
        if step is None:
            return
        before_ms = vehicle.steps[vehicle.current - 1].end_ms if vehicle.current - 1 in vehicle.steps else 0
        length_us = max(0, step.end_ms - before_ms) * 1000
        if body.entity != step.entity or body.slot == 0:
            body.entity, body.slot = step.entity, 0
            line = self._lines.get(step.entity) if step.action is _DRIVING else None
            if line is not None:
                body.path = along(line, body.since_us, body.since_us + round(length_us * NEARLY), NEARLY)
            else:
                body.path = still(self._standing(node, step.entity), time_us)

    def _in_slot(self, node: int, body: _SeenVehicle, time_us: int, *, at_end: bool) -> None:
        """What the vehicle's own drive says: into this slot, evenly, or at its end."""
        entity = self.site.entities[body.entity]
        line = self._lines.get(body.entity)
        if line is None:
            body.path = still(self._standing(node, body.entity), time_us)
            return
        slots = max(1, entity.capacity)
        begin, end = (body.slot - 1) / slots, min(1.0, body.slot / slots)
        if at_end:
            body.path = still(spot_on(line, end * NEARLY), time_us)
        else:
            body.path = along(part(line, begin, end * NEARLY), time_us, time_us + entity.duration_us // slots)

    # --- out ---------------------------------------------------------------------------------------------------

    def machine(self, node: int, now_us: int) -> Json:
        """Where a vehicle is, what it does and which boxes it has; nothing of a desk."""
        body = self._bodies.get(node)
        if body is None:
            return {"where": "", "car": None}
        aboard = self.view.history.loads.aboard.get(node)
        vehicle = self._seen.vehicles[node]
        step = vehicle.step
        doing = step.action.name.lower().replace("_", " ") if step is not None and step.action is not _DRIVING else ""
        told: list[list[object]] = []
        for later in vehicle.to_come():
            end_us = self._clock.log_us(vehicle.begin_ms + later.end_ms, now_us)
            what = later.action.name.lower().replace("_", " ")
            told.append([end_us, f"{what} {self.words.place(later.entity)}"])
        return {
            "where": f"{self.words.place(body.entity)}{f', {doing}' if doing else ''}",
            "car": self.words.load(aboard) if aboard is not None else None,
            "path": body.path,
            "ahead": self._ahead(node, vehicle),
            "held": self._held(node),
            "told": told,
        }

    def _ahead(self, node: int, vehicle: VehicleSeen) -> list[str | list[float]]:
        """The way to come: lanes by their shapes, the one in hand too; other places by their spots."""
        found: list[str | list[float]] = []
        for step in vehicle.to_come():
            if step.entity in self._lines:
                one: str | list[float] = str(step.entity)
            elif self.site.entities[step.entity].kind is EntityKind.AREA:
                continue
            else:
                x, y = self._standing(node, step.entity)
                one = [round(x, 1), round(y, 1)]
            if not found or found[-1] != one:
                found.append(one)
        return found

    def _held(self, node: int) -> list[list[object]]:
        """Lanes with the piece of them that is held, and crossings."""
        found: list[list[object]] = []
        for number in self._rights.held_by(node, TokenKind.SEGMENT):
            entity = self.site.entities.get(number >> 8)
            if entity is None or entity.kind is EntityKind.AREA:
                continue
            slots, slot = max(1, entity.capacity), number & 0xFF
            line = self._lines.get(entity.number)
            piece = part(line, (slot - 1) / slots, min(1.0, slot / slots)) if line is not None else []
            found.append([str(entity.number), [[round(x, 1), round(y, 1)] for x, y in piece]])
        return found

    def marks(self, now_us: int) -> Json:
        """Stations with the boxes that stand there, and blocked lanes."""
        marks: Json = {}
        for one in self.site.entities.values():
            if one.kind is EntityKind.STATION:
                row = [self.site.boxes[number - 1].name for number, at in self._boxes.items() if at == one.number]
                marks[str(one.number)] = {"count": len(row), "lines": row}
        for lane, blocked in self._seen.blocked.items():
            if blocked:
                marks[str(lane)] = {"state": "blocked", "lines": ["blocked"]}
        return {"marks": marks, "things": []}

    # --- spots -------------------------------------------------------------------------------------------------

    def _bay(self, node: int, area: int) -> Spot:
        """A vehicle's own bay in an area."""
        if area not in self._corners:
            return self._spots[area]
        (x0, _), (x1, y1) = self._corners[area]
        rank, count = self.site.vehicles.index(node), len(self.site.vehicles)
        return x0 + (x1 - x0) * (rank + 0.5) / count, y1 - BAY / 2

    def _standing(self, node: int, entity: int) -> Spot:
        """Where a vehicle is drawn that is at a station, in an area, or on a crossing."""
        place = self.site.entities[entity]
        if place.kind is EntityKind.STATION:
            (x0, _), (x1, y1) = self._corners[entity]
            return (x0 + x1) / 2, y1
        return self._bay(node, entity)


SCENE = TerminalScene
