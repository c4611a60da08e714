"""What one trial may take: events, which are the same on every machine, and as a net seconds of the wall.

A run that hangs is a finding with its seed and scenario, like any other. A machine that does not come to rest is halted
by its own controller, a moment at which virtual time stands still is found by the loop; what moves on, but ever slower,
runs into the event limit; and what never comes back from one decision is torn out by the wall clock.
"""

import signal
from collections.abc import Iterator
from contextlib import contextmanager

#: Events of a run: so many at least, and so many for each second that it may simulate. A small site with
#: 3,000 foreign frames a second for a while takes 200 a second in the mean, an undisturbed site 37 to 114 (measured).
EVENTS, EVENTS_A_SECOND = 1_000_000, 500
#: Seconds of the wall likewise: simulated time passes at 100 to 300 times its pace on one core (measured).
WALL_S, WALL_PER_SIMULATED = 600.0, 0.1
#: What was swallowed on its way out is thrown again after this, s of the wall.
AGAIN_S = 5.0


class WallLimitError(SystemExit):
    """A trial has taken too long; of a class that asyncio lets through, and no guard of a controller swallows."""


def event_limit(limit_s: float) -> int:
    """Most events of a run that may simulate ``limit_s``."""
    return EVENTS + round(EVENTS_A_SECOND * limit_s)


def wall_limit_s(limit_s: float) -> float:
    """Most seconds of the wall for it."""
    return WALL_S + WALL_PER_SIMULATED * limit_s


@contextmanager
def wall_limit(seconds: float) -> Iterator[None]:
    """Raise ``WallLimitError`` inside where it takes longer; without effect where there is no such timer to be set.

    That is in a thread other than the main one, and on systems without ``setitimer``.
    """
    before, is_set = None, True
    try:
        # Within: on a busy machine a short time may be over before anything else is done.
        try:
            before = signal.getsignal(signal.SIGALRM)
            end_after(seconds)
        except (AttributeError, ValueError):
            is_set = False
        yield
    finally:
        if is_set:
            signal.setitimer(signal.ITIMER_REAL, 0)
            signal.signal(signal.SIGALRM, before)


def end_after(seconds: float) -> None:
    """Raise ``WallLimitError`` after so long, for good: of a process that does nothing else.

    Raises ``AttributeError`` where there is no such timer, ``ValueError`` in a thread other than the main one.
    """

    def over(_number: int, _frame: object) -> None:
        raise WallLimitError(f"{seconds:.0f} s of the wall are over")

    signal.signal(signal.SIGALRM, over)
    signal.setitimer(signal.ITIMER_REAL, seconds, AGAIN_S)
