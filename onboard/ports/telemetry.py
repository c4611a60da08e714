"""What a controller tells the world beside the bus."""

from typing import Protocol


class Telemetry(Protocol):
    """A sink of events in words. Losing one must never matter to the bus."""

    def event(self, time_us: int, source: str, text: str) -> None:
        """One event at loop time ``time_us``, in microseconds, of the machine named ``source``."""
