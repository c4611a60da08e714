"""Who wins the bus: the arbitration field as a number, and what happens where two nodes send the same one."""

from collections.abc import Sequence
from typing import NamedTuple

from bus_sim.can.bitstream import stuffed_bits
from onboard.core.frame import CAN_EFF_MASK, CAN_MAX_DLC, CAN_SFF_MASK, Frame


def is_sendable(frame: Frame) -> bool:
    """Whether a frame can be put on a classic CAN bus: identifier in range, at most 8 bytes, no error frame."""
    top = CAN_EFF_MASK if frame.is_extended else CAN_SFF_MASK
    return (
        0 <= frame.arbitration_id <= top
        and 0 <= frame.remote_dlc <= CAN_MAX_DLC
        and len(frame.data) <= (0 if frame.is_remote else CAN_MAX_DLC)
        and not frame.is_error
    )


def arbitration_key(frame: Frame) -> int:
    """The arbitration field as 32 bits, dominant bits 0: of frames that start together the smallest wins.

    Base identifier (11), RTR or SRR, IDE, identifier extension (18), RTR (ISO 11898-1, 10.4.2.2). So of one base
    identifier a standard data frame beats a standard remote frame, and both beat every extended frame.
    """
    rtr = int(frame.is_remote)
    if frame.is_extended:
        identifier = frame.arbitration_id & CAN_EFF_MASK
        return identifier >> 18 << 21 | 0b11 << 19 | (identifier & 0x3FFFF) << 1 | rtr
    return (frame.arbitration_id & CAN_SFF_MASK) << 21 | rtr << 20


class Collision(NamedTuple):
    """The first bit at which frames with one arbitration field differ.

    ``position`` counts wire bits from SOF (0); ``recessive`` are the indices of the frames that had sent recessive
    there: their senders see a dominant bit instead, which after arbitration is a bit error.
    """

    position: int
    recessive: tuple[int, ...]


def first_difference(frames: Sequence[Frame]) -> Collision | None:
    """Where two or more frames that started together and tied in arbitration diverge; None where all are equal."""
    streams = [stuffed_bits(frame) for frame in frames]
    for position, bits in enumerate(zip(*streams, strict=False)):
        if len(set(bits)) > 1:
            return Collision(position, tuple(index for index, bit in enumerate(bits) if bit))
    return None
