"""Longest frame that an identifier can make, by following the stuffing rule through everything that is not known.

Own code on purpose: what bounds the simulated bus shares nothing with it.
"""

from functools import cache

#: CRC delimiter, ACK slot and delimiter, end of frame, intermission: never stuffed (ISO 11898-1, 10.4).
_TAIL_BITS = 1 + 1 + 1 + 7 + 3
_CRC_BITS = 15


def _header(arbitration_id: int, data_bytes: int) -> str:
    """SOF to DLC of an extended data frame as 0 and 1, unstuffed (ISO 11898-1, 10.4.2)."""
    identifier = f"{arbitration_id:029b}"
    return f"0{identifier[:11]}11{identifier[11:]}000{data_bytes:04b}"


@cache
def longest_frame_bits(arbitration_id: int, data_bytes: int) -> int:
    """Most bit times of a data frame with this 29-bit identifier, intermission included, over all data it can carry.

    The CRC counts as free, so the true longest may be a bit or two less. At most 80 + 10 s for s bytes (Davis, Burns,
    Bril, Lukkien 2007), which assumes the worst of the identifier, too. Raises ``ValueError`` for what is no frame.
    """
    if not 0 <= arbitration_id < 1 << 29 or not 0 <= data_bytes <= 8:
        raise ValueError(f"{arbitration_id:#x} with {data_bytes} bytes: no classic frame with a 29-bit identifier")
    return _longest(_header(arbitration_id, data_bytes) + "x" * (8 * data_bytes + _CRC_BITS)) + _TAIL_BITS


def _longest(bits: str) -> int:
    """Most bits on the wire for a pattern of 0, 1 and x (either), a stuff bit after five equal ones (10.5)."""
    # Most stuff bits so far by (last bit, length of its run).
    reached = {("", 0): 0}
    for bit in bits:
        following: dict[tuple[str, int], int] = {}
        for (last, run), stuffed in reached.items():
            for value in "01" if bit == "x" else bit:
                state, total = (value, run + 1 if value == last else 1), stuffed
                if state[1] == 5:
                    state, total = ("1" if value == "0" else "0", 1), stuffed + 1
                following[state] = max(following.get(state, 0), total)
        reached = following
    return len(bits) + max(reached.values())
