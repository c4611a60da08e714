"""Handing frames to those who asked for them, whatever they do with them."""

import asyncio
from typing import Any

from onboard.core.frame import Frame
from onboard.ports.bus import FrameHandler


class Subscribers:
    """The subscribers of one bus connection, served in the order in which they came.

    A handler that raises breaks neither the reader nor the other handlers: the exception goes to the loop's
    exception handler, as with every asyncio callback, and is counted in ``failures``. (A listener that raises ends
    python-can's reader thread in silence.)
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, bus_name: str) -> None:
        self.failures = 0
        self._loop = loop
        self._bus_name = bus_name
        self._on_frame: list[FrameHandler] = []
        self._on_sent: list[FrameHandler] = []

    def add(self, on_frame: FrameHandler, on_sent: FrameHandler | None) -> None:
        """Serve one more subscriber, behind those there are; None where it does not want its own frames back."""
        self._on_frame.append(on_frame)
        if on_sent is not None:
            self._on_sent.append(on_sent)

    def received(self, frame: Frame) -> None:
        """A frame of another node has arrived."""
        self._tell(self._on_frame, frame)

    def sent(self, frame: Frame) -> None:
        """A frame of this node has left."""
        self._tell(self._on_sent, frame)

    def _tell(self, handlers: list[FrameHandler], frame: Frame) -> None:
        now_us = round(self._loop.time() * 1_000_000)
        for handler in handlers:
            try:
                handler(frame, now_us)
            except Exception as error:  # noqa: BLE001 - any fault of a subscriber; reported, never swallowed
                self.failures += 1
                context: dict[str, Any] = {"message": f"subscriber of bus {self._bus_name} failed", "exception": error}
                self._loop.call_exception_handler(context)
