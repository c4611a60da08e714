"""Machines that walk along an alley under tokens alone, each in a holon of its own, over a bus that may lose frames.

They heed no clock: a walker asks for its next segment as soon as it can. Only the order in which tokens are granted
keeps them to the order of their plans.
"""

import random
from collections.abc import Sequence
from dataclasses import dataclass, field

from onboard.config.site import parse_site
from onboard.contract.codes import DriveMode, Grade, KindCode, LegAction, MachineState, Reason, Side
from onboard.contract.messages import DriveState, Itinerary, Leg, Message, Progress, Stamp, SyncRequest, TokenRequest
from onboard.core.authority import TokenKey, segment_token
from onboard.core.behaviour import BehaviourFactory, Fleet
from onboard.core.effects import Effect, Halt, Record, Send
from onboard.core.mirror import Mirror
from onboard.core.negotiation import Estimator, NegotiationEvent
from onboard.core.serial import successor, to_bus_ms
from onboard.core.site import Machine, Segment, Site
from onboard.holon.holon import Holon
from onboard.systems.car_park.travel import ORDER_PATIENCE_US
from onboard.systems.registry import factory_for
from onboard.ways.all_or_none import AllOrNone
from onboard.ways.mirror import WayFleet, way_fleet
from onboard.work.plain import NoEstimator

STEP_US = 20_000
#: A walker needs this long for a segment.
PACE_US = 300_000
ROUND_US = 60_000_000
STEWARD = 1

SITE = parse_site(
    """
[site]
name = "walk"
[floors]
count = 1
positions = 12
[[compartments]]
name = "IOC1"
node = 1
at = "p(1,4)"
[[robots]]
name = "MR1"
node = 11
home = "p(1,1)"
[[robots]]
name = "MR2"
node = 12
home = "p(1,12)"
""",
    "walk.toml",
    crowded=True,
)


