"""For imports that are not rewritten yet: ``onboard.contract`` and ``onboard.core.assignments``."""

from onboard.contract.messages import (
    Go,
    Halted,
    Regeneration,
    RegenerationState,
    SyncDone,
    TokenAssigned,
    TokenDispute,
    TokenGiven,
    TokenSeen,
)
from onboard.core.assignments import assignment_digest

__all__ = [
    "Go",
    "Halted",
    "Regeneration",
    "RegenerationState",
    "SyncDone",
    "TokenAssigned",
    "TokenDispute",
    "TokenGiven",
    "TokenSeen",
    "assignment_digest",
]
