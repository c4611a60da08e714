"""One powered door with a bolt: constant speed, opens again for whatever stands in it, ends closing in LOCKED."""

from collections.abc import Callable

from bus_sim.devices.timers import Timer, Timers
from onboard.contract.codes import DoorAction, DoorPosition

#: The bolt's travel after the door has closed, us: plausible for a motor lock.
BOLT_US = 300_000
#: A door that found something in its way tries again this long after the way is clear, us: time for a person to step
#: back.
RETRY_US = 2_000_000

#: What an order does in each position: the position that follows at once, or None where nothing changes.
ORDERS: dict[tuple[DoorPosition, DoorAction], DoorPosition | None] = {
    (DoorPosition.OPEN, DoorAction.OPEN): None,
    (DoorPosition.OPEN, DoorAction.CLOSE): DoorPosition.CLOSING,
    (DoorPosition.OPENING, DoorAction.OPEN): None,
    (DoorPosition.OPENING, DoorAction.CLOSE): DoorPosition.CLOSING,
    (DoorPosition.CLOSING, DoorAction.OPEN): DoorPosition.OPENING,
    (DoorPosition.CLOSING, DoorAction.CLOSE): None,
    (DoorPosition.CLOSED, DoorAction.OPEN): DoorPosition.OPENING,
    (DoorPosition.CLOSED, DoorAction.CLOSE): None,
    (DoorPosition.LOCKED, DoorAction.OPEN): DoorPosition.OPENING,
    (DoorPosition.LOCKED, DoorAction.CLOSE): None,
    (DoorPosition.FORCED, DoorAction.OPEN): DoorPosition.OPENING,
    (DoorPosition.FORCED, DoorAction.CLOSE): DoorPosition.CLOSING,
}


class Door:
    """Starts LOCKED. ``travel_us`` is a whole stroke; one turned back half-way needs half of it.

    ``may_open`` is the interlock's contact: an OPEN order while it is off is passed over and counted in
    ``interlock_refusals``. ``is_clear`` is the safety edge: while it is off the door does not close, a closing door
    opens again, and tries once more ``RETRY_US`` after it is clear. ``on_position`` is told every new position.
    """

    def __init__(
        self,
        timers: Timers,
        travel_us: int,
        may_open: Callable[[], bool],
        is_clear: Callable[[], bool],
        on_position: Callable[[DoorPosition], None],
    ) -> None:
        self.position = DoorPosition.LOCKED
        self.interlock_refusals = 0
        self._timers = timers
        self._travel_us = travel_us
        self._may_open = may_open
        self._is_clear = is_clear
        self._on_position = on_position
        self._ordered = DoorAction.CLOSE
        self._was_clear = True
        self._timer: Timer | None = None
        #: Width left open when the present movement began, as travel time, us, and when it began.
        self._width_us = 0
        self._since_us = 0

    def order(self, action: DoorAction) -> None:
        """Carry out an order, as far as interlock and safety edge let it."""
        if action is DoorAction.OPEN and not self._may_open():
            self.interlock_refusals += 1
            return
        self._ordered = action
        following = ORDERS[self.position, action]
        if following is DoorPosition.CLOSING and not self._is_clear():
            self._retry_later()
        elif following is not None:
            self._enter(following)

    def way_changed(self) -> None:
        """Something came into the way or left it."""
        was_clear, self._was_clear = self._was_clear, self._is_clear()
        if not self._was_clear:
            if self.position is DoorPosition.CLOSING:
                self._enter(DoorPosition.OPENING)
        elif not was_clear and self.position is DoorPosition.OPEN and self._ordered is DoorAction.CLOSE:
            self._retry_later()

    def force(self) -> None:
        """Somebody breaks the bolt: the door stands ajar, not locked, until it is ordered to move."""
        self._width_us = 0
        self._enter(DoorPosition.FORCED)

    def _retry_later(self) -> None:
        self._set_timer(RETRY_US, self._retry)

    def _retry(self) -> None:
        if self.position is DoorPosition.OPEN and self._ordered is DoorAction.CLOSE and self._is_clear():
            self._enter(DoorPosition.CLOSING)

    def _enter(self, position: DoorPosition) -> None:
        now_us = self._timers.now_us()
        self._width_us = self._open_width_us(now_us)
        self._since_us = now_us
        self.position = position
        if position is DoorPosition.OPENING:
            self._set_timer(self._travel_us - self._width_us, self._opened)
        elif position is DoorPosition.CLOSING:
            self._set_timer(self._width_us, lambda: self._enter(DoorPosition.CLOSED))
        elif position is DoorPosition.CLOSED:
            self._set_timer(BOLT_US, lambda: self._enter(DoorPosition.LOCKED))
        elif self._timer is not None:
            self._timer.cancel()
        self._on_position(position)

    def _opened(self) -> None:
        self._enter(DoorPosition.OPEN)
        if self._ordered is DoorAction.CLOSE and self._is_clear():
            self._retry_later()

    def _open_width_us(self, now_us: int) -> int:
        elapsed_us = now_us - self._since_us
        if self.position is DoorPosition.OPENING:
            return min(self._travel_us, self._width_us + elapsed_us)
        if self.position is DoorPosition.CLOSING:
            return max(0, self._width_us - elapsed_us)
        return self._width_us

    def _set_timer(self, delay_us: int, callback: Callable[[], None]) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer = self._timers.call_at(self._timers.now_us() + delay_us, callback)
