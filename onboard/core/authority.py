"""Authority: versioned tokens, each with exactly one holder, and the one function that permits motion.

Rules (design, section 5): a right moves only by *erase, journal, then send*; it is accepted only if addressed to me,
newer than all that I did with it, and from whom I believe to hold it; nothing is taken back because of a time-out, and
what I hold leaves by my own hand only. A lost grant is said again until the new holder is heard, so losing frames costs
time and never doubles a token. Whatever ends a grant is in the journal, so that no replay revives it.
"""

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

from onboard.contract.codes import Reason, TokenKind
from onboard.contract.constants import NOBODY, SEEN_VERSION_BITS
from onboard.contract.messages import (
    Message,
    TokenDispute,
    TokenGiven,
    TokenGrant,
    TokenHeld,
    TokenRefusal,
    TokenRequest,
    TokenSeen,
)
from onboard.core.backoff import BackOff
from onboard.core.belief import Belief, Beliefs
from onboard.core.effects import Effect, Record, Report, Send
from onboard.core.journal_records import Entry, records_in
from onboard.core.records import RetiredRecord, TokenGivenRecord, TokenGoneRecord, TokenHeldRecord, TokenRecord
from onboard.core.run_versions import RunVersions
from onboard.core.site import Site
from onboard.core.token_keys import TokenKey, genesis_holder, may_exist, segment_token, station_token

__all__ = ["Claim", "TokenBook", "TokenKey", "genesis_holder", "may_exist", "segment_token", "station_token"]

#: Whoever was refused asks again after so many token repeats, but seldom where the holder gives by itself (rule 10).
REFUSED_REPEATS = 5
#: A grant this young is still on its way and is not said again for a request, us: one journal write, and a burst.
IN_FLIGHT_US = 20_000


class Claim(NamedTuple):
    """What a request says beside the token.

    ``itinerary_version`` is that of the firm itinerary that needs it, 0 for none; ``predecessor`` is who is believed to
    pass right before.
    """

    itinerary_version: int
    predecessor: int


def no_claim(key: TokenKey) -> Claim:
    """No plan needs the token, and nobody is believed to come first."""
    return Claim(0, NOBODY)


def nothing_first(grant: TokenGrant) -> list[Effect]:
    """A token needs no other word than its grant."""
    return []


class Grant(NamedTuple):
    """A token on its way: said again until ``holder`` is heard under ``version`` or newer."""

    version: int
    holder: int
    repeat_at_us: int


