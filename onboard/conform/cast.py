"""The fleet's part: signs of life, bus time, answers and tokens of every machine but the node under test.

It does what docs/protocol.md asks of a good fleet until a scene has it do something else.
"""

from binascii import crc_hqx
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

from onboard.conform.stage import MS, SECOND, Stage, Word
from onboard.contract.codes import CONTRACT_VERSION, Grade, KindCode, LegAction, MachineState, Reason, Side, TokenKind
from onboard.contract.constants import OUTSIDE
from onboard.contract.messages import (
    BusTime,
    CarAt,
    Heartbeat,
    Itinerary,
    Leg,
    Progress,
    Reference,
    Stamp,
    SyncDone,
    SyncRequest,
    TokenGrant,
    TokenHeld,
    TokenRefusal,
    TokenRequest,
)
from onboard.core.token_keys import TokenKey, genesis_holder

#: A grant is said again so often before its sender gives up on the play.
_MOST_REPEATS = 40
#: Versions of plans go round 255 while the play lasts (duty F5).
_FIRST_PLAN = 248
#: What the fleet does about a request: grants it (NONE), refuses it with a reason, or says nothing (None).
Answer = Callable[[TokenKey, TokenRequest], Reason | None]


def grants(_: TokenKey, __: TokenRequest) -> Reason | None:
    """As a good fleet without anybody else in the way does."""
    return Reason.NONE


def silent(_: TokenKey, __: TokenRequest) -> Reason | None:
    """Nobody answers, so that a request is repeated."""
    return None


@dataclass
class Part:
    """One machine that the kit plays."""

    node: int
    kind: KindCode
    #: Lives go round 255 while the play lasts (duty J1).
    boot: int = 252
    state: MachineState = MachineState.IDLE
    is_there: bool = True
    answers: bool = True
    contract: int = CONTRACT_VERSION
    site_digest: int = 0
    epoch: int = 0
    #: What it adds to its mirror's digest: not 0 where it believes something else.
    digest_error: int = 0
    due_us: int = 0

    def lives_anew(self) -> None:
        """It was switched off and on."""
        self.boot = self.boot % 255 + 1


@dataclass
class Flight:
    """A grant of the fleet that is not confirmed yet."""

    grant: TokenGrant
    due_us: int
    wait_us: int
    count: int = 0


class Double(Protocol):
    """What a machine of the fleet does by itself, beside what every one does: a lift goes where it is wanted."""

    def answer(self, key: TokenKey, request: TokenRequest) -> Reason | None:
        """What it does about a request for what it holds, as ``Answer``."""

    def gave(self, key: TokenKey) -> None:
        """It has given a token away."""

    def tell(self) -> None:
        """Say where it is, for somebody asks."""

    def next_us(self) -> int | None:
        """When ``wake`` is wanted next by the kit's clock; None: not by time."""

    def wake(self) -> None:
        """Do what is due by now."""

    def reset(self) -> None:
        """A good machine again, behind every scene."""


