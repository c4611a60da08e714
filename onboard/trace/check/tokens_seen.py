"""Who holds which token, as the frames alone tell it."""

from collections import OrderedDict, deque
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

from onboard.contract.codes import KindCode, RegenerationPhase, TokenKind
from onboard.contract.messages import Regeneration, TokenAssigned, TokenGrant, TokenHeld
from onboard.contract.runs import MOST_SPREAD
from onboard.core.serial import is_newer
from onboard.core.site import Segment, Site, Station

#: Bits of a token's version (dbc/fleet.dbc).
VERSION_BITS = 28
#: Handovers of one token that are remembered, to tell a repeated frame from a second grant.
MEMORY = 8
#: Most tokens remembered: all of the largest site, and the cars of many days. The one longest silent is forgotten.
MOST_TOKENS = 20_000
#: A freeze that is not said again for so long is over, us (onboard/holon/regeneration.py).
FORGOTTEN_US = 10_000_000
#: A frame may overtake another of its own sender, whose identifier is larger, by some bursts on a busy bus, us.
OVERTAKING_US = 100_000


class Token(NamedTuple):
    """Which token: its kind and number on the wire."""

    kind: TokenKind
    number: int

    def __str__(self) -> str:
        if self.kind is TokenKind.SEGMENT:
            return f"segment {Segment(self.number >> 8, self.number & 0xFF)}"
        if self.kind is TokenKind.STATION:
            return f"station {Station.from_number(self.number & 0xFFFF)}"
        return f"{self.kind.name.lower()} {self.number >> 16}.{self.number & 0xFFFF}"


#: ``Token`` from a tuple of both its fields: half the time of calling the class.
_token_of: Callable[[Any], Token] = partial(tuple.__new__, Token)


class Handover(NamedTuple):
    """A token came to ``holder`` under ``version``; ``giver`` 0 where nobody was heard giving it."""

    version: int
    giver: int
    holder: int
    time_us: int


def token_named(word: TokenGrant | TokenHeld) -> Token:
    """The token that a word is about."""
    return _token_of((word.token_kind, word.token))


class TokensSeen:
    """The last handovers of each token. ``from_start`` is true where the log begins with the site's first power-up."""

    def __init__(self, site: Site | None) -> None:
        self.from_start = False
        self._site = site
        self._past: OrderedDict[Token, deque[Handover]] = OrderedDict()
        #: Whose tokens of places are by the site file: asked of each body at each word of it.
        self._first: dict[Token, int | None] = {}
        #: The newest version of any segment, by track: those that go together get one that is newer than each.
        self._newest: dict[int, int] = {}
        #: What an operator's tool has assigned, until it says that it counts.
        self._assigned: dict[Token, TokenAssigned] = {}
        self._step, self._step_us = RegenerationPhase.NONE, 0

    def last(self, token: Token) -> Handover | None:
        """The newest handover heard of."""
        past = self._past.get(token)
        return past[-1] if past else None

    def following(self, token: Token, version: int) -> int:
        """The newest version that may follow ``version`` of a token: by one, or in a run of its track's segments."""
        if token.kind is not TokenKind.SEGMENT:
            return version + 1
        return self._newest.get(token.number >> 8, version) + 1 if self.from_start else version + MOST_SPREAD

    def under(self, token: Token, version: int) -> Handover | None:
        """The handover that made this version, if it is remembered."""
        return next((one for one in self._past.get(token, ()) if one.version == version), None)

    def holder(self, token: Token) -> int | None:
        """Who holds it; None where the log does not tell."""
        last = self.last(token)
        if last is not None:
            return last.holder
        return self.first_holder(token) if self.from_start else None

    def first_holder(self, token: Token) -> int | None:
        """Who holds it before it first moves: cars and tasks are their origin's; for all others the site file tells."""
        if token.kind in (TokenKind.CAR, TokenKind.TASK):
            return token.number >> 16
        if self._site is None:
            return None
        if token not in self._first:
            if len(self._first) >= MOST_TOKENS:
                self._first.clear()
            self._first[token] = self._first_by_site(token, self._site)
        return self._first[token]

    @staticmethod
    def _first_by_site(token: Token, site: Site) -> int | None:
        for machine in site.machines.values():
            if token.kind is TokenKind.SEGMENT:
                if machine.kind is KindCode.ROBOT and machine.home.number == token.number:
                    return machine.node_id
            elif machine.station is not None and machine.station.number == token.number:
                return machine.node_id
        return site.stewards.get(token.number >> 8)

    def may_use(self, token: Token, node: int, now_us: int) -> bool:
        """Whether ``node`` holds it, held it a moment ago, or the log does not tell."""
        holder = self.holder(token)
        if holder in (None, node):
            return True
        last = self.last(token)
        return last is not None and last.giver == node and now_us - last.time_us <= OVERTAKING_US

    def on_grant(self, grant: TokenGrant, time_us: int) -> None:
        """Take up a grant, whether it was right or not: the newest version counts."""
        self._learn(token_named(grant), grant.version, grant.sender, grant.holder, time_us)

    def on_held(self, held: TokenHeld, time_us: int) -> None:
        """Take up a statement; it tells something new only where the grant is not in the log."""
        self._learn(token_named(held), held.version, 0, held.sender, time_us)

    def is_frozen(self, now_us: int) -> bool:
        """Whether all stand, so that rights can be made anew: not long after the last word of it."""
        is_begun = self._step in (RegenerationPhase.FREEZE, RegenerationPhase.READ_BACK)
        return is_begun and now_us - self._step_us < FORGOTTEN_US

    def on_operator(self, word: TokenAssigned | Regeneration, time_us: int) -> None:
        """A line of a list of rights that are made anew, or a step: the list counts from COMMIT on, else it is over."""
        if isinstance(word, TokenAssigned):
            if len(self._assigned) < MOST_TOKENS:
                self._assigned[Token(word.token_kind, word.token)] = word
            return
        self._step, self._step_us = word.regeneration_phase, time_us
        if word.regeneration_phase is RegenerationPhase.COMMIT:
            for token, one in self._assigned.items():
                self._learn(token, one.version, 0, one.holder, time_us)
        if word.regeneration_phase is not RegenerationPhase.READ_BACK:
            self._assigned.clear()

    def _learn(self, token: Token, version: int, giver: int, holder: int, time_us: int) -> None:
        past = self._past.get(token)
        if past is None:
            past = self._past[token] = deque(maxlen=MEMORY)
            if len(self._past) > MOST_TOKENS:
                self._past.popitem(last=False)
        elif is_newer(version, past[-1].version, VERSION_BITS):
            self._past.move_to_end(token)
        else:
            return
        past.append(Handover(version, giver, holder, time_us))
        if token.kind is TokenKind.SEGMENT:
            track = token.number >> 8
            self._newest[track] = max(version, self._newest.get(track, 0))
