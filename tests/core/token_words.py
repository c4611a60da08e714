"""Words about tokens to one book, as the controller hands them on: for tests that play a bus of their own."""

from onboard.contract.codes import Reason
from onboard.contract.messages import Message, TokenDispute, TokenGiven, TokenGrant, TokenHeld, TokenRequest, TokenSeen
from onboard.core.authority import TokenBook
from onboard.core.effects import Effect, Send


def hear(book: TokenBook, message: Message, now_us: int, verdict: Reason = Reason.NONE) -> list[Effect]:
    """What a book does with a word of another node; ``verdict`` is what its machine says to a request."""
    match message:
        case TokenRequest():
            return book.on_request(message, verdict, now_us)
        case TokenGrant():
            return book.on_grant(message, now_us)
        case TokenHeld():
            return book.on_held(message, now_us)
        case TokenDispute():
            return book.on_dispute(message, now_us)
        case TokenGiven():
            return book.on_given(message, now_us)
        case TokenSeen():
            book.on_seen(message)
    return []


def said(effects: list[Effect]) -> list[Message]:
    """What goes out on the bus of some effects."""
    return [effect.message for effect in effects if isinstance(effect, Send)]
