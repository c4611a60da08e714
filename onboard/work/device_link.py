"""An order to a device of this machine: one at a time, numbered, and said again until it is obeyed or another follows.

A device that hears an order twice under one number does it once.
"""

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Generic, TypeVar

from onboard.contract.messages import Message
from onboard.core.effects import Effect
from onboard.core.motion_authority import Permit
from onboard.core.serial import successor

#: Numbers of orders have so many bits in every DBC file.
_BITS = 8

AnOrder = TypeVar("AnOrder", bound=Hashable)


@dataclass
class DeviceLink(Generic[AnOrder]):
    """The orders to one device. ``message`` makes the frame of an order under its number; times in us of bus time.

    ``again_us``: an order that is wanted still is said again after this; a drive needs that while it moves.
    """

    message: Callable[[int, AnOrder], Message]
    again_us: int
    wanted: AnOrder | None = None
    due_us: int | None = None
    sequence: int = 0
    #: What permitted the order that is wanted: asked again with each repeat.
    _permit: Permit | None = None

    def go_on_from(self, sequence: int) -> None:
        """The device's first word after a start: numbers go on from the last that it obeyed, in whichever life."""
        self.sequence = sequence

    def is_obeyed(self, sequence: int) -> bool:
        """Whether the device, which names the last order that it obeyed, has obeyed the one that is wanted."""
        return self.wanted is not None and sequence == self.sequence

    def order(self, wanted: AnOrder, permit: Permit, now_us: int, *, anew: bool = False) -> list[Effect]:
        """Say an order: at once where it is another than before, else when it is due; ``anew``: under a new number.

        What is not permitted is not said, and the order before, if any, when it is due next.
        """
        if not permit:
            self.due_us = None if self.due_us is None else now_us + self.again_us
            return []
        self._permit = permit
        if wanted == self.wanted:
            if self.due_us is not None and now_us < self.due_us:
                return []
            if anew:
                self.sequence = successor(self.sequence, _BITS)
        else:
            self.wanted, self.sequence = wanted, successor(self.sequence, _BITS)
        self.due_us = now_us + self.again_us
        return permit.order(self.message(self.sequence, wanted))

    def again(self, now_us: int) -> list[Effect]:
        """The order that is wanted, where it is due."""
        if self.wanted is None or self._permit is None:
            return []
        return self.order(self.wanted, self._permit.again(), now_us)

    def pause(self) -> None:
        """The device is at it: nothing is due, and the next word of the same order is said at once."""
        self.due_us = None

    def rest(self) -> None:
        """Nothing is wanted any more: a drive that hears nothing stops."""
        self.wanted = self.due_us = None
