"""Getting frames out without ever blocking the loop: at once and again a little later, or from a thread."""

import asyncio
import threading
from collections import deque
from collections.abc import Callable
from enum import Enum, auto
from typing import Protocol

from onboard.core.frame import CAN_EFF_MASK, CAN_MAX_DLC, CAN_SFF_MASK, Frame

#: Frames that wait for the driver's queue; SocketCAN's own queue (``txqueuelen``) comes on top.
QUEUE_LIMIT = 1024
#: A full driver queue is tried again this much later, us: about the time of eight 8-byte frames at 500 kbit/s.
RETRY_US = 2_000
#: A frame that the driver refuses for so long is given up and counted, us; 1,500 frames take so long at 500 kbit/s.
GIVE_UP_US = 500_000


def is_sendable(frame: Frame) -> bool:
    """Whether a frame is one that a node of a classic CAN bus can send (ISO 11898-1); error frames nobody sends."""
    highest = CAN_EFF_MASK if frame.is_extended else CAN_SFF_MASK
    length = frame.remote_dlc if frame.is_remote else len(frame.data)
    return not frame.is_error and 0 <= frame.arbitration_id <= highest and 0 <= length <= CAN_MAX_DLC


class Submitted(Enum):
    """What became of a frame that was handed to a driver."""

    SENT = auto()
    FULL = auto()
    FAILED = auto()
    LOST = auto()


class Transmitter(Protocol):
    """Hands frames to a driver in the order in which they came, without blocking the loop."""

    def send(self, frame: Frame) -> bool:
        """Take a frame; False where it will not be sent. Never blocks."""

    def stop(self) -> None:
        """Take no more; frames that still wait are given up."""


class DirectTransmitter:
    """Hands frames to a driver that never blocks, from the loop itself.

    SocketCAN answers ENOBUFS at once when its queue is full, whatever time-out was asked for, so what it refuses
    waits here, in order, and is tried again by a loop timer until ``GIVE_UP_US`` have passed.
    """

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        submit: Callable[[Frame], Submitted],
        on_done: Callable[[Frame, Submitted], None],
    ) -> None:
        self.retries = 0
        self._loop = loop
        self._submit = submit
        self._on_done = on_done
        self._waiting: deque[tuple[Frame, float]] = deque()
        self._timer: asyncio.TimerHandle | None = None
        self._stopped = False

    def send(self, frame: Frame) -> bool:
        """Send now, or queue behind those that wait."""
        if self._stopped or len(self._waiting) >= QUEUE_LIMIT:
            return False
        if not self._waiting:
            result = self._submit(frame)
            if result is not Submitted.FULL:
                self._on_done(frame, result)
                return result is Submitted.SENT
        self._waiting.append((frame, self._loop.time() + GIVE_UP_US / 1_000_000))
        self._set_timer()
        return True

    def stop(self) -> None:
        """Drop the frames that wait, and set no timer again."""
        self._stopped = True
        self._waiting.clear()
        if self._timer is not None:
            self._timer.cancel()

    def _set_timer(self) -> None:
        if self._timer is None:
            self._timer = self._loop.call_later(RETRY_US / 1_000_000, self._retry)

    def _retry(self) -> None:
        self._timer = None
        while self._waiting:
            frame, give_up_at = self._waiting[0]
            self.retries += 1
            result = self._submit(frame)
            if result is Submitted.FULL:
                if self._loop.time() < give_up_at:
                    self._set_timer()
                    return
                result = Submitted.FAILED
            if self._waiting:
                self._waiting.popleft()
            self._on_done(frame, result)


class ThreadTransmitter:
    """Hands frames to a driver that may block (serial lines, TCP, vendors' libraries) from a thread of its own."""

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        submit: Callable[[Frame], Submitted],
        on_done: Callable[[Frame, Submitted], None],
        name: str,
    ) -> None:
        self._loop = loop
        self._submit = submit
        self._on_done = on_done
        self._waiting: deque[Frame] = deque()
        self._changed = threading.Condition()
        self._stopped = False
        threading.Thread(target=self._run, name=f"send {name}", daemon=True).start()

    def send(self, frame: Frame) -> bool:
        """Queue for the thread; False beyond ``QUEUE_LIMIT`` frames."""
        with self._changed:
            if self._stopped or len(self._waiting) >= QUEUE_LIMIT:
                return False
            self._waiting.append(frame)
            self._changed.notify()
        return True

    def stop(self) -> None:
        """Let the thread end. It is a daemon: a driver that blocks for ever does not keep the process alive."""
        with self._changed:
            self._stopped = True
            self._changed.notify()

    def _run(self) -> None:
        while True:
            with self._changed:
                while not self._waiting and not self._stopped:
                    self._changed.wait()
                if self._stopped:
                    return
                frame = self._waiting.popleft()
            result = self._submit(frame)
            if not call_in_loop(self._loop, self._on_done, frame, result):
                return


def call_in_loop(loop: asyncio.AbstractEventLoop, call: Callable[..., None], *arguments: object) -> bool:
    """``loop.call_soon_threadsafe``, or False where the loop is closed already."""
    try:
        loop.call_soon_threadsafe(call, *arguments)
    except RuntimeError:
        return False
    return True