@dataclass
class Walker:
    """Goes from home to ``turns[n]`` and back in round ``rounds[n]`` of its plan, a round lasting ``ROUND_US``."""

    fleet: WayFleet
    turns: Sequence[int]
    rounds: Sequence[int]
    log: list[tuple[Segment, int, int]]
    kind: KindCode = KindCode.ROBOT
    version: int = 0
    at: Segment | None = None
    legs: list[Leg] = field(default_factory=list)
    #: Where to go, in which leg and round, and how far that has come.
    path: list[tuple[Segment, int, int]] = field(default_factory=list)
    done: int = 0
    may_move_at_us: int = 0
    whole: AllOrNone = field(init=False)

    def __post_init__(self) -> None:
        self.whole = AllOrNone(self.fleet.tokens)

    @property
    def state(self) -> MachineState:
        return MachineState.STARTING if self.at is None else MachineState.WORKING

    @property
    def itinerary_version(self) -> int:
        return self.version

    @property
    def is_home(self) -> bool:
        return self.at is not None and self.done == len(self.path)

    def start(self, now_us: int) -> list[Effect]:
        return []

    def sense(self, message: Message, now_us: int) -> list[Effect]:
        """The first word of the drive is the beginning: a plan of all rounds is told."""
        if self.at is not None:
            return []
        home = self.at = self.fleet.machine.home
        self.stamp = Stamp(to_bus_ms(now_us), self.fleet.node_id, 0)
        for turn, number in zip(self.turns, self.rounds, strict=True):
            begin_us = now_us + number * ROUND_US
            self.legs.append(leg(LegAction.STAND, home.index, home.index, begin_us))
            for one, other, end_us in (
                (home.index, turn, begin_us + ROUND_US // 3),
                (turn, home.index, begin_us + 2 * ROUND_US // 3),
            ):
                step = 1 if other > one else -1
                way = [Segment(1, index) for index in range(one + step, other + step, step)]
                self.path += [(segment, len(self.legs), number) for segment in way]
                self.legs.append(leg(LegAction.TRAVEL, one, other, end_us))
        return self.tell()

    def tell(self, later_us: int = 0) -> list[Effect]:
        """Tell the rest of the plan, ``later_us`` later than before."""
        self.version = successor(self.version, 8)
        if self.path and self.done < len(self.path):
            first = self.path[self.done][1]
            keep = first - 1 if self.done == 0 or self.path[self.done - 1][1] != first else first
            self.legs = self.legs[keep:]
            self.path = [(segment, number - keep, r) for segment, number, r in self.path]
        self.legs = [one._replace(end_ms=one.end_ms + later_us // 1000) for one in self.legs]
        itinerary = Itinerary(self.fleet.node_id, self.version, Grade.FIRM, self.stamp, tuple(self.legs))
        self.fleet.mirror.on_itinerary(itinerary, self.stamp.award_ms * 1000)
        return [Send(itinerary), *self.where()]

    def where(self) -> list[Effect]:
        assert self.at is not None
        leg_number = self.path[self.done - 1][1] if self.done else 0
        progress = Progress(self.fleet.node_id, self.version, max(0, leg_number), 1, self.at.index, 0, 0)
        self.fleet.mirror.on_progress(progress)
        return [Send(progress)]

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        return []

    def negotiated(self, event: NegotiationEvent, now_us: int) -> list[Effect]:
        return []

    def may_grant(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        return Reason.TOKEN_NOT_GRANTABLE_YET

    def advance(self, now_us: int) -> list[Effect]:
        if self.at is None:
            return []
        tokens = self.fleet.tokens
        wanted = self.path[self.done][0] if self.done < len(self.path) else self.at
        needed = {segment_token(slot) for slot in (self.at, wanted, *self.whole.slots)}
        for key in [key for key in tokens.held if key not in needed]:
            # A request that came late was granted.
            return tokens.give(key, STEWARD, now_us)
        if self.is_home:
            return []
        following, _, number = self.path[self.done]
        behind = tokens.behind_since_us
        if behind and not self.whole.slots and min(behind.values()) + ORDER_PATIENCE_US <= now_us:
            way = [segment for segment, _, one in self.path[self.done :] if one == number]
            self.whole.begin((self.at, *way), now_us)
        self.whole.passed((self.at,))
        if self.whole.slots:
            effects = self.whole.advance((self.at,), now_us)
            if effects or not self.whole.is_complete:
                return effects
        if not tokens.holds(segment_token(following)):
            return tokens.want(segment_token(following), now_us)
        if now_us < self.may_move_at_us:
            return []
        left, self.at = self.at, following
        self.done += 1
        self.may_move_at_us = now_us + PACE_US
        self.log.append((following, number, self.fleet.node_id))
        effects = self.where()
        self.whole.passed((following,))
        if left not in self.whole.slots:
            effects += tokens.give(segment_token(left), STEWARD, now_us)
            self.fleet.mirror.order.on_return(self.fleet.node_id, left)
        return effects

    def next_wake(self) -> int | None:
        if self.at is None or self.is_home:
            return None
        behind = self.fleet.tokens.behind_since_us
        times = [self.may_move_at_us, self.whole.due_us]
        times.append(min(behind.values()) + ORDER_PATIENCE_US if behind and not self.whole.slots else None)
        return min(time for time in times if time is not None)

    def statements(self, now_us: int) -> list[Effect]:
        if self.at is None:
            return []
        told = self.fleet.mirror.itineraries[self.fleet.node_id]
        return [Send(told), *self.where(), *self.fleet.tokens.statements()]


def leg(action: LegAction, one: int, other: int, end_us: int) -> Leg:
    return Leg(action, 1, one, other, Side.NEAR, to_bus_ms(end_us))


@dataclass
class WalkerFactory(BehaviourFactory):
    fleet_type = WayFleet
    turns: Sequence[int]
    rounds: Sequence[int]
    log: list[tuple[Segment, int, int]]

    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> Estimator:
        return NoEstimator()

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> Walker:
        return Walker(way_fleet(fleet), self.turns, self.rounds, self.log)


class Alley:
    """A steward and two walkers whose rounds take turns; ``seed`` decides what a lossy bus does to single receivers."""

    def __init__(self, turns: dict[int, Sequence[int]], rounds: dict[int, Sequence[int]], seed: int) -> None:
        self.log: list[tuple[Segment, int, int]] = []
        self.heard: list[Message] = []
        self.journals: dict[int, list[dict[str, str | int]]] = {node: [] for node in SITE.machines}
        self.turns, self.rounds = turns, rounds
        self.holons = {node: self._holon(node, 1) for node in SITE.machines}
        self.wire: list[tuple[int, int, Message]] = []
        self.chance = random.Random(seed)
        self.now_us = 0
        self.loss = 0.0
        for node in self.holons:
            self.boot(node)

    def _holon(self, node: int, boot: int) -> Holon:
        machine = SITE.machines[node]
        if machine.kind is not KindCode.ROBOT:
            return Holon(SITE, machine, factory_for(SITE, machine.kind), boot=boot, entries=tuple(self.journals[node]))
        factory = WalkerFactory(self.turns[node], self.rounds[node], self.log)
        return Holon(SITE, machine, factory, boot=boot, entries=tuple(self.journals[node]))

    def boot(self, node: int) -> None:
        """Power-up: the holon begins, and its drive says where it stands."""
        holon = self.holons[node]
        self.carry_out(node, holon.start(self.now_us))
        self.carry_out(node, holon.sense(DriveState(node, 0, 0, 0, DriveMode.STANDING, True), self.now_us))

    def restart(self, node: int, boot: int) -> None:
        """Power off and on again with what the journal holds."""
        self.holons[node] = self._holon(node, boot)
        self.boot(node)

    def walker(self, node: int) -> Walker:
        behaviour = self.holons[node].behaviour
        assert isinstance(behaviour, Walker)
        return behaviour

    def carry_out(self, node: int, effects: list[Effect]) -> None:
        for effect in effects:
            if isinstance(effect, Record):
                self.journals[node].append(dict(effect.entry))
            elif isinstance(effect, Send):
                self.heard.append(effect.message)
                for other in self.holons:
                    if other != node:
                        self._post(other, effect.message)
            else:
                assert not isinstance(effect, Halt), effect

    def _post(self, node: int, message: Message) -> None:
        copies = 1
        due_us = self.now_us + STEP_US
        if self.loss and not isinstance(message, SyncRequest) and self.chance.random() < self.loss:
            copies = self.chance.choice((0, 0, 2))
            due_us += self.chance.randrange(3) * STEP_US
        self.wire += [(due_us, node, message)] * copies

    def run(self, seconds: float) -> None:
        end_us = self.now_us + round(seconds * 1e6)
        while self.now_us < end_us:
            self.now_us += STEP_US
            due = [entry for entry in self.wire if entry[0] <= self.now_us]
            self.wire = [entry for entry in self.wire if entry[0] > self.now_us]
            for _, node, message in due:
                self.carry_out(node, self.holons[node].receive(message, self.now_us))
            for node, holon in self.holons.items():
                wake_us = holon.next_wake()
                if wake_us is not None and wake_us <= self.now_us:
                    self.carry_out(node, holon.wake(self.now_us))
            self.assert_one_holder_each()

    def assert_one_holder_each(self) -> None:
        for index in range(1, 13):
            holders = [n for n, holon in self.holons.items() if holon.tokens.holds(segment_token(Segment(1, index)))]
            assert len(holders) <= 1, f"p(1,{index}) is held by {holders}"

    def assert_in_order(self) -> None:
        """On every segment the rounds came in the order of the plans."""
        for index in range(1, 13):
            rounds = [number for segment, number, _ in self.log if segment.index == index]
            assert rounds == sorted(rounds), f"p(1,{index}): {rounds}"

    def requests(self) -> list[TokenRequest]:
        return [message for message in self.heard if isinstance(message, TokenRequest)]
