"""Events in words on standard error, for a person at a board's console or in its system log."""

import sys


class ConsoleTelemetry:
    """``ports.Telemetry`` as one line an event: seconds since start, machine, text."""

    def event(self, time_us: int, source: str, text: str) -> None:
        """Print one line; a console that is gone must not stop a machine."""
        try:
            print(f"{time_us / 1e6:.3f} {source}: {text}", file=sys.stderr, flush=True)
        except OSError:
            return
