"""What ends a program from outside: Ctrl-C, a supervisor's SIGTERM, a terminal that is closed."""

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import asyncio

_OTHERS = (signal.SIGTERM, signal.SIGHUP)
_ENDING = (signal.SIGINT, *_OTHERS)


@contextlib.contextmanager
def ended_by(loop: "asyncio.AbstractEventLoop", end: Callable[[signal.Signals], None]) -> Iterator[None]:
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
    """SIGTERM and a closed terminal raise ``KeyboardInterrupt`` as Ctrl-C does: files are closed, and workers ended.

    For programs without a loop. Takes no signal that somebody takes or ignores already (nohup), and none outside the
    main thread.
    """
    here = threading.current_thread() is threading.main_thread()
    taken = [number for number in _OTHERS if here and signal.getsignal(number) is signal.SIG_DFL]
    for number in taken:
        signal.signal(number, signal.default_int_handler)
    try:
        yield
    finally:
        for number in taken:
            signal.signal(number, signal.SIG_DFL)
