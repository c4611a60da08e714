"""``regenerate``: the rights of a machine whose journal is lost are made anew (rule 3 of docs/protocol.md).

The sequence is a table: FREEZE until all have said what they hold, the person's yes, READ_BACK until all have the same
list in their journals, COMMIT until all live in the new epoch. Whatever speaks against it before COMMIT aborts it, and
nothing has changed then.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum

from onboard.contract.assignments import assignment_digest
from onboard.contract.codes import Reason, RegenerationPhase, TokenKind
from onboard.contract.constants import MOBILE_KINDS, NOBODY
from onboard.contract.messages import (
    Blocked,
    CarAt,
    Heartbeat,
    Message,
    Regeneration,
    RegenerationState,
    TokenAssigned,
    TokenGiven,
    TokenGrant,
    TokenHeld,
    TokenSeen,
)
from onboard.core.authority import TokenKey
from onboard.core.serial import is_newer, successor
from onboard.holon.remedies import reason_words
from onboard.operate.assignment import NO_BODY, BodySlots, RightsAssignment, Statements, Whose, assign
from onboard.operate.order import AGAIN_US, MISTAKE, NOT_CONFIRMED, OperatorCommand
from onboard.operate.park import Park
from onboard.operate.words import state_words
from onboard.ways.lifts import GATE_INDEX, platform
from onboard.ways.site import TrackKind, way_site

#: How long all may stand frozen while the person reads and decides, us: a site that waits longer is forgotten.
DECIDE_US = 300_000_000
#: TokenAssigned said in one go, and the pause behind them, us: a quarter of a bus of 500 kbit/s.
BURST, PAUSE_US = 50, 50_000
#: Who has not read all back is told all again after this, us; all have so long for it: two rounds of statements.
TELL_AGAIN_US, READ_US = 3_000_000, 30_000_000
#: ABORT is said so often, as nobody answers it: all three must be lost for it to be missed.
ABORTS = 3
_SLOT = TokenKind.SEGMENT


class RegenerationStep(Enum):
    """How far a regeneration is, in the words that the person reads."""

    FREEZE = "all are asked to stand and to say what they hold"
    ASK = "the person decides"
    READ_BACK = "all are told the list, and read it back"
    COMMIT = "all take up the new epoch"
    ABORT = "it is broken off: nothing has changed"


#: What is said in each step.
PHASES = {
    RegenerationStep.FREEZE: RegenerationPhase.FREEZE,
    RegenerationStep.ASK: RegenerationPhase.FREEZE,
    RegenerationStep.READ_BACK: RegenerationPhase.READ_BACK,
    RegenerationStep.COMMIT: RegenerationPhase.COMMIT,
    RegenerationStep.ABORT: RegenerationPhase.ABORT,
}


@dataclass(frozen=True, slots=True)
class Lost:
    """Who lost its rights, who is locked off (0: nobody), and where their bodies are.

    A machine that moves and lost its journal does not know where it is: it learns it from the rights that it gets.
    """

    lost: int
    absent: int = NOBODY
    body: BodySlots = NO_BODY
    blocked: BodySlots = NO_BODY


class Regenerate(OperatorCommand):
    """See the module. A machine that is said to be locked off and is heard ends it."""

    def __init__(self, park: Park, node: int, who: Lost) -> None:
        super().__init__(park, node)
        self._who = who
        self._step = RegenerationStep.FREEZE
        self._since_us = 0
        self._epoch = 0
        self._said = Statements(park.site, who.lost)
        self._frozen: dict[int, int] = {}
        self._read: set[int] = set()
        self._boots: dict[int, int] = {}
        self._assignment = RightsAssignment((), ())
        self._bursts: Iterator[list[Message]] = iter(())
        self._again_us = 0
        #: How much has been said of rights, and when that was more last.
        self._stated, self._stated_us = 0, 0
        self._aborts = 0
        #: The exit status where it is broken off.
        self._ending = NOT_CONFIRMED

    # --- with the person ---------------------------------------------------------------------------------------

    def preview(self, now_us: int) -> list[str]:
        """Who lost its rights, who is absent, and how everybody is."""
        park, who = self.park, self._who
        lines = [f"{known.machine.name} {state_words(park, node, now_us)}" for node, known in park.machines.items()]
        lines.append(f"the rights of {park.name(who.lost)} are made anew; all machines stand meanwhile")
        if who.body.slots:
            lines.append(
                f"{park.name(who.lost)} is told that it stands at {', '.join(map(str, sorted(who.body.slots)))}"
            )
        if who.absent:
            slots = ", ".join(str(one) for one in sorted(who.blocked.slots)) or "none"
            lines.append(f"{park.name(who.absent)} is absent; its rights go too; slots that stay blocked: {slots}")
        return lines

    @property
    def question(self) -> str:
        """First whether the absent machine is locked off; then whether the rights listed shall be made anew."""
        if self._step is RegenerationStep.ASK:
            return f"Shall {len(self._assignment.given)} rights be made anew under epoch {self._epoch}?"
        if self._who.absent:
            name = self.park.name(self._who.absent)
            return f"Is the power of {name} off and locked with a padlock, so that it CANNOT move?"
        return f"Is the journal of {self.park.name(self._who.lost)} lost for good, and shall all stand meanwhile?"

    @property
    def answer(self) -> str:
        """The name of who is locked off is typed."""
        return self.park.name(self._who.absent) if self._who.absent and self._step is RegenerationStep.FREEZE else ""

    @property
    def has_question(self) -> bool:
        """Whether all have said what they hold, so that the person has to decide now."""
        return self._step is RegenerationStep.ASK and self.status is None

    def answered(self, now_us: int, *, agrees: bool) -> None:
        """The person's yes has the list read back by all; a no breaks it off with nothing changed."""
        if self._step is not RegenerationStep.ASK:
            return
        if agrees:
            self._go_to(RegenerationStep.READ_BACK, now_us)
        else:
            self._abort("the person does not want it", now_us)

    def interrupt(self, now_us: int) -> list[Message]:
        """Break it off with nothing changed; what was committed stays so."""
        if self._step is RegenerationStep.COMMIT:
            self.tell("COMMIT was said: those who have not heard it stand until it is said again")
            return super().interrupt(now_us)
        self.tell("broken off: nothing has changed")
        self._step = RegenerationStep.ABORT
        super().interrupt(now_us)
        return [self._word()]

    # --- with the bus ------------------------------------------------------------------------------------------

    def begin(self, now_us: int) -> None:
        """Nothing is said unless everybody lives who is not locked off, and nobody who is."""
        super().begin(now_us)
        self._since_us = now_us
        for node in self._participants():
            if not self.park.lives(node, now_us):
                name = self.park.name(node)
                self.tell(f"{name} is not heard: start it, or lock it off and name it with --absent {name}")
                self.status = NOT_CONFIRMED
        if self._who.absent and self.park.lives(self._who.absent, now_us):
            self.tell(f"{self.park.name(self._who.absent)} lives: it is not absent")
            self.status = NOT_CONFIRMED
        beats = {node: self.park.machines[node].beat for node in self._participants()}
        self._boots = {node: beat.boot for node, beat in beats.items() if beat is not None}
        self._epoch = successor(_newest([beat.epoch for beat in beats.values() if beat is not None]), 8)
        if self.status is None:
            self.tell(f"epoch {self._epoch}: {RegenerationStep.FREEZE.value}")

    def feed(self, message: Message, now_us: int) -> None:
        """Statements, answers, and whatever speaks against it."""
        if self.status is not None:
            return
        if message.sender == self._who.absent:
            self._absent_is_heard(message, now_us)
            return
        match message:
            case Regeneration() if self._step is not RegenerationStep.ABORT:
                self._abort(f"{self.park.name(message.sender)} regenerates as well", now_us)
            case RegenerationState() if message.epoch == self._epoch and message.sender in self._participants():
                self._on_state(message, now_us)
            case Heartbeat() if message.sender in self._participants():
                self._on_heartbeat(message, now_us)
            case CarAt():
                self._said.car_at(message)
            case TokenHeld() if self._step is RegenerationStep.FREEZE:
                self._said.take_up(message.sender, _key(message), message.version, message.sender)
            case TokenSeen() | TokenGiven() | TokenGrant() if self._step is RegenerationStep.FREEZE:
                # The giver's word about what has left it is as good as a bystander's: only TokenHeld tells a holder.
                holder = message.holder if message.holder != message.sender else NOBODY
                self._said.take_up(message.sender, _key(message), message.version, holder)
        self._wake_us = now_us

    def wake(self, now_us: int) -> list[Message]:
        """Say what the present step needs again, or go to the next; a step that takes too long breaks it off."""
        if self.status is not None:
            return []
        match self._step:
            case RegenerationStep.FREEZE:
                self._freeze(now_us)
            case RegenerationStep.ASK if now_us >= self._since_us + DECIDE_US:
                self._abort("nobody has answered", now_us)
            case RegenerationStep.READ_BACK:
                self._read_back(now_us)
            case RegenerationStep.COMMIT:
                self._commit(now_us)
        return [] if self.next_wake() is None else self._words(now_us)

    # --- steps -------------------------------------------------------------------------------------------------

    def _freeze(self, now_us: int) -> None:
        late = [node for node in self._participants() if not self._has_stated(node)]
        stated = sum(map(len, self._said.said_by.values()))
        if stated > self._stated:
            self._stated, self._stated_us = stated, now_us
        if late and now_us >= max(self._since_us, self._stated_us) + self.confirm_us():
            self._abort(f"not all have said what they hold: {self._names(late)}", now_us)
            return
        if late:
            return
        bad = self._said.contradiction()
        if bad is not None:
            what = f"{bad[0].kind.name.lower()} {bad[0].number:#06x}"
            self._abort(f"the journals of {self._names(bad[1])} do not agree about {what}: name one of them", now_us)
            return
        whose = Whose(self._who.lost, self._who.absent, self._who.body, self._who.blocked)
        self._assignment = assign(self._said, whose, self.node)
        if (wrong := self._wrong_body(whose)) != "":
            self._ending = MISTAKE
            self._abort(wrong, now_us)
            return
        self._show()
        self._go_to(RegenerationStep.ASK, now_us)

    def _wrong_body(self, whose: Whose) -> str:
        """Where the person sees a body that a right says cannot be there: whose it is, and where it may be instead.

        A machine that moves and gets no right to where it stands could never tell its place.
        """
        lost, name = self._who.lost, self.park.name(self._who.lost)
        if self.park.site.machines[lost].kind not in MOBILE_KINDS or lost == self._who.absent:
            return ""
        mine = {one.token for one in self._assignment.given if (one.token_kind, one.holder) == (_SLOT, lost)}
        for slot in sorted(self._who.body.slots):
            if slot.number in mine or (slot.index == GATE_INDEX and platform(slot.track).number in mine):
                # The gate of who is aboard may be its lift's.
                continue
            holder = self._said.holder_of(TokenKey(_SLOT, slot.number))
            known = [str(one) for one in self._said.slots_given_to(lost)]
            instead = f"; by the words of the others it may be in {', '.join(known)}" if known else ""
            return f"--body {slot}: {self.park.name(holder)} holds it, so {name} cannot be there: look again{instead}"
        cars, stations = self._said.left_perhaps(lost)
        for station in stations:
            if station.segment not in self._who.body.slots:
                left = f"{name} may have left car {_car(cars[0])} at {station} before its word was lost"
                return f"--body: {left}: look there; push it to {station.segment}, then --body {station.segment}"
        return ""

    def _show(self) -> None:
        for node in self.park.machines:
            kinds = [one.token_kind for one in self._assignment.given if one.holder == node]
            if kinds:
                rights = ", ".join(f"{kinds.count(kind)} {kind.name.lower()}s" for kind in TokenKind if kind in kinds)
                self.tell(f"{self.park.name(node)} gets {rights}")
        cars, stations = self._said.left_perhaps(self._who.absent) if self._who.absent != NOBODY else ([], [])
        for station in stations:
            left = f"car {_car(cars[0])} was aboard {self.park.name(self._who.absent)} by the last word of it"
            self.tell(f"{left}, and may stand at {station}: look there, and take it out before another is brought")
        if self._assignment.nobodys:
            self.tell(f"{len(self._assignment.nobodys)} rights stay nobody's")

    def _read_back(self, now_us: int) -> None:
        late = [node for node in self._participants() if node not in self._read]
        if not late:
            self.tell(f"all have read {len(self._assignment.given)} rights back")
            self._go_to(RegenerationStep.COMMIT, now_us)
        elif now_us >= self._since_us + READ_US:
            self._abort(f"not all have read the list back: {self._names(late)}", now_us)

    def _commit(self, now_us: int) -> None:
        late = [node for node in self._participants() if not self._is_in_epoch(node)]
        if not late:
            for node in self._participants():
                self.tell(f"{self.park.name(node)} is in epoch {self._epoch}")
            self.end([])
        elif now_us >= self._since_us + self.confirm_us():
            self.tell("committed: who is not in the new epoch is an obstacle until regenerate is done for it")
            self.end(self.park.name(node) for node in late)

    def _words(self, now_us: int) -> list[Message]:
        """What is said in the present step, and when it is said again."""
        burst = next(self._bursts, None) if self._step is RegenerationStep.READ_BACK else None
        if burst is not None:
            self._wake_us = now_us + PAUSE_US
            return burst
        if now_us < self._again_us:
            self._wake_us = self._again_us
            return []
        self._again_us = self._wake_us = now_us + AGAIN_US
        if self._step is RegenerationStep.READ_BACK:
            self._again_us = self._wake_us = now_us + TELL_AGAIN_US
            self._bursts = self._in_bursts()
            return [self._word()]
        if self._step is RegenerationStep.ABORT:
            self._aborts += 1
            if self._aborts == ABORTS:
                self.status = self._ending
        return [self._word(), *(self._blocks() if self._step is RegenerationStep.COMMIT else [])]

    def _in_bursts(self) -> Iterator[list[Message]]:
        given = self._assignment.given
        for start in range(0, len(given), BURST):
            yield list(given[start : start + BURST])
        yield [self._word()]

    def _word(self) -> Regeneration:
        is_listed = self._step in (RegenerationStep.READ_BACK, RegenerationStep.COMMIT)
        given: tuple[TokenAssigned, ...] = self._assignment.given if is_listed else ()
        digest = assignment_digest(given) if is_listed else 0
        who = self._who
        return Regeneration(self.node, PHASES[self._step], self._epoch, who.lost, who.absent, len(given), digest)

    def _blocks(self) -> list[Message]:
        """The slots of a body that is locked off are planned around."""
        tracks = way_site(self.park.site).tracks
        return [
            Blocked(self.node, *slot, Reason.OPERATOR)
            for slot in sorted(self._who.blocked.slots)
            if tracks[slot.track].kind is not TrackKind.LIFT
        ]

    # --- what is heard -----------------------------------------------------------------------------------------

    def _absent_is_heard(self, message: Message, now_us: int) -> None:
        name, sign_of_life = self.park.name(message.sender), type(message).__name__
        if self._step in (RegenerationStep.COMMIT, RegenerationStep.ABORT):
            self.tell(f"{name} LIVES though it is said to be locked off ({sign_of_life})")
            return
        self._abort(f"{name} LIVES though it is said to be locked off ({sign_of_life}): go and see", now_us)

    def _on_state(self, state: RegenerationState, now_us: int) -> None:
        wanted = self._word()
        match state.regeneration_phase:
            case RegenerationPhase.REFUSED if self._step not in (RegenerationStep.COMMIT, RegenerationStep.ABORT):
                self._abort(f"{self.park.name(state.sender)} refuses: {reason_words(state.reason)}", now_us)
            case RegenerationPhase.FREEZE if self._step is RegenerationStep.FREEZE:
                self._frozen[state.sender] = state.tokens
            case RegenerationPhase.READ_BACK if self._step is RegenerationStep.READ_BACK:
                if (state.tokens, state.digest) == (wanted.tokens, wanted.digest):
                    self._read.add(state.sender)

    def _on_heartbeat(self, beat: Heartbeat, now_us: int) -> None:
        before = self._boots.setdefault(beat.sender, beat.boot)
        if beat.boot != before and self._step not in (RegenerationStep.COMMIT, RegenerationStep.ABORT):
            self._abort(f"{self.park.name(beat.sender)} was started again meanwhile", now_us)

    # --- inner works -------------------------------------------------------------------------------------------

    def _participants(self) -> list[int]:
        return [node for node in self.park.machines if node != self._who.absent]

    def _has_stated(self, node: int) -> bool:
        return node in self._frozen and len(self._said.said_by.get(node, ())) >= self._frozen[node]

    def _is_in_epoch(self, node: int) -> bool:
        beat = self.park.machines[node].beat
        return beat is not None and beat.epoch == self._epoch

    def _go_to(self, step: RegenerationStep, now_us: int) -> None:
        self._step, self._since_us, self._again_us, self._wake_us = step, now_us, now_us, now_us
        if step is RegenerationStep.READ_BACK:
            self._bursts = self._in_bursts()
            self._again_us = now_us + TELL_AGAIN_US
        self.tell(f"epoch {self._epoch}: {step.value}")

    def _abort(self, why: str, now_us: int) -> None:
        self.tell(why)
        self._go_to(RegenerationStep.ABORT, now_us)

    def _names(self, nodes: list[int]) -> str:
        return ", ".join(self.park.name(node) for node in nodes)


def _key(message: TokenHeld | TokenSeen | TokenGiven | TokenGrant) -> TokenKey:
    return TokenKey(message.token_kind, message.token)


def _newest(epochs: list[int]) -> int:
    """The newest of several epochs, serial numbers of 8 bits (RFC 1982); 0 where there is none."""
    newest = 0
    for epoch in epochs:
        if newest == 0 or is_newer(epoch, newest, 8):
            newest = epoch
    return newest


def _car(key: TokenKey) -> str:
    return f"{key.number >> 16}.{key.number & 0xFFFF}"
