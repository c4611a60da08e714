"""What a compartment has ordered its doors, light and desk to do, said again until their states show it.

An actuator may miss an order: its plug was out, its board was starting. States come unasked and again and again, so
each one that still shows the old picture a while after the order is answered by the order. All orders are settings,
which do nothing when they come twice; a desk that hears the number of its last order prints no second ticket.
"""

from dataclasses import dataclass, field

from onboard.contract.car_park_device import DeskPromise
from onboard.contract.codes import DeskText, DoorAction, DoorName, DoorPosition, LightColour, Reason
from onboard.contract.constants import NOBODY
from onboard.contract.messages import BayState, DeskOrder, DoorOrder, DoorState, LightOrder, Reference, TicketPrint
from onboard.core.authority import TokenKey
from onboard.core.effects import Effect, Record, Tell
from onboard.core.motion_authority import ALONE, MotionAuthority, Permit, authorised
from onboard.core.serial import successor
from onboard.systems.car_park.records import DoorRecord
from onboard.systems.car_park.tickets import TicketCodes
from onboard.systems.car_park.unheard import Unheard

#: A desk tells nobody what it shows: its last order is said again with so many states of the bay: a second at the
#: sensors' pace.
DESK_TIMES = 4
#: The longest wait that a desk can show, ms: 24 bits (dbc/car_park.dbc).
MOST_PROMISED_MS = (1 << 24) - 1

#: By these somebody comes to what is in the bay, or is shut in with it: not while another machine holds the bay.
_INTO_THE_BAY = ((DoorName.INPUT, DoorAction.OPEN), (DoorName.OUTPUT, DoorAction.CLOSE))
#: Where a door is that has heard an order. One that found something in its way has opened again by itself, and closes
#: when it is told once more or when the way is clear.
_HEARD = {
    DoorAction.OPEN: (DoorPosition.OPENING, DoorPosition.OPEN),
    DoorAction.CLOSE: (DoorPosition.CLOSING, DoorPosition.CLOSED, DoorPosition.LOCKED),
}


@dataclass
class BayOutputs:
    """Orders of one compartment; ``light`` is the colour last ordered, ``bay`` the right to its bay."""

    node_id: int
    motion: MotionAuthority
    bay: TokenKey
    codes: TicketCodes
    light: LightColour | None = None
    _sequence: int = 0
    _doors: dict[DoorName, DoorOrder] = field(default_factory=dict)
    _desk: DeskOrder | None = None
    _desk_left: int = 0
    #: The promise that the desk shows beside its text: of which car, when it will be there, bus us, and the spread, us.
    _promise: tuple[Reference, int, int] | None = None
    #: The code of the ticket that the desk's last order prints, or the next one will.
    _print: list[TicketPrint] = field(default_factory=list)
    _unheard: Unheard = field(default_factory=Unheard)

    def door(self, door: DoorName, action: DoorAction) -> list[Effect]:
        """Order a door once; the plant's interlock refuses what must not be, and the phase then waits.

        What is not permitted yet is ordered with a later state of the doors.
        """
        last = self._doors.get(door)
        if last is not None and last.action is action:
            return []
        order = self._doors[door] = DoorOrder(self.node_id, self._next(), door, action)
        self._unheard.ordered(door)
        return [Record(DoorRecord(door, action)), *self._permit(door, action).order(order)]

    def _permit(self, door: DoorName, action: DoorAction) -> Permit:
        """A compartment that begins its first life opens to customers before others have confirmed its rights."""
        is_away = (door, action) in _INTO_THE_BAY and not self.motion.tokens.is_mine_by_journal(self.bay)
        return authorised(self.motion, ALONE, Reason.TOKEN_HELD_BY_OTHER if is_away else Reason.NONE)

    def show(self, text: DeskText, car: Reference, compartment: int = NOBODY) -> Effect:
        """What the desk is to show, printing aside; GO_TO names the compartment to which the car comes."""
        self._print = []
        return self._order_desk(self._next(), text, car, compartment)

    def promise(self, car: Reference, ready_us: int, spread_us: int, now_us: int) -> Effect:
        """When a car will be there, for the desk to show beside its text; bus us."""
        self._promise, self._desk_left = (car, ready_us, spread_us), DESK_TIMES
        self._unheard.ordered("desk")
        return self._promised(now_us)

    def _promised(self, now_us: int) -> Effect:
        assert self._promise is not None
        car, ready_us, spread_us = self._promise
        in_ms = min(max(0, ready_us - now_us) // 1000, MOST_PROMISED_MS)
        return Tell(DeskPromise(self.node_id, car, in_ms, spread_us // 1000))

    @property
    def shown(self) -> tuple[DeskText, Reference] | None:
        """What the desk was ordered to show last, and about which car; None before the first order."""
        return None if self._desk is None else (self._desk.text, self._desk.car)

    def prepare_ticket(self, car: Reference) -> list[Effect]:
        """The code goes before all else, so that it is there when what the ticket stands for is on the disk."""
        self._print = self.codes.halves(self.node_id, self._next(), car)
        return [Tell(half) for half in self._print]

    def print_ticket(self, car: Reference) -> Effect:
        """TAKE_TICKET, under the number that its code was prepared with."""
        return self._order_desk(self._print[0].sequence, DeskText.TAKE_TICKET, car)

    def reprint(self, car: Reference) -> list[Effect]:
        """The same ticket once more: a code does not change."""
        return [*self.prepare_ticket(car), self.print_ticket(car)]

    def _order_desk(self, sequence: int, text: DeskText, car: Reference, compartment: int = NOBODY) -> Effect:
        self._desk, self._desk_left = DeskOrder(self.node_id, sequence, text, car, compartment), DESK_TIMES
        self._promise = None
        self._unheard.ordered("desk")
        return Tell(self._desk)

    def light_up(self, colour: LightColour) -> Effect:
        """The light before the input door."""
        self.light = colour
        self._unheard.ordered("light")
        return Tell(LightOrder(self.node_id, colour))

    def again(self, state: DoorState | BayState, now_us: int) -> list[Effect]:
        """What a state shows as not heard; time in us."""
        return self._doors_again(state, now_us) if isinstance(state, DoorState) else self._desk_again(now_us)

    def _doors_again(self, state: DoorState, now_us: int) -> list[Effect]:
        where = {DoorName.INPUT: state.input_door, DoorName.OUTPUT: state.output_door}
        orders = [
            effect
            for door, order in self._doors.items()
            if self._unheard.is_due(door, now_us, heard=where[door] in _HEARD[order.action])
            for effect in self._permit(door, order.action).order(order)
        ]
        if self.light is not None and self._unheard.is_due("light", now_us, heard=state.light is self.light):
            orders.append(Tell(LightOrder(self.node_id, self.light)))
        return orders

    def _desk_again(self, now_us: int) -> list[Effect]:
        if self._desk is None or not self._desk_left or not self._unheard.is_due("desk", now_us, heard=False):
            return []
        self._desk_left -= 1
        promised = [] if self._promise is None else [self._promised(now_us)]
        return [*(Tell(half) for half in self._print), Tell(self._desk), *promised]

    def _next(self) -> int:
        self._sequence = successor(self._sequence, 8)
        return self._sequence
