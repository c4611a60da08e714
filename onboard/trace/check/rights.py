"""Tokens: one holder each, by versions that rise, given by the holder only (design, section 5)."""

from collections.abc import Callable
from typing import Any

from onboard.contract.codes import TokenKind
from onboard.contract.messages import TokenGrant, TokenHeld
from onboard.core.serial import is_newer
from onboard.trace.check.event import Finding, LogEvent
from onboard.trace.check.picture import BusPicture
from onboard.trace.check.rule import Handlers, Rule
from onboard.trace.check.tokens_seen import VERSION_BITS, Handover, Token, token_named

#: A statement of what was given on a moment ago may have waited in its sender's queue, us.
STALE_US = 1_000_000


class OneHolder(Rule):
    """Every token has exactly one holder: a right moves by erase, journal, then send, and only its holder moves it."""

    name = "one-holder"
    title = "one holder a token"
    source = "design 5: erase, journal, then send; versions rise by one, in a run to one more than its highest"

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        #: What was told last of a token: frames that are said again show nothing new.
        self._told: dict[Token, str] = {}

    def handlers(self) -> Handlers:
        """Grants, and statements of who holds."""
        return {TokenGrant: self._on_grant, TokenHeld: self._on_held}

    def _tell(self, event: LogEvent[Any], token: Token, machines: tuple[int, ...], what: str) -> None:
        if self._told.get(token) != what:
            self._told[token] = what
            self.find(event, machines, what)

    def _on_grant(self, event: LogEvent[TokenGrant]) -> None:
        grant = event.message
        token, version = token_named(grant), grant.version
        if grant.holder == grant.sender:
            self._tell(event, token, (grant.sender,), f"gives {token} to itself")
        last = self.picture.tokens.last(token)
        if last is None:
            self._judge_first(event, token)
        elif not is_newer(version, last.version, VERSION_BITS):
            before = self.picture.tokens.under(token, version)
            if before is not None and not _is_repeat(grant, before):
                who = f"{before.giver} to {before.holder}" if before.giver else f"{before.holder} has it"
                self._tell(
                    event, token, (grant.sender, grant.holder), f"gives {token} under version {version} again: {who}"
                )
        elif grant.sender != last.holder:
            what = f"gives {token} under version {version}, but {last.holder} holds it under {last.version}"
            self._tell(event, token, (grant.sender, last.holder), what)
        elif version > self.picture.tokens.following(token, last.version) and not self.picture.disturbed:
            self._tell(event, token, (grant.sender,), f"gives {token} under version {version}, after {last.version}")

    def _judge_first(self, event: LogEvent[TokenGrant], token: Token) -> None:
        """The first time that a token moves: only where the log begins at power-up is it known whose it is."""
        first = self.picture.tokens.holder(token)
        if first not in (None, event.message.sender):
            self._tell(event, token, (event.message.sender, first or 0), f"gives {token}, which is {first}'s at first")

    def _on_held(self, event: LogEvent[TokenHeld]) -> None:
        held = event.message
        token, tokens = token_named(held), self.picture.tokens
        last = tokens.last(token)
        if last is None:
            first = tokens.holder(token)
            if token.kind is not TokenKind.CAR and first not in (None, held.sender):
                self._tell(
                    event, token, (held.sender, first or 0), f"says it holds {token}, which is {first}'s at first"
                )
        elif held.version == last.version:
            if held.sender != last.holder:
                what = f"says it holds {token} under version {held.version}, which {last.holder} holds"
                self._tell(event, token, (held.sender, last.holder), what)
        elif is_newer(held.version, last.version, VERSION_BITS):
            if not self.picture.disturbed:
                what = f"says it holds {token} under version {held.version}, which nobody gave"
                self._tell(event, token, (held.sender, last.holder), what)
        elif held.sender in self.picture.announcing:
            # An old copy of a journal that is told to all, so that who knows better says so: no right is used by it.
            return
        elif not self.picture.disturbed and event.time_us - last.time_us > STALE_US:
            what = f"says it holds {token} under version {held.version}, which it gave on: now {last.version}"
            self._tell(event, token, (held.sender, last.holder), what)


def _is_repeat(grant: TokenGrant, before: Handover) -> bool:
    return grant.holder == before.holder and before.giver in (0, grant.sender)
