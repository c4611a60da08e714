"""A holon whose processor may stand still and whose clock may be wrong; without such a fault it is the plain one."""

import math

from onboard.contract.messages import Message
from onboard.core.effects import Effect
from onboard.holon.holon import Holon

#: Messages that wait for a process that stands still; beyond that the oldest stay and the newest are lost, as in the
#: receive buffer of a socket (Linux' default holds some hundred CAN frames).
HELD_LIMIT = 300
#: The rate of a clock that stands still.
FROZEN_PPM = -1_000_000


class FaultyHolon(Holon):
    """``pause`` stops it as SIGSTOP does: it takes note of nothing, and afterwards takes in what had queued.

    ``set_clock`` changes how its own time follows the loop's: an offset at once, a rate from then on.
    """

    _paused_until_us = 0
    _zero_us = 0
    _offset_us = 0
    _ppm = 0
    _held: list[tuple[Message, bool]] | None = None

    def pause(self, until_us: int) -> None:
        """Stand still until this loop time, us."""
        self._paused_until_us = max(self._paused_until_us, until_us)
        self._held = self._held if self._held is not None else []

    def set_clock(self, now_us: int, *, jump_us: int = 0, ppm: int | None = None) -> None:
        """From loop time ``now_us`` on the clock is ``jump_us`` ahead of what it was, and runs ``ppm`` too fast."""
        self._offset_us = self._own_us(now_us) - now_us + jump_us
        self._zero_us = now_us
        self._ppm = self._ppm if ppm is None else ppm

    def receive(self, message: Message, local_us: int) -> list[Effect]:
        """Keep the message while paused; else hand it on at the time of the faulty clock."""
        if self._held is not None and local_us < self._paused_until_us:
            self._hold(message, is_device=False)
            return []
        return self._resume(local_us) + super().receive(message, self._own_us(local_us))

    def sense(self, message: Message, local_us: int) -> list[Effect]:
        """Keep the device's message while paused; else hand it on at the time of the faulty clock."""
        if self._held is not None and local_us < self._paused_until_us:
            self._hold(message, is_device=True)
            return []
        return self._resume(local_us) + super().sense(message, self._own_us(local_us))

    def wake(self, local_us: int) -> list[Effect]:
        """See ``Holon``. What fell due during a pause is done first, on the beliefs of then."""
        if self._held is not None and local_us < self._paused_until_us:
            return []
        effects = super().wake(self._own_us(local_us))
        return effects + self._resume(local_us)

    def start(self, local_us: int) -> list[Effect]:
        """Start at the time of the faulty clock."""
        return super().start(self._own_us(local_us))

    def bus_us(self, local_us: int) -> int:
        """Bus time in us as this machine believes it, by its faulty clock."""
        return super().bus_us(self._own_us(local_us))

    def next_wake(self) -> int | None:
        """See ``Holon``; in loop time. A clock that is frozen lets nothing fall due."""
        due_us = super().next_wake()
        if due_us is None:
            return None
        if self._held is not None:
            return self._paused_until_us
        if not (self._ppm or self._offset_us):
            return due_us
        way_us = due_us - self._offset_us - self._zero_us
        if self._ppm == FROZEN_PPM:
            return self._zero_us if way_us <= 0 else None
        at_us = self._zero_us + math.ceil(way_us / (1 + self._ppm / 1e6))
        # Rounding must not wake it a microsecond early, at which it finds nothing due, for ever.
        while self._own_us(at_us) < due_us:
            at_us += 1
        return at_us

    def _own_us(self, loop_us: int) -> int:
        return loop_us + self._offset_us + (loop_us - self._zero_us) * self._ppm // 1_000_000

    def _hold(self, message: Message, *, is_device: bool) -> None:
        assert self._held is not None
        if len(self._held) < HELD_LIMIT:
            self._held.append((message, is_device))

    def _resume(self, local_us: int) -> list[Effect]:
        """What had queued is taken in now, with the time of now, as a process reads its socket after SIGCONT."""
        held, self._held = self._held, None
        effects: list[Effect] = []
        for message, is_device in held or ():
            take = super().sense if is_device else super().receive
            effects += take(message, self._own_us(local_us))
        return effects