@dataclass
class Cast:
    """All of the fleet. ``answer`` and ``confirms`` are what scenes change; ``reset`` puts all back."""

    stage: Stage
    parts: dict[int, Part] = field(default_factory=dict)
    #: Those of them that do something by themselves.
    doubles: dict[int, Double] = field(default_factory=dict)
    #: Who holds a token of those that have moved, and under which version.
    tokens: dict[TokenKey, tuple[int, int]] = field(default_factory=dict)
    cars: dict[Reference, CarAt] = field(default_factory=dict)
    plans: dict[int, Itinerary] = field(default_factory=dict)
    #: Where the fleet's robots are.
    places: dict[int, Progress] = field(default_factory=dict)
    blocked: set[int] = field(default_factory=set)
    flights: dict[TokenKey, Flight] = field(default_factory=dict)
    answer: Answer = grants
    confirms: bool = True
    #: The life of the node under test that was heard last.
    boot: int = 0
    gives_time: bool = True
    time_error_us: int = 0
    time_due_us: int = 0
    #: Whether the fleet is on the bus at all.
    is_on: bool = True

    def __post_init__(self) -> None:
        site = self.stage.site
        for node, machine in site.machines.items():
            if node != self.stage.node:
                self.parts[node] = Part(node, machine.kind, site_digest=site.digest)
        self.stage.hearers.append(self.hear)

    def reset(self) -> None:
        """A good fleet again, behind every scene."""
        self.answer, self.confirms, self.is_on, self.gives_time, self.time_error_us = grants, True, True, True, 0
        for part in self.parts.values():
            part.state, part.is_there, part.answers, part.digest_error = MachineState.IDLE, True, True, 0
            part.contract, part.site_digest = CONTRACT_VERSION, self.stage.site.digest
            part.epoch = max(0, self.stage.epoch)
        for double in self.doubles.values():
            double.reset()

    # --- what it knows -------------------------------------------------------------------------------------------

    def holder(self, key: TokenKey) -> tuple[int, int]:
        """Who holds a token, and under which version (duty K1)."""
        made = 1 if key.kind in (TokenKind.CAR, TokenKind.TASK) else 0
        return self.tokens.get(key, (genesis_holder(self.stage.site, key), made))

    def held_by(self, node: int) -> list[TokenKey]:
        """Tokens that have come to a node."""
        return [key for key, (holder, _) in self.tokens.items() if holder == node]

    def digest(self) -> int:
        """What all should tell in their heartbeats (duty J4)."""
        words = [node << 8 | plan.version for node, plan in sorted(self.plans.items())]
        for car, at in sorted(self.cars.items()):
            if at.station != OUTSIDE:
                words += [car.origin << 16 | car.number, at.station]
        words += [1 << 31 | number for number in sorted(self.blocked)]
        return crc_hqx(b"".join(word.to_bytes(4, "big") for word in words), 0xFFFF)

    # --- what it hears -------------------------------------------------------------------------------------------

    def hear(self, word: Word) -> None:
        """Take in what the node said, and answer for everybody."""
        match word.message:
            case SyncRequest() as asked:
                self._answer_sync(asked)
            case TokenRequest() as request:
                self._answer_request(request)
            case TokenGrant() as grant:
                self._take(grant)
            case TokenHeld() as held:
                self._confirmed(held)
            case Itinerary() as plan:
                if plan.grade is not Grade.TENTATIVE:
                    self._planned(plan)
            case CarAt() as at:
                self.cars[at.car] = at
            case Heartbeat() as beat if beat.boot != self.boot:
                self._begins(beat)

    def _begins(self, beat: Heartbeat) -> None:
        """A life of the node: its plan is forgotten (duty R4), and the first tells in which epoch the site is."""
        if self.boot == 0:
            for part in self.parts.values():
                part.epoch = beat.epoch
        self.boot = beat.boot
        self.plans.pop(beat.sender, None)

    def _planned(self, plan: Itinerary) -> None:
        if plan.grade is Grade.FIRM:
            self.plans[plan.sender] = plan
        else:
            self.plans.pop(plan.sender, None)

    def _answer_sync(self, asked: SyncRequest) -> None:
        for part in self.parts.values():
            if not (self.is_on and part.is_there and part.answers and asked.whom in (0, part.node)):
                continue
            if part.node == self._time_giver() and self.gives_time:
                self._tell_time()
            if part.node in self.plans:
                self.stage.say(self.plans[part.node], self.places[part.node])
            for at in self.cars.values():
                if at.sender == part.node:
                    self.stage.say(at)
            if part.node in self.doubles:
                self.doubles[part.node].tell()
            self.stage.say(*(TokenHeld(part.node, *key, self.tokens[key][1]) for key in self.held_by(part.node)))
            self.stage.say(SyncDone(part.node, asked.sender, part.boot, 0))

    def _answer_request(self, request: TokenRequest) -> None:
        key = TokenKey(request.token_kind, request.token)
        holder, version = self.holder(key)
        if request.version_seen > version:
            # The node has a longer memory than this play.
            self.tokens[key] = (holder, request.version_seen)
        if holder not in self.parts or not self.is_on:
            flight = self.flights.get(key)
            if flight is not None and self.answer(key, request) is Reason.NONE:
                self.stage.say(flight.grant)
            return
        answer = self.doubles[holder].answer(key, request) if holder in self.doubles else self.answer(key, request)
        if answer is Reason.NONE:
            self.grant(key, request.sender)
        elif answer is not None:
            seen = self.holder(key)[1] & 0xFFFFF
            self.stage.say(TokenRefusal(holder, *key, seen, request.sender, answer))

    def grant(self, key: TokenKey, to: int) -> TokenGrant:
        """Its holder gives a token away (duties K3, K4), and says so until it is confirmed."""
        holder, version = self.holder(key)
        said = TokenGrant(holder, *key, version + 1, to)
        self.tokens[key] = (to, version + 1)
        repeat_us = self.stage.site.timing.token_repeat_us
        self.flights[key] = Flight(said, self.stage.now_us + repeat_us, repeat_us)
        self.stage.say(said)
        if holder in self.doubles:
            self.doubles[holder].gave(key)
        return said

    def _take(self, grant: TokenGrant) -> None:
        key = TokenKey(grant.token_kind, grant.token)
        if grant.holder not in self.parts or not self.is_on:
            return
        if self.confirms:
            self.tokens[key] = (grant.holder, grant.version)
            self.flights.pop(key, None)
            self.stage.say(TokenHeld(grant.holder, *key, grant.version))
            if key.kind is TokenKind.CAR:
                self._keep(Reference(key.number >> 16, key.number & 0xFFFF), grant)

    def _keep(self, car: Reference, grant: TokenGrant) -> None:
        """Duty C4: the keeper says where the car stands under its own version."""
        at = self.cars.get(car)
        if at is not None:
            self.cars[car] = CarAt(grant.holder, car, at.station, grant.version & 0xFFFF, at.wheelbase_mm)
            self.stage.say(self.cars[car])

    def _confirmed(self, held: TokenHeld) -> None:
        key = TokenKey(held.token_kind, held.token)
        if held.version >= self.holder(key)[1]:
            self.tokens[key] = (held.sender, held.version)
            self.flights.pop(key, None)

    # --- what is due ---------------------------------------------------------------------------------------------

    def next_us(self) -> int:
        """When something is to be said."""
        times = [part.due_us for part in self.parts.values()] + [flight.due_us for flight in self.flights.values()]
        times += [due_us for double in self.doubles.values() if (due_us := double.next_us()) is not None]
        return min([self.time_due_us, *times])

    def wake(self) -> None:
        """Say what is due by now: time, signs of life, grants again."""
        now_us = self.stage.now_us
        if self.time_due_us <= now_us:
            self.time_due_us = now_us + self.stage.site.timing.bus_time_us
            # One that nobody acknowledged would come stale.
            if self.is_on and self.gives_time and not self.stage.is_off:
                self._tell_time()
        for part in self.parts.values():
            if part.due_us <= now_us:
                part.due_us = now_us + self.stage.site.timing.heartbeat_us
                if self.is_on and part.is_there:
                    self.beat(part)
        for key, flight in list(self.flights.items()):
            if flight.due_us <= now_us:
                self._repeat(key, flight)
        for double in self.doubles.values():
            double.wake()

    def _repeat(self, key: TokenKey, flight: Flight) -> None:
        flight.count += 1
        flight.wait_us = min(flight.wait_us * (1 if flight.count < 3 else 2), 5 * SECOND)
        flight.due_us = self.stage.now_us + flight.wait_us
        if flight.count > _MOST_REPEATS:
            del self.flights[key]
        elif self.is_on:
            self.stage.say(flight.grant)

    def _time_giver(self) -> int:
        return min(node for node, part in self.parts.items() if part.is_there or node == self.stage.caller)

    def _tell_time(self) -> None:
        self.stage.say(BusTime(self.stage.caller, self.stage.bus_us + self.time_error_us))

    def beat(self, part: Part) -> None:
        """Say its sign of life, with the digest of all."""
        digest = self.digest() ^ part.digest_error
        self.stage.say(
            Heartbeat(part.node, part.contract, part.site_digest, digest, part.boot, part.kind, part.state, part.epoch)
        )

    def begin(self) -> None:
        """The fleet comes to the bus: time first, then everybody in turn."""
        self.is_on, self.time_due_us = True, self.stage.now_us
        for node, part in self.parts.items():
            if part.kind is KindCode.ROBOT:
                self.stand(node)
        for rank, part in enumerate(self.parts.values()):
            part.due_us = self.stage.now_us + 5 * MS * (rank + 1)

    def stand(self, node: int) -> None:
        """A robot of the fleet is at its home (duty J5)."""
        home, now_ms = self.stage.site.machines[node].home, self.stage.bus_ms()
        leg = Leg(LegAction.STAND, home.track, home.index, home.index, Side.NEAR, now_ms + 1)
        version = self.plans[node].version % 255 + 1 if node in self.plans else _FIRST_PLAN
        self.plans[node] = Itinerary(node, version, Grade.FIRM, Stamp(now_ms, node, 0), (leg,))
        self.places[node] = Progress(node, 0, 0, home.track, home.index, 0, 0)
        self.stage.say(self.places[node], self.plans[node])
