"""Who takes part and who is in the way, by signs of life and by what machines say of themselves (design, section 5).

Any message is a sign of life. Who is silent, says STOPPED or OBSTACLE, or speaks another contract or site is in the way
until it is heard again as a machine that takes part; a robot that was started again, until it has told a plan.
"""

from dataclasses import dataclass, field

from onboard.core.authority import TokenBook
from onboard.core.codes import MOBILE_KINDS, MachineState, Reason
from onboard.core.mirror import MISSED_HEARTBEATS, Mirror
from onboard.core.obstacles import STILL, holder_in
from onboard.core.site import Machine, Site


@dataclass
class Presence:
    """One machine's view of the others' presence. All times are bus time in us."""

    site: Site
    node_id: int
    mirror: Mirror
    tokens: TokenBook
    #: Machines that speak another contract or know another site, and which of the two.
    foreign: dict[int, Reason] = field(default_factory=dict)
    _listening_since_us: int | None = None

    @property
    def patience_us(self) -> int:
        """A machine that is not heard for so long is silent."""
        return MISSED_HEARTBEATS * self.site.timing.heartbeat_us

    def heard(self, node: int, now_us: int) -> None:
        """A sign of life; whoever was an obstacle may take part again."""
        peer = self.mirror.peers.get(node)
        if peer is not None:
            peer.heard_at_us = now_us
        if node in self.mirror.obstacles.machines:
            self._judge(self.site.machines[node], now_us)

    def review(self, now_us: int) -> None:
        """Look at all other machines of the site; once in a heartbeat period is often enough."""
        if self._listening_since_us is None:
            self._listening_since_us = now_us
        for machine in self.site.machines.values():
            if machine.node_id != self.node_id:
                self._judge(machine, now_us)

    def begin_anew(self, now_us: int) -> None:
        """I have not listened for a while myself: everybody gets the time to be heard again."""
        self._listening_since_us = now_us
        for peer in self.mirror.peers.values():
            peer.heard_at_us = now_us

    def _judge(self, machine: Machine, now_us: int) -> None:
        reason = self._why(machine, now_us)
        if reason is Reason.NONE:
            self.mirror.admit(machine.node_id, now_us)
            return
        seen = self.mirror.progress.get(machine.node_id)
        slots = self.mirror.obstacles.slots_of(machine, seen, holder_in(self.tokens.holder_of))
        self.mirror.set_aside(machine.node_id, slots, reason, now_us)

    def _why(self, machine: Machine, now_us: int) -> Reason:
        """Why a machine is an obstacle; NONE where it takes part, or has not had the time to say anything."""
        node = machine.node_id
        if node in self.foreign:
            return self.foreign[node]
        peer, known = self.mirror.peers.get(node), self.mirror.obstacles.machines.get(node)
        heard_us = self._listening_since_us if peer is None else peer.heard_at_us
        if heard_us is None or now_us - heard_us >= self.patience_us:
            return Reason.NONE if heard_us is None else Reason.NODE_SILENT
        if peer is not None and peer.state in STILL:
            return Reason.ACTUATOR_FAULT if peer.state is MachineState.STOPPED else Reason.POSITION_UNKNOWN
        planless = machine.kind in MOBILE_KINDS and node not in self.mirror.itineraries
        return Reason.NONE if known is None or not planless else known.reason
