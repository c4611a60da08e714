"""Who holds which right to a place, by the newest word that was said of it."""

from onboard.contract.codes import TokenKind
from onboard.contract.messages import TokenGrant, TokenHeld
from onboard.core.serial import is_newer

#: Loads come and go for ever, places do not: rights to loads are not remembered.
_PLACES = (TokenKind.SEGMENT, TokenKind.STATION)


class RightsHistory:
    """A fold over grants and statements: (version, node-ID of the holder) of each right to a segment or station."""

    def __init__(self) -> None:
        self._known: dict[tuple[TokenKind, int], tuple[int, int]] = {}

    def feed(self, message: TokenGrant | TokenHeld) -> None:
        """Take up one; what is older than what was heard already does not count."""
        if message.token_kind not in _PLACES:
            return
        holder = message.holder if isinstance(message, TokenGrant) else message.sender
        key = message.token_kind, message.token
        known = self._known.get(key)
        if known is None or not is_newer(known[0], message.version, 16):
            self._known[key] = message.version, holder

    def held_by(self, node: int, kind: TokenKind) -> list[int]:
        """Numbers of the rights of one kind that a machine holds, in order."""
        return sorted(number for (one, number), (_, holder) in self._known.items() if one is kind and holder == node)
