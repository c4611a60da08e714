"""Slots that a body has left and nobody has asked for: they go back to their stewards together, as one run.

Whoever asks for one meanwhile gets it from who has left it, in the same order of passing by which a steward gives it.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from onboard.contract.codes import Reason
from onboard.core.effects import Effect
from onboard.core.site import Segment
from onboard.core.token_keys import TokenKey, segment_token
from onboard.ways.mirror import WayFleet, slot_of
from onboard.ways.site import TrackKind

#: So many wait at most, and the first of them so long, us: of a machine that is lost meanwhile these stay closed too.
MOST_LEFT, LEFT_US = 8, 8_000_000


@dataclass
class LeftBehind:
    """One machine's slots of that kind, in the order in which they were granted to it. Times are bus time in us."""

    fleet: WayFleet
    slots: Sequence[Segment] = ()
    #: When they go back at the latest.
    due_us: int | None = None

    def __post_init__(self) -> None:
        stations = (machine.station for machine in self.fleet.site.machines.values())
        #: Where cars come in and go out: closed by nobody who is lost and is not there.
        self.fronts = frozenset(station.segment for station in stations if station is not None)

    def give_back(self, free: Sequence[Segment], now_us: int, *, is_under_way: bool) -> list[Effect]:
        """``free`` is all that was left by now: what waits no longer goes back, the rest waits for more."""
        kept = [slot for slot in free if self.fleet.site.tracks[slot.track].kind is not TrackKind.LIFT]
        is_due = self.due_us is not None and self.due_us <= now_us
        if not is_under_way or len(kept) > MOST_LEFT or is_due or not self.fronts.isdisjoint(kept):
            kept = []
        if kept and self.due_us is None:
            self.due_us = now_us + LEFT_US
        self.slots, self.due_us = kept, self.due_us if kept else None
        for slot in free:
            self.fleet.mirror.order.on_return(self.fleet.node_id, slot)
        return self._give([slot for slot in free if slot not in kept], now_us)

    def give_all(self, needed: Collection[Segment], now_us: int) -> list[Effect]:
        """Nothing waits any longer, though the way may lead there again: others may come first."""
        left, self.slots, self.due_us = self.slots, (), None
        return self._give([slot for slot in left if slot not in needed], now_us)

    def may_grant(self, key: TokenKey, requester: int, now_us: int, *, is_used: bool) -> Reason:
        """A slot that was left, or is not ``is_used``, goes to who is next there; nothing else, and no lift's."""
        slot = slot_of(key)
        if key != segment_token(slot):
            return Reason.TOKEN_NOT_GRANTABLE_YET
        is_kept = is_used or self.fleet.site.tracks[slot.track].kind is TrackKind.LIFT
        if is_kept and slot not in self.slots:
            return Reason.TOKEN_NOT_GRANTABLE_YET
        return self.fleet.passing_verdict(key, requester, now_us)

    def _give(self, slots: Sequence[Segment], now_us: int) -> list[Effect]:
        effects: list[Effect] = []
        for slot in slots:
            steward = self.fleet.site.stewards[slot.track]
            if steward != self.fleet.node_id and self.fleet.tokens.holds(segment_token(slot)):
                effects += self.fleet.tokens.give(segment_token(slot), steward, now_us)
        return effects
