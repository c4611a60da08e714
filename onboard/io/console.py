"""Events in words on standard error, for a person at a board's console or in its system log."""

import sys

from onboard.ports.telemetry import Telemetry


class ConsoleTelemetry:
    """``ports.Telemetry`` as one line an event: seconds since start, machine, text."""

    def event(self, time_us: int, source: str, text: str) -> None:
        """Print one line; a console that is gone must not stop a machine."""
        try:
            print(f"{time_us / 1e6:.3f} {source}: {text}", file=sys.stderr, flush=True)
        except OSError:
            return


class ManyTelemetry:
    """``ports.Telemetry`` to several sinks, in their order."""

    def __init__(self, *sinks: Telemetry) -> None:
        self._sinks = sinks

    def event(self, time_us: int, source: str, text: str) -> None:
        """Hand one event to each sink; what one of them raises keeps it from those behind."""
        for sink in self._sinks:
            sink.event(time_us, source, text)
