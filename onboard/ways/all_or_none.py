"""Tokens without an agreed order: all of them to the next refuge, that refuge included, or none (design, section 5).

After a restart or while mirrors differ nobody knows who passes first. Then a machine asks for its whole way at once,
holders serve the machine that has asked longest, and whoever does not get all gives back what it does not stand on: so
no two machines wait for each other with tokens in hand. A right is never taken back from outside.
"""

from collections.abc import Collection
from dataclasses import dataclass

from onboard.core.authority import TokenBook, segment_token
from onboard.core.backoff import PACE_US, QUICK
from onboard.core.effects import Effect, Send
from onboard.core.site import Segment

#: Token repeats for which an incomplete set is kept; then it is given back: two lost frames and the journals.
PATIENCE_REPEATS = 10
#: What a slot that is taken and given back in one round costs: request, word that it is held, grant.
FRAMES_A_SLOT = 3


@dataclass
class AllOrNone:
    """One machine's set of ``slots`` in the order of its way; empty where the order is agreed.

    ``due_us`` is when an incomplete set is given back, or asked for again.
    """

    tokens: TokenBook
    slots: tuple[Segment, ...] = ()
    due_us: int | None = None
    _rests: bool = False
    #: Rounds that ended without the whole set, and what it held when it began to rest.
    _rounds: int = 0
    _kept: int = 0

    @property
    def is_complete(self) -> bool:
        """Whether every slot of the set is held, so that the machine may go."""
        return all(self.tokens.holds(segment_token(slot)) for slot in self.slots)

    def begin(self, slots: tuple[Segment, ...], now_us: int) -> None:
        """Ask for a new set from now on."""
        self.end()
        self.slots = slots
        self.tokens.unordered = {segment_token(slot) for slot in slots}
        self._set_due(now_us)

    def end(self) -> None:
        """The refuge is reached, or the order is agreed again: what is held is held as any other token."""
        self.slots = ()
        self.tokens.unordered = set()
        self.due_us = None
        self._rests = False
        self._rounds = 0

    def passed(self, occupied: Collection[Segment]) -> None:
        """Let go of slots that lie behind the body; the last one ends the set."""
        # A way may come back to a slot: only the first of them is where the body is.
        at = next((number for number, slot in enumerate(self.slots) if slot in occupied), 0)
        if at and at == len(self.slots) - 1:
            self.end()
        else:
            self.slots = self.slots[at:]

    def advance(self, occupied: Collection[Segment], now_us: int) -> list[Effect]:
        """Ask for what is missing; after a while without success give back all but what the body is in, and rest."""
        if self.is_complete:
            self.due_us, self._rounds = None, 0
            return []
        if self.due_us is None:
            self._set_due(now_us)
        if self._rests and self._held() > self._kept:
            # What was missing has come: there is no need to rest on.
            self.due_us = now_us
        effects: list[Effect] = []
        if self.due_us is not None and self.due_us <= now_us:
            self._rests = not self._rests
            if self._rests:
                return self._rest(occupied, now_us)
            self._set_due(now_us)
        if not self._rests:
            for slot in self.slots:
                effects += self.tokens.want(segment_token(slot), now_us)
        return effects

    def _set_due(self, now_us: int) -> None:
        self.due_us = now_us + self.tokens.site.timing.token_repeat_us * PATIENCE_REPEATS

    def _held(self) -> int:
        return sum(self.tokens.holds(segment_token(slot)) for slot in self.slots)

    def _rest(self, occupied: Collection[Segment], now_us: int) -> list[Effect]:
        """Give back; the first rests are short, then each lasts as long as what its round said may take (rule 10)."""
        self._rounds += 1
        effects = self._give_back(occupied, now_us)
        self._kept = self._held()
        said = FRAMES_A_SLOT * sum(isinstance(effect, Send) for effect in effects)
        # Half of the pace is for what is asked for meanwhile.
        paced_us = 2 * said * PACE_US if self._rounds > QUICK else 0
        self.due_us = now_us + max(self.tokens.site.timing.token_repeat_us, paced_us)
        return effects

    def _give_back(self, occupied: Collection[Segment], now_us: int) -> list[Effect]:
        effects: list[Effect] = []
        for slot in self.slots:
            key, steward = segment_token(slot), self.tokens.site.stewards[slot.track]
            if slot not in occupied and self.tokens.holds(key) and steward != self.tokens.node_id:
                effects += self.tokens.give(key, steward, now_us)
        return effects
