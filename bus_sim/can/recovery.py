"""Nodes that are off the bus and the recessive bits they count before they come back (ISO 11898-1, 12.1.4.4)."""

from typing import Final, Protocol

from bus_sim.can.error_counters import RECOVERY_BITS, RECOVERY_SEQUENCES
from bus_sim.can.node import SimulatedBus
from bus_sim.virtual_time import Clock

#: Ticks to a bit time: a tick is 1 / (bit rate) microseconds, so that every bit rate counts in whole numbers.
TICKS_PER_BIT: Final = 1_000_000
_SEQUENCE_TICKS: Final = RECOVERY_BITS * TICKS_PER_BIT


class Idle(Protocol):
    """What is asked of the bus whose recessive bits are counted (``Medium``)."""

    clock: Clock
    bit_rate: int

    @property
    def is_silent(self) -> bool:
        """Whether no frame is on the wire."""

    def come_back(self, node: SimulatedBus) -> None:
        """A node has counted its 128 idle sequences, and takes part again (ISO 11898-1)."""


class BusOffRecovery:
    """Counts sequences of eleven recessive bits for every node in bus-off; each frame ends with one of them.

    ACK delimiter, end of frame and intermission are eleven recessive bits, as are error delimiter and intermission.
    """

    def __init__(self, medium: Idle) -> None:
        self._medium = medium
        self._missing: dict[SimulatedBus, int] = {}
        self._recessive_since_ticks = -_SEQUENCE_TICKS
        self._timer_us: int | None = None

    def begin(self, node: SimulatedBus) -> None:
        """A node starts to count."""
        if node in self._missing:
            return
        now_ticks = self._medium.clock.now_us() * self._medium.bit_rate
        if not self._missing:
            self._recessive_since_ticks = max(self._recessive_since_ticks, now_ticks)
        elif self._medium.is_silent:
            self._settle(now_ticks)
        self._missing[node] = RECOVERY_SEQUENCES
        self._set_timer()

    def forget(self, node: SimulatedBus) -> None:
        """A node left before it was back."""
        self._missing.pop(node, None)

    def bus_idle_from(self, ticks: int) -> None:
        """A frame or error frame was over, intermission included, at ``ticks``."""
        self._recessive_since_ticks = ticks - _SEQUENCE_TICKS
        if self._missing:
            self._set_timer()

    def frame_begins(self, ticks: int) -> None:
        """A start of frame ends the run of recessive bits."""
        if self._missing:
            self._settle(ticks)

    def _set_timer(self) -> None:
        due_ticks = self._recessive_since_ticks + min(self._missing.values()) * _SEQUENCE_TICKS
        clock = self._medium.clock
        due_us = max(-(-due_ticks // self._medium.bit_rate), clock.now_us())
        if self._timer_us is None or due_us < self._timer_us:
            self._timer_us = due_us
            clock.at_us(due_us, self._look)

    def _look(self, now_us: int) -> None:
        if now_us != self._timer_us:
            return
        self._timer_us = None
        if self._medium.is_silent and self._missing:
            self._settle(now_us * self._medium.bit_rate)
            if self._missing:
                self._set_timer()

    def _settle(self, ticks: int) -> None:
        """Book the sequences seen up to ``ticks``; who has seen enough is back."""
        seen = max(0, (ticks - self._recessive_since_ticks) // _SEQUENCE_TICKS)
        self._recessive_since_ticks += seen * _SEQUENCE_TICKS
        for node in list(self._missing):
            self._missing[node] -= seen
            if self._missing[node] <= 0:
                del self._missing[node]
                self._medium.come_back(node)
