"""What machines say of who stands and why, and so that rights come back: contract 2 (docs/contract-2.md).

As in ``messages.py``: field names are the signal names of ``dbc/fleet.dbc``, and each class is one frame. A token's
``version`` is the number of its transfer, 1 to 2**28 - 1; it never wraps.
"""

import zlib
from collections.abc import Iterable
from dataclasses import dataclass

from onboard.core.codes import Reason, RegenerationPhase, TokenKind
from onboard.core.messages import Message


@dataclass(frozen=True, slots=True)
class Go(Message):
    """An operator lifts the emergency stop of node ``stopper``, 0 for all stops."""

    stopper: int


@dataclass(frozen=True, slots=True)
class TokenDispute(Message):
    """A grant under ``version`` does not come from ``believed``, whom the sender believes to hold the token."""

    token_kind: TokenKind
    token: int
    version: int
    believed: int


@dataclass(frozen=True, slots=True)
class TokenGiven(Message):
    """The sender's journal says that it gave the token to ``holder`` under ``version``: the answer to a dispute."""

    token_kind: TokenKind
    token: int
    version: int
    holder: int


@dataclass(frozen=True, slots=True)
class TokenSeen(Message):
    """The newest ``version`` of a token that the sender knows, and its ``holder``: a hint, never a right."""

    token_kind: TokenKind
    token: int
    version: int
    holder: int


@dataclass(frozen=True, slots=True)
class TokenAssigned(Message):
    """While tokens are regenerated: under the new epoch ``holder`` will hold the token under ``version``."""

    token_kind: TokenKind
    token: int
    version: int
    holder: int


@dataclass(frozen=True, slots=True)
class Halted(Message):
    """``machine`` does nothing any more, by its own word or because it fell silent.

    ``cause`` is the node that brought it about, 0 for nobody; ``boot`` the machine's boot counter, 0 for unknown.
    """

    machine: int
    reason: Reason
    cause: int
    needs_person: bool
    boot: int


@dataclass(frozen=True, slots=True)
class Regeneration(Message):
    """An operator's step in regenerating the tokens of ``lost`` under a new ``epoch``; ``absent`` is locked off."""

    regeneration_phase: RegenerationPhase
    epoch: int
    lost: int
    absent: int
    tokens: int
    digest: int


@dataclass(frozen=True, slots=True)
class RegenerationState(Message):
    """A machine's answer to ``Regeneration``: how far it is, and what it read back."""

    regeneration_phase: RegenerationPhase
    epoch: int
    tokens: int
    digest: int
    reason: Reason


@dataclass(frozen=True, slots=True)
class SyncDone(Message):
    """All that the sender vouches for has been said since the request of ``whom`` (0: of several)."""

    whom: int
    boot: int


def assignment_digest(assigned: Iterable[TokenAssigned]) -> int:
    """What ``Regeneration`` and ``RegenerationState`` tell as ``digest``, 16 bits.

    The low half of the CRC-32 over kind, token, version and holder of each as big-endian words of 32 bits, in the order
    of kind and token; the same whatever the order in which they came.
    """
    ordered = sorted((one.token_kind, one.token, one.version, one.holder) for one in assigned)
    return zlib.crc32(b"".join(word.to_bytes(4, "big") for one in ordered for word in one)) & 0xFFFF
