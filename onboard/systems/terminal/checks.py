"""Rules of a container terminal, from a log alone: bodies, rights, boxes, the order on lanes, plans as told."""

from collections.abc import Callable
from typing import NamedTuple

from onboard.contract.codes import TokenKind
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import CarAt
from onboard.contract.terminal import PlanHead, PlanStep, StepReport, StepResult
from onboard.contract.terminal_device import HandlerState, MoveOrder, MoveState
from onboard.systems.terminal.site import Entity, EntityKind, Terminal
from onboard.trace.check.calls import BidsGoDown, BidsInTime, CallsClosed
from onboard.trace.check.event import Finding, LogEvent
from onboard.trace.check.holds import HoldAnswered, LetGoAgain
from onboard.trace.check.picture import BusPicture
from onboard.trace.check.rights import OneHolder
from onboard.trace.check.rule import Handlers, Rule
from onboard.trace.check.tokens_seen import Token


class EntitySlot(NamedTuple):
    """One body's room on an entity: the entity's number, and the slot in it."""

    entity: int
    slot: int


class _TerminalRule(Rule):
    """A rule that looks entities up."""

    needs_site = True

    def entity(self, number: int) -> Entity | None:
        """The entity of a number, None where the site has none, or is another system's."""
        site = self.picture.site
        return site.entities.get(number) if isinstance(site, Terminal) else None

    def name_of(self, slot: EntitySlot) -> str:
        """A slot for people."""
        entity = self.entity(slot.entity)
        return f"slot {slot.slot} of {entity.name if entity is not None else slot.entity}"


class OneBodyInSlot(_TerminalRule):
    """Two vehicles' drives never say that they are in one slot, and a lane or station never holds more than it may."""

    name = "one-body-a-slot"
    title = "never two vehicles in one slot, nor more in an entity than it holds"
    source = "rows M15, M19, decision on flag 8; design 5"
    on_devices = True

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._at: dict[int, EntitySlot] = {}

    def handlers(self) -> Handlers:
        """Reads where drives say that they are."""
        return {MoveState: self._on_state}

    def _on_state(self, event: LogEvent[MoveState]) -> None:
        state = event.message
        here = EntitySlot(state.entity, state.slot)
        if self._at.get(state.sender) == here:
            return
        self._at[state.sender] = here
        others = [node for node, at in self._at.items() if at == here and node != state.sender]
        if others:
            self.find(event, (*others, state.sender), f"both in {self.name_of(here)}")
        entity = self.entity(state.entity)
        inside = [node for node, at in self._at.items() if at.entity == state.entity]
        if entity is not None and entity.capacity and len(inside) > entity.capacity:
            self.find(event, tuple(inside), f"{len(inside)} in {entity.name}, which holds {entity.capacity}")


class MovesByRight(_TerminalRule):
    """A vehicle orders its drive only into slots whose tokens it holds; in an area it has a bay of its own."""

    name = "moves-by-right"
    title = "orders to drives only into slots held"
    source = "design 5: authorised() before each movement order"
    on_devices = True

    def handlers(self) -> Handlers:
        """Reads the orders that drives are given."""
        return {MoveOrder: self._on_order}

    def _on_order(self, event: LogEvent[MoveOrder]) -> None:
        order = event.message
        entity = self.entity(order.entity)
        if entity is None or entity.kind is EntityKind.AREA:
            return
        token = Token(TokenKind.SEGMENT, order.entity << 8 | order.slot)
        holder = self.picture.tokens.holder(token)
        self.picture.unjudged += holder is None
        if not self.picture.tokens.may_use(token, order.sender, event.time_us):
            here = self.name_of(EntitySlot(order.entity, order.slot))
            self.find(event, (order.sender,), f"is sent into {here}, which {holder} holds")