@dataclass
class TokenBook:
    """One node's tokens: those it holds, those it gave away and has not heard of yet, and whom it believes of others.

    Pure: every method takes the time (bus time, us) and returns effects in the order in which they must happen.
    """

    site: Site
    node_id: int
    held: dict[TokenKey, int] = field(default_factory=dict)
    leaving: dict[TokenKey, Grant] = field(default_factory=dict)
    #: The newest version under which this node itself held a token, or gave it away: what it takes must be newer.
    seen: dict[TokenKey, int] = field(default_factory=dict)
    #: To whom each token went that this node gave away last, and under which version: what it answers to a dispute.
    given: dict[TokenKey, Belief] = field(default_factory=dict)
    #: Tokens given away while somebody who was started again waited for an answer.
    gifts: set[TokenKey] = field(default_factory=set)
    beliefs: Beliefs = field(init=False)
    #: When what waits for an answer is said again.
    backoff: BackOff = field(init=False)
    wanted: dict[TokenKey, int] = field(default_factory=dict)
    refused: dict[TokenKey, Reason] = field(default_factory=dict)
    #: What to say with a request for a token, from this node's plan and mirror.
    claim: Callable[[TokenKey], Claim] = no_claim
    #: What must be in the journal before a token granted to me counts as mine; None where it cannot be mine yet.
    before_taking: Callable[[TokenGrant], list[Effect] | None] = nothing_first
    #: What must be heard before a grant of mine can be accepted; it is said again with it.
    before_grant: Callable[[TokenGrant], list[Effect]] = nothing_first
    #: Tokens asked for without an agreed order, and since when the holder's view of the order has differed from mine.
    unordered: set[TokenKey] = field(default_factory=set)
    behind_since_us: dict[TokenKey, int] = field(default_factory=dict)
    #: Whether what the journal says is mine may be used: not before all that live have answered after a start.
    is_synced: bool = True
    contradicted: tuple[int, str] | None = None  # Who has what of this node that its journal never gave: it is old.
    #: Nodes asked for all that they vouch for that have not ended their answer: what they say they hold is believed.
    asked: set[int] = field(default_factory=set)
    #: Words that came to nothing, by reason: the holon's own count; and who claimed a right of mine how often.
    drops: Counter[Reason] = field(default_factory=Counter)
    claimants: Counter[int] = field(default_factory=Counter)
    #: Grows with every change of what is held, given away, wanted or refused here, so that nobody need look twice.
    changes: int = 0
    #: Grants to me from whom I do not believe to hold the token, until that is settled.
    _disputed: dict[TokenKey, TokenGrant] = field(default_factory=dict)
    #: When a word of a class about a token may be said again, so that many who ask are answered once.
    _said_us: dict[tuple[TokenKey, type[Message]], int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.backoff = BackOff(self.site.timing.token_repeat_us)
        self.beliefs = Beliefs(lambda key: genesis_holder(self.site, key))
        self._versions = RunVersions(lambda key: self.own_version(key) if self.holds(key) else None)

    def replay(self, entries: Iterable[Entry]) -> None:
        """Restore holdings from the journal, oldest entry first; entries of other record types are passed over."""
        for record in records_in(entries, RetiredRecord, TokenHeldRecord, TokenGivenRecord, TokenGoneRecord):
            if isinstance(record, RetiredRecord):
                self.retire(TokenKey(record.kind, record.number))
            if not isinstance(record, TokenRecord):
                continue
            key, version, holder = TokenKey(record.kind, record.number), record.version, record.holder
            self.seen[key] = max(version, self.seen.get(key, 0))
            self.held.pop(key, None)
            self.leaving.pop(key, None)
            has_come = not isinstance(record, TokenGivenRecord)
            self.beliefs.take_up(key, version, holder, confirmed=has_come)
            if isinstance(record, TokenHeldRecord):
                self.held[key] = version
            else:
                self.given[key] = Belief(version, holder, has_come)
            if isinstance(record, TokenGivenRecord):
                self.leaving[key] = Grant(version, holder, 0)

    def holds(self, key: TokenKey) -> bool:
        """Whether this node is the holder now; a token never seen to move is with its genesis holder."""
        return self.is_synced and (
            key in self.held if key in self.seen else genesis_holder(self.site, key) == self.node_id
        )

    def is_mine_by_journal(self, key: TokenKey) -> bool:
        """Whether this node holds a token if its journal is all that ever was."""
        return key in self.held if key in self.seen else genesis_holder(self.site, key) == self.node_id

    def mine(self) -> list[TokenKey]:
        """Tokens that came to this node and that it may use or give away now."""
        return list(self.held) if self.is_synced else []

    def holder_of(self, key: TokenKey) -> int:
        """Who holds a token as far as this node heard: exact for its own, a hint for others."""
        return self.node_id if self.holds(key) else self.beliefs.latest(key).holder

    def version_of(self, key: TokenKey) -> int:
        """The newest version of a token that is known for sure, 0 where it never moved."""
        return max(self.seen.get(key, 0), self.beliefs.of(key).version)

    def own_version(self, key: TokenKey) -> int:
        """The version under which this node holds a token, or gave it away last; 0 where it never had it but first."""
        return self.held.get(key, self.seen.get(key, 0))

    def is_known(self, key: TokenKey) -> bool:
        """Whether anything was ever heard of a token."""
        return key in self.seen or key in self.beliefs.verified or key in self.beliefs.hints

    def trust(self) -> None:
        """Nobody knows better than the journal: what it says is mine, and what the site file gives me first, is."""
        self.is_synced = True
        self.changes += 1

    def create(self, key: TokenKey) -> list[Effect]:
        """Bring a new token into the world, held by this node. Raises ``ValueError`` where it exists."""
        if self.is_known(key):
            raise ValueError(f"token {key} exists already")
        self._hold(key, 1)
        return [_record(TokenHeldRecord, key, 1, self.node_id)]

    def retire(self, key: TokenKey) -> bool:
        """Forget the token of what ended so long ago that no frame about it can still be under way; True if so.

        Its number comes again after 65,535 others; what was never retired is remembered for good.
        """
        if key in self.leaving or key in self.wanted:
            return False
        for table in (self.seen, self.held, self.given, self._disputed):
            table.pop(key, None)
        self.gifts.discard(key)
        self.beliefs.forget(key)
        self._said_us = {said: due_us for said, due_us in self._said_us.items() if said[0] != key}
        self.changes += 1
        return True

    def want(self, key: TokenKey, now_us: int) -> list[Effect]:
        """Ask for a token until it is granted or no longer wanted. Nothing happens where it is held or asked for."""
        if self.is_mine_by_journal(key) or key in self.wanted:
            return []
        self.wanted[key] = now_us
        self.changes += 1
        return self.wake(now_us)

    def forget(self, key: TokenKey) -> None:
        """Stop asking. A grant that still arrives is accepted and can be given back."""
        self.changes += 1
        self.wanted.pop(key, None)
        self.backoff.forget(("wanted", key))
        self.refused.pop(key, None)
        self.behind_since_us.pop(key, None)

    def begin_anew(self, now_us: int) -> None:
        """A machine has come back, or was started: what waits may wait for it, and is said soon again."""
        self.backoff.begin_anew()
        soon_us = now_us + self.backoff.repeat_us
        self.wanted = {key: min(due_us, soon_us) for key, due_us in self.wanted.items()}
        self.leaving = {
            key: grant._replace(repeat_at_us=min(grant.repeat_at_us, soon_us)) for key, grant in self.leaving.items()
        }

    def give(self, key: TokenKey, to: int, now_us: int) -> list[Effect]:
        """Move a held token to node ``to``: erase, journal, then send.

        Raises ``ValueError`` where it is not held, or has moved so often that no version is left for it.
        """
        if not self.holds(key):
            raise ValueError(f"node {self.node_id} gives {key} which it does not hold")
        version = self._versions.following(key, self.own_version(key), to, now_us)
        self.held.pop(key, None)
        self.changes += 1
        self.seen[key] = version
        self.given[key] = Belief(version, to)
        self.gifts.add(key)
        self.beliefs.take_up(key, version, to, giver=self.node_id)
        self.backoff.forget(("leaving", key))
        self.leaving[key] = Grant(version, to, self.backoff.say(("leaving", key), now_us))
        return [_record(TokenGivenRecord, key, version, to), Send(self._grant(key, version, to))]

    # --- words of others ---------------------------------------------------------------------------------------

    def on_request(self, request: TokenRequest, verdict: Reason, now_us: int) -> list[Effect]:
        """Answer a request for a token held here: ``verdict`` NONE grants, any other reason refuses and says so."""
        key = TokenKey(request.token_kind, request.token)
        pending = self.leaving.get(key) if self.is_synced else None
        if pending is not None and pending.holder == request.sender:
            said_us = self.backoff.last_us(("leaving", key))
            if said_us is not None and now_us < said_us + IN_FLIGHT_US:
                return []
            return self._grant_again(key, pending)
        if not self.holds(key):
            return []
        if verdict is Reason.NONE:
            return self.give(key, request.sender, now_us)
        version = self.own_version(key) % (1 << SEEN_VERSION_BITS)
        return [Send(TokenRefusal(self.node_id, key.kind, key.number, version, request.sender, verdict))]

    def on_grant(self, grant: TokenGrant, now_us: int, known: TokenKey | None = None) -> list[Effect]:
        """Accept a token if addressed to me, newer than all that I did with it, and from whom I believe to hold it.

        One that needs another word first is as if it had not been heard: its giver says both again. Else learn where it
        went.
        """
        key = TokenKey(grant.token_kind, grant.token) if known is None else known
        if grant.holder != self.node_id:
            return self._overheard(key, grant.sender, grant.version, grant.holder, now_us)
        return self._offered(key, grant, now_us)

    def on_held(self, statement: TokenHeld, now_us: int = 0, known: TokenKey | None = None) -> list[Effect]:
        """The new holder speaks: its grant need not be repeated. Who is not believed to hold it is a claimant."""
        key = TokenKey(statement.token_kind, statement.token) if known is None else known
        sender, version = statement.sender, statement.version
        if self.holds(key):
            is_old = version < self.own_version(key)
            return self._tell_seen(key, now_us) if is_old else self._claimed(key, sender, now_us)
        belief = self.beliefs.of(key)
        if belief[:3] == (version, sender, True):
            return []
        if sender == belief.holder and version >= belief.version:
            return self._verified(key, version, sender, now_us, confirmed=True)
        if version <= belief.version:
            return self._tell_seen(key, now_us) if key in self.seen else []
        if sender in self.asked:
            return self._verified(key, version, sender, now_us, confirmed=True)
        self.beliefs.hint(key, version, sender)
        return self._dispute(key, version, now_us)

    def on_given(self, word: TokenGiven, now_us: int) -> list[Effect]:
        """Whoever was believed to hold a token says to whom it gave it: the chain of beliefs goes on from there."""
        return self._overheard(TokenKey(word.token_kind, word.token), word.sender, word.version, word.holder, now_us)

    def drop_disputed(self, giver: int) -> None:
        """A node was started again: what it gave before, and was disputed, counts only if it gives it again."""
        self._disputed = {key: grant for key, grant in self._disputed.items() if grant.sender != giver}

    def on_dispute(self, dispute: TokenDispute, now_us: int) -> list[Effect]:
        """Somebody believes that I hold a token which another gave away: say what my journal knows of it."""
        if dispute.believed != self.node_id:
            return []
        return self._answer(TokenKey(dispute.token_kind, dispute.token), now_us)

    def on_seen(self, word: TokenSeen) -> None:
        """Somebody tells the newest that it knows: a hint."""
        self.beliefs.hint(TokenKey(word.token_kind, word.token), word.version, word.holder)

    def on_refusal(self, refusal: TokenRefusal, now_us: int) -> None:
        """Remember why the holder does not give a wanted token yet; as it remembers the request, ask less often."""
        key = TokenKey(refusal.token_kind, refusal.token)
        if refusal.requester == self.node_id and key in self.wanted:
            self.refused[key] = refusal.reason
            is_behind = refusal.reason is Reason.MIRROR_BEHIND
            if is_behind:
                self.behind_since_us.setdefault(key, now_us)
            else:
                self.behind_since_us.pop(key, None)
            is_soon = is_behind or key in self.unordered or not self.claim(key).itinerary_version
            is_soon |= refusal.reason is Reason.TOKEN_NOT_GRANTABLE_YET and key.kind is not TokenKind.SEGMENT
            rest_us = REFUSED_REPEATS * self.backoff.repeat_us if is_soon else self.backoff.longest_us
            self.wanted[key] = max(now_us + rest_us, 0 if is_behind else self.wanted[key])
            self.changes += 1

    def newest(self, key: TokenKey) -> TokenSeen:
        """The newest that I know of a token: who is sure to have had it, as its holder or as who gave it away then.

        A grant that its receiver has not confirmed proves that its giver had the token, and nothing about its receiver.
        """
        if self.is_mine_by_journal(key):
            return TokenSeen(self.node_id, *key, self.own_version(key), self.node_id)
        belief = self.beliefs.of(key)
        sure = belief.holder if belief.confirmed else belief.giver or self.node_id
        return TokenSeen(self.node_id, *key, belief.version, sure)

    # --- what is said without being asked --------------------------------------------------------------------------

    def statements(self) -> list[Effect]:
        """What this node holds away from the site file's first holders, and what it gave away and is under way."""
        held = [Send(TokenHeld(self.node_id, *key, version)) for key, version in self.held.items()]
        gone = [Send(TokenGiven(self.node_id, *key, one.version, one.holder)) for key, one in self.leaving.items()]
        return [*held, *gone]

    def wake(self, now_us: int) -> list[Effect]:
        """Say again what has waited long enough: wanted tokens, and grants whose receiver was not heard."""
        effects: list[Effect] = []
        if not self.is_synced:
            return effects
        waiting = len(self.wanted) + len(self.leaving)
        for key, due_us in self.wanted.items():
            if due_us <= now_us:
                claim = no_claim(key) if key in self.unordered else self.claim(key)
                of_set = self.backoff.unordered_us * max(1, len(self.unordered & self.wanted.keys()))
                longest_us = self.backoff.longest_us if claim.itinerary_version else of_set
                self.wanted[key] = self.backoff.say(("wanted", key), now_us, waiting, longest_us)
                seen = self.version_of(key) % (1 << SEEN_VERSION_BITS)
                effects.append(Send(TokenRequest(self.node_id, *key, seen, *claim)))
        for key, grant in self.leaving.items():
            if grant.repeat_at_us <= now_us:
                due_us = self.backoff.say(("leaving", key), now_us, waiting)
                self.leaving[key] = grant._replace(repeat_at_us=due_us)
                effects += self._grant_again(key, grant)
        return effects

    def next_wake(self) -> int | None:
        """When something falls due to be said again, bus time in us."""
        times = [*self.wanted.values(), *(grant.repeat_at_us for grant in self.leaving.values())]
        return min(times, default=None) if self.is_synced else None

    def is_news(self, key: TokenKey, version: int) -> bool:
        """Whether ``version`` of a token is newer than all that is known of it, hints too."""
        return version > max(self.seen.get(key, 0), self.beliefs.latest(key).version)

    # --- inner works -----------------------------------------------------------------------------------------------

    def _hold(self, key: TokenKey, version: int) -> None:
        self.held[key] = self.seen[key] = version
        self.beliefs.take_up(key, version, self.node_id, confirmed=True)
        self.leaving.pop(key, None)
        self._disputed.pop(key, None)
        self.forget(key)

    def _offered(self, key: TokenKey, grant: TokenGrant, now_us: int) -> list[Effect]:
        if not self.is_synced:
            return []
        if grant.version <= self.seen.get(key, 0):
            # A repeated grant of what I accepted means that my statement was lost.
            return self._answer(key, now_us)
        if self.holds(key):
            return self._claimed(key, grant.sender, now_us)
        belief = self.beliefs.of(key)
        if grant.sender != belief.holder:
            self.drops[Reason.NOT_THE_HOLDER] += 1
            self._disputed[key] = grant
            return self._dispute(key, grant.version, now_us)
        return self._take(key, grant) if grant.version > belief.version else []

    def _take(self, key: TokenKey, grant: TokenGrant) -> list[Effect]:
        first = self.before_taking(grant)
        if first is None:
            return []
        self._hold(key, grant.version)
        held = Send(TokenHeld(self.node_id, *key, grant.version))
        return [*first, _record(TokenHeldRecord, key, grant.version, self.node_id), held]

    def _overheard(self, key: TokenKey, giver: int, version: int, holder: int, now_us: int) -> list[Effect]:
        """``giver`` says that it gave a token to ``holder``: believed of whom I believe to have held it."""
        if self.holds(key):
            return self._claimed(key, giver, now_us) if version > self.own_version(key) else []
        belief = self.beliefs.of(key)
        if version <= belief.version or holder == self.node_id:
            # What is given to me comes with its grant.
            return []
        if giver == belief.holder:
            return self._verified(key, version, holder, now_us, giver=giver)
        self.beliefs.hint(key, version, holder)
        return []

    def _verified(
        self, key: TokenKey, version: int, holder: int, now_us: int, *, confirmed: bool = False, giver: int = NOBODY
    ) -> list[Effect]:
        """The chain of beliefs goes on: my own grant has arrived with it, and a disputed one may be right now."""
        self.beliefs.take_up(key, version, holder, confirmed=confirmed, giver=giver)
        effects: list[Effect] = []
        pending = self.leaving.get(key)
        # Its receiver says that it holds the token, or that it gave it on: either proves that it had it.
        if pending is not None and (confirmed or version > pending.version):
            del self.leaving[key]
            self.changes += 1
            self.backoff.forget(("leaving", key))
            self.given[key] = Belief(pending.version, pending.holder, confirmed=True)
            effects.append(_record(TokenGoneRecord, key, pending.version, pending.holder))
        disputed = self._disputed.pop(key, None)
        return effects if disputed is None else effects + self._offered(key, disputed, now_us)

    def _claimed(self, key: TokenKey, by: int, now_us: int) -> list[Effect]:
        """Somebody says that what I hold is not mine: counted, named, and I keep it and say so."""
        self.drops[Reason.RIGHT_CLAIMED] += 1
        self.claimants[by] += 1
        self.changes += 1
        first = [Report(f"node {by} claims {key.kind.name} {key.number}, which is mine")] * (self.claimants[by] == 1)
        return [*first, *self._answer(key, now_us)]

    def _answer(self, key: TokenKey, now_us: int) -> list[Effect]:
        """What my journal knows of a token: that I hold it, or to whom I gave it; once for all who ask at a time."""
        given = self.given.get(key)
        word: Message
        if self.holds(key):
            word = TokenHeld(self.node_id, key.kind, key.number, self.own_version(key))
        elif given is not None and self.is_synced:
            word = TokenGiven(self.node_id, key.kind, key.number, given.version, given.holder)
        else:
            return []
        return self._once(key, word, IN_FLIGHT_US, now_us)

    def _tell_seen(self, key: TokenKey, now_us: int) -> list[Effect]:
        """Somebody says that it holds a token under a version older than I know."""
        return self._once(key, self.newest(key), self.site.timing.token_repeat_us, now_us)

    def _dispute(self, key: TokenKey, version: int, now_us: int) -> list[Effect]:
        believed = self.beliefs.of(key).holder
        word = TokenDispute(self.node_id, key.kind, key.number, version, believed)
        return self._once(key, word, self.site.timing.token_repeat_us // 2, now_us)

    def _once(self, key: TokenKey, word: Message, period_us: int, now_us: int) -> list[Effect]:
        """Say a word at most once in a period; the same as when it was said last, or not."""
        if now_us < self._said_us.get((key, type(word)), now_us):
            return []
        self._said_us[key, type(word)] = now_us + period_us
        return [Send(word)]

    def _grant_again(self, key: TokenKey, given: Grant) -> list[Effect]:
        grant = self._grant(key, given.version, given.holder)
        return [*self.before_grant(grant), Send(grant)]

    def _grant(self, key: TokenKey, version: int, to: int) -> TokenGrant:
        return TokenGrant(self.node_id, key.kind, key.number, version, to)


def _record(record: type[TokenRecord], key: TokenKey, version: int, holder: int) -> Record:
    return Record(record(key.kind, key.number, version, holder))
