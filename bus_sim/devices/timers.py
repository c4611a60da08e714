"""Timers in whole microseconds, for everything in the plant; the asyncio loop underneath may run in virtual time."""

import asyncio
from collections.abc import Callable
from typing import Protocol


class Timer(Protocol):
    """A call that has not been made yet."""

    def cancel(self) -> None:
        """Never make it. Harmless where it was made already."""


class Timers(Protocol):
    """A clock and calls at chosen times, both in microseconds of loop time."""

    def now_us(self) -> int:
        """The present time; never less than the time asked for by the call being made."""

    def call_at(self, when_us: int, callback: Callable[[], object]) -> Timer:
        """Make one call at ``when_us``, or as soon as possible where that is past."""


class LoopTimers:
    """Timers on an asyncio event loop.

    A loop keeps its time as a float and may call a little early; ``now_us`` then still answers the time asked for.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._floor_us = 0

    def now_us(self) -> int:
        """The loop's time, rounded to a microsecond."""
        return max(self._floor_us, round(self._loop.time() * 1e6))

    def call_at(self, when_us: int, callback: Callable[[], object]) -> Timer:
        """A timer of the loop."""
        return self._loop.call_at(when_us / 1e6, self._fire, when_us, callback)

    def _fire(self, when_us: int, callback: Callable[[], object]) -> None:
        self._floor_us = max(self._floor_us, when_us)
        callback()
