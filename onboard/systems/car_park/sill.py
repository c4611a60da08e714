"""Proof that a lift's platform is where a robot wants to cross its sill: the gate held, and the lift's word under it.

The word is one that the lift said under the very version of the gate's token that the robot holds: until that token is
back, the lift does not move. No time, no plan and no earlier word stands for it; without it the robot asks, and stands.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field

from onboard.contract.codes import KindCode, Reason, TokenKind
from onboard.contract.messages import Progress, SyncRequest
from onboard.core.authority import segment_token
from onboard.core.behaviour import OverheardWord
from onboard.core.effects import Effect, Send
from onboard.core.site import Segment
from onboard.ways.lifts import GATE_INDEX, gate, is_same_stop, lift_index_of, platform, says_standing
from onboard.ways.mirror import WayFleet

#: Who holds a gate and has not heard where its lift stands asks for it after so long, and again, us: a lift that moves
#: says where it is within it.
ASK_AGAIN_US = 1_000_000


@dataclass
class SillProof:
    """What one robot knows of the platforms whose gates it holds."""

    fleet: WayFleet
    _ask_at_us: dict[int, int] = field(default_factory=dict)

    def word(self, lift_track: int) -> Progress | None:
        """The last word of a lift for where it is, of whatever time."""
        return self.fleet.mirror.progress.get(self.fleet.site.stewards[lift_track])

    def heeds(self, message: OverheardWord) -> bool:
        """Whether a word says where a lift is, or is about no slot: of slots I know what I have, and wait for."""
        if isinstance(message, Progress):
            machine = self.fleet.site.machines.get(message.sender)
            return machine is not None and machine.kind is KindCode.LIFT
        return message.token_kind not in (TokenKind.SEGMENT, TokenKind.RUN)

    def stands_at(self, lift_track: int) -> int | None:
        """The lift index at which the platform stands for as long as I hold its gate; None where that is not proved."""
        version = self.fleet.tokens.held.get(segment_token(gate(lift_track)))
        return None if version is None else says_standing(self.word(lift_track), version)

    def lacks(self, slot: Segment, floor: int) -> Reason:
        """Why ``slot`` cannot be entered on a floor (an alley's track) though its token is held; NONE where it can."""
        if slot.index != GATE_INDEX or slot.track not in self.fleet.site.lifts:
            return Reason.NONE
        here = lift_index_of(self.fleet.site, slot.track, floor)
        there = self.stands_at(slot.track)
        return Reason.NONE if is_same_stop(self.fleet.site, slot.track, there, here) else Reason.DOOR_NOT_READY

    def ask(self, lifts: Iterable[int], now_us: int) -> list[Effect]:
        """Ask each of these lifts whose gate is held for its word, where that has not come a while after, and again."""
        held = self.fleet.tokens.held
        unproved = [lift for lift in lifts if segment_token(gate(lift)) in held and self.stands_at(lift) is None]
        # It comes by itself with the gate.
        self._ask_at_us = {lift: self._ask_at_us.get(lift, now_us + ASK_AGAIN_US) for lift in unproved}
        asked = [lift for lift, due_us in self._ask_at_us.items() if due_us <= now_us]
        self._ask_at_us.update(dict.fromkeys(asked, now_us + ASK_AGAIN_US))
        return [Send(SyncRequest(self.fleet.node_id, self.fleet.site.stewards[lift])) for lift in asked]

    def next_wake(self) -> int | None:
        """When a lift is to be asked, or None."""
        return min(self._ask_at_us.values(), default=None)

    def refuse(self, lift_track: int, floor: int, now_us: int) -> list[Effect]:
        """Give gate and platform back where the lift has said under this gate that it stands at another floor.

        It took the robot for one that boards there; with both back it looks anew.
        """
        at, site, tokens = self.stands_at(lift_track), self.fleet.site, self.fleet.tokens
        if at is None or is_same_stop(site, lift_track, at, lift_index_of(site, lift_track, floor)):
            return []
        effects: list[Effect] = []
        lift = self.fleet.site.stewards[lift_track]
        for slot in (gate(lift_track), platform(lift_track)):
            key = segment_token(slot)
            tokens.forget(key)
            if tokens.holds(key):
                effects += tokens.give(key, lift, now_us)
        return effects
