"""Frames as logs keep them: without what only a customer's paper and a desk know."""

from onboard.contract.messages import TicketPrint, TicketRead
from onboard.contract.packing import device
from onboard.core.frame import Frame

_NODE_MASK = 0xFF
_SECRET = frozenset(one.identifier for one in device.FRAMES if one.frame in (TicketPrint, TicketRead))
#: Bytes before the code (dbc/device.dbc): which act, and which half.
_TOLD_BYTES = 2


def untold(frame: Frame) -> Frame:
    """The frame with zeros for the code of a ticket; any other as it is."""
    if not frame.is_extended or frame.arbitration_id & ~_NODE_MASK not in _SECRET:
        return frame
    return frame._replace(data=frame.data[:_TOLD_BYTES].ljust(len(frame.data), b"\0"))
