"""Signals that whoever started the tests ignores (``nohup``, a job in the background) still end what the tests start.

A program inherits that a signal is ignored, and keeps to it. A signal that is handled here is the default one there.
"""

import signal
from types import FrameType

#: What the tests send to programs.
SENT = (signal.SIGHUP, signal.SIGINT, signal.SIGTERM)


def give_children_the_default() -> None:
    """Handle what is ignored: the tests themselves go on ignoring it, except for the interrupt, which some raise."""
    for number in SENT:
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, signal.default_int_handler if number == signal.SIGINT else _ignore)


def _ignore(_number: int, _frame: FrameType | None) -> None:
    pass
