"""What ends a program from outside: Ctrl-C, a supervisor's SIGTERM, a terminal that is closed."""

import asyncio
import contextlib
import signal
import threading
from collections.abc import Callable, Iterator

_ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@contextlib.contextmanager
def ended_by(loop: asyncio.AbstractEventLoop, end: Callable[[signal.Signals], None]) -> Iterator[None]:
    """``end`` is called on the loop for every signal that asks a program to end, instead of ending it in the middle.

    A closed terminal counts unless the program was started to outlive it (nohup). Does nothing outside the main
    thread, which alone hears of signals.
    """
    hears = threading.current_thread() is threading.main_thread()
    numbers = [number for number in _ENDING if hears and signal.getsignal(number) is not signal.SIG_IGN]
    for number in numbers:
        loop.add_signal_handler(number, end, number)
    try:
        yield
    finally:
        for number in numbers:
            loop.remove_signal_handler(number)


@contextlib.contextmanager
def terminated_as_interrupted() -> Iterator[None]:
    """SIGTERM raises ``KeyboardInterrupt`` as Ctrl-C does, so that files are closed and workers ended on the way out.

    For programs without a loop. Does nothing outside the main thread, or where somebody takes the signal already.
    """
    free = signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    if not free or threading.current_thread() is not threading.main_thread():
        yield
        return
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
