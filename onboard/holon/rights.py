"""What a node does with words about tokens: asks, answers, accepts, disputes; the book beside it keeps who holds what.

Petitions that were refused are looked at again; a requester that sees another order of passing is asked to state its
own (design, section 5).
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from onboard.contract.codes import Reason
from onboard.contract.constants import NOBODY
from onboard.contract.messages import (
    Message,
    SyncDone,
    SyncRequest,
    TokenDispute,
    TokenGiven,
    TokenGrant,
    TokenHeld,
    TokenRefusal,
    TokenRequest,
    TokenSeen,
)
from onboard.core.authority import Claim, TokenBook, TokenKey, genesis_holder
from onboard.core.behaviour import Fleet
from onboard.core.effects import Effect, Send
from onboard.holon.witness import Witness

#: A machine whose view of the order differs from mine is asked to state its own at most this often, us: an answer has
#: come by then.
ASK_AGAIN_US = 1_000_000


@dataclass
class RightsTalk:
    """One node's words about tokens; all times are bus time, us.

    ``may_grant`` is its behaviour's verdict on a request: token, requester and time to a reason, NONE for yes.
    """

    fleet: Fleet
    may_grant: Callable[[TokenKey, int, int], Reason]
    witness: Witness
    #: Whether nothing is taken or given: rights are made anew.
    is_frozen: Callable[[], bool] = bool
    _asked_again_us: dict[int, int] = field(default_factory=dict)
    #: Requests that were told since they were last heard that their order of passing is not the one seen here.
    _told_behind: set[tuple[TokenKey, int]] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.site, self.node_id, self.drops = self.fleet.site, self.fleet.node_id, self.fleet.drops
        self.tokens: TokenBook = self.fleet.tokens
        self.tokens.drops = self.drops
        self.mirror, self.petitions = self.fleet.mirror, self.fleet.petitions
        self.tokens.claim = self._claim

    def handlers(self) -> dict[type[Message], Callable[[Any, int], list[Effect]]]:
        """Handler by message class; each takes the class that it is listed under."""
        return {
            TokenRequest: self._on_request,
            TokenGrant: self._on_grant,
            TokenHeld: self._on_held,
            TokenRefusal: self._on_refusal,
            TokenDispute: self.tokens.on_dispute,
            TokenGiven: self._on_given,
            TokenSeen: self._on_seen,
            SyncDone: self.witness.on_done,
        }

    def _on_request(self, request: TokenRequest, now_us: int) -> list[Effect]:
        key = TokenKey(request.token_kind, request.token)
        self.petitions.hear(key, request, now_us)
        self.witness.hear(request, now_us)
        if not self.tokens.holds(key):
            return self.tokens.on_request(request, Reason.TOKEN_HELD_BY_OTHER, now_us)
        verdict = self.may_grant(key, request.sender, now_us)
        effects = self.tokens.on_request(request, verdict, now_us)
        self._told_behind.discard((key, request.sender))
        if verdict is Reason.MIRROR_BEHIND:
            self._told_behind.add((key, request.sender))
            effects += self._ask_again(key, request, now_us)
        return effects

    def _ask_again(self, key: TokenKey, request: TokenRequest, now_us: int) -> list[Effect]:
        """The requester and I see another order: those whom it is about say again what they plan and where they are."""
        about = [request.sender, request.predecessor, self._claim(key, request.sender).predecessor]
        effects: list[Effect] = []
        for node in dict.fromkeys(about):
            asked_us = self._asked_again_us.get(node)
            if node in (NOBODY, self.node_id) or (asked_us is not None and now_us < asked_us + ASK_AGAIN_US):
                continue
            self._asked_again_us[node] = now_us
            effects.append(Send(SyncRequest(self.node_id, node)))
        return effects

    def _claim(self, key: TokenKey, node: int | None = None) -> Claim:
        """What a node's plan says about a token as I see it; by default mine."""
        itinerary = self.mirror.itineraries.get(self.node_id if node is None else node)
        if itinerary is None:
            return Claim(0, NOBODY)
        return Claim(itinerary.version, self.mirror.predecessor(itinerary.sender, key))

    def serve_petitions(self, now_us: int) -> list[Effect]:
        """Look again at requests that were refused: what stood against them may be over."""
        effects: list[Effect] = []
        for key in list(self.petitions.open):
            for requester in self.petitions.due(key, now_us) if self.tokens.holds(key) else ():
                if not self.tokens.holds(key) or not self._was_heard_of_late(requester, now_us):
                    continue
                verdict = self.may_grant(key, requester, now_us)
                if verdict is Reason.NONE:
                    effects += self.tokens.give(key, requester, now_us)
                elif verdict is Reason.MIRROR_BEHIND and (key, requester) not in self._told_behind:
                    # It asks seldom, and only its next request can tell who of us is right.
                    self._told_behind.add((key, requester))
                    again = TokenRequest(requester, *key, 0, *self._claim(key, requester))
                    effects += self.tokens.on_request(again, verdict, now_us)
        self._told_behind = {(key, one) for key, one in self._told_behind if self.petitions.claim(key, one)}
        return effects

    def _was_heard_of_late(self, requester: int, now_us: int) -> bool:
        """Whether an old request is still somebody's: a right that is given to a dead machine is gone with it.

        A machine that lives is heard in each heartbeat period; it gets the right with its next word.
        """
        peer = self.mirror.peers.get(requester)
        return peer is None or now_us - peer.heard_at_us <= self.site.timing.heartbeat_us * 5 // 4

    def petition_due(self) -> int | None:
        """When the first request for a token held here is to be looked at again, bus time in us; None for never."""
        waiting = self.petitions.open.items()
        if not waiting:
            return None
        return min((one.due_us for key, by in waiting if self.tokens.holds(key) for one in by.values()), default=None)

    def _on_grant(self, grant: TokenGrant, now_us: int) -> list[Effect]:
        key = TokenKey(grant.token_kind, grant.token)
        if not self._may_move(key, grant.holder) or (grant.holder == self.node_id and self.is_frozen()):
            return []
        self.witness.hear(grant, now_us)
        if self.tokens.is_news(key, grant.version) and not self.tokens.holds(key):
            self.mirror.on_return(grant.sender, key)
            self.petitions.close(key, grant.holder)
        effects = self.tokens.on_grant(grant, now_us, key)
        return self._after(key, effects, now_us) if effects else effects

    def _on_held(self, statement: TokenHeld, now_us: int) -> list[Effect]:
        key = TokenKey(statement.token_kind, statement.token)
        if not self._may_move(key, statement.sender):
            return []
        self.witness.hear(statement, now_us)
        self.petitions.close(key, statement.sender)
        effects = self.tokens.on_held(statement, now_us, key)
        return self._after(key, effects, now_us) if effects else effects

    def _on_given(self, word: TokenGiven, now_us: int) -> list[Effect]:
        key = TokenKey(word.token_kind, word.token)
        if not self._may_move(key, word.holder):
            return []
        self.witness.hear(word, now_us)
        return self._after(key, self.tokens.on_given(word, now_us), now_us)

    def _on_seen(self, word: TokenSeen, now_us: int) -> list[Effect]:
        if self._may_move(TokenKey(word.token_kind, word.token), word.holder):
            self.witness.hear(word, now_us)
            self.tokens.on_seen(word)
        return []

    def _may_move(self, key: TokenKey, holder: int) -> bool:
        """Whether the site has such a token and such a holder, so that nobody fills the book with what cannot be."""
        machines = self.site.machines
        if holder in machines and genesis_holder(self.site, key) in machines:
            return True
        self.drops[Reason.VALUE_OUT_OF_RANGE] += 1
        return False

    def _after(self, key: TokenKey, effects: list[Effect], now_us: int) -> list[Effect]:
        """What has come to me by a word may be asked for already."""
        if effects and self.tokens.holds(key):
            self.petitions.returned(key, now_us)
            effects = effects + self.serve_petitions(now_us)
        return effects

    def _on_refusal(self, refusal: TokenRefusal, now_us: int) -> list[Effect]:
        """Only who holds a token, by what was proved or by what was heard last, can refuse it: else I go on asking."""
        key, beliefs = TokenKey(refusal.token_kind, refusal.token), self.tokens.beliefs
        if refusal.sender not in (beliefs.of(key).holder, beliefs.latest(key).holder):
            self.drops[Reason.NOT_THE_HOLDER] += 1
            return []
        self.tokens.on_refusal(refusal, now_us)
        return []
