"""A vehicle's drive and handler: orders out, states in; an order is said again until it is carried out."""

from dataclasses import dataclass

from onboard.core.effects import Effect
from onboard.core.motion_authority import Permit
from onboard.core.serial import successor
from onboard.systems.terminal.messages import (
    Action,
    HandlerMode,
    HandlerOrder,
    HandlerState,
    MoveMode,
    MoveOrder,
    MoveState,
)

#: Orders are repeated so often, us (dbc/terminal.dbc).
REPEAT_US = 500_000


@dataclass
class Body:
    """One vehicle's devices. ``move`` and ``handler`` are what they said last, None before they spoke.

    What was ordered is said again only as far as what permitted it still does.
    """

    node_id: int
    move: MoveState | None = None
    handler: HandlerState | None = None
    move_order: MoveOrder | None = None
    handler_order: HandlerOrder | None = None
    due_us: int | None = None
    crossing: tuple[int, int] = (0, 0)
    _move_permit: Permit | None = None
    _handler_permit: Permit | None = None

    @property
    def is_known(self) -> bool:
        """Whether place and load are sensed, with a place in the site."""
        return self.move is not None and self.handler is not None and self.move.entity != 0

    @property
    def is_moving(self) -> bool:
        """Whether a move was ordered that is not carried out yet."""
        return self.move_order is not None

    @property
    def is_handling(self) -> bool:
        """Whether an action of the handler was ordered that is not over yet."""
        return self.handler_order is not None

    @property
    def is_at_rest(self) -> bool:
        """Whether it stands, with nothing ordered that is not over."""
        stands = self.move is not None and self.move.mode is not MoveMode.MOVING
        return stands and not self.is_moving and not self.is_handling

    @property
    def stands_ready(self) -> bool:
        """Whether the slot is crossed and nothing is ordered: the next may be entered."""
        return self.move is not None and not self.is_moving and self.move.at_end and self.move.mode is MoveMode.STANDING

    def sense(self, message: MoveState | HandlerState) -> None:
        """What a device says; the order that it carried out need not be repeated."""
        if isinstance(message, MoveState):
            self.move = message
            order = self.move_order
            arrived = order is not None and (message.entity, message.slot) == (order.entity, order.slot)
            if order is not None and message.sequence == order.sequence and arrived:
                self.move_order = None
        else:
            self.handler = message
            pending = self.handler_order
            over = message.gear is not HandlerMode.WORKING
            if pending is not None and message.sequence == pending.sequence and over:
                self.handler_order = None
        if self.move_order is None and self.handler_order is None:
            self.due_us = None

    def go(self, permit: Permit, entity: int, slot: int, towards: int, now_us: int) -> list[Effect]:
        """Order one slot, as far as that is permitted."""
        assert self.move is not None
        if not permit:
            return []
        self._move_permit = permit
        self.move_order = MoveOrder(self.node_id, successor(self.move.sequence, 8), entity, slot, towards)
        self.due_us = now_us + REPEAT_US
        self.crossing = (entity, towards)
        return permit.order(self.move_order)

    def towards(self) -> int:
        """For which entity the one in hand is being crossed, as ordered; 0 for none, or for not known."""
        return self.crossing[1] if self.move is not None and self.crossing[0] == self.move.entity else 0

    def handle(self, permit: Permit, action: Action, box: int, now_us: int) -> list[Effect]:
        """Order one action at a station, as far as that is permitted."""
        assert self.handler is not None
        if not permit:
            return []
        self._handler_permit = permit
        self.handler_order = HandlerOrder(self.node_id, successor(self.handler.sequence, 8), action, box)
        self.due_us = now_us + REPEAT_US
        return permit.order(self.handler_order)

    def repeat(self, now_us: int) -> list[Effect]:
        """Say pending orders again where they are due."""
        if self.due_us is None or now_us < self.due_us:
            return []
        self.due_us = now_us + REPEAT_US
        pending = ((self._move_permit, self.move_order), (self._handler_permit, self.handler_order))
        return [
            effect
            for permit, order in pending
            if permit is not None and order is not None
            for effect in permit.again().order(order)
        ]
