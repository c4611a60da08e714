"""A robot's body as its controller knows it: one order at a time, said again until it is taken up."""

from dataclasses import dataclass, field

from onboard.contract.mapd import CartAction
from onboard.contract.mapd_device import CartOrder, CartState
from onboard.core.effects import Effect
from onboard.core.motion_authority import Permit
from onboard.work.device_link import DeviceLink

#: An order that is not taken up is said again after this, us (dbc/mapd.dbc).
ORDER_AGAIN_US = 500_000


@dataclass
class Cart:
    """``state`` is what was sensed last, None before the first word."""

    node_id: int
    state: CartState | None = None
    link: DeviceLink[tuple[CartAction, int, int, int]] = field(init=False)

    def __post_init__(self) -> None:
        me = self.node_id
        self.link = DeviceLink(lambda sequence, order: CartOrder(me, sequence, *order), ORDER_AGAIN_US)

    @property
    def again_us(self) -> int | None:
        """When an order is to be said again, bus time in us; None where it is taken up, or there is none."""
        return self.link.due_us

    def sense(self, state: CartState) -> None:
        """A word of the body; the order that it names is taken up."""
        self.state = state
        if self.link.is_obeyed(state.sequence):
            self.link.pause()

    def order(self, permit: Permit, action: CartAction, cell: int, task: int, step: int, now_us: int) -> list[Effect]:
        """Give an order, or say it again where it is due, as far as that is permitted."""
        assert self.state is not None
        wanted = (action, cell, task, step)
        if wanted == self.link.wanted and self.link.is_obeyed(self.state.sequence):
            return []
        if wanted != self.link.wanted:
            self.link.go_on_from(self.state.sequence)
        return self.link.order(wanted, permit, now_us)
