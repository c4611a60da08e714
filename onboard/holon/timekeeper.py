"""Which time a machine goes by: its own loop time, which never goes back, and bus time, which somebody sends.

The lowest live fixed node sends bus time; the others follow (design, section 5).
"""

from collections import Counter
from dataclasses import dataclass, field
from enum import Enum

from onboard.contract.codes import Reason
from onboard.contract.constants import MOBILE_KINDS
from onboard.contract.messages import BusTime
from onboard.core.bus_time import BUS_TIME_MODULUS, FAR_US, MAX_SLEW_US, BusClock
from onboard.core.mirror import Mirror
from onboard.core.serial import away
from onboard.core.site import Machine, Site


class TimeHeard(Enum):
    """What a time message did to the clock."""

    NOTHING = "nothing"
    FIRST = "bus time is known from now on"
    FOLLOWED = "a little nearer, or far off for now"
    SET_ANEW = "it was far off, and is set"
    REFUTED = "its sender does not know the time of the bus: it is to be told"


@dataclass
class Timekeeper:
    """One machine's clock and its part in the election of the time source. ``drops`` counts what came to nothing.

    ``due_us`` is when this machine sends bus time next, bus time in us; None while another does.
    """

    site: Site
    machine: Machine
    mirror: Mirror
    drops: Counter[Reason]
    clock: BusClock = field(init=False)
    due_us: int | None = None
    _steady_us: int = 0
    _behind_us: int = 0
    #: The lowest node that has sent bus time within a heartbeat, and when it did last, us: loop time, and as it said.
    _source: tuple[int, int, int] | None = None

    def __post_init__(self) -> None:
        self.clock = BusClock(self.site.timing.bus_time_us)

    def steady(self, local_us: int) -> int:
        """A loop time that never goes back: where the clock does, time stands still for a moment instead."""
        steady_us = local_us + self._behind_us
        if steady_us < self._steady_us:
            self._behind_us = self._steady_us - local_us
            return self._steady_us
        self._steady_us = steady_us
        return steady_us

    def loop_us(self, bus_us: int) -> int:
        """When the machine's own clock will show a bus time, us of it."""
        return self.clock.local_us(bus_us) - self._behind_us

    def bus_us(self, local_us: int) -> int:
        """Bus time at a time of the machine's own clock, for who looks from outside."""
        return self.clock.bus_us(local_us + self._behind_us)

    def elect(self, local_us: int) -> None:
        """Send bus time, or follow: the lowest live fixed node sends it."""
        if self.machine.kind in MOBILE_KINDS:
            return
        now_us = self.clock.bus_us(local_us)
        lower = [node for node in self.mirror.alive(now_us) if node < self.machine.node_id and self._is_fixed(node)]
        if lower:
            self.clock.follow(local_us)
            self.due_us = None
            return
        self.clock.lead(local_us)
        if self.due_us is None:
            self.due_us = now_us

    def _is_fixed(self, node: int) -> bool:
        """Whether a node is a fixed machine, by the site and not by what it says of itself."""
        machine = self.site.machines.get(node)
        return machine is not None and machine.kind not in MOBILE_KINDS

    def hear(self, message: BusTime, local_us: int) -> TimeHeard:
        """Take up a time message of a machine of this site."""
        if message.bus_time_us >= BUS_TIME_MODULUS or not self._is_fixed(message.sender):
            self.drops[Reason.VALUE_OUT_OF_RANGE] += 1
            return TimeHeard.NOTHING
        is_mobile = self.machine.kind in MOBILE_KINDS
        if not is_mobile and message.sender > self.machine.node_id:
            # At power-up every fixed machine speaks until it hears a lower one: that is no mistake.
            return TimeHeard.SET_ANEW if self.clock.adopt(message.bus_time_us, local_us) else TimeHeard.NOTHING
        if self._is_old(message, local_us):
            self.drops[Reason.LATE] += 1
            return TimeHeard.NOTHING
        if not is_mobile and self.clock.refutes(message.bus_time_us, local_us):
            return TimeHeard.REFUTED
        first, before_us = not self.clock.is_set, self.clock.bus_us(local_us)
        self.clock.heard(message.bus_time_us, local_us)
        if first:
            return TimeHeard.FIRST
        return TimeHeard.SET_ANEW if self.clock.bus_us(local_us) - before_us > MAX_SLEW_US else TimeHeard.FOLLOWED

    def _is_old(self, message: BusTime, local_us: int) -> bool:
        """Whether a time waited behind other words of its sender.

        At power-up a fixed machine that is not the source has hundreds of words before it on the bus; and the source
        tells each who asks, behind its own answer to the first. Two such times are as far off, and would set clocks.
        """
        known, said_us = self._source, message.bus_time_us
        if known is not None and message.sender > known[0] and local_us - known[1] < self.site.timing.heartbeat_us:
            return self.clock.is_far(said_us, local_us)
        self._source = message.sender, local_us, said_us
        if known is None or message.sender != known[0] or not 0 <= said_us - known[2] <= FAR_US:
            return False
        is_behind = away(said_us, self.clock.said_us(local_us), BUS_TIME_MODULUS) < -FAR_US
        self.clock.far_us = None if is_behind else self.clock.far_us  # the one before has waited too
        return is_behind
