"""Whether the controller of this board works: its own heartbeats, heard on the fleet bus.

A frame comes back to a second socket of the same computer only once it was sent, and on a real bus only once another
node has acknowledged it (Linux Documentation/networking/can.rst, "local loopback of sent frames").
"""

import select
import socket
import struct
import time
from collections.abc import Callable, Iterator

from onboard.config.machine import MachineConfig
from onboard.contract.messages import Heartbeat
from onboard.core.frame import Frame
from onboard.wire.codec import fleet_codec
from onboard.wire.decoder import Decoder

#: So many heartbeats of one life; a controller that is started again and again does not come so far.
HEARTBEATS = 10
_PATIENCE_S = 2.0
#: ``struct can_frame``: identifier with flags, length, padding, data (linux/can.h).
_FRAME = struct.Struct("=IB3x8s")
_EXTENDED, _ERROR, _REMOTE, _IDENTIFIER = 0x80000000, 0x20000000, 0x40000000, 0x1FFFFFFF


class Health:
    """Counts the heartbeats of one node's present life."""

    def __init__(self, node: int) -> None:
        self._node = node
        self._decoder = Decoder(fleet_codec())
        self._boot: int | None = None
        self.beats = 0

    def feed(self, frame: Frame) -> bool:
        """Whether, with this frame, the controller has shown that it works."""
        message = self._decoder.feed(frame, 0)
        if isinstance(message, Heartbeat) and message.sender == self._node:
            self.beats = self.beats + 1 if message.boot == self._boot else 1
            self._boot = message.boot
        return self.beats >= HEARTBEATS


def frame_of(raw: bytes) -> Frame | None:
    """A data frame with an extended identifier, as SocketCAN tells it; None for any other."""
    identifier, length, data = _FRAME.unpack(raw)
    if identifier & (_EXTENDED | _ERROR | _REMOTE) != _EXTENDED:
        return None
    return Frame(identifier & _IDENTIFIER, data[:length])


def wait_for_health(machine: MachineConfig, limit_s: float, has_ended: Callable[[], bool]) -> bool:
    """Listen on the fleet bus until the controller has shown that it works, has ended, or so long."""
    health, end_s = Health(machine.machine.node_id), time.monotonic() + limit_s
    for frame in _heard(machine.fleet_bus.channel):
        if frame is not None and health.feed(frame):
            return True
        if time.monotonic() > end_s or (frame is None and has_ended()):
            break
    return False


def _heard(channel: str) -> Iterator[Frame | None]:
    """What comes over an interface; None for each second without, and where there is no such interface."""
    while True:
        try:
            with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as bus:
                bus.bind((channel,))
                bus.settimeout(_PATIENCE_S)
                while True:
                    yield frame_of(bus.recv(_FRAME.size))
        except TimeoutError:
            yield None
        except OSError:
            # It is not there yet, or went down.
            select.select([], [], [], _PATIENCE_S)
            yield None
