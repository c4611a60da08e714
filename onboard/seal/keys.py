"""What a node has to seal with, and to tell others' seals by."""

from collections.abc import Mapping
from dataclasses import dataclass

#: Bytes of every key.
KEY_BYTES = 32


@dataclass(frozen=True, slots=True)
class Keys:
    """The group key of a site, and one key for each other node that only it and ``node`` have, by its node-ID.

    ``made`` is greater each time that keys are written, Unix time in s: lives of their owner begin above it.
    Raises ``ValueError`` for a key of another length, and where ``node`` is among the others.
    """

    node: int
    group: bytes
    pairs: Mapping[int, bytes]
    made: int = 0

    def __post_init__(self) -> None:
        for key in (self.group, *self.pairs.values()):
            if len(key) != KEY_BYTES:
                raise ValueError(f"a key of {len(key)} bytes: {KEY_BYTES} are needed")
        if self.node in self.pairs:
            raise ValueError(f"a key of node {self.node} for itself")
