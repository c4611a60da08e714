"""Riding a lift: give the gate back aboard, wait for the floor, and hold the gate again before leaving."""

from dataclasses import dataclass

from onboard.core.authority import segment_token
from onboard.core.behaviour import Fleet
from onboard.core.effects import Effect, Send
from onboard.core.lifts import gate, platform
from onboard.core.messages import SyncRequest

#: Who holds the gate and has not heard where the lift stands asks for it after so long, and again, us. Ours.
ASK_AGAIN_US = 1_000_000


@dataclass
class Riding:
    """One ride in hand: on ``lift_track`` to its index ``leave``. ``done`` once the gate is held at that floor."""

    fleet: Fleet
    lift_track: int = 0
    leave: int = 0
    done: bool = True
    _gate_returned: bool = False
    _ask_at_us: int | None = None

    def begin(self, lift_track: int, leave: int) -> list[Effect]:
        """The carrier stands on the platform."""
        self.lift_track, self.leave = lift_track, leave
        self.done = self._gate_returned = False
        self._ask_at_us = None
        return []

    def advance(self, now_us: int) -> list[Effect]:
        """Return the gate so that the platform may move; then ask until the lift grants it at the other floor."""
        if self.done:
            return []
        tokens, key = self.fleet.tokens, segment_token(gate(self.lift_track))
        lift = self.fleet.site.stewards[self.lift_track]
        if not self._gate_returned:
            self._gate_returned = True
            return tokens.give(key, lift, now_us) if tokens.holds(key) else []
        if not tokens.holds(key):
            return tokens.want(key, now_us)
        if not tokens.holds(segment_token(platform(self.lift_track))):
            return []
        # The grant alone would do; the lift's own word for where it stands makes a wrong floor impossible to miss.
        seen = self.fleet.mirror.progress.get(lift)
        self.done = seen is not None and seen.index == self.leave and seen.speed_mm_s == 0
        due_us = now_us + ASK_AGAIN_US if self._ask_at_us is None else self._ask_at_us
        if self.done or now_us < due_us:
            self._ask_at_us = due_us
            return []
        # It grants the gate where it stands: its word was lost, and by itself it says it only once.
        self._ask_at_us = now_us + ASK_AGAIN_US
        return [Send(SyncRequest(self.fleet.node_id, lift))]
