"""Authority: versioned tokens, each with exactly one holder, and the one function that permits motion.

Rules (design, section 5): a right moves only by *erase, journal, then send*; it is accepted only if addressed to me and
newer than anything seen; nothing is taken back because of a time-out. A lost grant is said again until the new holder
is heard, so losing frames costs time and never doubles a token.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from onboard.core.codes import NOBODY, SEEN_VERSION_BITS, KindCode, Reason, TokenKind
from onboard.core.effects import Effect, Record, Send
from onboard.core.messages import TokenGrant, TokenHeld, TokenRefusal, TokenRequest
from onboard.core.serial import is_newer, successor
from onboard.core.site import Segment, Site, Station

#: Bits of a version in ``TokenGrant`` and ``TokenHeld``: 163 years of the busiest slot, so that it never wraps.
_VERSION_BITS = 28
#: Whoever was refused asks again after this many token repeats: the holder remembers the request. Ours.
REFUSED_REPEATS = 5
#: A grant this young is still on its way and is not said again for a request, us: one journal write, and a burst. Ours.
IN_FLIGHT_US = 20_000


class TokenKey(NamedTuple):
    """Which token: its kind and 24-bit number."""

    kind: TokenKind
    number: int


def segment_token(segment: Segment) -> TokenKey:
    """The token of one body slot."""
    return TokenKey(TokenKind.SEGMENT, segment.number)


def station_token(station: Station) -> TokenKey:
    """The token of one place, or of a compartment's bay: who holds it may send a shuttle in."""
    return TokenKey(TokenKind.STATION, station.number)


def car_token(origin: int, number: int) -> TokenKey:
    """The token of one car: its holder is the custodian."""
    return TokenKey(TokenKind.CAR, origin << 16 | number)


def genesis_holder(site: Site, key: TokenKey) -> int:
    """Who holds a token before it first moves, by the site file alone.

    A robot holds the segment of its home, a compartment its bay; the track's steward holds all other segments and
    places. Cars and tasks are made by their origin node.
    """
    if key.kind in (TokenKind.CAR, TokenKind.TASK):
        return key.number >> 16
    if key.kind is TokenKind.SEGMENT:
        for machine in site.machines.values():
            if machine.kind is KindCode.ROBOT and machine.home.number == key.number:
                return machine.node_id
    else:
        for node_id, station in site.compartments.items():
            if station.number == key.number:
                return node_id
    return site.stewards.get(key.number >> 8, 0)


