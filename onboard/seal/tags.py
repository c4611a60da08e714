"""The tag of a seal: 48 bits of BLAKE2s (RFC 7693) under a key, over number, taker, nonce and the frames sealed.

48 bits, as MAVLink 2 signs with. A full bus of 500 kbit/s carries 1,760 seals a second; each is tried over 23 sequences
of frames at most, and 40 of them over 265 more (heard.py): a guess succeeds once in 175 years.
"""

import struct
from collections.abc import Iterable
from functools import lru_cache
from hashlib import blake2s

from onboard.core.frame import Frame

#: Bytes of a tag.
TAG_BYTES = 6
#: Only these tags are made with these keys; other uses of BLAKE2s under the same key give others.
_PERSON = b"fleetbus"
_HEAD = struct.Struct(">QBQ").pack
_FRAME = struct.Struct(">IB").pack
#: Most keys whose first block is kept hashed: those of a site of 250 machines.
_KEYS_KEPT = 512


@lru_cache(maxsize=_KEYS_KEPT)
def _begun(key: bytes) -> blake2s:
    return blake2s(key=key, digest_size=TAG_BYTES, person=_PERSON)


def bytes_of(frame: Frame) -> bytes:
    """What of one frame goes into a tag."""
    data = frame.data
    return _FRAME(frame.arbitration_id, len(data)) + data


def tag_over(key: bytes, number: int, said: bytes, taker: int = 0, nonce: int = 0) -> int:
    """The tag over frames that are bytes already (``bytes_of``, one after the other)."""
    begun = _begun(key).copy()
    begun.update(_HEAD(number, taker, nonce) + said)
    return int.from_bytes(begun.digest(), "little")


def tag_of(key: bytes, number: int, frames: Iterable[Frame], taker: int = 0, nonce: int = 0) -> int:
    """The tag under ``number``, 64 bits; ``taker`` 0 under a group key, ``nonce`` 0 but in answers."""
    return tag_over(key, number, b"".join(map(bytes_of, frames)), taker, nonce)


def following(last: int, low: int) -> int:
    """The least number above ``last`` that ends in the 16 bits ``low``."""
    number = last & ~0xFFFF | low
    return number if number > last else number + 0x10000
