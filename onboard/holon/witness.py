"""Restart: who was started again asks all what they know, and uses no right before they have answered.

A journal may be an old copy of itself, and no medium knows that (``journal_state.py``). The bus does: who took a token
from me says so, and so does who saw it taken. What is known better elsewhere takes the right to move from this machine
until a person has decided (docs/protocol.md, Restart).
"""

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import reduce
from operator import or_
from typing import NamedTuple

from onboard.contract.codes import MachineState, Reason
from onboard.contract.constants import NOBODY, SEEN_VERSION_BITS
from onboard.contract.messages import (
    Halted,
    Heartbeat,
    SyncDone,
    SyncRequest,
    TokenGiven,
    TokenGrant,
    TokenHeld,
    TokenRequest,
    TokenSeen,
)
from onboard.core.authority import TokenBook, TokenKey
from onboard.core.bus_time import MAX_SLEW_US
from onboard.core.effects import Effect, Send
from onboard.core.mirror import Mirror
from onboard.core.serial import is_newer

#: A digest that a peer tells was mine at most so long ago where nothing was missed, us: frames wait behind others.
FRAMES_WAIT_US = 300_000
#: Who has said so many words that change digests within so long, us, asks nobody: two plans that answer each other.
RESTLESS, RESTLESS_US = 4, 6_000_000
#: A machine's digest may be heard so long before the word that made it, us: the word waits for the journal.
WORDS_WAIT_US = 20_000
#: Whoever has nothing to say that makes mirrors equal is asked at so many heartbeats, then at every so many.
OFTEN = 3
SELDOM = 8
#: Who asks within this time of an answer shares the next one, us: at power-up all ask all. And within so many bits of
#: each of its frames, of 160 with stuff bits: four who vouch for hundreds of things answer at once. And within so many
#: for each right that was heard of: all tell two or three words about each, and as long the bus is free for others.
ANSWER_PERIOD_US, ANSWER_FRAME_BITS, KNOWN_RIGHT_BITS = 250_000, 640, 900
#: Who is to be asked by any one of all: the first slot begins so long after the cause, us, when who was started with
#: all others has answered all; then each has its own, as long as a question and the first answer at 125 kbit/s.
FIRST_SLOT_US = 400_000
SLOT_US = 5_000
#: So many words about rights within an answer's period are no ordinary work: a tenth of what it holds at 500 kbit/s.
FLOOD = 100
#: Nobody waits for longer while such words come, us: 15,000 of them at 500 kbit/s.
MOST_FLOOD_US = 5_000_000
#: Bits of ``SyncDone.askers``.
ASKER_BITS = 48
#: So many things at most of those that it held before is a machine told, the last ones: an old journal lacks these.
MOST_DOUBTS = 4
#: From one question to who has not answered to the next, us: two shared answers.
AGAIN_US = 500_000
#: So many heartbeat periods after its start a machine has been compared with by all that live: the first word may be
#: lost, and the next.
COMPARING_BEATS = 4


class Doubt(NamedTuple):
    """Why this machine must not use its rights, who knows better, and what of."""

    reason: Reason
    cause: int
    what: str

    @property
    def text(self) -> str:
        """One line for a person."""
        return f"the journal is lost or old: node {self.cause} {self.what}; a person must regenerate its tokens"


