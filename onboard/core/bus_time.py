"""Bus time: one clock for plans and deadlines, slewed while it is in sync; no lease or safety rule depends on it.

A clock that is far off is no clock: it counts as lost, so that its machine neither calls nor bids, and is set anew
once a second time message confirms the error.
"""

from dataclasses import dataclass

#: Largest correction that one time message makes, us: with one message in 5 s this follows drifts up to 400 ppm.
MAX_SLEW_US = 2_000
#: No drift and no bus delay explains an error beyond this, us: one of the two clocks has jumped. Ours; the slew limit
#: would need more than three minutes for it, and hours for seconds.
FAR_US = 100_000
#: Two errors that differ by less than this are the same, us: bus delays of some frames.
SAME_US = 20_000
#: Sync messages missed before the clock counts as lost.
MISSED_LIMIT = 4
#: Bus time on the wire has 48 bits of microseconds: 8.9 years.
BUS_TIME_MODULUS = 1 << 48


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
        error_us = bus_time_us - self.bus_us(local_us)
        confirmed = self.far_us is not None and abs(error_us - self.far_us) <= SAME_US
        if self.heard_at_us is None or confirmed:
            self.far_us = None
            self.offset_us += error_us
        elif abs(error_us) > FAR_US:
            self.far_us = error_us
        else:
            self.far_us = None
            self.offset_us += max(-MAX_SLEW_US, min(MAX_SLEW_US, error_us))
        self.heard_at_us = local_us

    def is_lost(self, local_us: int) -> bool:
        """Whether deadlines can no longer be trusted; such a machine does not bid."""
        if self.is_source:
            return False
        if self.far_us is not None:
            return True
        return self.heard_at_us is None or local_us - self.heard_at_us > MISSED_LIMIT * self.period_us
