"""Riding a lift: give the gate back aboard, wait for the floor, and hold the gate again before leaving."""

from dataclasses import dataclass, field

from onboard.core.authority import segment_token
from onboard.core.effects import Effect
from onboard.systems.car_park.sill import SillProof
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

    def __post_init__(self) -> None:
        self.sill = SillProof(self.fleet)

    def begin(self, lift_track: int, leave: int) -> list[Effect]:
        """The carrier stands on the platform."""
        self.lift_track, self.leave = lift_track, leave
        self.done = self._gate_returned = False
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
        self.done = is_same_stop(self.fleet.site, self.lift_track, self.sill.stands_at(self.lift_track), self.leave)
        return self.sill.ask([self.lift_track], now_us)
