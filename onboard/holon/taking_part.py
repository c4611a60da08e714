"""What part a machine takes at the moment: whether it deals in rights, begins anything, and who it knows to live on."""

from collections import Counter
from dataclasses import dataclass

from onboard.contract.change import SiteNext
from onboard.contract.codes import MachineState, Reason
from onboard.contract.messages import EmergencyStop, Go, Halted, Heartbeat, Message, Progress, Regeneration
from onboard.holon.holding import MachineHolds
from onboard.holon.presence import Presence
from onboard.holon.regeneration import Regenerating
from onboard.holon.site_change import SiteChange
from onboard.holon.timekeeper import Timekeeper
from onboard.holon.witness import Witness

#: States of machines that do not bid.
_NO_BIDDERS = (MachineState.OBSTACLE, MachineState.STOPPED, MachineState.STARTING)
#: All that is heard of a machine with another contract or site: the stop, who it is, and where it stands.
_HEARD_FROM_STRANGERS = (EmergencyStop, Heartbeat, Progress)
#: All that a machine hears while it is apart: what may end that, who lives and who counts, why others stand.
_WHILE_APART = (EmergencyStop, Go, Halted, Heartbeat, Regeneration, SiteNext)


@dataclass(frozen=True, slots=True)
class TakingPart:
    """One machine's part, by what holds it; nothing is kept here, so nothing here can be old."""

    presence: Presence
    holding: MachineHolds
    regeneration: Regenerating
    witness: Witness
    time: Timekeeper
    change: SiteChange

    @property
    def is_still(self) -> bool:
        """Whether this machine is an obstacle: it neither moves nor bids."""
        return self.presence.held_until_us is not None or self.holding.is_held or self.regeneration.is_frozen

    def why_still(self) -> Reason:
        """Why this machine may not move anything; NONE where it may."""
        if self.holding.is_held:
            return self.holding.why.reason
        if self.regeneration.is_frozen:
            return Reason.REGENERATION
        # It was started, or slept, or its bus time was set anew: it listens before it moves.
        return Reason.NONE if self.begins else Reason.POSITION_UNKNOWN

    @property
    def deals(self) -> bool:
        """Whether this machine asks for rights and gives them away."""
        return not (self.holding.is_apart or self.regeneration.is_frozen)

    @property
    def begins(self) -> bool:
        """Whether this machine may begin anything: whoever was started again waits until all have answered."""
        return not (self.is_still or self.witness.is_waiting)

    def why_no_bid(self, state: MachineState, now_us: int) -> Reason:
        """Why this machine, whose behaviour is in ``state``, does not answer a call; NONE where it does."""
        if self.time.clock.is_lost(self.time.clock.local_us(now_us)):
            return Reason.BUS_TIME_LOST
        return Reason.NONE if self.begins and state not in _NO_BIDDERS else Reason.POSITION_UNKNOWN

    def is_deaf_to(self, message: Message, drops: Counter[Reason]) -> bool:
        """Whether nothing is taken in now, or not of this sender: of another contract or site it is counted."""
        if self.holding.is_apart and not isinstance(message, _WHILE_APART):
            return True
        foreign = self.presence.foreign.get(message.sender)
        if foreign is None or isinstance(message, _HEARD_FROM_STRANGERS):
            return False
        drops[foreign[0]] += 1
        return True

    def lives_on(self, beat: Heartbeat, now_us: int) -> bool:
        """Take up a heartbeat that says nothing new to any part of this machine: it falls due as it did before.

        Its sender said the same before but for its mirror, in this epoch, and was admitted; neither it nor I was silent
        since; it is no obstacle; our mirrors agree; and it is not about who sends bus time. False elsewhere.
        """
        if not self.deals or (self.time.clock.is_source and beat.sender < self.time.machine.node_id):
            return False
        is_usual = self.witness.agrees(beat) and self.change.strange(beat, self.regeneration.epoch) is Reason.NONE
        if not is_usual or not self.presence.lives_on(beat, now_us):
            return False
        self.holding.heard(now_us)
        return True
