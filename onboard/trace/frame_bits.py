"""Exact length of a classic frame on the wire: identifier, data, CRC and the stuff bits of exactly these bits.

Own code on purpose: what measures the simulated bus shares nothing with it. CAN FD frames have two bit rates and are
not counted.
"""

from functools import lru_cache

from onboard.core.frame import Frame

#: CRC delimiter, ACK slot and delimiter, end of frame, intermission: never stuffed (ISO 11898-1, 10.4).
_TAIL_BITS = 1 + 1 + 1 + 7 + 3
#: x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1 without its highest term (ISO 11898-1, 10.4.2.6).
_CRC_POLYNOMIAL = 0x4599
_CRC_BITS = 15
#: An error frame at its longest: both flags, delimiter, intermission (ISO 11898-1, 10.4.4).
ERROR_FRAME_BITS = 12 + 8 + 3


@lru_cache(maxsize=4096)
def frame_bits(frame: Frame) -> int:
    """Bit times from start of frame to the end of the intermission."""
    if frame.is_error:
        return ERROR_FRAME_BITS
    remote = "1" if frame.is_remote else "0"
    if frame.is_extended:
        identifier = f"{frame.arbitration_id:029b}"
        head = f"0{identifier[:11]}11{identifier[11:]}{remote}00"
    else:
        head = f"0{frame.arbitration_id:011b}{remote}00"
    bits = f"{head}{frame.dlc:04b}" + "".join(f"{byte:08b}" for byte in frame.data)
    bits += f"{_crc(bits):015b}"
    return len(bits) + _stuff_bits(bits) + _TAIL_BITS


def _crc(bits: str) -> int:
    register = 0
    for bit in bits:
        following = (register >> _CRC_BITS - 1 & 1) ^ (bit == "1")
        register = register << 1 & (1 << _CRC_BITS) - 1
        if following:
            register ^= _CRC_POLYNOMIAL
    return register


def _stuff_bits(bits: str) -> int:
    """How many bits are put in: one of the other value after five equal ones, itself counted on."""
    stuffed, run, last = 0, 0, ""
    for bit in bits:
        run = run + 1 if bit == last else 1
        last = bit
        if run == 5:
            stuffed += 1
            last, run = "0" if bit == "1" else "1", 1
    return stuffed
