"""Tokens: who asks for them, who gives and who holds them.

Written by ``make docs`` from ``dbc/fleet.dbc``: change that file, never this one.
"""

from onboard.contract.base import Message, message
from onboard.contract.codes import Reason, RegenerationPhase, TokenKind


@message(frozen=True, slots=True)
class TokenGrant(Message):
    """Moves one token to holder.

    Order at the giver: erase, journal, send. Repeated until TokenHeld or a newer version is heard. Nothing is taken
    back because of a time-out.
    """

    #: What the token number means.
    token_kind: TokenKind
    #: SEGMENT: track << 8 | index. STATION: track << 8 | side << 7 | index. CAR and TASK: origin node-ID << 16 |
    #: number. RUN: track << 16 | first index << 8 | last index, 16 segments in line at most, in this order; the frame
    #: is as good as one for each of them. 0 to 16777215.
    token: int
    #: Number of this transfer of the token; grows with each (by one, or to one more than the highest of a run) and
    #: never wraps; 0 is never sent by a giver. A receiver accepts only a version newer than any seen. 0 to 268435455.
    version: int
    #: Node-ID of the new holder; everybody else only learns where the token went. 1 to 255.
    holder: int


@message(frozen=True, slots=True)
class TokenHeld(Message):
    """The sender holds the token under version: ends the repeating of TokenGrant.

    Sent after the journal has the token.
    """

    #: What the token number means.
    token_kind: TokenKind
    #: SEGMENT: track << 8 | index. STATION: track << 8 | side << 7 | index. CAR and TASK: origin node-ID << 16 |
    #: number. RUN: track << 16 | first index << 8 | last index, 16 segments in line at most, in this order; the frame
    #: is as good as one for each of them. 0 to 16777215.
    token: int
    #: Number of this transfer of the token; grows with each (by one, or to one more than the highest of a run) and
    #: never wraps; 0 is never sent by a giver. A receiver accepts only a version newer than any seen. 0 to 268435455.
    version: int


@message(frozen=True, slots=True)
class TokenRefusal(Message):
    """The answer to a request that cannot be served now; the requester asks again."""

    #: What the token number means.
    token_kind: TokenKind
    #: SEGMENT: track << 8 | index. STATION: track << 8 | side << 7 | index. CAR and TASK: origin node-ID << 16 |
    #: number. RUN: track << 16 | first index << 8 | last index, 16 segments in line at most, in this order; the frame
    #: is as good as one for each of them. 0 to 16777215.
    token: int
    #: Version under which the sender holds it. Of a run the least, which claims too much of none. Low 20 bits of the
    #: version, compared as a serial number (RFC 1982). 0 to 1048575.
    version: int
    #: Node-ID that asked. 1 to 255.
    requester: int
    #: Why not yet.
    reason: Reason


@message(frozen=True, slots=True)
class TokenRequest(Message):
    """Asks whoever holds the token.

    Repeated every token_repeat of the site until granted, refused or no longer wanted. Every node remembers a
    request for 12.5 token_repeat, so once refused it is repeated every 5 token_repeat only.
    """

    #: What the token number means.
    token_kind: TokenKind
    #: SEGMENT: track << 8 | index. STATION: track << 8 | side << 7 | index. CAR and TASK: origin node-ID << 16 |
    #: number. RUN: track << 16 | first index << 8 | last index, 16 segments in line at most, in this order; the frame
    #: is as good as one for each of them. 0 to 16777215.
    token: int
    #: Newest version that the sender has seen of this token, 0 for none. Of a run the least, which claims too much of
    #: none. Low 20 bits of the version, compared as a serial number (RFC 1982). A holder that knows only older ones has
    #: an old journal. 0 to 1048575.
    version_seen: int
    #: Version of the sender's firm itinerary that needs the token; 0: no order of passing is agreed, the sender asks
    #: for all tokens to its next refuge, or none. 0 to 255.
    itinerary_version: int
    #: Node-ID that passes right before the sender, in the sender's view, 0 for nobody. A holder with another view
    #: refuses (MIRROR_BEHIND) and asks those whom it is about to state their plans again. 0 to 255.
    predecessor: int


