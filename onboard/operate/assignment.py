"""Which rights are nobody's after a machine lost its own, and whom they go to (rule 3 of docs/protocol.md).

Only statements made while all stand frozen count: who lives says what it holds, and the newest that it has seen of all
else. What nobody says to hold, and nobody but the lost machine can have, is made anew above every version that anybody
knows, so that a grant which is still on its way is old.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

from onboard.contract.codes import TokenKind
from onboard.contract.constants import ANY_STATION, MOBILE_KINDS, NOBODY, OUTSIDE
from onboard.contract.messages import CarAt, TokenAssigned
from onboard.core.authority import TokenKey, genesis_holder, may_exist, station_token
from onboard.core.site import Machine, Segment, Site, Station
from onboard.ways.lifts import gate, lift_at, platform
from onboard.ways.site import way_site
from onboard.ways.tokens import tokens_of

#: Highest version of a token (dbc/fleet.dbc): above it nothing can be made anew.
LAST_VERSION = (1 << 28) - 1
#: Most tokens that are remembered: of a site with 4,000 places and 1,000 cars, twice. Bounds what one node can say.
MOST_TOKENS = 20_000


class TokenClaim(NamedTuple):
    """Who says to hold a token, or is said to, under which version."""

    version: int
    node: int


@dataclass
class Statements:
    """What was said since all stand frozen. ``lost`` is not believed about what it holds."""

    site: Site
    lost: int
    held: dict[TokenKey, dict[int, int]] = field(default_factory=dict)
    seen: dict[TokenKey, TokenClaim] = field(default_factory=dict)
    said_by: dict[int, set[TokenKey]] = field(default_factory=dict)
    cars: dict[TokenKey, CarAt] = field(default_factory=dict)

    def take_up(self, sender: int, key: TokenKey, version: int, holder: int) -> None:
        """``sender`` says that ``holder`` has a token, or has been given it, under ``version``."""
        if not may_exist(self.site, key) or (key not in self.seen and len(self.seen) >= MOST_TOKENS):
            return
        self.said_by.setdefault(sender, set()).add(key)
        known = self.seen.get(key)
        if known is None or version > known.version:
            self.seen[key] = TokenClaim(version, holder)
        if sender == self.lost:
            return
        if sender == holder:
            self.held.setdefault(key, {})[sender] = version
        elif self.held.get(key, {}).get(sender, version) < version:
            # It was said before that machine stood frozen: it has given the token away since.
            del self.held[key][sender]
            if not self.held[key]:
                del self.held[key]

    def car_at(self, word: CarAt) -> None:
        """Take up where a car stands, unless a newer word of that car is known."""
        key = TokenKey(TokenKind.CAR, word.car.origin << 16 | word.car.number)
        known = self.cars.get(key)
        if may_exist(self.site, key) and (known is None or word.version >= known.version):
            self.cars[key] = word

    def holder_of(self, key: TokenKey) -> int:
        """Who says to hold a token; who had it first, where nobody does."""
        return min(self.held.get(key, ()), default=genesis_holder(self.site, key))

    def slots_given_to(self, node: int) -> list[Segment]:
        """Slots that went to ``node`` by the newest that others know, and that nobody says to hold."""
        keys = [key for key, claim in sorted(self.seen.items()) if claim.node == node and key not in self.held]
        return [Segment(key.number >> 8, key.number & 0xFF) for key in keys if key.kind is TokenKind.SEGMENT]

    def left_perhaps(self, node: int) -> tuple[list[TokenKey], list[Station]]:
        """Cars aboard ``node`` by all that others know, and the places where it had the right to leave them.

        It has that right from before it leaves a car until it has said where: its last word may be missing.
        """
        its = [key for key, claim in sorted(self.seen.items()) if claim.node == node and key not in self.held]
        cars = [key for key in its if key in self.cars and self.cars[key].station == ANY_STATION]
        places = {place.number: place for place in way_site(self.site).places}
        stations = [places[key.number] for key in its if key.kind is TokenKind.STATION and key.number in places]
        return (cars, stations) if cars else ([], [])

    def contradiction(self) -> tuple[TokenKey, list[int]] | None:
        """A token that two say to hold, or that one holds under a version older than another knows; with whom."""
        for key in sorted(self.held):
            holders = sorted(self.held[key])
            newest = self.seen[key]
            if len(holders) > 1 or newest.version > self.held[key][holders[0]]:
                return key, holders
        return None


@dataclass(frozen=True)
class BodySlots:
    """Slots and stations in which a machine's body is."""

    slots: frozenset[Segment] = frozenset()
    bay: Station | None = None

    @classmethod
    def of_fixed(cls, site: Site, machine: Machine) -> "BodySlots":
        """A lift's platform and gate, a compartment's bay."""
        if machine.station is not None:
            return cls(bay=machine.station)
        if machine.home.track in way_site(site).lifts:
            return cls(frozenset((platform(machine.home.track), gate(machine.home.track))))
        return cls()

    @classmethod
    def of_segments(cls, site: Site, segments: Iterable[Segment]) -> "BodySlots":
        """A platform goes with its gate: who may stand on the sill keeps the lift where it is."""
        slots: set[Segment] = set()
        for segment in segments:
            lift = lift_at(way_site(site), segment)
            slots.update([segment] if lift is None else [platform(lift), gate(lift)])
        return cls(frozenset(slots))

    def has(self, key: TokenKey) -> bool:
        """Whether a token is of one of the slots, or of a place beside one."""
        if key.kind is TokenKind.SEGMENT:
            return Segment(key.number >> 8, key.number & 0xFF) in self.slots
        if key.kind is not TokenKind.STATION:
            return False
        station = Station.from_number(key.number)
        return station == self.bay or station.segment in self.slots


