"""Who takes part and who is in the way, by signs of life and by what machines say of themselves (design, section 5).

Any message is a sign of life. Who is silent, says STOPPED or OBSTACLE, or speaks another contract or site is in the way
until it is heard again as a machine that takes part; a robot that was started again, until it has told a plan.

The same holds for this machine: when it finds that it has slept for longer than the others wait for its word, or that
more machines speak another contract or know another site than speak its own, it is an obstacle first (``is_held``).
"""

from dataclasses import dataclass, field, replace
from operator import attrgetter

from onboard.contract.codes import MachineState, Reason
from onboard.contract.constants import MOBILE_KINDS, NOBODY, STILL
from onboard.contract.messages import Halted, Heartbeat
from onboard.core.authority import TokenBook
from onboard.core.mirror import MISSED_HEARTBEATS, Mirror
from onboard.core.site import Machine, Site

#: A machine that did nothing for more heartbeat periods than this has slept: others may have missed its word.
SLEPT_BEATS = 2
#: How long a machine that woke listens before it takes part, us: the others say what they plan.
SETTLING_US = 2_000_000
#: What a heartbeat says of its sender, whatever its mirror shows.
_LIFE = attrgetter("contract", "site_digest", "boot", "kind", "state", "epoch")


@dataclass
class Presence:
    """One machine's view of the others' presence. All times are bus time in us."""

    site: Site
    node_id: int
    mirror: Mirror
    tokens: TokenBook
    #: Machines that speak another contract or know another site: which of the two, and when last heard.
    foreign: dict[int, tuple[Reason, int]] = field(default_factory=dict)
    #: Until when this machine is an obstacle after it woke, and how often it has been admitted since.
    held_until_us: int | None = None
    #: Last word of machines that say themselves that they do not act.
    halts: dict[int, Halted] = field(default_factory=dict)
    #: When it did anything last.
    active_us: int | None = None
    _listening_since_us: int | None = None

    @property
    def patience_us(self) -> int:
        """A machine that is not heard for so long is silent."""
        return MISSED_HEARTBEATS * self.site.timing.heartbeat_us

    @property
    def is_held(self) -> bool:
        """Whether this machine is an obstacle: it neither moves nor bids."""
        return self.held_until_us is not None

    def begins(self, now_us: int) -> None:
        """I live from now on, in the time that is known now."""
        self.active_us = now_us

    def awake(self, now_us: int) -> bool:
        """Note that this machine lives; True where it finds that it has slept. Before its first beat it tells nothing.

        It then waits until the others have said what they plan by now.
        """
        slept = self.slept(now_us)
        self.active_us = now_us
        if slept:
            self.listen_anew(now_us)
            self.mirror.slept(now_us)
        return slept

    def slept(self, now_us: int) -> bool:
        """Whether this machine has done nothing for so long that others may have missed its word."""
        before_us = self.active_us
        return before_us is not None and now_us - before_us > SLEPT_BEATS * self.site.timing.heartbeat_us

    def lives_on(self, beat: Heartbeat, now_us: int) -> bool:
        """Note a heartbeat that says nothing new: its sender's last word again, of a machine that takes part.

        False, and nothing is noted, where it may be news: the sender or I was not heard for long, or it is an obstacle.
        """
        peer = self.mirror.peers.get(beat.sender)
        if peer is None or peer.beat is None or now_us - peer.heard_at_us >= self.patience_us:
            return False
        if peer.beat is not beat and _LIFE(peer.beat) != _LIFE(beat):
            return False
        is_known = beat.sender in self.mirror.aside or beat.sender in self.foreign or beat.sender in self.halts
        if is_known or self.active_us is None or self.slept(now_us):
            return False
        peer.heard_at_us = self.active_us = now_us
        return True

    def listen_anew(self, now_us: int) -> None:
        """Be an obstacle until the others have said what they plan by now: I did not hear them for a while."""
        self._begin_anew(now_us)
        self.held_until_us = now_us + SETTLING_US

    def is_admitted(self, now_us: int, *, in_time: bool = True) -> bool:
        """Whether the time as an obstacle has just ended; not before the clock is ``in_time`` again."""
        if self.held_until_us is None or now_us < self.held_until_us:
            return False
        if not in_time or self._is_outvoted(now_us):
            self.held_until_us = now_us + SETTLING_US
            return False
        self.held_until_us = None
        return True

    def heard_foreign(self, node: int, reason: Reason, now_us: int) -> None:
        """A machine says that it speaks another contract, or knows another site."""
        self.foreign[node] = reason, now_us
        if node in self.site.machines:
            self._judge(self.site.machines[node], now_us)
        if self._is_outvoted(now_us) and self.held_until_us is None:
            self.held_until_us = now_us + SETTLING_US

    def _is_outvoted(self, now_us: int) -> bool:
        """Whether more live machines are foreign to me than not; of two halves that with the lowest node-ID counts.

        Only machines of the site have a vote: what else is on the bus can be made up by one node.
        """
        since_us, machines = now_us - self.patience_us, self.site.machines
        others = [node for node, (_, heard_us) in self.foreign.items() if heard_us > since_us and node in machines]
        alive = self.mirror.alive(now_us)
        ours = [self.node_id, *(node for node in alive if node not in self.foreign and node in machines)]
        return (len(others), -min(others, default=0)) > (len(ours), -min(ours))

    def heard_halted(self, halted: Halted, now_us: int) -> None:
        """A machine says why it does not act; of others' words about it only its own word counts."""
        if halted.sender == halted.machine and halted.machine in self.site.machines:
            self.halts[halted.machine] = halted
            self._judge(self.site.machines[halted.machine], now_us)

    def heard_beat(self, beat: Heartbeat) -> None:
        """A machine that says that it takes part again does not stand by its last word."""
        word = self.halts.get(beat.sender)
        if word is not None and (beat.state not in STILL or beat.boot != word.boot):
            del self.halts[beat.sender]

    def halted_ones(self, now_us: int) -> list[Halted]:
        """What I say of machines that are silent, or stand laden, as the lowest live one that is no obstacle."""
        obstacles = self.mirror.aside
        if not obstacles:
            return []
        alive = self.mirror.alive(now_us)
        if self.is_held or min([node for node in alive if node not in obstacles], default=self.node_id) < self.node_id:
            return []
        silent = [node for node in sorted(obstacles) if node not in alive and node not in self.foreign]
        standing = [node for node in sorted(alive & obstacles.keys()) if self._is_stuck(node)]
        return [self._told_of(node) for node in silent] + [self.standing_word(node) for node in standing]

    def _is_stuck(self, node: int) -> bool:
        """Whether a machine lives and stands with what nobody can take from it."""
        stands = self.mirror.aside[node].reason is Reason.FALSE_STATEMENT
        return stands and self.mirror.is_laden(node)

    def standing_word(self, node: int) -> Halted:
        """A machine that says that it goes does not: nobody but a person can help."""
        peer = self.mirror.peers.get(node)
        return Halted(self.node_id, node, Reason.FALSE_STATEMENT, NOBODY, True, 0 if peer is None else peer.boot)

    def _told_of(self, node: int) -> Halted:
        """Why a silent machine does not act: its own last word, where it had one."""
        word, peer = self.halts.get(node), self.mirror.peers.get(node)
        boot = 0 if peer is None else peer.boot
        if word is None:
            return Halted(self.node_id, node, Reason.NODE_SILENT, NOBODY, False, boot)
        return replace(word, sender=self.node_id)

    def is_back(self, node: int, now_us: int) -> bool:
        """Whether a sign of life now ends a silence: of the machine, or of all, as I was cut off."""
        peer = self.mirror.peers.get(node)
        return peer is not None and now_us - peer.heard_at_us >= self.patience_us

    def heard(self, node: int, now_us: int) -> None:
        """A sign of life; whoever was an obstacle may take part again."""
        peer = self.mirror.peers.get(node)
        if peer is not None:
            peer.heard_at_us = now_us
        if node in self.mirror.aside:
            self._judge(self.site.machines[node], now_us)

    def review(self, now_us: int) -> None:
        """Look at all other machines of the site; once in a heartbeat period is often enough."""
        if self._listening_since_us is None:
            self._listening_since_us = now_us
        peers, stands, late_us = self.mirror.peers, self.mirror.stands, now_us - self.patience_us
        in_question = {*self.mirror.aside, *self.halts, *self.foreign}
        for node, machine in self.site.machines.items():
            peer = peers.get(node)
            # Most take part as they did, with nothing said or known against them.
            if peer is None or peer.heard_at_us <= late_us or peer.state in STILL or node in in_question:
                if node != self.node_id:
                    self._judge(machine, now_us)
            elif machine.kind in MOBILE_KINDS and stands(node, now_us):
                self._judge(machine, now_us)

    def _begin_anew(self, now_us: int) -> None:
        """I have not listened for a while myself: everybody gets the time to be heard again."""
        self._listening_since_us = now_us
        self.mirror.was_silent.update(self.mirror.peers)
        for peer in self.mirror.peers.values():
            peer.heard_at_us = now_us

    def _judge(self, machine: Machine, now_us: int) -> None:
        reason = self._why(machine, now_us)
        if reason is Reason.NONE:
            self.mirror.admit(machine.node_id, now_us)
            return
        slots = self.mirror.slots_of(machine, self.tokens.holder_of)
        self.mirror.set_aside(machine.node_id, slots, reason, now_us)

    def _why(self, machine: Machine, now_us: int) -> Reason:
        """Why a machine is an obstacle; NONE where it takes part, or has not had the time to say anything."""
        node = machine.node_id
        if node in self.foreign:
            return self.foreign[node][0]
        peer, known = self.mirror.peers.get(node), self.mirror.aside.get(node)
        word = self.halts.get(node)
        if word is not None:
            return word.reason
        heard_us = self._listening_since_us if peer is None else peer.heard_at_us
        if heard_us is None or now_us - heard_us >= self.patience_us:
            return Reason.NONE if heard_us is None else Reason.NODE_SILENT
        if peer is not None and peer.state in STILL:
            return Reason.ACTUATOR_FAULT if peer.state is MachineState.STOPPED else Reason.POSITION_UNKNOWN
        if self.mirror.stands(node, now_us):
            return Reason.FALSE_STATEMENT
        return Reason.NONE if known is None or not self.mirror.is_planless(machine) else known.reason
