"""What a machine says and does about its holds (holon/holding.py): words, journal, and the way back."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from onboard.contract.codes import MachineState, Reason, TaskPhase
from onboard.contract.constants import NOBODY
from onboard.contract.messages import (
    Award,
    Bid,
    CallForProposals,
    EmergencyStop,
    Go,
    Halted,
    Heartbeat,
    Itinerary,
    LeftOut,
    Message,
    TaskReport,
    TokenDispute,
    TokenGiven,
    TokenGrant,
    TokenHeld,
    TokenRequest,
)
from onboard.contract.runs import singles
from onboard.core.behaviour import Behaviour
from onboard.core.effects import Effect, Record, Report, Send
from onboard.core.journal_state import RIGHTS_LOST
from onboard.core.records import BootRecord
from onboard.holon.holding import HoldResponse, HoldState, MachineHolds
from onboard.holon.own_number import OwnNumber
from onboard.holon.presence import Presence

#: Words that make a contract, or claim or move a right: not those of a machine whose journal is not to be relied on.
#: That they are missing is for all others as if they were lost on the bus, which they bear.
_OF_RIGHTS = (
    *(CallForProposals, LeftOut, Bid, Award, Itinerary),
    *(TokenRequest, TokenGrant, TokenHeld, TokenGiven, TokenDispute),
)


@runtime_checkable
class SelfStopping(Protocol):
    """A behaviour that stops its own machine for more than one reason; of any other an actuator is broken."""

    @property
    def why_stopped(self) -> Reason:
        """Why it says STOPPED; NONE where it does not."""


@dataclass
class Holds:
    """One machine's. ``heartbeat`` makes its sign of life, ``new_life`` begins another: its number, what to ask.

    ``behaviour`` gives what this machine does: it may have stopped itself.
    """

    holding: MachineHolds
    presence: Presence
    own: OwnNumber
    drops: Counter[Reason]
    heartbeat: Callable[[], Heartbeat]
    new_life: Callable[[int], tuple[int, list[Effect]]]
    behaviour: Callable[[], Behaviour]

    def on_own_number(self, message: Message, now_us: int) -> list[Effect]:
        """Somebody sends under my number: I hold, and take nothing in, until I know that nobody believed it."""
        self.drops[Reason.DUPLICATE_NODE_ID] += 1
        return self.apply(
            self.holding.own_frame(now_us, is_right=any(map(self.own.is_right, singles(message)))), now_us
        )

    def on_stop(self, stop: EmergencyStop, now_us: int) -> list[Effect]:
        """From anybody: standing is always safe. It is no sign of life of its sender, who may be nobody of the site."""
        return self.apply(self.holding.stop(stop.sender, now_us), now_us)

    def on_go(self, go: Go, now_us: int) -> list[Effect]:
        """A person lets me, or whom an emergency stop holds, go on; that gives nobody the rights back that it lost."""
        if go.stopper == self.holding.node_id and self.holding.why.reason in RIGHTS_LOST:
            return []
        return self.apply(self.holding.go(go.stopper), now_us)

    def on_halted(self, halted: Halted, now_us: int) -> list[Effect]:
        """Another machine does not act."""
        self.presence.heard_halted(halted, now_us)
        return []

    def apply(self, outcome: HoldResponse, now_us: int) -> list[Effect]:
        """What follows from an event of the holds."""
        match outcome:
            case HoldResponse.HOLDS:
                reason, cause, needs_person = self.holding.why
                line = f"held: {reason.name}, by node {cause}" + (", a person must decide" if needs_person else "")
                is_lasting = self.holding.hold is HoldState.PERSON
                record: list[Effect] = [Record(self.holding.record())] if is_lasting else []
                return [*record, Report(line), *self.words()]
            case HoldResponse.GOES_ON:
                self.presence.listen_anew(now_us)
                return [Report("goes on"), *self.words()]
            case HoldResponse.COMES_BACK:
                return self._come_back(now_us)
            case _:
                return []

    def words(self) -> list[Effect]:
        """My sign of life, and why I do not act where I do not."""
        beat = self.heartbeat()
        if self.holding.is_held:
            return [Send(beat), Send(self.holding.word(beat.boot))]
        return [Send(beat), self._stopped(beat)] if beat.state is MachineState.STOPPED else [Send(beat)]

    def _stopped(self, beat: Heartbeat) -> Effect:
        """Nothing from outside holds it, and nobody else can let it go on: a person has to help."""
        behaviour, me = self.behaviour(), self.holding.node_id
        # Of who says no more all believe that an actuator is broken (``Presence``).
        why = behaviour.why_stopped if isinstance(behaviour, SelfStopping) else Reason.ACTUATOR_FAULT
        return Send(Halted(me, me, why, NOBODY, True, beat.boot))

    def _come_back(self, now_us: int) -> list[Effect]:
        """As after a restart: under a new boot counter, and all are asked what they know before any right is used."""
        boot, ask = self.new_life(now_us)
        self.presence.listen_anew(now_us)
        records: list[Effect] = [Record(self.holding.record()), Record(BootRecord(boot))]
        return [*records, Report("comes back: nobody sends under its number any more"), *self.words(), *ask]


def without_rights(effects: list[Effect], vouching: tuple[type[Message], ...]) -> list[Effect]:
    """What is left of them where nobody knows this machine's rights: it still tells how it is, and gives tasks back.

    ``vouching`` are messages that only who has its rights may say, beside those of the core.
    """
    of_rights = (*_OF_RIGHTS, *vouching)
    return [one for one in effects if not (isinstance(one, Send) and _is_of_rights(one.message, of_rights))]


def _is_of_rights(message: Message, of_rights: tuple[type[Message], ...]) -> bool:
    if isinstance(message, TaskReport):
        return message.phase is not TaskPhase.FORFEITED
    return isinstance(message, of_rights)
