"""A machine that does nothing any more, and why: who brought it about, and what lets it go on (docs/protocol.md, 13).

A held machine lives: it says ``Halted`` in each heartbeat period, stands, uses no right and gives none away, and comes
back. A halted one says why once and is silent: its process ends. Frames under one's own number are the case of rule 2
of the protocol's review: the machine goes on by itself only once the bus was heard without them for a while, and where
somebody made or moved a right under its number a person decides.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import NamedTuple

from onboard.contract.codes import Reason
from onboard.contract.constants import NOBODY
from onboard.contract.messages import Halted
from onboard.core.journal_records import Entry, records_in
from onboard.core.records import HeldRecord, ReleasedRecord

#: An emergency stop holds so long after it was last heard, us (docs/protocol.md).
STOP_LASTS_US = 30_000_000
#: Heartbeat periods without a frame under my number after which I go on (docs/protocol.md).
QUIET_BEATS = 3
#: A frame under my number this many heartbeat periods after the first of one hold is a twin that lives, not a log that
#: somebody plays or a slip of a tool: ten minutes at the default.
TWIN_BEATS = 600
#: Without a frame of anybody for so many heartbeat periods I hear nothing, and silence proves nothing.
DEAF_BEATS = 2
#: Holds for a person in which nothing is taken in: it could not be written down, or somebody else says it as well.
_APART = (Reason.DUPLICATE_NODE_ID, Reason.JOURNAL_FOREIGN)


class HoldState(Enum):
    """Whether a machine acts, or what holds it."""

    ACTING = "acts"
    STOPPED = "held by an emergency stop"
    OWN_NUMBER = "held while somebody sends under its number"
    PERSON = "held until a person decides"
    HALTED = "halted for good"


class HoldEvent(Enum):
    """What can happen to that."""

    STOP = "an emergency stop is heard"
    STOP_OVER = "the last emergency stop was lifted, or is old"
    OWN_FRAME = "a frame under my number"
    OWN_RIGHT = "a frame under my number made or moved a right, or a twin lives"
    QUIET = "the bus was heard, and nobody sent under my number for a while"
    DECIDE = "a person must decide"
    GO = "a person lets me go on"
    BREAK = "an invariant is broken: the process ends"


class HoldResponse(Enum):
    """What the machine does upon it."""

    NOTHING = "nothing new"
    HOLDS = "stands, and says why"
    GOES_ON = "takes part again after it has listened"
    COMES_BACK = "takes part again as after a restart: a new boot counter, and every right is compared"
    ENDS = "says why, and is silent"


class HoldReason(NamedTuple):
    """Why a machine does not act: the reason, the node that brought it about (0: nobody), whether a person decides."""

    reason: Reason
    cause: int
    needs_person: bool


_NOTHING = HoldReason(Reason.NONE, NOBODY, False)


@dataclass
class MachineHolds:
    """One machine's holds. All times are bus time in us; ``beat_us`` is the heartbeat period.

    Every event answers with what is to be done. A hold for a person outlives the process: ``record`` is for the
    journal, ``replay`` takes it up.
    """

    node_id: int
    beat_us: int
    hold: HoldState = HoldState.ACTING
    #: Emergency stops that hold: by whom, and when last heard.
    stops: dict[int, int] = field(default_factory=dict)
    _decision: HoldReason = _NOTHING
    _own_since_us: int | None = None
    _quiet_since_us: int = 0
    _heard_us: int | None = None

    def __post_init__(self) -> None:
        self._deaf_us = DEAF_BEATS * self.beat_us

    # --- what holds --------------------------------------------------------------------------------------------

    @property
    def is_held(self) -> bool:
        """Whether the machine does nothing: it neither moves nor bids nor gives a right away."""
        return self.hold is not HoldState.ACTING

    @property
    def is_apart(self) -> bool:
        """Whether it also takes in nothing of rights and plans, as if it were off: it compares all when it is back."""
        if self.hold is HoldState.ACTING:
            return False
        lasting = self.hold is HoldState.PERSON and self._decision.reason in _APART
        return lasting or self.hold in (HoldState.OWN_NUMBER, HoldState.HALTED)

    @property
    def why(self) -> HoldReason:
        """Why the machine does not act; NONE where it acts."""
        if self.hold is HoldState.STOPPED:
            return HoldReason(Reason.EMERGENCY_STOP, max(self.stops, key=lambda node: self.stops[node]), False)
        if self.hold is HoldState.OWN_NUMBER:
            return HoldReason(Reason.DUPLICATE_NODE_ID, self.node_id, False)
        return self._decision if self.is_held else _NOTHING

    def word(self, boot: int) -> Halted:
        """What is said of it; ``boot`` is the boot counter."""
        return Halted(self.node_id, self.node_id, self.why.reason, self.why.cause, self.why.needs_person, boot)

    def last_word(self, boot: int, reason: Reason, *, needs_person: bool) -> Halted:
        """What is said before the process ends; a hold for a person outlives it, whatever starts the process again."""
        if self.hold is not HoldState.HALTED:
            self.halt(reason)
        word = self.word(boot)
        return word if word.reason is not reason else replace(word, needs_person=needs_person)

    # --- events ------------------------------------------------------------------------------------------------

    def stop(self, stopper: int, now_us: int) -> HoldResponse:
        """An emergency stop from ``stopper`` is heard."""
        self.stops[stopper] = now_us
        return self._fire(HoldEvent.STOP)

    def go(self, named: int) -> HoldResponse:
        """A person ends the emergency stop of node ``named``, or all with 0; my own number lets me go on at all."""
        for stopper in list(self.stops) if named == NOBODY else [named]:
            self.stops.pop(stopper, None)
        if named == self.node_id and self.hold in (HoldState.PERSON, HoldState.OWN_NUMBER):
            return self._fire(HoldEvent.GO)
        return HoldResponse.NOTHING if self.stops else self._fire(HoldEvent.STOP_OVER)

    def own_frame(self, now_us: int, *, is_right: bool) -> HoldResponse:
        """Somebody sends under my number; ``is_right``: what it says makes or moves a right that is not so."""
        if self._own_since_us is None:
            self._own_since_us = now_us
        self._quiet_since_us = now_us
        is_twin = now_us - self._own_since_us >= TWIN_BEATS * self.beat_us
        if is_right or is_twin:
            return self._decide(HoldEvent.OWN_RIGHT, Reason.DUPLICATE_NODE_ID, self.node_id)
        return self._fire(HoldEvent.OWN_FRAME)

    def heard(self, now_us: int) -> None:
        """A frame of another machine: my silence counts only while I hear the bus."""
        if self._heard_us is None or now_us - self._heard_us > self._deaf_us:
            self._quiet_since_us = now_us
        self._heard_us = now_us

    def slept(self, now_us: int) -> None:
        """I heard nothing for a while, or my clock has jumped: what was to last so long lasts so long from now on."""
        self.stops = dict.fromkeys(self.stops, now_us)
        self._quiet_since_us = now_us
        self._own_since_us = None if self._own_since_us is None else now_us

    def for_person(self, reason: Reason, cause: int) -> HoldResponse:
        """Only a person can know what is right: hold for ``reason``, brought about by node ``cause`` (0: nobody)."""
        return self._decide(HoldEvent.DECIDE, reason, cause)

    def halt(self, reason: Reason, cause: int = NOBODY) -> HoldResponse:
        """The process is about to end."""
        if self.hold is HoldState.PERSON:
            return self._fire(HoldEvent.BREAK)
        return self._decide(HoldEvent.BREAK, reason, cause)

    def wake(self, now_us: int, *, acknowledged: bool = True) -> HoldResponse:
        """Let stops grow old and silence count; ``acknowledged``: the bus has taken my own frames meanwhile."""
        if self.stops:
            self.stops = {node: heard_us for node, heard_us in self.stops.items() if now_us - heard_us < STOP_LASTS_US}
        if not acknowledged or self._is_deaf(now_us):
            self._quiet_since_us = now_us
        if self.hold is HoldState.OWN_NUMBER and self._is_quiet(now_us):
            return self._fire(HoldEvent.QUIET)
        # Of a machine that acts no stop can be over.
        is_over = not self.stops and self.hold is not HoldState.ACTING
        return self._fire(HoldEvent.STOP_OVER) if is_over else HoldResponse.NOTHING

    def next_wake(self) -> int | None:
        """When ``wake`` has something to do, bus time in us."""
        if self.hold is HoldState.ACTING and not self.stops:
            return None
        times = [heard_us + STOP_LASTS_US for heard_us in self.stops.values()]
        if self.hold is HoldState.OWN_NUMBER:
            times.append(self._quiet_since_us + QUIET_BEATS * self.beat_us)
        return min(times, default=None)

    # --- the journal -------------------------------------------------------------------------------------------

    def record(self) -> HeldRecord | ReleasedRecord:
        """The journal's entry about a hold for a person, or about its end."""
        if self.hold is not HoldState.PERSON:
            return ReleasedRecord()
        return HeldRecord(self._decision.reason, self._decision.cause)

    def replay(self, entries: Iterable[Entry], of_journal: Reason = Reason.NONE) -> None:
        """Take up a hold for a person that was not ended before the process was; ``of_journal``: its own reason."""
        for record in records_in(entries, HeldRecord, ReleasedRecord):
            if isinstance(record, HeldRecord):
                self.for_person(record.reason, record.cause)
            elif self.hold is HoldState.PERSON:
                self._fire(HoldEvent.GO)
        if of_journal is not Reason.NONE:
            self.for_person(of_journal, NOBODY)

    # --- inner works -------------------------------------------------------------------------------------------

    def _decide(self, event: HoldEvent, reason: Reason, cause: int) -> HoldResponse:
        if (self.hold, event) in TABLE:
            # The first decision that is due stands: what follows from it would hide it.
            self._decision = HoldReason(reason, cause, True)
        return self._fire(event)

    def _fire(self, event: HoldEvent) -> HoldResponse:
        entry = TABLE.get((self.hold, event))
        if entry is None:
            return HoldResponse.NOTHING
        self.hold, outcome = entry
        if self.hold is HoldState.ACTING:
            self._own_since_us = None
            if self.stops:
                self.hold = HoldState.STOPPED
        return outcome

    def _is_deaf(self, now_us: int) -> bool:
        return self._heard_us is None or now_us - self._heard_us > self._deaf_us

    def _is_quiet(self, now_us: int) -> bool:
        return now_us - self._quiet_since_us >= QUIET_BEATS * self.beat_us


