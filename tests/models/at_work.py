"""One shipped machine of a car park as an exploration drives it: words and time in, what it does in order out.

What the holon does around rights, calls and the behaviour is done here in its order, without bus time and the pauses
between words: a machine that is down is silent for all others after the next while, one that is up is heard. Of
heartbeats all that counts is of which life they are: who was started again says so with each.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from onboard.contract.codes import MachineState, Reason
from onboard.contract.constants import NOBODY
from onboard.contract.messages import (
    Award,
    Bid,
    CallForProposals,
    Heartbeat,
    Itinerary,
    LeftOut,
    Message,
    SyncRequest,
    TaskReport,
    TokenGrant,
    TokenHeld,
)
from onboard.core.authority import TokenBook
from onboard.core.behaviour import Behaviour, BehaviourFactory
from onboard.core.effects import Actuate, Effect, Halt, Record, Send
from onboard.core.negotiation import EVENT_TYPES, negotiation_of
from onboard.core.negotiation.initiator import is_any_sound
from onboard.core.records import BootRecord, next_boot
from onboard.holon.rights import RightsTalk
from onboard.holon.witness import Witness
from onboard.systems.car_park import custody
from onboard.systems.car_park.site import CarPark
from onboard.ways.mirror import WayFleet, WayMirror
from tests.models.snapshot import NOW_US

Entry = Mapping[str, str | int]
#: By these nothing is decided: counts, what never changes, what is the same under another name.
_NAMES = """
    site _park machine factory timing prepare entries counters drops claimants event changes gifts awards_sent number
    is_obstacle is_sound _calls delay slot policy silent alternatives searched rights
"""
#: By these nothing is decided here: ways and their times, and when within a while something is said again.
_WAYS = """
    reservations plans replaced order standing giving_way carriage clearance blocked_words _robots outputs stall backoff
    _stood places standoff _said_us _prune_at_us _tokens_seen _seen _heard _places_seen
