"""Bus time: one clock for plans and deadlines, slewed while it is in sync; no lease or safety rule depends on it.

A clock that is far off is no clock: it counts as lost, so that its machine neither calls nor bids, and is set anew
once a second time message confirms the error.

**Bus time never goes back** on one machine, but by a slew. One that has to be set back is set forward by the rest of
the way round: the wire shows bus time modulo ``BUS_TIME_MODULUS``, so that is the same time, after 8.8 years of sleep.
"""

from dataclasses import dataclass

from onboard.core.serial import BUS_MS_MODULUS, away

#: Largest correction that one time message makes, us: with one message in 5 s this follows drifts up to 400 ppm.
MAX_SLEW_US = 2_000
#: No drift and no bus delay explains an error beyond this, us: one of the two clocks has jumped; the slew limit
#: would need more than three minutes for it, and hours for seconds.
FAR_US = 100_000
#: Two errors that differ by less than this are the same, us: bus delays of some frames.
SAME_US = 20_000
#: Sync messages missed before the clock counts as lost.
MISSED_LIMIT = 4
#: Who has sent bus time for less than this takes up that of another which is ahead, us: it has just been started, and
#: its own time began with it; two periods of the message.
YOUNG_US = 10_000_000
#: Bus time on the wire counts the microseconds of 65 rounds of its milliseconds, 8.8 years, and begins anew: the most
#: whole rounds that 48 bits hold, so that us and ms always tell the same time, also to who hears it for the first time.
BUS_TIME_MODULUS = 65 * BUS_MS_MODULUS * 1000


@dataclass
class BusClock:
    """Offset of bus time from this machine's loop time, both in us.

    ``period_us`` is the site's time message period. A machine that sends bus time itself is always in sync.
    """

    period_us: int
    offset_us: int = 0
    heard_at_us: int | None = None
    is_source: bool = False
    #: The error of the last message, us, where that was far too large; None while in sync.
    far_us: int | None = None
    #: Since when this machine has sent bus time, us of loop time.
    source_since_us: int | None = None

    @property
    def is_set(self) -> bool:
        """Whether bus time is known at all: heard once, or made here."""
        return self.is_source or self.heard_at_us is not None

    def bus_us(self, local_us: int) -> int:
        """Bus time at loop time ``local_us``."""
        return local_us + self.offset_us

    def local_us(self, bus_us: int) -> int:
        """Loop time at bus time ``bus_us``."""
        return bus_us - self.offset_us

    def heard(self, bus_time_us: int, local_us: int) -> None:
        """Take up a time message: the first sets the clock, each later one pulls it by at most ``MAX_SLEW_US``.

        One that is far off loses the clock, and the next sets it if it says the same.
        """
        error_us, far_us = self._error_us(bus_time_us, local_us), self.far_us
        self.far_us = None
        if self.heard_at_us is None:
            self.offset_us += error_us
        elif far_us is not None and abs(away(error_us, far_us, BUS_TIME_MODULUS)) <= SAME_US:
            self.offset_us += error_us % BUS_TIME_MODULUS
        elif abs(error_us) > FAR_US:
            self.far_us = error_us
        else:
            self.offset_us += max(-MAX_SLEW_US, min(MAX_SLEW_US, error_us))
        self.heard_at_us = local_us

    def lead(self, local_us: int) -> None:
        """From now on this machine sends bus time, if it does not already."""
        if not self.is_source:
            self.is_source, self.source_since_us = True, local_us

    def follow(self, local_us: int) -> None:
        """Another machine sends bus time; what this one has sent until now is what it knows of it."""
        if self.is_source:
            self.is_source, self.heard_at_us = False, local_us

    def refutes(self, bus_time_us: int, local_us: int) -> bool:
        """Whether a time message is that of a source which was started anew and does not know the time of the bus yet.

        It is answered once, with the time as this machine knows it: a source that says so again means it.
        """
        error_us = self._error_us(bus_time_us, local_us)
        if not self.is_set or self.far_us is not None or error_us > -FAR_US:
            return False
        self.far_us, self.heard_at_us = error_us, local_us
        return True

    def adopt(self, bus_time_us: int, local_us: int) -> bool:
        """Take up the time of the bus, where this machine has just begun to send its own and that is behind."""
        ahead_us = self._error_us(bus_time_us, local_us)
        is_young = self.source_since_us is not None and local_us - self.source_since_us < YOUNG_US
        adopts = self.is_source and is_young and ahead_us > FAR_US
        self.offset_us += ahead_us if adopts else 0
        return adopts

    def is_far(self, bus_time_us: int, local_us: int) -> bool:
        """Whether a time message is too far off to be slewed to; never the first."""
        return self.is_set and abs(self._error_us(bus_time_us, local_us)) > FAR_US

    def said_us(self, local_us: int) -> int:
        """Bus time as it goes on the wire."""
        return self.bus_us(local_us) % BUS_TIME_MODULUS

    def _error_us(self, bus_time_us: int, local_us: int) -> int:
        return away(bus_time_us, self.said_us(local_us), BUS_TIME_MODULUS)

    def is_lost(self, local_us: int) -> bool:
        """Whether deadlines can no longer be trusted; such a machine does not bid."""
        if self.is_source:
            return False
        is_far, heard_us = self.far_us is not None, self.heard_at_us
        return is_far or heard_us is None or local_us - heard_us > MISSED_LIMIT * self.period_us
