"""A vehicle's drive and handler: orders out, states in; an order is said again until it is carried out."""

from dataclasses import dataclass, field

from onboard.contract.terminal import Action, HandlerMode, MoveMode
from onboard.contract.terminal_device import HandlerOrder, HandlerState, MoveOrder, MoveState
from onboard.core.effects import Effect
from onboard.core.motion_authority import Permit
from onboard.work.device_link import DeviceLink

#: Orders are repeated so often, us (dbc/terminal.dbc).
REPEAT_US = 500_000
#: So often while a slot is crossed, us (dbc/terminal.dbc).
GO_ON_US = 1_000_000


@dataclass
class VehicleParts:
    """One vehicle's devices. ``move`` and ``handler`` are what they said last, None before they spoke.

    What was ordered is said again only as far as what permitted it still does.
    """

    node_id: int
    move: MoveState | None = None
    handler: HandlerState | None = None
    #: The slot that was ordered: entity, slot, and the entity towards which it is crossed.
    drive: DeviceLink[tuple[int, int, int]] = field(init=False)
    #: The action that was ordered, and its box.
    gear: DeviceLink[tuple[Action, int]] = field(init=False)
    crossing: tuple[int, int] = (0, 0)
    #: When the order of the slot that is being crossed is said again, us: a drive that hears none stands there.
    go_on_us: int | None = None

    def __post_init__(self) -> None:
        me = self.node_id
        self.drive = DeviceLink(lambda sequence, order: MoveOrder(me, sequence, *order), REPEAT_US)
        self.gear = DeviceLink(lambda sequence, order: HandlerOrder(me, sequence, *order), REPEAT_US)

    @property
    def due_us(self) -> int | None:
        """When an order is to be said again, bus time in us; None for never."""
        times = (self.drive.due_us, self.gear.due_us, None if self.is_moving else self.go_on_us)
        return min((time for time in times if time is not None), default=None)

    @property
    def is_known(self) -> bool:
        """Whether place and load are sensed, with a place in the site."""
        return self.move is not None and self.handler is not None and self.move.entity != 0

    @property
    def is_moving(self) -> bool:
        """Whether a move was ordered that is not carried out yet."""
        return self.drive.wanted is not None

    @property
    def is_handling(self) -> bool:
        """Whether an action of the handler was ordered that is not over yet."""
        return self.gear.wanted is not None

    @property
    def is_at_rest(self) -> bool:
        """Whether it stands, with nothing ordered that is not over."""
        stands = self.move is not None and self.move.mode is not MoveMode.MOVING
        return stands and not self.is_moving and not self.is_handling

    @property
    def stands_ready(self) -> bool:
        """Whether the slot is crossed and nothing is ordered: the next may be entered."""
        return self.move is not None and not self.is_moving and self.move.at_end and self.move.mode is MoveMode.STANDING

    def sense(self, message: MoveState | HandlerState, now_us: int) -> None:
        """What a device says; the order that it carried out need not be repeated."""
        if isinstance(message, MoveState):
            self.move = message
            order = self.drive.wanted
            if order is None:
                self.drive.go_on_from(message.sequence)
            elif self.drive.is_obeyed(message.sequence) and (message.entity, message.slot) == order[:2]:
                self.drive.rest()
            if message.at_end or self.is_moving:
                self.go_on_us = None
            elif self.go_on_us is None:
                self.go_on_us = now_us + GO_ON_US
        else:
            self.handler = message
            if self.gear.wanted is None:
                self.gear.go_on_from(message.sequence)
            elif self.gear.is_obeyed(message.sequence) and message.gear is not HandlerMode.WORKING:
                self.gear.rest()

    def go(self, permit: Permit, entity: int, slot: int, towards: int, now_us: int) -> list[Effect]:
        """Order one slot, as far as that is permitted."""
        assert self.move is not None
        if permit:
            self.crossing, self.go_on_us = (entity, towards), None
        return self.drive.order((entity, slot, towards), permit, now_us)

    def towards(self) -> int:
        """For which entity the one in hand is being crossed, as ordered; 0 for none, or for not known."""
        return self.crossing[1] if self.move is not None and self.crossing[0] == self.move.entity else 0

    def handle(self, permit: Permit, action: Action, box: int, now_us: int) -> list[Effect]:
        """Order one action at a station, as far as that is permitted."""
        assert self.handler is not None
        return self.gear.order((action, box), permit, now_us)

    def go_on(self, permit: Permit, now_us: int) -> list[Effect]:
        """Say it under the number that the drive knows; ``permit`` is to be in that slot."""
        assert self.move is not None
        self.go_on_us = now_us + GO_ON_US
        known = self.move.sequence, self.move.entity, self.move.slot
        return permit.order(MoveOrder(self.node_id, *known, self.towards()))

    def repeat(self, now_us: int) -> list[Effect]:
        """Say pending orders again where they are due."""
        return self.drive.again(now_us) + self.gear.again(now_us)