"""
#: Attributes of machines that an exploration does not compare.
LEFT_OUT = frozenset((_NAMES + _WAYS).split())
#: Rounds in which a machine comes to rest after an event.
_MOST_ROUNDS = 40
#: The life in which all explored machines begin: another than that of their journals.
FIRST_LIFE = 2


class _Quiet(Witness):
    """Restarts with a whole journal are explored: nobody knows better than that."""

    def hear(self, message: Message, now_us: int) -> None:
        """Nothing."""


def at_once(*_: object) -> int:
    """No bid waits: words come in any order all the same."""
    return 0


class Body:
    """What a machine moves and senses: it does at once what it is told. Its state outlives the controller."""

    def start(self) -> list[Message]:
        """What its sensors say at power-up."""
        return []

    def order(self, order: Message) -> list[Message]:
        """What its sensors say when an order is carried out."""
        return []

    def meets(self, event: Any) -> list[Message]:
        """What its sensors say where it goes on by itself, or they see something."""
        return []

    @property
    def state(self) -> Any:
        """All that it remembers, to compare."""
        return None


@dataclass(frozen=True)
class Moved:
    """A body has moved: its state from now on."""

    state: Any


#: What a machine does, in order: a line of its journal, a word on the bus, or a motion of its body.
Deed = tuple[tuple[str, str | int], ...] | Message | Moved


@dataclass
class AtWork:
    """One machine, with its body and the journal of its lives before; ``prepare`` sees its behaviour first."""

    site: CarPark
    node: int
    factory: BehaviourFactory
    body: Body
    entries: tuple[Entry, ...] = ()
    prepare: Callable[[Behaviour], object] = id
    #: Which words it says that anybody here makes anything of.
    is_said: Callable[[Message], bool] = bool
    #: Whether it takes part: after a start it listens for a while first.
    takes_part: bool = False
    halted: str = ""
    fleet: WayFleet = field(init=False)
    behaviour: Any = field(init=False)
    rights: RightsTalk = field(init=False)
    boot: int = field(init=False)
    #: Of whom a later life than the first was heard.
    boots: dict[int, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        site, machine = self.site, self.site.machines[self.node]
        tokens = TokenBook(site, self.node)
        tokens.replay(self.entries)
        mirror = WayMirror(site, self.node)
        self.boot = next_boot(self.entries)
        estimator = self.factory.estimator(site, machine, mirror)
        negotiation = negotiation_of(site, machine, estimator, self.boot, mirror.aside.__contains__)
        negotiation.delay = at_once
        negotiation.slot = negotiation.slot._replace(length_us=0)
        self.fleet = WayFleet(site, machine, tokens, mirror, negotiation, self.entries)
        self.behaviour = self.factory.behaviour(self.fleet, estimator)
        # What a task costs here is a price, and no way.
        negotiation.is_sound = is_any_sound
        self.prepare(self.behaviour)
        witness = _Quiet(tokens, mirror, self.boot, True, self._statements, {})
        self.rights = RightsTalk(self.fleet, self.behaviour.may_grant, witness)

    def _statements(self, now_us: int) -> list[Effect]:
        return [*self.behaviour.statements(now_us), *self.fleet.mirror.statements()]

    def _beat(self) -> list[Effect]:
        beat = Heartbeat(self.node, 0, 0, 0, self.boot, self.behaviour.kind, MachineState.IDLE)
        return [Send(beat)] if self.boot > FIRST_LIFE else []

    # --- events, each with what is done about it -----------------------------------------------------------------

    def starts(self) -> list[Deed]:
        """Power-up: a life begins, all are asked, and the sensors speak."""
        others = set(self.site.machines) - {self.node}
        self.fleet.tokens.is_synced, self.fleet.tokens.asked = False, others
        effects: list[Effect] = [Record(BootRecord(self.boot)), *self.behaviour.start(NOW_US)]
        effects += [*self.fleet.tokens.statements(), Send(SyncRequest(self.node, NOBODY)), *self._beat()]
        for state in self.body.start():
            effects += self.behaviour.sense(state, NOW_US)
        return self._deeds(effects)

    def waits(self, down: Iterable[int]) -> list[Deed]:
        """A while has passed: all that waits is due, and who is down has been silent for long."""
        mirror, tokens = self.fleet.mirror, self.fleet.tokens
        if not self.takes_part:
            self.takes_part = True
            tokens.asked = set()
            tokens.trust()
        for node, machine in self.site.machines.items():
            if node == self.node:
                continue
            if node in down:
                mirror.set_aside(node, mirror.slots_of(machine, tokens.holder_of), Reason.NODE_SILENT, NOW_US)
            else:
                mirror.admit(node, NOW_US)
        effects = tokens.wake(NOW_US) + self.rights.serve_petitions(NOW_US)
        effects += self._negotiated(self.fleet.negotiation.wake(NOW_US))
        # By digests all come to have one another's plans and cars.
        plan = mirror.itineraries.get(self.node)
        plans: list[Effect] = [] if plan is None else [Send(plan)]
        return self._deeds([*self._beat(), *effects, *plans, *custody.statements(self.fleet)])

    def sleeps(self) -> list[Deed]:
        """It did nothing for a while, as whose process was stopped: it asks what it has missed, and plans anew."""
        self.fleet.admissions += 1
        self.fleet.winners.begin_anew(NOW_US)
        asked = [Send(SyncRequest(self.node, node)) for node in self.site.machines if node != self.node]
        return self._deeds([*asked, *self._statements(NOW_US)])

    def meets(self, event: Any) -> list[Deed]:
        """Its body goes on by itself, or its sensors see something."""
        effects: list[Effect] = []
        for state in self.body.meets(event):
            effects += self.behaviour.sense(state, NOW_US)
        return [Moved(self.body.state), *self._deeds(effects)]

    def hears(self, word: Message) -> list[Deed]:
        """A word of another machine."""
        if isinstance(word, SyncRequest):
            return self._deeds(self._is_asked(word))
        return self._deeds(self._takes_up(word))

    def _is_asked(self, word: SyncRequest) -> list[Effect]:
        if word.whom not in (NOBODY, self.node):
            return []
        if word.whom == NOBODY:
            # Its first word: it was started, and what it planned before is forgotten.
            self.fleet.mirror._forget_plan(word.sender)
            self.fleet.mirror.admit(word.sender, NOW_US)
            self.fleet.tokens.begin_anew(NOW_US)
            self.fleet.negotiation.begin_anew(NOW_US)
        return [*self.behaviour.hear(word, NOW_US), *self._statements(NOW_US)]

    def _takes_up(self, word: Message) -> list[Effect]:
        mirror = self.fleet.mirror
        if isinstance(word, Heartbeat):
            if self.boots.get(word.sender, FIRST_LIFE) < word.boot:
                self.boots[word.sender] = word.boot
                mirror._forget_plan(word.sender)
            return []
        mirror.hear(word, NOW_US)
        if isinstance(word, Itinerary):
            if word.stamp.award_ms < self.boots.get(word.sender, FIRST_LIFE):
                # A bus brings the words of one machine in their order: none of a plan of a life before.
                return []
            mirror.on_itinerary(word, NOW_US)
        handler = self.rights.handlers().get(type(word)) or mirror.handlers().get(type(word))
        effects: list[Effect] = handler(word, NOW_US) if handler is not None else []
        if isinstance(word, CallForProposals | Bid | Award | TaskReport | LeftOut | Itinerary):
            is_early = isinstance(word, CallForProposals) and not self.takes_part
            effects += [] if is_early else self._negotiated(self.fleet.negotiation.receive(word, NOW_US))
        effects = effects + self.behaviour.hear(word, NOW_US)
        if isinstance(word, TokenGrant | TokenHeld):
            proven = mirror.settle(word)
            if proven is not None:
                effects += self.behaviour.hear(proven, NOW_US)
        return effects

    def _negotiated(self, outcome: Iterable[Any]) -> list[Effect]:
        effects: list[Effect] = []
        for item in outcome:
            if isinstance(item, EVENT_TYPES):
                effects += self.behaviour.negotiated(item, NOW_US)
            else:
                effects.append(item)
        return effects

    # --- what is done --------------------------------------------------------------------------------------------

    def _deeds(self, effects: list[Effect]) -> list[Deed]:
        """Carry on until the machine waits for something; what its body does is sensed at once."""
        deeds: list[Deed] = []
        for _ in range(_MOST_ROUNDS):
            while effects:
                effects = self._carried_out(effects, deeds)
            negotiation = self.fleet.negotiation
            due_us = negotiation.next_wake()
            if due_us is not None and due_us <= NOW_US:
                effects = self._negotiated(negotiation.wake(NOW_US))
            if not effects and self.takes_part and not self.halted:
                effects = self.behaviour.advance(NOW_US)
            if not effects and (due_us is None or due_us > NOW_US):
                break
        self.fleet.motion.event += 1
        return deeds

    def _of_life(self, word: Message) -> Message:
        """The time of a plan's stamp, which decides nothing here, tells of which life it is."""
        if not isinstance(word, Itinerary):
            return word
        return replace(word, stamp=word.stamp._replace(award_ms=self.boot))

    def _carried_out(self, effects: list[Effect], deeds: list[Deed]) -> list[Effect]:
        """What follows at once from effects in their order: only what the body does is sensed."""
        follow: list[Effect] = []
        for effect in effects:
            match effect:
                case Record():
                    deeds.append(tuple(effect.entry.items()))
                case Send(message=message) if self.is_said(message):
                    deeds.append(self._of_life(message))
                case Actuate(message=order):
                    sensed = self.body.order(order)
                    deeds.append(Moved(self.body.state))
                    for state in sensed:
                        follow += self.behaviour.sense(state, NOW_US)
                case Halt(why=why):
                    self.halted = why
        return follow
