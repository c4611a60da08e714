"""The body of a shipped compartment: doors that are at once where they are ordered, and a bay with or without a car."""

from dataclasses import dataclass
from typing import NamedTuple

from onboard.contract.codes import DoorAction, DoorName, DoorPosition, LightColour
from onboard.contract.messages import BayState, DoorOrder, DoorState, Message
from tests.models.at_work import Body


class DoorsState(NamedTuple):
    """Where the doors are."""

    input_door: DoorPosition = DoorPosition.LOCKED
    output_door: DoorPosition = DoorPosition.LOCKED


@dataclass
class BayBody(Body):
    """Doors and bay of one compartment; ``load_kg`` is in it all the time."""

    node: int
    now: DoorsState
    load_kg: int

    @property
    def state(self) -> DoorsState:
        """Where the doors are."""
        return self.now

    def start(self) -> list[Message]:
        """Doors and bay are told."""
        length_mm, height_mm, wheelbase_mm = (4_500, 1_500, 2_700) if self.load_kg else (0, 0, 0)
        bay = BayState(
            self.node,
            load_kg=self.load_kg,
            length_mm=length_mm,
            height_mm=height_mm,
            width_mm=1_800 if self.load_kg else 0,
            wheelbase_mm=wheelbase_mm,
            person_inside=False,
            carrier_in_front=False,
        )
        return [self._doors(), bay]

    def _doors(self) -> DoorState:
        return DoorState(self.node, self.now.input_door, self.now.output_door, LightColour.RED)

    def order(self, order: Message) -> list[Message]:
        """A door is open, or locked; never both open."""
        if not isinstance(order, DoorOrder):
            return []
        position = DoorPosition.OPEN if order.action is DoorAction.OPEN else DoorPosition.LOCKED
        is_input = order.door is DoorName.INPUT
        other = self.now.output_door if is_input else self.now.input_door
        if position is DoorPosition.OPEN and other is not DoorPosition.LOCKED:
            return []
        self.now = self.now._replace(**{"input_door" if is_input else "output_door": position})
        return [self._doors()]
