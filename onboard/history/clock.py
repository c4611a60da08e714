"""Bus time against the log's."""

from onboard.contract.messages import BusTime
from onboard.core.serial import from_bus_ms


class LoggedBusTime:
    """What the last ``BusTime`` said. ``offset_us`` is None before it."""

    def __init__(self) -> None:
        self.offset_us: int | None = None

    def feed(self, message: BusTime, time_us: int) -> None:
        """Takes up a time message that was logged at ``time_us``: the offset from then on."""
        self.offset_us = time_us - message.bus_time_us

    def log_us(self, bus_ms: int, now_us: int) -> int | None:
        """The time of the log nearest to now at which bus time reads ``bus_ms``; None where nobody told bus time."""
        if self.offset_us is None:
            return None
        return from_bus_ms(bus_ms, now_us - self.offset_us) + self.offset_us
