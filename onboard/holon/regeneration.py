"""One machine's part in making lost rights anew: it stands, says what it knows, and keeps the list before it counts.

A person's tool leads (docs/protocol.md, Regeneration). Two things hold whatever is lost on the way: nothing of the
list counts before everybody has it in the journal, and who has it there waits, also over its own restart, until it
hears that it counts (somebody lives in the new epoch) or that it does not (somebody of the old one works).
"""

from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

from onboard.contract.assignments import assignment_digest
from onboard.contract.codes import MachineState, Reason, RegenerationPhase, TokenKind
from onboard.contract.constants import NOBODY
from onboard.contract.messages import (
    Heartbeat,
    Message,
    Regeneration,
    RegenerationState,
    TokenAssigned,
    TokenHeld,
    TokenSeen,
)
from onboard.core.authority import TokenBook, TokenKey, may_exist
from onboard.core.belief import Belief
from onboard.core.effects import Effect, Record, Report, Send
from onboard.core.journal_records import Entry, records_in
from onboard.core.mirror import Mirror
from onboard.core.records import AssignedRecord, EpochRecord, ReadBackRecord, TokenGoneRecord, TokenHeldRecord
from onboard.core.serial import is_newer
from onboard.core.site import Segment

#: A freeze that its operator does not say again for so long is over, us: it says it each second.
FORGOTTEN_US = 10_000_000
#: Statements said in one go, and the least pause behind them, us: a controller's queue has room for 1,000 frames. All
#: machines say theirs at once, so the pause is as long as a burst of each takes, in frames of 160 bits with stuff bits.
BURST, PAUSE_US, FRAME_BITS = 100, 50_000, 160
#: Who repeats FREEZE for so long behind the last statement has missed something: all is said again, us.
SAY_AGAIN_US = 4_000_000


