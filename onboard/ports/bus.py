"""What a controller needs of a CAN bus, real or simulated."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol

from onboard.core.frame import Frame

#: Called with a frame and the loop time of its reception or transmission, in microseconds.
FrameHandler = Callable[[Frame, int], None]


class ErrorState(IntEnum):
    """Fault confinement state of a CAN controller (ISO 11898-1, 12.1.4)."""

    ERROR_ACTIVE = 0
    ERROR_PASSIVE = 1
    BUS_OFF = 2


@dataclass(frozen=True, slots=True)
class BusHealth:
    """Counters of one node's bus connection since it was opened; ``tec`` and ``rec`` as in ISO 11898-1.

    An interface that cannot tell an error counter reports 0 for it.
    """

    state: ErrorState = ErrorState.ERROR_ACTIVE
    tec: int = 0
    rec: int = 0
    sent: int = 0
    received: int = 0
    send_refused: int = 0
    receive_overflows: int = 0


class Bus(Protocol):
    """One node's connection to one CAN bus."""

    name: str

    def subscribe(self, on_frame: FrameHandler, on_sent: FrameHandler | None = None) -> None:
        """Hand every frame of other nodes to ``on_frame``; frames of this node, once acknowledged, to ``on_sent``."""

    def send(self, frame: Frame) -> bool:
        """Queue for transmission; False, and counted, where the transmit queue is full. Never blocks, never raises."""

    def health(self) -> BusHealth:
        """A snapshot of the counters."""

    async def close(self) -> None:
        """Leave the bus; later sends answer False."""
