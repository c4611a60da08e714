"""The bits of a classic CAN frame on the wire (ISO 11898-1, 10.4 and 10.5): CRC, stuffing, exact and worst-case length.

Lengths are in nominal bit times and include the three bits of intermission that follow a frame, as can-utils'
``canframelen.c`` counts them. A remote frame has no data field whatever its DLC says; ``canframelen.c`` counts one for
remote frames with a DLC above 0, which is the only place where the two differ.
"""

from functools import lru_cache
from typing import Final

from onboard.core.frame import CAN_EFF_MASK, CAN_MAX_DLC, CAN_SFF_MASK, Frame

#: Error flag of an error-active node: six dominant bits; of an error-passive one: six recessive.
FLAG_BITS: Final = 6
DELIMITER_BITS: Final = 8
INTERMISSION_BITS: Final = 3
#: An error-passive transmitter waits this long after intermission (suspend transmission, ISO 11898-1, 10.9.4).
SUSPEND_BITS: Final = 8
#: ACK delimiter and end of frame: recessive, and with intermission eleven recessive bits in a row.
ACK_DELIMITER_BITS: Final = 1
END_OF_FRAME_BITS: Final = 7
#: CRC delimiter, ACK slot, ACK delimiter, end of frame: the part of a frame that is not stuffed.
TAIL_BITS: Final = 2 + ACK_DELIMITER_BITS + END_OF_FRAME_BITS

#: Generator polynomial of the 15-bit CRC without its highest term (ISO 11898-1, 10.4.2.6).
_CRC_POLYNOMIAL: Final = 0x4599
_CRC_MASK: Final = 0x7FFF
#: After five equal bits the transmitter inserts their complement (ISO 11898-1, 10.5).
_STUFF_AFTER: Final = 5

# A stuffing state is (last bit) * 4 + (length of its run - 1), the run being 1 to 4: at 5 a stuff bit starts a new run.
_AFTER_SOF: Final = 0
_STATES: Final = 8


def _stuff_step(state: int, bit: int) -> tuple[int, int]:
    """The state after one more bit, and the number of bits stuffed (0 or 1)."""
    last, run = state >> 2, (state & 3) + 1
    run = run + 1 if bit == last else 1
    if run == _STUFF_AFTER:
        return (bit ^ 1) << 2, 1
    return bit << 2 | run - 1, 0


def _stuff_table(width: int) -> tuple[list[int], list[int]]:
    """Tables of next state, shifted by eight as an index, and bits stuffed, by ``state << 8 | chunk``."""
    next_state, stuffed = [0] * (_STATES << 8), [0] * (_STATES << 8)
    for start in range(_STATES):
        for chunk in range(1 << width):
            state, count = start, 0
            for shift in range(width - 1, -1, -1):
                state, more = _stuff_step(state, chunk >> shift & 1)
                count += more
            next_state[start << 8 | chunk] = state << 8
            stuffed[start << 8 | chunk] = count
    return next_state, stuffed


def _crc_step(crc: int, bit: int) -> int:
    feedback = crc >> 14 ^ bit
    crc = crc << 1 & _CRC_MASK
    return crc ^ _CRC_POLYNOMIAL if feedback else crc


def _crc_table() -> list[int]:
    table = []
    for byte in range(256):
        crc = 0
        for shift in range(7, -1, -1):
            crc = _crc_step(crc, byte >> shift & 1)
        table.append(crc)
    return table


_NEXT, _STUFFED = _stuff_table(8)
_NEXT_OF_7, _STUFFED_OF_7 = _stuff_table(7)
_CRC = _crc_table()


def header_bits(frame: Frame) -> list[int]:
    """SOF to DLC, unstuffed; 0 is dominant. 19 bits, or 39 where the frame is extended."""
    rtr = int(frame.is_remote)
    fields: tuple[tuple[int, int], ...]
    if frame.is_extended:
        identifier = frame.arbitration_id & CAN_EFF_MASK
        fields = ((0, 1), (identifier >> 18, 11), (0b11, 2), (identifier & 0x3FFFF, 18), (rtr, 1), (0, 2))
    else:
        fields = ((0, 1), (frame.arbitration_id & CAN_SFF_MASK, 11), (rtr, 1), (0, 2))
    return [value >> shift & 1 for value, width in (*fields, (frame.dlc, 4)) for shift in range(width - 1, -1, -1)]


def stuffed_bits(frame: Frame) -> list[int]:
    """SOF to the end of the CRC sequence as it goes over the wire, bit by bit: for faults and tests, not for speed."""
    plain = header_bits(frame)
    if not frame.is_remote:
        plain += [byte >> shift & 1 for byte in frame.data for shift in range(7, -1, -1)]
    crc = 0
    for bit in plain:
        crc = _crc_step(crc, bit)
    plain += [crc >> shift & 1 for shift in range(14, -1, -1)]
    wire = [plain[0]]
    state = _AFTER_SOF
    for bit in plain[1:]:
        wire.append(bit)
        state, stuffed = _stuff_step(state, bit)
        if stuffed:
            wire.append(bit ^ 1)
    return wire


@lru_cache(maxsize=16384)
def _header(arbitration_id: int, is_extended: bool, is_remote: bool, dlc: int) -> tuple[int, int, int]:
    """Bits up to the DLC with stuffing, the stuffing state as an index, and the CRC so far."""
    data = b"" if is_remote else bytes(dlc)
    bits = header_bits(Frame(arbitration_id, data, is_extended, is_remote, remote_dlc=dlc if is_remote else 0))
    state, crc, length = _AFTER_SOF, 0, len(bits)
    for bit in bits[1:]:
        state, stuffed = _stuff_step(state, bit)
        crc = _crc_step(crc, bit)
        length += stuffed
    return length, state << 8, crc


def frame_length_bits(frame: Frame) -> int:
    """Exact length of one data or remote frame with stuff bits and intermission, in bit times: 47 to 160."""
    arbitration_id, data, is_extended, is_remote, _is_error, remote_dlc = frame
    if is_remote:
        length, state, crc = _header(arbitration_id, is_extended, True, remote_dlc)
    else:
        length, state, crc = _header(arbitration_id, is_extended, False, len(data))
        following, stuffed, crc_of = _NEXT, _STUFFED, _CRC
        length += 8 * len(data)
        for byte in data:
            crc = (crc << 8 & _CRC_MASK) ^ crc_of[crc >> 7 ^ byte]
            state |= byte
            length += stuffed[state]
            state = following[state]
    state |= crc >> 8
    length += _STUFFED_OF_7[state]
    return length + _STUFFED[_NEXT_OF_7[state] | crc & 0xFF] + 15 + TAIL_BITS + INTERMISSION_BITS


def worst_case_length_bits(data_bytes: int, *, is_extended: bool) -> int:
    """Upper bound of a data frame's length with intermission: 80 + 10 s or 55 + 10 s bits for s bytes, 0 to 8.

    Davis, Burns, Bril, Lukkien: Controller Area Network (CAN) schedulability analysis, Real-Time Systems 35 (2007).
    Raises ``ValueError`` for another number of bytes.
    """
    if not 0 <= data_bytes <= CAN_MAX_DLC:
        raise ValueError(f"{data_bytes} data bytes: a classic CAN frame carries 0 to {CAN_MAX_DLC}")
    return (80 if is_extended else 55) + 10 * data_bytes