@message(frozen=True, slots=True)
class TokenDispute(Message):
    """The grant heard by the sender does not come from whom it believes to hold the token: it is not accepted.

    The node believed to hold it answers TokenGiven or TokenHeld.
    """

    #: What the token number means.
    token_kind: TokenKind
    #: SEGMENT: track << 8 | index. STATION: track << 8 | side << 7 | index. CAR and TASK: origin node-ID << 16 |
    #: number. RUN: track << 16 | first index << 8 | last index, 16 segments in line at most, in this order; the frame
    #: is as good as one for each of them. 0 to 16777215.
    token: int
    #: Version of the grant that was not accepted. 0 to 268435455.
    version: int
    #: Node-ID that the sender believes to hold the token. 1 to 255.
    believed: int


@message(frozen=True, slots=True)
class TokenGiven(Message):
    """Whoever gave the token away says from its journal to whom and under which version: the answer to TokenDispute."""

    #: What the token number means.
    token_kind: TokenKind
    #: SEGMENT: track << 8 | index. STATION: track << 8 | side << 7 | index. CAR and TASK: origin node-ID << 16 |
    #: number. RUN: track << 16 | first index << 8 | last index, 16 segments in line at most, in this order; the frame
    #: is as good as one for each of them. 0 to 16777215.
    token: int
    #: Number of this transfer of the token; grows with each (by one, or to one more than the highest of a run) and
    #: never wraps; 0 is never sent by a giver. A receiver accepts only a version newer than any seen. 0 to 268435455.
    version: int
    #: Node-ID to which it was given. 1 to 255.
    holder: int


@message(frozen=True, slots=True)
class TokenSeen(Message):
    """The newest version of a token that the sender knows, and who held it then.

    Said for a machine that was started again, and while tokens are regenerated. A hint, never a right.
    """

    #: What the token number means.
    token_kind: TokenKind
    #: SEGMENT: track << 8 | index. STATION: track << 8 | side << 7 | index. CAR and TASK: origin node-ID << 16 |
    #: number. RUN: track << 16 | first index << 8 | last index, 16 segments in line at most, in this order; the frame
    #: is as good as one for each of them. 0 to 16777215.
    token: int
    #: Number of this transfer of the token; grows with each (by one, or to one more than the highest of a run) and
    #: never wraps; 0 is never sent by a giver. A receiver accepts only a version newer than any seen. 0 to 268435455.
    version: int
    #: Node-ID that holds it as far as the sender knows. 1 to 255.
    holder: int


@message(frozen=True, slots=True)
class TokenAssigned(Message):
    """While tokens are regenerated: under the new epoch the token is held by holder under version.

    It counts once the operator has said COMMIT and everybody has read all of them back.
    """

    #: What the token number means.
    token_kind: TokenKind
    #: SEGMENT: track << 8 | index. STATION: track << 8 | side << 7 | index. CAR and TASK: origin node-ID << 16 |
    #: number. RUN: track << 16 | first index << 8 | last index, 16 segments in line at most, in this order; the frame
    #: is as good as one for each of them. 0 to 16777215.
    token: int
    #: Number of this transfer of the token; grows with each (by one, or to one more than the highest of a run) and
    #: never wraps; 0 is never sent by a giver. A receiver accepts only a version newer than any seen. 0 to 268435455.
    version: int
    #: Node-ID that will hold it. 1 to 255.
    holder: int


@message(frozen=True, slots=True)
class Regeneration(Message):
    """An operator's tool regenerates the tokens of a machine whose journal is lost, under a new epoch of the site."""

    #: What everybody is asked to do.
    regeneration_phase: RegenerationPhase
    #: The new epoch of the site. 1 to 255.
    epoch: int
    #: Node-ID of the machine whose tokens are regenerated, 0 for none. 0 to 250.
    lost: int
    #: Node-ID of a machine that a person has locked off, 0 for none. 0 to 250.
    absent: int
    #: How many TokenAssigned belong to it. 0 to 65535.
    tokens: int
    #: Low 16 bits of the CRC-32 over kind, token, version and holder of each assignment, by kind and token, as 32-bit
    #: big-endian words. 0 to 65535.
    digest: int


@message(frozen=True, slots=True)
class RegenerationState(Message):
    """A machine's answer: how far it is, and what it read back."""

    #: How far it is.
    regeneration_phase: RegenerationPhase
    #: The epoch that it is about. 0 to 255.
    epoch: int
    #: How many TokenAssigned it has, or has told. 0 to 65535.
    tokens: int
    #: Low 16 bits of the CRC-32 over kind, token, version and holder of each assignment, by kind and token, as 32-bit
    #: big-endian words. 0 to 65535.
    digest: int
    #: Why it refuses, where it does.
    reason: Reason