@dataclass
class Regenerating:
    """All times are bus time, us. ``on_end`` is called when the machine may act again: whose rights are new, or 0.

    ``extra`` says what belongs to the rights, such as where bodies are.
    """

    tokens: TokenBook
    mirror: Mirror
    extra: Callable[[int], list[Effect]]
    on_end: Callable[[int, int], list[Effect]]
    #: Why this machine can take no part in it; NONE where it can.
    refuses: Callable[[], Reason] = lambda: Reason.NONE
    #: The epoch in which this machine lives, 0 for the first.
    epoch: int = 0
    phase: RegenerationPhase = RegenerationPhase.NONE
    _next: int = 0
    _lost: int = NOBODY
    _list: dict[TokenKey, TokenAssigned] = field(default_factory=dict)
    _heard_us: int = 0
    _to_say: deque[Message] = field(default_factory=deque)
    _count: int = 0
    _say_us: int | None = None
    _said_us: int = 0

    def __post_init__(self) -> None:
        self.site, self.node_id = self.tokens.site, self.tokens.node_id
        bits = BURST * FRAME_BITS * len(self.site.machines)
        self._pause_us = max(PAUSE_US, bits * 1_000_000 // self.site.bitrate)

    @property
    def is_frozen(self) -> bool:
        """Whether this machine stands, and neither grants nor takes a right."""
        return self.phase is not RegenerationPhase.NONE

    @property
    def is_kept(self) -> bool:
        """Whether the list is in the journal: only a word of others ends that."""
        return self.phase is RegenerationPhase.READ_BACK

    def handlers(self) -> dict[type[Message], Callable[[Any, int], list[Effect]]]:
        """Which method takes which message, with bus time in us as its second argument."""
        return {Regeneration: self.on_word, TokenAssigned: self.on_assigned}

    def replay(self, entries: Iterable[Entry]) -> None:
        """The epoch, and a list that was read back and of which nobody said yet whether it counts."""
        known: dict[int, dict[TokenKey, TokenAssigned]] = {}
        for record in records_in(entries, AssignedRecord, ReadBackRecord, EpochRecord):
            match record:
                case AssignedRecord():
                    one = TokenAssigned(NOBODY, record.kind, record.number, record.version, record.holder)
                    known.setdefault(record.epoch, {})[TokenKey(one.token_kind, one.token)] = one
                case ReadBackRecord():
                    self._next, self._lost = record.epoch, record.lost
                    self._list, self.phase = known.get(self._next, {}), RegenerationPhase.READ_BACK
                case EpochRecord():
                    self.epoch, self.phase = record.epoch, RegenerationPhase.NONE

    # --- words -------------------------------------------------------------------------------------------------

    def on_word(self, word: Regeneration, now_us: int) -> list[Effect]:
        """A step of the operator."""
        why = self.refuses()
        match word.regeneration_phase:
            case RegenerationPhase.FREEZE if why is not Reason.NONE:
                return [self._state(RegenerationPhase.REFUSED, 0, 0, why, word.epoch)]
            case _ if why is not Reason.NONE:
                return []
            case RegenerationPhase.FREEZE:
                return self._freeze(word, now_us)
            case RegenerationPhase.READ_BACK if self.is_frozen and word.epoch == self._next:
                self._heard_us = now_us
                return self._read_back(word)
            case RegenerationPhase.COMMIT if self.is_kept and word.epoch == self._next:
                return self._commit(now_us)
            case RegenerationPhase.COMMIT if word.epoch == self.epoch:
                return [self._state(RegenerationPhase.COMMIT, 0, 0)]
            case RegenerationPhase.ABORT if self.is_frozen and word.epoch == self._next:
                return self._give_up("the operator has broken it off", now_us)
        return []

    def on_assigned(self, word: TokenAssigned, _now_us: int) -> list[Effect]:
        """One line of the list; what the site does not have is none."""
        key = TokenKey(word.token_kind, word.token)
        if self.phase is RegenerationPhase.FREEZE and may_exist(self.site, key):
            self._list[key] = word
        return []

    def on_heartbeat(self, beat: Heartbeat, now_us: int) -> list[Effect]:
        """Somebody lives in the epoch of my list: it counts. Somebody of mine works: it does not."""
        if not self.is_kept:
            return []
        if beat.epoch == self._next:
            return self._commit(now_us)
        if beat.epoch == self.epoch and beat.state in (MachineState.IDLE, MachineState.WORKING):
            return self._give_up(f"node {beat.sender} works in the old epoch", now_us)
        return []

    def wake(self, now_us: int) -> list[Effect]:
        """Say on what is known, and forget a freeze whose operator is gone."""
        if self.phase is RegenerationPhase.FREEZE and now_us >= self._heard_us + FORGOTTEN_US:
            return self._give_up("its operator is not heard any more", now_us)
        if self._say_us is None or now_us < self._say_us:
            return []
        burst = [self._to_say.popleft() for _ in range(min(BURST, len(self._to_say)))]
        self._said_us, self._say_us = now_us, now_us + self._pause_us if self._to_say else None
        return [Send(message) for message in burst]

    def next_wake(self) -> int | None:
        """When ``wake`` has something to do."""
        if self.phase is not RegenerationPhase.FREEZE:
            return None
        forgotten_us = self._heard_us + FORGOTTEN_US
        return forgotten_us if self._say_us is None else min(self._say_us, forgotten_us)

    # --- steps -------------------------------------------------------------------------------------------------

    def _freeze(self, word: Regeneration, now_us: int) -> list[Effect]:
        if word.absent == self.node_id:
            return [self._state(RegenerationPhase.REFUSED, 0, 0, Reason.FALSE_STATEMENT, word.epoch)]
        if self.is_kept and word.epoch == self._next:
            return []
        if not is_newer(word.epoch, self.epoch, 8):
            return [self._state(RegenerationPhase.REFUSED, 0, 0, Reason.OTHER_EPOCH, word.epoch)]
        effects: list[Effect] = []
        if not self.is_frozen or (word.epoch, word.lost) != (self._next, self._lost):
            effects.append(Report(f"stands: the rights of node {word.lost} are made anew"))
            self.phase, self._next, self._lost, self._list = RegenerationPhase.FREEZE, word.epoch, word.lost, {}
            self.mirror.recalls()
            self._begin_to_say(now_us)
        elif not self._to_say and now_us >= self._said_us + SAY_AGAIN_US:
            self._begin_to_say(now_us)
        self._heard_us = now_us
        return [*effects, self._state(RegenerationPhase.FREEZE, self._count, 0), *self.wake(now_us)]

    def _begin_to_say(self, now_us: int) -> None:
        """What I hold, the last that I gave away of each, and what I know the lost machine to hold."""
        book, is_lost = self.tokens, self._lost == self.node_id
        known: dict[TokenKey, Message] = {}
        for pair, one in book.beliefs.verified.items():
            key = TokenKey(*pair)
            if one.holder not in (self.node_id, NOBODY) and (key in book.given or one.holder == self._lost):
                known[key] = TokenSeen(self.node_id, *key, one.version, one.holder)
        vouched = self.mirror.vouched(self._lost)
        for key, (version, _) in vouched.items():
            known.setdefault(key, TokenSeen(self.node_id, *key, version, self._lost))
        if not is_lost:
            held = {key: TokenHeld(self.node_id, *key, version) for key, version in book.held.items()}
            known |= held
        self._to_say = deque([*(word for _, word in vouched.values()), *known.values()])
        self._to_say.extend(one.message for one in self.extra(now_us) if isinstance(one, Send))
        self._count, self._say_us, self._said_us = len(known), now_us, now_us

    def _read_back(self, word: Regeneration) -> list[Effect]:
        count, digest = len(self._list), assignment_digest(self._list.values())
        state = self._state(RegenerationPhase.READ_BACK, count, digest)
        if self.is_kept or (count, digest) != (word.tokens, word.digest):
            return [state]
        self.phase = RegenerationPhase.READ_BACK
        # What others remember they say once: a life that begins before the list counts has to know it.
        lines = [*map(self._line, self._list.values()), *self._take_over(counts=False)]
        return [*lines, Record(ReadBackRecord(self._next, self._lost)), state]

    def _take_over(self, *, counts: bool) -> list[Effect]:
        mine = {key: one.version for key, one in self._list.items() if one.holder == self.node_id}
        return self.mirror.takes_over(mine, counts=counts)

    def _commit(self, now_us: int) -> list[Effect]:
        effects = self._take_up() + self._take_over(counts=True)
        self.epoch, self.phase = self._next, RegenerationPhase.NONE
        self.tokens.changes += 1
        effects += [Record(EpochRecord(self.epoch)), self._state(RegenerationPhase.COMMIT, 0, 0)]
        return effects + self.on_end(self._lost, now_us)

    def _give_up(self, why: str, now_us: int) -> list[Effect]:
        # The journal says the epoch once more: what was read back is over.
        record: list[Effect] = [Record(EpochRecord(self.epoch))] if self.is_kept else []
        self.phase, self._say_us = RegenerationPhase.NONE, None
        return [*record, Report(f"nothing has changed: {why}"), *self.on_end(NOBODY, now_us)]

    # --- the book ----------------------------------------------------------------------------------------------

    def _take_up(self) -> list[Effect]:
        """The list counts: what is mine by it, and what is not any more, for the journal as well."""
        effects: list[Effect] = []
        if self._lost == self.node_id:
            effects += self._forget_own()
        for key, one in self._list.items():
            effects += self._set(key, one.version, one.holder)
        return effects

    def _forget_own(self) -> list[Effect]:
        """The lost machine has what the list gives it, and nothing of what its journal or the site file says."""
        book, effects = self.tokens, list[Effect]()
        # What others took from this node since is no token of the site, and would be its own by an empty journal.
        known = {*self.mirror.site_tokens(), *(TokenKey(*pair) for pair in book.beliefs.verified)}
        first = {key for key in known if book.is_mine_by_journal(key)}
        for key in sorted({*book.seen, *book.held, *book.leaving, *first} - set(self._list)):
            version = max(book.seen.get(key, 0), book.beliefs.of(key).version)
            holder = book.beliefs.latest(key).holder
            effects += self._set(key, version, holder if holder != self.node_id else NOBODY)
        return effects

    def _set(self, key: TokenKey, version: int, holder: int) -> list[Effect]:
        book = self.tokens
        is_mine, concerns = holder == self.node_id, key in book.seen or book.is_mine_by_journal(key)
        book.leaving.pop(key, None)
        book.beliefs.take_up(key, version, holder, confirmed=True)
        if not is_mine and not concerns:
            return []
        book.held.pop(key, None)
        book.seen[key] = version
        if is_mine:
            book.held[key] = version
            book.forget(key)
        else:
            book.given[key] = Belief(version, holder, confirmed=True)
        record = TokenHeldRecord if is_mine else TokenGoneRecord
        return [Record(record(key.kind, key.number, version, holder))]

    def _line(self, one: TokenAssigned) -> Effect:
        return Record(AssignedRecord(self._next, one.token_kind, one.token, one.version, one.holder))

    def slots(self) -> tuple[Segment, ...]:
        """Segments that the list gives to this node."""
        mine = [
            key.number
            for key, one in self._list.items()
            if one.holder == self.node_id and key.kind is TokenKind.SEGMENT
        ]
        return tuple(Segment(number >> 8, number & 0xFF) for number in sorted(mine))

    def _state(
        self, phase: RegenerationPhase, tokens: int, digest: int, reason: Reason = Reason.NONE, epoch: int | None = None
    ) -> Effect:
        of = epoch if epoch is not None else self._next or self.epoch
        return Send(RegenerationState(self.node_id, phase, of, tokens, digest, reason))
