"""A plain CAN socket on a node of the guest: what comes, and waiting for it."""

import contextlib
import os
import select
import socket
import struct
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from hil.guest.libc import setns

#: ``struct can_frame`` of linux/can.h: identifier with its flags, length, three bytes, eight of data.
_FRAME = struct.Struct("=IB3x8s")
_RECEIVE_BUFFER = 8 << 20


class NotHeardError(Exception):
    """What was waited for did not come in time; ``str`` says what."""


class CandumpListener:
    """Every frame of one node's bus in candump's words (``ID#DATA``), own ones of the same interface included."""

    def __init__(self, namespace: str, channel: str = "can0") -> None:
        """Raises ``OSError`` where there is no such namespace or interface."""
        self.frames: list[str] = []
        with in_namespace(namespace):
            self._socket = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER)
            self._socket.bind((channel,))
        self._socket.setblocking(False)

    def wait(self, what: str, is_there: Callable[[], bool], limit_s: float) -> None:
        """Read until ``is_there``, which is asked after every frame. Raises ``NotHeardError`` after ``limit_s``."""
        end_s = time.monotonic() + limit_s
        self.read()
        while not is_there():
            left_s = end_s - time.monotonic()
            if left_s <= 0:
                raise NotHeardError(f"not within {limit_s:g} s: {what}")
            select.select([self._socket], [], [], left_s)
            self.read()

    def read(self) -> list[str]:
        """All that has come so far."""
        with contextlib.suppress(BlockingIOError):
            while True:
                identifier, length, data = _FRAME.unpack(self._socket.recv(_FRAME.size))
                digits = 8 if identifier & socket.CAN_EFF_FLAG else 3
                self.frames.append(f"{identifier & socket.CAN_EFF_MASK:0{digits}X}#{data[:length].hex().upper()}")
        return self.frames


@contextlib.contextmanager
def in_namespace(name: str) -> Iterator[None]:
    """This thread is in a network namespace of ``ip netns`` for a while. A socket stays where it was made."""
    own = os.open("/proc/thread-self/ns/net", os.O_RDONLY)
    try:
        with Path("/run/netns", name).open("rb") as file:
            setns(file.fileno())
        yield
    finally:
        setns(own)
        os.close(own)
