"""Doors of compartments, from their device buses (docs/decisions.md, flag 5)."""

from collections.abc import Callable

from onboard.contract.codes import DoorAction, DoorName, DoorPosition, ShuttleMode
from onboard.contract.messages import BayState, DoorOrder, DoorState, ShuttleState
from onboard.trace.check.event import Finding, LogEvent
from onboard.trace.check.picture import BusPicture
from onboard.trace.check.rule import Handlers, Rule
from onboard.ways.site import way_site

_Seen = LogEvent[DoorState] | LogEvent[BayState] | LogEvent[ShuttleState]
#: Positions in which nobody passes a door.
_SHUT = (DoorPosition.CLOSING, DoorPosition.CLOSED, DoorPosition.LOCKED, DoorPosition.FORCED)


class Doors(Rule):
    """One of a compartment's doors is always locked; no person and no shuttle is inside behind the wrong one.

    A state that lasts is told once.
    """

    name = "doors"
    title = "one door locked, nobody with the machines"
    source = "docs/decisions.md, flag 5; issue 4, point 1"
    on_devices = True

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._doors: dict[int, DoorState] = {}
        self._inside: dict[int, bool] = {}
        self._shuttles: dict[int, ShuttleState] = {}
        self._told: set[tuple[int, str]] = set()

    def handlers(self) -> Handlers:
        """Reads doors, orders to them, bays and shuttles."""
        return {
            DoorState: self._on_doors,
            DoorOrder: self._on_order,
            BayState: self._on_bay,
            ShuttleState: self._on_shuttle,
        }

    def _on_order(self, event: LogEvent[DoorOrder]) -> None:
        """A door is told to open only while the other one is locked, and the inner one with nobody inside."""
        order = event.message
        doors = self._doors.get(order.sender)
        if doors is None or order.action is not DoorAction.OPEN:
            return
        inner = order.door is DoorName.OUTPUT
        other = doors.input_door if inner else doors.output_door
        if other is not DoorPosition.LOCKED:
            self.find(event, (order.sender,), f"{order.door.name} is told to open while the other is {other.name}")
        elif inner and self._inside.get(order.sender):
            self.find(event, (order.sender,), "the output door is told to open with a person inside")

    def _on_doors(self, event: LogEvent[DoorState]) -> None:
        state = event.message
        self._doors[state.sender] = state
        locked = DoorPosition.LOCKED
        both = state.input_door is not locked and state.output_door is not locked
        self._state(event, state.sender, "neither door is locked", holds=both)
        self._judge_person(event, state.sender)
        self._judge_shuttles(event, state.sender)

    def _on_bay(self, event: LogEvent[BayState]) -> None:
        node, inside = event.message.sender, event.message.person_inside
        doors, before = self._doors.get(node), self._inside.get(node, inside)
        # Of a door that was opening the word that it is open may be lost: only one that was shut is passed by nobody.
        if doors is not None and inside is not before and doors.input_door in _SHUT:
            self.find(event, (node,), f"a person passes the input door, which is {doors.input_door.name}")
        self._inside[node] = inside
        self._judge_person(event, event.message.sender)

    def _judge_person(self, event: _Seen, node: int) -> None:
        doors = self._doors.get(node)
        holds = doors is not None and self._inside.get(node, False) and doors.output_door is not DoorPosition.LOCKED
        self._state(event, node, "a person is inside while the output door is not locked", holds=holds)

    def _on_shuttle(self, event: LogEvent[ShuttleState]) -> None:
        self._shuttles[event.message.sender] = event.message
        if self.picture.has_site:
            for node in way_site(self.picture.site).compartments:
                self._judge_shuttles(event, node)

    def _judge_shuttles(self, event: _Seen, node: int) -> None:
        """No shuttle is in a bay whose output door is not open."""
        doors = self._doors.get(node)
        if doors is None or not self.picture.has_site or node not in way_site(self.picture.site).compartments:
            return
        bay = way_site(self.picture.site).compartments[node]
        for robot, state in self._shuttles.items():
            body = self.picture.bodies.get(robot)
            out = state.extension_mm > 0 or state.mode not in (ShuttleMode.HOME, ShuttleMode.FAULT)
            inside = out and body is not None and (body.track, body.index, state.side) == bay
            what = f"the shuttle of {robot} is in the bay while its door is not open"
            self._state(event, node, what, holds=inside and doors.output_door is not DoorPosition.OPEN)

    def _state(self, event: _Seen, node: int, what: str, *, holds: bool) -> None:
        if holds and (node, what) not in self._told:
            self._told.add((node, what))
            self.find(event, (node,), what)
        elif not holds:
            self._told.discard((node, what))
