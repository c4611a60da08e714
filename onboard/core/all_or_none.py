"""Tokens without an agreed order: all of them to the next refuge, that refuge included, or none (design, section 5).

After a restart or while mirrors differ nobody knows who passes first. Then a machine asks for its whole way at once,
holders serve the machine that has asked longest, and whoever does not get all gives back what it does not stand on: so
no two machines wait for each other with tokens in hand. A right is never taken back from outside.
"""

from collections.abc import Collection
from dataclasses import dataclass

from onboard.core.authority import TokenBook, segment_token
from onboard.core.effects import Effect
from onboard.core.site import Segment

#: Token repeats for which an incomplete set is kept; then it is given back. Ours: two lost frames and the journals.
PATIENCE_REPEATS = 10


@dataclass
class AllOrNone:
    """One machine's set of ``slots`` in the order of its way; empty where the order is agreed.

    ``due_us`` is when an incomplete set is given back, or asked for again.
    """

    tokens: TokenBook
    slots: tuple[Segment, ...] = ()
    due_us: int | None = None
    _rests: bool = False

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
            self.due_us = None
            return []
        if self.due_us is None:
            self._set_due(now_us)
        effects: list[Effect] = []
        if self.due_us is not None and self.due_us <= now_us:
            self._rests = not self._rests
            self._set_due(now_us)
            if self._rests:
                return self._give_back(occupied, now_us)
        if not self._rests:
            for slot in self.slots:
                effects += self.tokens.want(segment_token(slot), now_us)
        return effects

    def _set_due(self, now_us: int) -> None:
        self.due_us = now_us + self.tokens.site.timing.token_repeat_us * (1 if self._rests else PATIENCE_REPEATS)

    def _give_back(self, occupied: Collection[Segment], now_us: int) -> list[Effect]:
        effects: list[Effect] = []
        for slot in self.slots:
            key, steward = segment_token(slot), self.tokens.site.stewards[slot.track]
            if slot not in occupied and self.tokens.holds(key) and steward != self.tokens.node_id:
                effects += self.tokens.give(key, steward, now_us)
        return effects