#: Of a machine that is in no slot.
NO_BODY = BodySlots()


class RightsAssignment(NamedTuple):
    """What is made anew, and which tokens are nobody's from now on."""

    given: tuple[TokenAssigned, ...]
    nobodys: tuple[TokenKey, ...]


class Whose(NamedTuple):
    """Who is lost and who is locked off (0: nobody), and where their bodies are."""

    lost: int
    absent: int
    body: BodySlots
    blocked: BodySlots


def assign(statements: Statements, whose: Whose, operator: int) -> RightsAssignment:
    """The lost machine's rights: to it where its body is, else to who had them first, else to the lowest fixed one.

    What the absent machine held goes the same way, but for the slots of its body, which are nobody's.
    """
    given: list[TokenAssigned] = []
    nobodys: list[TokenKey] = []
    for key in sorted({*tokens_of(way_site(statements.site)), *statements.seen}):
        if key in statements.held or not _is_orphan(statements, key, whose):
            continue
        to = _heir(statements, key, whose)
        version = 1 + _newest(statements, key)
        if to == NOBODY or version > LAST_VERSION:
            nobodys.append(key)
        else:
            given.append(TokenAssigned(operator, key.kind, key.number, version, to))
    return RightsAssignment(tuple(given), tuple(nobodys))


def _newest(statements: Statements, key: TokenKey) -> int:
    """The newest version known of a token; of a segment of its whole track, as one grant goes above all in line."""
    newest = statements.seen[key].version if key in statements.seen else 0
    if key.kind is not TokenKind.SEGMENT or key.number >> 8 in way_site(statements.site).lifts:
        return newest
    on_track = (one for one in statements.seen if one.kind is key.kind and one.number >> 8 == key.number >> 8)
    return max((statements.seen[one].version for one in on_track), default=0)


def _is_orphan(statements: Statements, key: TokenKey, whose: Whose) -> bool:
    """Whether a token that nobody says to hold is lost: one never seen to move is with its first holder."""
    if key in statements.seen:
        return True
    return genesis_holder(statements.site, key) in (whose.lost, whose.absent)


def _heir(statements: Statements, key: TokenKey, whose: Whose) -> int:
    site, absent = statements.site, whose.absent
    if whose.blocked.has(key):
        return NOBODY
    if whose.body.has(key):
        return whose.lost
    if key.kind in (TokenKind.CAR, TokenKind.TASK):
        return _heir_of_car(statements, key, whose)
    seen = statements.seen.get(key)
    # A grant to a machine that lives is on its way: it is that machine's.
    wanted = NOBODY if seen is None or seen.node == whose.lost else seen.node
    # A machine that moves learns from the slots that it gets where it is: it gets no others.
    is_placed = whose.lost if site.machines[whose.lost].kind in MOBILE_KINDS else NOBODY
    for node in (wanted, genesis_holder(site, key), site.stewards.get(key.number >> 8, NOBODY)):
        if node in site.machines and node not in (absent, is_placed):
            return node
    return _lowest_fixed(site, absent)


def _heir_of_car(statements: Statements, key: TokenKey, whose: Whose) -> int:
    """Who keeps the station at which a car stands; nobody where nobody knows it, or it is aboard who is absent."""
    word = statements.cars.get(key)
    if word is not None and word.station not in (ANY_STATION, OUTSIDE):
        station = Station.from_number(word.station)
        if _is_at_hand(statements, key, station, whose):
            return whose.lost
        keeper = next((node for node, one in way_site(statements.site).compartments.items() if one == station), None)
        keeper = statements.site.stewards.get(station.track, NOBODY) if keeper is None else keeper
        if keeper in statements.site.machines and keeper != whose.absent:
            return keeper
        return _lowest_fixed(statements.site, whose.absent)
    return NOBODY if whose.lost == whose.absent else whose.lost


def _is_at_hand(statements: Statements, key: TokenKey, station: Station, whose: Whose) -> bool:
    """Whether the lost machine had the rights to a car and to the station beside it: its shuttle may be at the car."""
    had, beside = statements.seen.get(key), station_token(station)
    is_beside = whose.body.has(beside) and beside not in statements.held
    return is_beside and had is not None and had.node == whose.lost


def _lowest_fixed(site: Site, absent: int) -> int:
    fixed = [node for node, one in site.machines.items() if one.kind not in MOBILE_KINDS and node != absent]
    return min(fixed, default=NOBODY)
