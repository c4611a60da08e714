"""Riding a lift: give the gate back aboard, wait for the floor, and hold the gate again before leaving."""

from dataclasses import dataclass, field

from onboard.core.authority import TokenKey, segment_token
from onboard.core.effects import Effect
from onboard.systems.car_park.sill import ASK_AGAIN_US, SillProof
from onboard.ways.lifts import gate, is_same_stop, platform
from onboard.ways.mirror import WayFleet


@dataclass
class Riding:
    """One ride in hand: on ``lift_track`` to its index ``leave``. ``done`` once the gate is held at that floor."""

    fleet: WayFleet
    lift_track: int = 0
    leave: int = 0
    done: bool = True
    sill: SillProof = field(init=False)
    _gate_returned: bool = False
    #: When a gate that came before the ride is given back again, us.
    _again_at_us: int | None = None

    def __post_init__(self) -> None:
        self.sill = SillProof(self.fleet)

    def begin(self, lift_track: int, leave: int) -> list[Effect]:
        """The carrier stands on the platform."""
        self.lift_track, self.leave = lift_track, leave
        self.done = self._gate_returned = False
        self._again_at_us = None
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
        here = self.sill.stands_at(self.lift_track)
        self.done = is_same_stop(self.fleet.site, self.lift_track, here, self.leave)
        if here is None or self.done:
            return self.sill.ask([self.lift_track], now_us)
        return self._return_again(key, lift, now_us)

    def _return_again(self, key: TokenKey, lift: int, now_us: int) -> list[Effect]:
        """The gate came at another floor: the lift had not sensed yet who is aboard, and waits for ever without it.

        Not at once: until its sensors tell, it would be given back and forth at the pace of the bus.
        """
        if self._again_at_us is None:
            self._again_at_us = now_us + ASK_AGAIN_US
        if now_us < self._again_at_us:
            return []
        self._again_at_us = None
        return self.fleet.tokens.give(key, lift, now_us)
