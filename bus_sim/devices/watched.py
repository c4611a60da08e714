"""Work of a device that goes on only while its order is said again: it stands where none is heard for too long."""

from collections.abc import Callable

from bus_sim.devices.timers import Timers


class WatchedWork:
    """One thing at a time. ``stands`` is called where it stops in the middle; ``time_out_us`` is from a DBC file."""

    def __init__(self, timers: Timers, time_out_us: int, stands: Callable[[], None]) -> None:
        self._timers, self._time_out_us, self._stands = timers, time_out_us, stands
        self._left_us = 0
        self._done: Callable[[], None] | None = None
        self._fresh_until_us = 0
        self._is_standing = False
        #: Counts what was begun: a timer of what was broken off does nothing.
        self._begun = 0

    @property
    def is_in_hand(self) -> bool:
        """Whether something is begun and not over."""
        return self._done is not None

    def begin(self, duration_us: int, done: Callable[[], None]) -> None:
        """By an order that is heard now; what was in hand before is broken off."""
        self._left_us, self._done = duration_us, done
        self._begun += 1
        self._fresh_until_us = self._timers.now_us() + self._time_out_us
        self._is_standing = False
        self._go_on(self._begun)

    def end(self) -> None:
        """What is in hand is broken off."""
        self._begun += 1
        self._done = None

    def hear(self) -> bool:
        """The order is said again; whether the work stood, and goes on by that."""
        self._fresh_until_us = self._timers.now_us() + self._time_out_us
        stood, self._is_standing = self._is_standing and self.is_in_hand, False
        if stood:
            self._go_on(self._begun)
        return stood

    def _go_on(self, begun: int) -> None:
        if begun != self._begun or self._is_standing or self._done is None:
            return
        now_us = self._timers.now_us()
        if self._left_us <= 0:
            done, self._done = self._done, None
            done()
        elif now_us >= self._fresh_until_us:
            self._is_standing = True
            self._stands()
        else:
            share_us = min(self._left_us, self._fresh_until_us - now_us)
            self._left_us -= share_us
            self._timers.call_at(now_us + share_us, lambda: self._go_on(begun))
