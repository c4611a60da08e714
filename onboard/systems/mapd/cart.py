"""A robot's body as its controller knows it: one order at a time, said again until it is taken up."""

from dataclasses import dataclass

from onboard.core.effects import Effect
from onboard.core.motion_authority import Permit
from onboard.core.serial import successor
from onboard.systems.mapd.messages import CartAction, CartOrder, CartState

#: An order that is not taken up is said again after this, us (dbc/mapd.dbc).
ORDER_AGAIN_US = 500_000


@dataclass
class Cart:
    """``state`` is what was sensed last, None before the first word."""

    node_id: int
    state: CartState | None = None
    again_us: int | None = None
    _order: CartOrder | None = None

    def sense(self, state: CartState) -> None:
        """A word of the body; the order that it names is taken up."""
        self.state = state
        if self._order is not None and state.sequence == self._order.sequence:
            self.again_us = None

    def order(self, permit: Permit, action: CartAction, cell: int, task: int, step: int, now_us: int) -> list[Effect]:
        """Give an order, or say it again where it is due, as far as that is permitted."""
        assert self.state is not None
        same = self._order is not None and (
            (self._order.cart_action, self._order.cell, self._order.task, self._order.step)
            == (action, cell, task, step)
        )
        if not permit or (same and (self.again_us is None or now_us < self.again_us)):
            return []
        if not same:
            sequence = successor(self.state.sequence, 8)
            self._order = CartOrder(self.node_id, sequence, action, cell, task, step)
        assert self._order is not None
        self.again_us = now_us + ORDER_AGAIN_US
        return permit.order(self._order)
