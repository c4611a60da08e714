"""Who holds which right to a place, by the newest word that was said of it."""

from dataclasses import dataclass

from onboard.contract.codes import TokenKind
from onboard.contract.messages import TokenGrant, TokenHeld
from onboard.core.serial import is_newer

#: Loads come and go for ever, places do not: rights to loads are not remembered.
_PLACES = (TokenKind.SEGMENT, TokenKind.STATION)


@dataclass(frozen=True, slots=True)
class RightTold:
    """Who has a right by its own word, or by the word of ``giver``, who had it; 0 for the holder's own word."""

    kind: TokenKind
    number: int
    holder: int
    giver: int


class RightsHistory:
    """A fold over grants and statements: (version, node-ID of the holder) of each right to a segment or station."""

    def __init__(self) -> None:
        self._known: dict[tuple[TokenKind, int], tuple[int, int]] = {}

    def on_word(self, word: TokenGrant | TokenHeld) -> RightTold:
        """Take up one; what is older than what was heard already does not count."""
        giver = word.sender if isinstance(word, TokenGrant) else 0
        holder = word.holder if isinstance(word, TokenGrant) else word.sender
        key = word.token_kind, word.token
        known = self._known.get(key)
        if word.token_kind in _PLACES and (known is None or not is_newer(known[0], word.version, 16)):
            self._known[key] = word.version, holder
        return RightTold(word.token_kind, word.token, holder, giver)

    def held_by(self, node: int, kind: TokenKind) -> list[int]:
        """Numbers of the rights of one kind that a machine holds, in order."""
        return sorted(number for (one, number), (_, holder) in self._known.items() if one is kind and holder == node)
