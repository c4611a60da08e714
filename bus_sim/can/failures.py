"""How a frame on the wire fails: when the nodes notice, and how long their error flags take (ISO 11898-1, 10.6).

Error flags overlap: the first to notice sends six bits, which break the stuffing rule for the others, whose own six
follow. Together they take 6 to 12 bits, and the eight bits of the error delimiter come after the last of them.
"""

from dataclasses import dataclass
from functools import lru_cache

from bus_sim.can import bitstream
from bus_sim.can.error_frames import BusError
from bus_sim.can.node import SimulatedBus
from onboard.core.frame import Frame


@dataclass(frozen=True, slots=True)
class Failure:
    """A frame noticed to be wrong ``detected_bits`` after the begin of its SOF, then flags of ``flag_bits`` together.

    ``detected_first`` are the receivers that noticed before the others.
    """

    error: BusError
    detected_bits: int
    flag_bits: int
    detected_first: tuple[SimulatedBus, ...] = ()

    @property
    def length_bits(self) -> int:
        """From SOF to the end of intermission."""
        return self.detected_bits + self.flag_bits + bitstream.DELIMITER_BITS + bitstream.INTERMISSION_BITS


@lru_cache(maxsize=1024)
def _on_wire(frame: Frame) -> tuple[int, ...]:
    """A frame that fails is sent again at once, in a burst some thousand times a second: its bits are kept."""
    return tuple(bitstream.stuffed_bits(frame))


def bit_error(frame: Frame, position: int) -> Failure:
    """The transmitter sees another bit than it sent at wire bit ``position`` and flags it from the next bit on.

    The receivers notice six equal bits in a row, to which the bits just before the flag may belong.
    """
    wire = _on_wire(frame)
    wrong = wire[position] ^ 1
    run = 1
    if wrong == 0:
        while run < min(position + 1, bitstream.FLAG_BITS) and wire[position - run] == 0:
            run += 1
    else:
        run = 0
    return Failure(BusError.BIT, position + 1, 2 * bitstream.FLAG_BITS - run)


def acknowledgement_missing(length_bits: int) -> Failure:
    """Nobody drove the ACK slot of a frame of ``length_bits``, intermission included: the sender flags it at once."""
    after_slot = bitstream.ACK_DELIMITER_BITS + bitstream.END_OF_FRAME_BITS + bitstream.INTERMISSION_BITS
    return Failure(BusError.ACKNOWLEDGEMENT, length_bits - after_slot, bitstream.FLAG_BITS)


def wrong_crc(length_bits: int, receivers: tuple[SimulatedBus, ...]) -> Failure:
    """Some receivers flag a wrong CRC after the ACK delimiter; the rest see a dominant bit in the end of frame.

    So theirs begin one bit later, and both together take seven bits.
    """
    detected = length_bits - bitstream.END_OF_FRAME_BITS - bitstream.INTERMISSION_BITS
    return Failure(BusError.CRC, detected, bitstream.FLAG_BITS + 1, receivers)


def broken_off(length_bits: int, gone_bits: int) -> Failure | None:
    """The transmitter vanished ``gone_bits`` after SOF; the receivers notice six recessive bits in a row.

    None where the stuffed part was over: what is left of a frame is recessive but for the receivers' own ACK.
    """
    if gone_bits >= length_bits - bitstream.INTERMISSION_BITS - bitstream.TAIL_BITS:
        return None
    return Failure(BusError.STUFF, gone_bits + bitstream.FLAG_BITS, bitstream.FLAG_BITS)
