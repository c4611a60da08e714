"""What a regeneration of tokens tells of its assignments, so that everybody can check that it has them all."""

import zlib
from collections.abc import Iterable

from onboard.contract.rights import TokenAssigned


def assignment_digest(assigned: Iterable[TokenAssigned]) -> int:
    """What ``Regeneration`` and ``RegenerationState`` tell as ``digest``, 16 bits.

    The low half of the CRC-32 over kind, token, version and holder of each as big-endian words of 32 bits, in the order
    of kind and token; the same whatever the order in which they came.
    """
    ordered = sorted((one.token_kind, one.token, one.version, one.holder) for one in assigned)
    return zlib.crc32(b"".join(word.to_bytes(4, "big") for one in ordered for word in one)) & 0xFFFF
