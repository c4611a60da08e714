"""Error frames as monitors see them: class bits and eight data bytes as in Linux ``linux/can/error.h``."""

from enum import Enum
from typing import Final

from bus_sim.can.error_counters import PASSIVE_ABOVE, ErrorCounters
from onboard.core.frame import Frame
from onboard.ports.bus import ErrorState

CAN_ERR_CRTL: Final = 0x004
CAN_ERR_PROT: Final = 0x008
CAN_ERR_ACK: Final = 0x020
CAN_ERR_BUSOFF: Final = 0x040
CAN_ERR_BUSERROR: Final = 0x080
CAN_ERR_RESTARTED: Final = 0x100
CAN_ERR_CNT: Final = 0x200

_CRTL_RX_PASSIVE: Final = 0x10
_CRTL_TX_PASSIVE: Final = 0x20
_LOCATION_CRC_SEQUENCE: Final = 0x08
_LOCATION_ACK_SLOT: Final = 0x19
_LARGEST_BYTE: Final = 0xFF


class ErrorsHeard(Enum):
    """Which error frames a monitor sees: of Linux's drivers those that change a counter (can.rst, berr-reporting off).

    A lone node counts no attempt any more once it is error-passive, and makes thousands of them each second.
    """

    NONE = 0
    COUNTED = 1
    EVERY = 2


class BusError(Enum):
    """What went wrong on the wire; the value is error type and location (``data[2]``, ``data[3]``)."""

    BIT = (0x01, 0x00)
    STUFF = (0x04, 0x00)
    CRC = (0x00, _LOCATION_CRC_SEQUENCE)
    ACKNOWLEDGEMENT = (0x00, _LOCATION_ACK_SLOT)


def error_frame(error: BusError, counters: ErrorCounters) -> Frame:
    """One bus error, with the counters (and what they now mean) of the node that transmitted."""
    state = counters.state
    error_class = CAN_ERR_PROT | CAN_ERR_BUSERROR | CAN_ERR_CNT
    if error is BusError.ACKNOWLEDGEMENT:
        error_class |= CAN_ERR_ACK
    controller = 0
    if state is ErrorState.BUS_OFF:
        error_class |= CAN_ERR_BUSOFF
    elif state is ErrorState.ERROR_PASSIVE:
        error_class |= CAN_ERR_CRTL
        controller = _CRTL_TX_PASSIVE if counters.tec > PASSIVE_ABOVE else _CRTL_RX_PASSIVE
    kind, location = error.value
    tec, rec = min(counters.tec, _LARGEST_BYTE), min(counters.rec, _LARGEST_BYTE)
    return Frame(error_class, bytes((0, controller, kind, location, 0, 0, tec, rec)), is_extended=False, is_error=True)


def restarted_frame() -> Frame:
    """A node that was off the bus is back, error-active."""
    return Frame(CAN_ERR_RESTARTED | CAN_ERR_CNT, bytes(8), is_extended=False, is_error=True)
