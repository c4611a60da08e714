"""Doors of compartments, from their device buses (docs/decisions.md, flag 5)."""

from collections.abc import Callable

from onboard.core.codes import DoorPosition, Side
from onboard.core.messages import BayState, DoorState, ShuttleState
from onboard.trace.check.event import Event, Finding
from onboard.trace.check.picture import Picture
from onboard.trace.check.rule import Handlers, Rule


class Doors(Rule):
    """One of a compartment's doors is always locked; no person and no shuttle is inside behind the wrong one.

    A state that lasts is told once.
    """

    name = "doors"
    title = "one door locked, nobody with the machines"
    source = "docs/decisions.md, flag 5; issue 4, point 1"
    on_devices = True

    def __init__(self, picture: Picture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._doors: dict[int, DoorState] = {}
        self._inside: dict[int, bool] = {}
        self._told: set[tuple[int, str]] = set()

    def handlers(self) -> Handlers:
        """Doors, bays and shuttles."""
        return {DoorState: self._on_doors, BayState: self._on_bay, ShuttleState: self._on_shuttle}

    def _on_doors(self, event: Event[DoorState]) -> None:
        state = event.message
        self._doors[state.sender] = state
        locked = DoorPosition.LOCKED
        both = state.input_door is not locked and state.output_door is not locked
        self._state(event, state.sender, "neither door is locked", holds=both)
        self._judge_person(event, state.sender)

    def _on_bay(self, event: Event[BayState]) -> None:
        self._inside[event.message.sender] = event.message.person_inside
        self._judge_person(event, event.message.sender)

    def _judge_person(self, event: Event[DoorState] | Event[BayState], node: int) -> None:
        doors = self._doors.get(node)
        holds = doors is not None and self._inside.get(node, False) and doors.output_door is not DoorPosition.LOCKED
        self._state(event, node, "a person is inside while the output door is not locked", holds=holds)

    def _on_shuttle(self, event: Event[ShuttleState]) -> None:
        state = event.message
        body = self.picture.bodies.get(state.sender)
        if body is None or not state.extension_mm or not self.picture.has_site:
            return
        for node, bay in self.picture.site.compartments.items():
            beside = (bay.track, bay.index, bay.side) == (body.track, body.index, Side(state.side))
            doors = self._doors.get(node)
            if beside and doors is not None and doors.output_door is not DoorPosition.OPEN:
                self.find(event, (state.sender, node), f"a shuttle is in the bay, its door {doors.output_door.name}")

    def _state(self, event: Event[DoorState] | Event[BayState], node: int, what: str, *, holds: bool) -> None:
        if holds and (node, what) not in self._told:
            self._told.add((node, what))
            self.find(event, (node,), what)
        elif not holds:
            self._told.discard((node, what))