def may_exist(site: Site, key: TokenKey) -> bool:
    """Whether the site has such a token, so that no frame can fill the book with what nobody ever made."""
    return genesis_holder(site, key) in site.machines


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
    """One node's tokens: those it holds, those it gave away and has not heard of yet, and all it saw of others.

    Pure: every method takes the time (bus time, us) and returns effects in the order in which they must happen.
    """

    site: Site
    node_id: int
    held: dict[TokenKey, int] = field(default_factory=dict)
    leaving: dict[TokenKey, Grant] = field(default_factory=dict)
    seen: dict[TokenKey, int] = field(default_factory=dict)
    holder: dict[TokenKey, int] = field(default_factory=dict)
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
    #: Whether tokens never seen to move count as with their first holders: not while my journal may be lost.
    genesis_counts: bool = True
    #: Grows with every change of the tables above, so that nobody need look twice at the same state.
    changes: int = 0
    _genesis: dict[TokenKey, int] = field(default_factory=dict)

    def replay(self, entries: Iterable[Mapping[str, str | int]]) -> None:
        """Restore holdings from the journal, oldest entry first; entries of other record types are passed over."""
        for entry in entries:
            if entry.get("record") not in ("token_held", "token_given", "token_gone"):
                continue
            key = TokenKey(TokenKind(int(entry["kind"])), int(entry["number"]))
            version = int(entry["version"])
            self.seen[key] = version
            self.held.pop(key, None)
            self.leaving.pop(key, None)
            if entry["record"] == "token_held":
                self.held[key] = version
            elif entry["record"] == "token_given":
                self.holder[key] = int(entry["holder"])
                self.leaving[key] = Grant(version, int(entry["holder"]), 0)

    def holds(self, key: TokenKey) -> bool:
        """Whether this node is the holder now; a token never seen to move is with its genesis holder."""
        if key in self.held:
            return True
        return self.genesis_counts and self._is_own_at_first(key)

    def holder_of(self, key: TokenKey) -> int:
        """Who holds a token as far as this node heard: exact for its own, a hint for others."""
        if self.holds(key):
            return self.node_id
        return self.holder.get(key, self._first_holder(key))

    def trust_genesis(self) -> None:
        """Nobody knew an earlier life of this node: what the site file gives it first is its own."""
        self.genesis_counts = True
        self.changes += 1

    def create(self, key: TokenKey) -> list[Effect]:
        """Bring a new token (of a car) into the world, held by this node. Raises ``ValueError`` where it exists."""
        if key in self.seen or key in self.held:
            raise ValueError(f"token {key} exists already")
        self.held[key] = self.seen[key] = 1
        self.changes += 1
        return [self._record("token_held", key, 1, self.node_id)]

    def retire(self, key: TokenKey) -> None:
        """Forget the token of a car that left so long ago that no frame about it can still be under way.

        Its number comes again after 65,535 others; what was never retired is remembered for good.
        """
        if key not in self.leaving and key not in self.wanted:
            for table in (self.seen, self.holder, self.held, self._genesis):
                table.pop(key, None)
            self.changes += 1

    def want(self, key: TokenKey, now_us: int) -> list[Effect]:
        """Ask for a token until it is granted or no longer wanted. Nothing happens where it is held or asked for."""
        if self.holds(key) or key in self.wanted or self._is_own_at_first(key):
            return []
        self.wanted[key] = now_us
        self.changes += 1
        return self.wake(now_us)

    def forget(self, key: TokenKey) -> None:
        """Stop asking. A grant that still arrives is accepted and can be given back."""
        self.changes += 1
        self.wanted.pop(key, None)
        self.refused.pop(key, None)
        self.behind_since_us.pop(key, None)

    def give(self, key: TokenKey, to: int, now_us: int) -> list[Effect]:
        """Move a held token to node ``to``: erase, journal, then send. Raises ``ValueError`` where it is not held."""
        if not self.holds(key):
            raise ValueError(f"node {self.node_id} gives {key} which it does not hold")
        version = successor(self.held.pop(key, self.seen.get(key, 0)), _VERSION_BITS)
        self.changes += 1
        self.seen[key] = version
        self.holder[key] = to
        self.leaving[key] = Grant(version, to, now_us + self.site.timing.token_repeat_us)
        return [self._record("token_given", key, version, to), Send(self._grant(key, version, to))]

    def on_request(self, request: TokenRequest, verdict: Reason, now_us: int) -> list[Effect]:
        """Answer a request for a token held here: ``verdict`` NONE grants, any other reason refuses and says so."""
        key = TokenKey(request.token_kind, request.token)
        pending = self.leaving.get(key)
        if pending is not None and pending.holder == request.sender:
            if now_us < pending.repeat_at_us - self.site.timing.token_repeat_us + IN_FLIGHT_US:
                return []
            return self._grant_again(key, pending)
        if not self.holds(key):
            return []
        if verdict is Reason.NONE:
            return self.give(key, request.sender, now_us)
        version = self.held.get(key, self.seen.get(key, 0))
        return [Send(TokenRefusal(self.node_id, key.kind, key.number, _told(version), request.sender, verdict))]

    def on_grant(self, grant: TokenGrant, now_us: int) -> list[Effect]:
        """Accept a token only if addressed to me and newer than anything seen; else learn where it went.

        One that needs another word first is as if it had not been heard: its giver says both again.
        """
        key = TokenKey(grant.token_kind, grant.token)
        if not self.is_news(key, grant.version):
            return self._say_again(key, grant)
        first = self.before_taking(grant) if grant.holder == self.node_id else []
        if first is None:
            return []
        self._learn(key, grant.version, grant.holder)
        if grant.holder != self.node_id:
            return []
        self.held[key] = grant.version
        self.changes += 1
        self.forget(key)
        return [
            *first,
            self._record("token_held", key, grant.version, self.node_id),
            Send(TokenHeld(self.node_id, key.kind, key.number, grant.version)),
        ]

    def on_held(self, statement: TokenHeld) -> list[Effect]:
        """The new holder speaks: its grant need not be repeated."""
        key = TokenKey(statement.token_kind, statement.token)
        pending = self.leaving.get(key)
        if pending is not None and pending.version == statement.version and pending.holder == statement.sender:
            del self.leaving[key]
            return [self._record("token_gone", key, statement.version, statement.sender)]
        if self.is_news(key, statement.version):
            self._learn(key, statement.version, statement.sender)
        return []

    def on_refusal(self, refusal: TokenRefusal, now_us: int) -> None:
        """Remember why the holder does not give a wanted token yet; as it remembers the request, ask less often."""
        key = TokenKey(refusal.token_kind, refusal.token)
        if refusal.requester == self.node_id and key in self.wanted:
            self.refused[key] = refusal.reason
            if refusal.reason is Reason.MIRROR_BEHIND:
                self.behind_since_us.setdefault(key, now_us)
            else:
                self.behind_since_us.pop(key, None)
            self.wanted[key] = now_us + REFUSED_REPEATS * self.site.timing.token_repeat_us
            self.changes += 1

    def statements(self) -> list[Effect]:
        """What this node holds away from the site file's first holders, said for a node that asks."""
        return [Send(TokenHeld(self.node_id, key.kind, key.number, version)) for key, version in self.held.items()]

    def wake(self, now_us: int) -> list[Effect]:
        """Say again what has waited long enough: wanted tokens, and grants whose receiver was not heard."""
        effects: list[Effect] = []
        repeat_us = self.site.timing.token_repeat_us
        for key, due_us in self.wanted.items():
            if due_us <= now_us:
                self.wanted[key] = now_us + repeat_us
                claim = no_claim(key) if key in self.unordered else self.claim(key)
                effects.append(Send(TokenRequest(self.node_id, *key, _told(self.seen.get(key, 0)), *claim)))
        for key, grant in self.leaving.items():
            if grant.repeat_at_us <= now_us:
                self.leaving[key] = grant._replace(repeat_at_us=now_us + repeat_us)
                effects += self._grant_again(key, grant)
        return effects

    def next_wake(self) -> int | None:
        """When something falls due to be said again, bus time in us."""
        times = [*self.wanted.values(), *(grant.repeat_at_us for grant in self.leaving.values())]
        return min(times) if times else None

    def is_news(self, key: TokenKey, version: int) -> bool:
        """Whether ``version`` of a token is newer than anything seen of it."""
        return key not in self.seen or is_newer(version, self.seen[key], _VERSION_BITS)

    def _is_own_at_first(self, key: TokenKey) -> bool:
        return key not in self.seen and self._first_holder(key) == self.node_id

    def _first_holder(self, key: TokenKey) -> int:
        found = self._genesis.get(key)
        if found is None:
            found = self._genesis[key] = genesis_holder(self.site, key)
        return found

    def _learn(self, key: TokenKey, version: int, holder: int) -> None:
        # A newer version held elsewhere proves that my own grant arrived, or that my memory is older than the bus.
        self.changes += 1
        self.seen[key] = version
        self.holder[key] = holder
        self.held.pop(key, None)
        self.leaving.pop(key, None)

    def _say_again(self, key: TokenKey, grant: TokenGrant) -> list[Effect]:
        """A repeated grant of what I accepted means that my statement was lost: state it again."""
        if grant.holder == self.node_id and self.held.get(key) == grant.version:
            return [Send(TokenHeld(self.node_id, key.kind, key.number, grant.version))]
        return []

    def _grant_again(self, key: TokenKey, given: Grant) -> list[Effect]:
        grant = self._grant(key, given.version, given.holder)
        return [*self.before_grant(grant), Send(grant)]

    def _grant(self, key: TokenKey, version: int, to: int) -> TokenGrant:
        return TokenGrant(self.node_id, key.kind, key.number, version, to)

    def _record(self, record: str, key: TokenKey, version: int, holder: int) -> Record:
        return Record(
            {"record": record, "kind": int(key.kind), "number": key.number, "version": version, "holder": holder}
        )


def needs_no_proof(segment: Segment) -> Reason:
    """The token of a slot that is always there is enough."""
    return Reason.NONE


@dataclass(frozen=True, slots=True)
class MotionState:
    """What ``authorised`` looks at: the tokens held and whether the machine may move at all.

    ``proof`` says why a slot whose token is held cannot be entered all the same: a platform that nobody said is there.
    """

    tokens: TokenBook
    position_known: bool
    stopped: bool
    proof: Callable[[Segment], Reason] = needs_no_proof


def authorised(state: MotionState, segment: Segment) -> tuple[bool, Reason]:
    """Whether this machine's body may be in ``segment`` now, and if not, why not.

    Asked before every movement order and again while the movement runs; nothing else permits motion.
    """
    if state.stopped:
        return False, Reason.OPERATOR
    if not state.position_known:
        return False, Reason.POSITION_UNKNOWN
    key = segment_token(segment)
    if not state.tokens.holds(key):
        return False, state.tokens.refused.get(key, Reason.NOT_AUTHORISED)
    reason = state.proof(segment)
    return reason is Reason.NONE, reason


def _told(version: int) -> int:
    """A version as it fits in a request or a refusal."""
    return version & ((1 << SEEN_VERSION_BITS) - 1)
