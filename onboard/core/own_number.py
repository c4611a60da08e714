"""Frames that somebody else sends under this machine's number: which of them made or moved a right.

What is word for word an old statement of mine, such as a log that is played on the live bus, moves nothing: everybody
goes by versions. What is news under my number somebody may have believed (docs/contract-2.md, Halted).
"""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field

from onboard.core.authority import TokenBook, TokenKey
from onboard.core.codes import CallResult
from onboard.core.effects import Effect, Send
from onboard.core.messages import Award, CarAt, Message, TokenGrant, TokenHeld
from onboard.core.mirror import Mirror
from onboard.core.serial import is_newer

#: Own awards remembered: a fleet closes some hundreds an hour. Ours.
MOST_AWARDS = 256
#: Bits by which ``CarAt.version`` is compared (core/mirror.py).
_CAR_VERSION_BITS = 16


@dataclass
class OwnNumber:
    """What this machine has said itself, as far as rights follow from it."""

    node_id: int
    tokens: TokenBook
    mirror: Mirror
    awards: deque[Award] = field(default_factory=lambda: deque(maxlen=MOST_AWARDS))

    def note(self, effects: Iterable[Effect]) -> None:
        """Remember the awards among what is about to be said."""
        for effect in effects:
            if isinstance(effect, Send) and isinstance(effect.message, Award) and effect.message not in self.awards:
                self.awards.append(effect.message)

    def is_right(self, message: Message) -> bool:
        """Whether a frame under my number says something of rights that I never said."""
        match message:
            case TokenGrant():
                key = TokenKey(message.token_kind, message.token)
                return self._is_other(key, message.version, message.holder)
            case TokenHeld():
                key = TokenKey(message.token_kind, message.token)
                return self._is_other(key, message.version, self.node_id)
            case CarAt():
                known = self.mirror.cars.get(message.car)
                if known is None or is_newer(message.version, known.version, _CAR_VERSION_BITS):
                    return True
                said = (self.node_id, message.station)
                return message.version == known.version and (known.custodian, known.station) != said
            case Award():
                return message.result is CallResult.AWARDED and message not in self.awards
        return False

    def _is_other(self, key: TokenKey, version: int, holder: int) -> bool:
        """Whether a token would be somewhere else than I know, under what version I know or a newer one."""
        if self.tokens.is_news(key, version):
            return True
        return version == self.tokens.seen.get(key) and holder != self.tokens.holder_of(key)
