"""Bus time: one clock for plans and deadlines, slewed and never stepped; no lease or safety rule depends on it."""

from dataclasses import dataclass

#: Largest correction that one time message makes, us: with one message in 5 s this follows drifts up to 400 ppm.
MAX_SLEW_US = 2_000
#: Sync messages missed before the clock counts as lost.
MISSED_LIMIT = 4


@dataclass
class BusClock:
    """Offset of bus time from this machine's loop time, both in us.

    ``period_us`` is the site's time message period. A machine that sends bus time itself is always in sync.
    """

    period_us: int
    offset_us: int = 0
    heard_at_us: int | None = None
    is_source: bool = False

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
        """Take up a time message: the first sets the clock, each later one pulls it by at most ``MAX_SLEW_US``."""
        error_us = bus_time_us - self.bus_us(local_us)
        if self.heard_at_us is not None:
            error_us = max(-MAX_SLEW_US, min(MAX_SLEW_US, error_us))
        self.offset_us += error_us
        self.heard_at_us = local_us

    def is_lost(self, local_us: int) -> bool:
        """Whether deadlines can no longer be trusted; such a machine does not bid."""
        if self.is_source:
            return False
        return self.heard_at_us is None or local_us - self.heard_at_us > MISSED_LIMIT * self.period_us