#: (state, event) to the next state and what the machine does; pairs that are missing change nothing.
TABLE: dict[tuple[HoldState, HoldEvent], tuple[HoldState, HoldResponse]] = {
    (HoldState.ACTING, HoldEvent.STOP): (HoldState.STOPPED, HoldResponse.HOLDS),
    (HoldState.ACTING, HoldEvent.OWN_FRAME): (HoldState.OWN_NUMBER, HoldResponse.HOLDS),
    (HoldState.ACTING, HoldEvent.OWN_RIGHT): (HoldState.PERSON, HoldResponse.HOLDS),
    (HoldState.ACTING, HoldEvent.DECIDE): (HoldState.PERSON, HoldResponse.HOLDS),
    (HoldState.ACTING, HoldEvent.BREAK): (HoldState.HALTED, HoldResponse.ENDS),
    (HoldState.STOPPED, HoldEvent.STOP_OVER): (HoldState.ACTING, HoldResponse.GOES_ON),
    (HoldState.STOPPED, HoldEvent.OWN_FRAME): (HoldState.OWN_NUMBER, HoldResponse.HOLDS),
    (HoldState.STOPPED, HoldEvent.OWN_RIGHT): (HoldState.PERSON, HoldResponse.HOLDS),
    (HoldState.STOPPED, HoldEvent.DECIDE): (HoldState.PERSON, HoldResponse.HOLDS),
    (HoldState.STOPPED, HoldEvent.BREAK): (HoldState.HALTED, HoldResponse.ENDS),
    (HoldState.OWN_NUMBER, HoldEvent.QUIET): (HoldState.ACTING, HoldResponse.COMES_BACK),
    (HoldState.OWN_NUMBER, HoldEvent.GO): (HoldState.ACTING, HoldResponse.COMES_BACK),
    (HoldState.OWN_NUMBER, HoldEvent.OWN_RIGHT): (HoldState.PERSON, HoldResponse.HOLDS),
    (HoldState.OWN_NUMBER, HoldEvent.DECIDE): (HoldState.PERSON, HoldResponse.HOLDS),
    (HoldState.OWN_NUMBER, HoldEvent.BREAK): (HoldState.HALTED, HoldResponse.ENDS),
    (HoldState.PERSON, HoldEvent.GO): (HoldState.ACTING, HoldResponse.COMES_BACK),
    (HoldState.PERSON, HoldEvent.BREAK): (HoldState.HALTED, HoldResponse.ENDS),
}
