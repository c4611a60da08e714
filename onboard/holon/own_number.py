"""Frames that somebody else sends under this machine's number: which of them made or moved a right.

What is word for word an old statement of mine, such as a log that is played on the live bus, moves nothing: everybody
goes by versions. What is news under my number somebody may have believed (docs/protocol.md, Halting).
"""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field

from onboard.contract.codes import CallResult
from onboard.contract.messages import Award, Message, TokenGrant, TokenHeld
from onboard.core.authority import TokenBook, TokenKey
from onboard.core.effects import Effect, Send
from onboard.core.mirror import Mirror

#: Own awards remembered: a fleet closes some hundreds an hour.
MOST_AWARDS = 256


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
            case Award():
                return message.result is CallResult.AWARDED and message not in self.awards
        return self.mirror.is_false(message)

    def _is_other(self, key: TokenKey, version: int, holder: int) -> bool:
        """Whether a token would be somewhere else than I know, under what version I know or a newer one."""
        if self.tokens.is_news(key, version):
            return True
        return version == self.tokens.seen.get(key) and holder != self.tokens.holder_of(key)