class BoxInOnePlace(_TerminalRule):
    """No two vehicles carry one box, and whoever says where a box is holds the right to it."""

    name = "box-in-one-place"
    title = "no box twice, none stated without the right to it"
    source = "row M07; design 5: one holder a token"

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._aboard: dict[int, int] = {}

    def handlers(self) -> Handlers:
        """Reads labels that handlers see, and statements about boxes."""
        return {HandlerState: self._on_state, CarAt: self._on_statement}

    def _on_state(self, event: LogEvent[HandlerState]) -> None:
        state = event.message
        if self._aboard.get(state.sender, 0) == state.box:
            return
        self._aboard[state.sender] = state.box
        others = [node for node, box in self._aboard.items() if box and box == state.box and node != state.sender]
        if others:
            self.find(event, (*others, state.sender), f"box {state.box} is aboard of both")

    def _on_statement(self, event: LogEvent[CarAt]) -> None:
        statement = event.message
        token = Token(TokenKind.CAR, statement.car.origin << 16 | statement.car.number)
        if statement.station == ANY_STATION and not self.picture.tokens.may_use(token, statement.sender, event.time_us):
            holder = self.picture.tokens.holder(token)
            what = f"says that box {statement.car.number} is aboard, and {holder} holds the right to it"
            self.find(event, (statement.sender,), what)


class NobodyOvertakes(_TerminalRule):
    """Vehicles leave a lane in the order in which they came, by their own reports."""

    name = "nobody-overtakes"
    title = "lanes are left in the order in which they were entered"
    source = "row M18"
    undisturbed = True

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._rows: dict[int, list[int]] = {}
        self._steps: dict[tuple[int, int, int], int] = {}

    def handlers(self) -> Handlers:
        """Plans and reports: the entity of the step after the one reported is entered."""
        return {PlanStep: self._on_step, StepReport: self._on_report}

    def _on_step(self, event: LogEvent[PlanStep]) -> None:
        step = event.message
        self._steps[step.sender, step.version, step.step] = step.entity

    def _on_report(self, event: LogEvent[StepReport]) -> None:
        report = event.message
        if report.result is not StepResult.DONE:
            return
        entered = self._steps.get((report.sender, report.version, report.step + 1), 0)
        if entered == report.entity:
            return
        left = self._rows.get(report.entity, [])
        if report.sender in left:
            if left[0] != report.sender:
                entity = self.entity(report.entity)
                name = entity.name if entity is not None else str(report.entity)
                self.find(event, (report.sender, left[0]), f"overtook on {name}")
            left.remove(report.sender)
        entity = self.entity(entered)
        if entity is not None and entity.kind is EntityKind.LANE:
            row = self._rows.setdefault(entered, [])
            if report.sender not in row:
                row.append(report.sender)


class PlansInOrder(_TerminalRule):
    """The steps of a plan follow each other in time and in the network (rows M09, M12)."""

    name = "plans-in-order"
    title = "a plan's steps follow each other in time and along the network"
    source = "rows M09, M12"

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._last: dict[int, PlanStep] = {}

    def handlers(self) -> Handlers:
        """Plans as they are told."""
        return {PlanHead: self._on_head, PlanStep: self._on_step}

    def _on_head(self, event: LogEvent[PlanHead]) -> None:
        self._last.pop(event.message.sender, None)

    def _on_step(self, event: LogEvent[PlanStep]) -> None:
        step = event.message
        last = self._last.get(step.sender)
        self._last[step.sender] = step
        if last is None or (last.version, last.step + 1) != (step.version, step.step):
            return
        if step.end_ms < last.end_ms:
            self.find(event, (step.sender,), f"step {step.step} ends before step {last.step}")
        before = self.entity(last.entity)
        if before is not None and step.entity != last.entity and step.entity not in before.leads_to:
            self.find(event, (step.sender,), f"{before.name} does not lead to entity {step.entity}")


#: What a terminal's log is judged by: the rules of all fleets that hold here, and its own.
RULES: tuple[type[Rule], ...] = (
    OneHolder,
    CallsClosed,
    BidsInTime,
    BidsGoDown,
    OneBodyInSlot,
    MovesByRight,
    BoxInOnePlace,
    NobodyOvertakes,
    PlansInOrder,
    LetGoAgain,
    HoldAnswered,
)