@dataclass
class Witness:
    """One machine's questions after its start, and its answers to those of others. All times are bus time, us.

    ``has_past`` tells whether the journal knows an earlier life; ``statements`` says all that the machine vouches for.
    """

    tokens: TokenBook
    mirror: Mirror
    boot: int
    has_past: bool
    statements: Callable[[int], list[Effect]]
    #: Who has said that it does nothing, as ``Presence`` keeps them.
    halts: Mapping[int, Halted] = field(default_factory=dict)
    doubt: Doubt | None = None
    #: Whether a plan of mine is on its way still: nobody else has it in his digest.
    is_telling: Callable[[], bool] = lambda: False
    #: Who has answered since this one started, under which boot: what it says later is no proof against its journal.
    answered: dict[int, int] = field(default_factory=dict)
    #: My mirror's digest, and until when it was another.
    digest: int | None = None
    digests_before: dict[int, int] = field(default_factory=dict)
    #: When words of mine changed it, the last few times.
    _told: deque[int] = field(default_factory=lambda: deque([-RESTLESS_US] * RESTLESS, RESTLESS))
    #: Whose digest is another than mine: both, and how often in a row it was told so.
    _apart: dict[int, tuple[int, int, int]] = field(default_factory=dict)
    #: What machines that were started again held by their own word before, until they say so again.
    doubted: dict[int, dict[TokenKey, int]] = field(default_factory=dict)
    #: Machines that were started again and were not answered since.
    starting: set[int] = field(default_factory=set)
    _since_us: int | None = None
    _ask_at_us: int | None = None
    _askers: set[int] = field(default_factory=set)
    _answer_at_us: int | None = None
    _quiet_until_us: int | None = None
    #: Whom to ask when, unless its answer to another is heard before.
    _slots: dict[int, int] = field(default_factory=dict)
    #: When the last words about rights were heard, and since when there were so many of them.
    _words_us: deque[int] = field(default_factory=lambda: deque(maxlen=FLOOD))
    _flood_us: int = 0

    def __post_init__(self) -> None:
        self.site, self.node_id = self.tokens.site, self.tokens.node_id
        self._others = set(self.site.machines) - {self.node_id}
        #: After what all heard, this machine speaks so much later, us.
        self.slot_us = sum(node < self.node_id for node in self._others) * SLOT_US
        #: What stands for each machine in ``SyncDone.askers``.
        self._bits = {node: 1 << place % ASKER_BITS for place, node in enumerate(sorted(self.site.machines))}

    # --- asking ------------------------------------------------------------------------------------------------

    @property
    def is_over(self) -> bool:
        """Whether all that live have answered, and nobody knew better than the journal."""
        return self.tokens.is_synced

    @property
    def is_waiting(self) -> bool:
        """Whether a machine that was started again has to wait still; in a first life only rights wait."""
        return self.has_past and not self.is_over

    def on_heartbeat(self, beat: Heartbeat, now_us: int, *, is_fresh: bool) -> list[Effect]:
        """Ask who is new or was started again, and whose mirror has differed from mine for a while."""
        before = self.mirror.boots_before[beat.sender] if is_fresh else 0
        if before or (is_fresh and self.answered.get(beat.sender) != beat.boot):
            self._was_started(beat.sender)
            return self._ask_newcomer(beat.sender, before, now_us)
        self._compare(beat, now_us)
        return []

    def _compare(self, beat: Heartbeat, now_us: int) -> None:
        """Ask soon whose mirror is another than mine; seldom, where asking it has not made them equal."""
        told, mine = beat.mirror_digest, self.mirror.digest()
        if self._was_mine(told, now_us):
            self._apart.pop(beat.sender, None)
            return
        self._told[-1] = now_us if self.is_telling() else self._told[-1]
        is_restless = now_us - self._told[-1] < FRAMES_WAIT_US or now_us - self._told[0] < RESTLESS_US
        if is_restless or self._is_flooded(now_us):
            # Others hear one by one what I said in one step: what they believed in between I never did. Where I say
            # one word after the other, the last ones wait for my share of the bus, and all are behind me. And while
            # answers come all are behind each other.
            return
        before = self._apart.get(beat.sender, (0, 0, 0))
        times = before[2] + 1 if before[:2] == (told, mine) else 1
        self._apart[beat.sender] = told, mine, times
        if (times <= OFTEN or times % SELDOM == 0) and not self._has_just_begun(now_us):
            self._slots.setdefault(beat.sender, now_us + WORDS_WAIT_US + self.slot_us)

    def _has_just_begun(self, now_us: int) -> bool:
        """Whether all are asked, and answer: what is missing then is asked for all the same."""
        return self._since_us is not None and now_us < self._since_us + self.site.timing.heartbeat_us

    def _is_made_up(self, node: int, now_us: int) -> bool:
        """Whether what was only to be compared was equal meanwhile: words of a machine wait for its journal."""
        return node not in self.tokens.asked and self._was_mine(self._apart.get(node, (-1,))[0], now_us)

    def agrees(self, beat: Heartbeat) -> bool:
        """Whether a peer's mirror is as mine, and was when it said so last."""
        return beat.mirror_digest == self.mirror.digest() and beat.sender not in self._apart

    def heed(self, effects: list[Effect], now_us: int) -> bool:
        """Note my mirror's digest as it is after an event; True where words of mine among ``effects`` changed it."""
        digest = self.mirror.digest()
        if digest == self.digest:
            return False
        if self.digest is not None:
            before = self.digests_before
            # In the order of time: hundreds may come in one wait, and none of those is looked at for each.
            before.pop(self.digest, None)
            while before and next(iter(before.values())) < now_us - FRAMES_WAIT_US:
                del before[next(iter(before))]
            before[self.digest] = now_us
        self.digest = digest
        digested = self.mirror.digested
        if not any(isinstance(effect, Send) and isinstance(effect.message, digested) for effect in effects):
            return False
        self._told.append(now_us)
        return True

    def _was_mine(self, digest: int, now_us: int) -> bool:
        past_us = now_us - FRAMES_WAIT_US
        return digest == self.mirror.digest() or self.digests_before.get(digest, past_us - 1) >= past_us

    def begin(self, now_us: int) -> list[Effect]:
        """What the journal says that I hold and gave away, for all to compare, and the question to all."""
        self.tokens.is_synced = False
        self._since_us = now_us
        self._ask_at_us = now_us + self.site.timing.heartbeat_us
        self.tokens.asked = set(self._others)
        # Who comes back after a hold asks anew: what was answered before that is old.
        self.answered.clear()
        for node in self._others:
            self._was_started(node)
        # All answer me now and ask me: what they say in it need not be told to them.
        return self._be_quiet([*self.tokens.statements(), Send(SyncRequest(self.node_id, NOBODY))], now_us)

    def _be_quiet(self, said: list[Effect], now_us: int) -> list[Effect]:
        """The next answer is shared by all who ask while this is said: more at once would never let its end through."""
        bits = max(len(said) * ANSWER_FRAME_BITS, len(self.tokens.beliefs.verified) * KNOWN_RIGHT_BITS)
        self._quiet_until_us = now_us + max(ANSWER_PERIOD_US, bits * 1_000_000 // self.site.bitrate)
        return said

    def shift(self, by_us: int) -> None:
        """Bus time was set, or set anew: what is due stays as far away as it was."""
        self._since_us = _later(self._since_us, by_us)
        self._ask_at_us = _later(self._ask_at_us, by_us)
        self._answer_at_us = _later(self._answer_at_us, by_us)
        self._quiet_until_us = _later(self._quiet_until_us, by_us)
        self._slots = {node: due_us + by_us for node, due_us in self._slots.items()}
        if abs(by_us) > MAX_SLEW_US:
            for peer in self.mirror.peers.values():
                # Who has just come has no earlier life because the time was set.
                peer.since_us += by_us
            self._words_us.clear()
            self.digests_before.clear()
            self._told = deque((told_us + by_us for told_us in self._told), RESTLESS)

    def slept(self, now_us: int) -> None:
        """I heard nothing for a while, or my clock has jumped: who has not answered has had no time to."""
        if not self.is_over and self._since_us is not None:
            self._since_us, self._ask_at_us = now_us, now_us + self.site.timing.heartbeat_us

    def ask(self, node: int, boot_before: int = 0) -> list[Effect]:
        """Ask one machine for all that it vouches for; what it says that it holds is believed until it has done."""
        self.tokens.asked.add(node)
        return [Send(SyncRequest(self.node_id, node, boot_before))]

    def _ask_newcomer(self, node: int, boot_before: int, now_us: int) -> list[Effect]:
        """Who knows an earlier life of it says so at once; what it vouches for it says to all, whoever asks."""
        if boot_before:
            return self.ask(node, boot_before)
        if node not in self.answered:
            self.tokens.asked.add(node)
            self._slots.setdefault(node, now_us + FIRST_SLOT_US + self.slot_us)
        return []

    def on_done(self, word: SyncDone, now_us: int) -> list[Effect]:
        """A machine has said all: of what it held before its restart and does not know of, it is told."""
        self._slots.pop(word.sender, None)
        if not self._is_answer(word) or word.sender not in self._others:
            return []
        self.tokens.asked.discard(word.sender)
        self.answered[word.sender] = word.boot
        effects = self._tell_doubted(word.sender)
        self._review(now_us)
        return effects

    def _is_answer(self, word: SyncDone) -> bool:
        """Whether all of what was said was said for me too: who asked later has heard a part of it."""
        is_mine = not word.askers or bool(word.askers & self._bits[self.node_id])
        return word.whom == self.node_id or (word.whom == NOBODY and is_mine)

    def _review(self, now_us: int) -> None:
        """The rights are mine once all that live have answered; without a past, all there are, or all as new as I."""
        if self.is_over or self.doubt is not None or self._since_us is None:
            return
        if self.tokens.contradicted is not None:
            self._doubt(Reason.JOURNAL_SHORT, *self.tokens.contradicted)
            self.tokens.contradicted = None
            return
        if not self._missing(now_us) and (self._has_all_answered or not self._has_just_begun(now_us)):
            self.tokens.trust()

    @property
    def _has_all_answered(self) -> bool:
        """Whether a machine with a past was answered by each other one: nobody is left who might still be heard."""
        return self.has_past and self._others <= self.answered.keys()

    def _missing(self, now_us: int) -> set[int]:
        live = self._live(now_us)
        if not self.has_past and any(self.mirror.peers[node].boot > 1 for node in live):
            # A first life in a fleet that has a past: whoever is away may know of an earlier one.
            return self._others - self.answered.keys()
        return live - self.answered.keys()

    def _live(self, now_us: int) -> set[int]:
        """Who can answer: not who has said that it is halted or held apart; who has stopped itself answers."""
        live = self.mirror.alive(now_us) & self._others
        stands = {node for node in live if self.mirror.peers[node].state is MachineState.STOPPED}
        return {node for node in live if node not in self.halts or node in stands}

    def wake(self, now_us: int) -> list[Effect]:
        """Ask again who has not answered, and answer those who asked meanwhile."""
        effects: list[Effect] = []
        self._review(now_us)
        if not self.is_over and self.doubt is None and self._ask_at_us is not None and self._ask_at_us <= now_us:
            self._ask_at_us = now_us + AGAIN_US
            missing, live = self._missing(now_us), self._live(now_us)
            for node in [] if self._is_flooded(now_us) else sorted(missing & live):
                effects += self.ask(node)
            for node in sorted(missing - live):
                effects.append(Send(Halted(self.node_id, self.node_id, Reason.JOURNAL_LOST, node, False, self.boot)))
        for node in self._due(now_us):
            del self._slots[node]
            effects += [] if self._is_made_up(node, now_us) else self.ask(node)
        if self._is_answering(now_us):
            effects += self._answer(now_us)
        return effects

    def _due(self, now_us: int) -> list[int]:
        """Whom to ask now."""
        due = sorted(node for node, due_us in self._slots.items() if due_us <= now_us)
        if not due or not self._is_flooded(now_us):
            return due
        self._slots = {node: due_us + ANSWER_PERIOD_US for node, due_us in self._slots.items()}
        return []

    def _is_answering(self, now_us: int) -> bool:
        """Whether those who asked meanwhile are answered now."""
        if self._answer_at_us is None or self._answer_at_us > now_us:
            return False
        if not self._is_flooded(now_us):
            return True
        self._answer_at_us = self._quiet_until_us = now_us + ANSWER_PERIOD_US
        return False

    def _is_flooded(self, now_us: int) -> bool:
        """Whether answers still come: who is silent may be waiting behind them, and so may who asks."""
        return self._is_flood(now_us) and now_us - self._flood_us < MOST_FLOOD_US

    def _is_flood(self, now_us: int) -> bool:
        return len(self._words_us) == FLOOD and now_us - self._words_us[0] < ANSWER_PERIOD_US

    def next_wake(self) -> int | None:
        """When there is something to ask or to answer, bus time in us."""
        asking_us = None if self.is_over or self.doubt is not None else self._ask_at_us
        times = (asking_us, self._answer_at_us, *self._slots.values())
        return min((time_us for time_us in times if time_us is not None), default=None)

    # --- answering ---------------------------------------------------------------------------------------------

    def _was_started(self, node: int) -> None:
        """A machine was started again: what it held by its own word it has to say again, and what it gave me too."""
        self.tokens.drop_disputed(node)
        if not self.starting:
            self.tokens.gifts = set(self.tokens.leaving)
        self.starting.add(node)
        beliefs = self.tokens.beliefs.verified
        self.doubted[node] = {
            TokenKey(*key): one.version for key, one in beliefs.items() if one.holder == node and one.confirmed
        }

    def on_request(self, request: SyncRequest, now_us: int) -> list[Effect]:
        """Answer at once; whoever asks soon after shares one answer with all others who do."""
        if request.whom == self.node_id and self._has_forgotten(request):
            if self._may_know_better(request.sender, now_us):
                self._doubt(Reason.JOURNAL_LOST, request.sender, f"knew this node under boot {request.boot_before}")
                return []
            self.tokens.drops[Reason.LATE] += 1
        return self._answer_to(request, now_us)

    def on_other_request(self, node: int, now_us: int) -> None:
        """Another has asked a machine, whose answer I hear with it."""
        if node in self._slots and self.is_over:
            self._slots[node] = max(self._slots[node], now_us + ANSWER_PERIOD_US + self.slot_us)

    def _may_know_better(self, node: int, now_us: int) -> bool:
        """Whether a machine may have known an earlier life of mine without having said so yet.

        Whoever was there when I was started has compared then; a word of that kind later would stop any machine.
        """
        just_begun = now_us < (self._since_us or 0) + COMPARING_BEATS * self.site.timing.heartbeat_us
        return just_begun or not self.is_over or node not in self.answered

    def _answer_to(self, request: SyncRequest, now_us: int) -> list[Effect]:
        known = self.mirror.peers.get(request.sender)
        effects: list[Effect] = []
        patience_us = self.site.timing.heartbeat_us // 2
        if request.whom == NOBODY and known is not None and known.since_us + patience_us < now_us:
            # All are asked at power-up only: I knew it before, even where its counter is the same again.
            effects = self.ask(request.sender, known.boot)
        self._askers.add(request.sender)
        if self._answer_at_us is not None:
            return effects
        if self._quiet_until_us is not None and now_us < self._quiet_until_us:
            self._answer_at_us = self._quiet_until_us
            return effects
        if self._is_flooded(now_us):
            self._answer_at_us = now_us + ANSWER_PERIOD_US
            return effects
        return self._answer(now_us) + effects

    def _has_forgotten(self, request: SyncRequest) -> bool:
        """Whether my journal lacks a life that a peer knew: tokens that I gave away then would seem to be mine."""
        before = request.boot_before
        if before == 0 or request.sender not in self._others:
            return False
        return not self.has_past or is_newer(before, self.boot, 8)

    def _answer(self, now_us: int) -> list[Effect]:
        askers, self._askers = sorted(self._askers | self._starters()), set()
        self._answer_at_us, effects = None, self.statements(now_us)
        for node in askers:
            effects += self._tell_doubted(node) + self._tell_gifts(node)
        effects += self._tell_own_gifts(set(askers)) + self._for_the_silent(now_us)
        return self._be_quiet([*effects, Send(self._done(askers))], now_us)

    def _starters(self) -> set[int]:
        """Who starts, and so asks this machine as well, or has asked before it was there."""
        peers = self.mirror.peers
        return {node for node in self.starting & peers.keys() if peers[node].state is MachineState.STARTING}

    def _done(self, askers: list[int]) -> SyncDone:
        if len(askers) == 1:
            return SyncDone(self.node_id, askers[0], self.boot, 0)
        # A tool is no machine of the site: with whom it is answered is not told.
        is_told = self._bits.keys() >= set(askers)
        bits = reduce(or_, (self._bits[node] for node in askers), 0) if is_told else 0
        return SyncDone(self.node_id, NOBODY, self.boot, bits)

    def _tell_doubted(self, node: int) -> list[Effect]:
        lost, beliefs = self.doubted.get(node, {}).items(), self.tokens.beliefs
        # Whoever has one of them since has said so, whatever this one knows.
        newest = [TokenSeen(self.node_id, *key, seen, node) for key, seen in lost if beliefs.of(key).version <= seen]
        return list(map(Send, newest[-MOST_DOUBTS:]))

    def _tell_gifts(self, node: int) -> list[Effect]:
        """What a machine gave away by its own word and nobody has said that he has: only I can tell if it forgot it."""
        return [
            Send(self.tokens.newest(TokenKey(*key)))
            for key, one in self.tokens.beliefs.verified.items()
            if one.giver == node and not one.confirmed
        ]

    def _tell_own_gifts(self, askers: set[int]) -> list[Effect]:
        """What I gave away since: who has it now may have answered before it had it."""
        if not self.starting & askers:
            return []
        self.starting -= askers
        given = [(key, self.tokens.given[key]) for key in sorted(self.tokens.gifts) if key in self.tokens.given]
        return [Send(TokenGiven(self.node_id, *key, one.version, one.holder)) for key, one in given]

    def _for_the_silent(self, now_us: int) -> list[Effect]:
        """What machines hold that cannot say so themselves: whoever gave it to them may have forgotten that."""
        live = self.mirror.alive(now_us) | {self.node_id}
        return [
            Send(self.tokens.newest(TokenKey(*key)))
            for key, one in self.tokens.beliefs.verified.items()
            if one.holder not in live and one.version
        ]

    # --- what others know better -------------------------------------------------------------------------------

    def hear(self, word: TokenHeld | TokenGrant | TokenGiven | TokenSeen | TokenRequest, now_us: int) -> None:
        """Compare what a machine says of a token with the journal, before the word counts for anything else."""
        if word.sender == self.node_id or word.sender not in self.site.machines:
            return
        self._words_us.append(now_us)
        if not self._is_flood(now_us):
            self._flood_us = now_us
        lost = self.doubted.get(word.sender)
        if lost and isinstance(word, (TokenHeld, TokenGrant, TokenGiven)):
            key = TokenKey(word.token_kind, word.token)
            if word.version >= lost.get(key, word.version + 1):
                del lost[key]
        if self.doubt is not None or self._since_us is None or word.sender in self.answered:
            return
        key = TokenKey(word.token_kind, word.token)
        own = self.tokens.own_version(key)
        is_mine = self.tokens.is_mine_by_journal(key)
        match word:
            case TokenRequest():
                mask = (1 << SEEN_VERSION_BITS) - 1
                is_newer_seen = is_newer(word.version_seen, own & mask, SEEN_VERSION_BITS)
                is_better = is_mine and word.version_seen != 0 and is_newer_seen
            case TokenSeen():
                is_better = word.version > own and (is_mine or word.holder == self.node_id)
            case _:
                is_better = is_mine and word.version > own
        if is_better:
            version = word.version_seen if isinstance(word, TokenRequest) else word.version
            reason = Reason.JOURNAL_SHORT if self.has_past else Reason.JOURNAL_LOST
            self._doubt(reason, word.sender, f"knows version {version} of {key.kind.name} {key.number}")

    def _doubt(self, reason: Reason, cause: int, what: str) -> None:
        self.doubt = Doubt(reason, cause, what)
        self.tokens.is_synced = False


def _later(time_us: int | None, by_us: int) -> int | None:
    return None if time_us is None else time_us + by_us
