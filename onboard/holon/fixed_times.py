"""What a machine says at fixed times: its sign of life with all that goes with it, bus time where it sends that.

And while it starts, the question to its own devices how they stand, which they say by themselves on change only.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

from onboard.contract.codes import MachineState, Reason
from onboard.contract.messages import BusTime, StateRequest
from onboard.core.behaviour import Fleet
from onboard.core.bus_time import BUS_TIME_MODULUS
from onboard.core.effects import Effect, Send, Tell
from onboard.core.site import BEATS_APART_US
from onboard.holon.drops import ToldDrops
from onboard.holon.holds import Holds
from onboard.holon.presence import Presence
from onboard.holon.timekeeper import Timekeeper

#: Whoever changes what all believe tells its digest so long after, us: the words of one step go together.
TELL_US = 100_000
#: Devices are asked again after this while their machine starts, us (dbc/device.dbc): a word may be lost.
ASK_AGAIN_US = 1_000_000


@dataclass
class FixedTimes:
    """One machine's words at fixed times. All times are bus time in us; ``drops`` gives what it dropped, by reason."""

    time: Timekeeper
    presence: Presence
    holds: Holds
    fleet: Fleet
    drops: Callable[[], Counter[Reason]]
    #: None before the first word.
    heartbeat_due_us: int | None = None
    #: When the devices are asked next; None where the machine has heard what it needs to take part.
    ask_due_us: int | None = None
    _told: ToldDrops = field(default_factory=ToldDrops)
    _is_starting: bool = False
    #: When the last sign of life was given, and when the next one is due in its turn; one that is said sooner, as
    #: something has changed, tells no drops: each reason is told at most once in a period (duty F3).
    _beat_us: int = 0
    _turn_us: int | None = None

    def __post_init__(self) -> None:
        nodes, beat_us = sorted(self.fleet.site.machines), self.fleet.site.timing.heartbeat_us
        #: Each machine's beats have a place of their own in the period: who was away is heard of by somebody soon.
        self._phase_us = nodes.index(self.fleet.node_id) * beat_us // len(nodes)

    def tell_soon(self, now_us: int, state: MachineState, *, has_told: bool) -> None:
        """Who ``has_told`` what changes the digest of all tells its own soon after; who has started says so."""
        is_starting = state is MachineState.STARTING
        if has_told:
            self._beat_by(max(now_us + TELL_US, self._beat_us + BEATS_APART_US))
        if self._is_starting and not is_starting:
            self._beat_by(now_us + TELL_US)
            self.ask_due_us = None
        self._is_starting = is_starting

    def say_first(self, now_us: int, state: MachineState, *, asks: bool) -> None:
        """The first word is due, and the devices are asked: what they said before bus time was known may be lost."""
        self.heartbeat_due_us = now_us
        if self.time.clock.is_set and asks:
            self.ask_devices(now_us, state)

    def ask_devices(self, now_us: int, state: MachineState) -> None:
        """Ask the devices once, and again for as long as the machine is starting."""
        self.ask_due_us, self._is_starting = now_us, state is MachineState.STARTING

    def on_return(self, beat_us: int, now_us: int) -> None:
        """Somebody was silent for long: at ``beat_us`` all tell what they believe; what waits is said soon again."""
        self._beat_by(max(beat_us, self._beat_us + BEATS_APART_US))
        self.fleet.tokens.begin_anew(now_us)
        self.fleet.negotiation.begin_anew(now_us)

    def _beat_by(self, when_us: int) -> None:
        if self.heartbeat_due_us is not None:
            self.heartbeat_due_us = min(self.heartbeat_due_us, when_us)

    def due_us(self, work_due_us: int | None) -> int | None:
        """The first of these words and of what is to be done otherwise; None where there is neither."""
        times = (self.heartbeat_due_us, self.ask_due_us, self.time.due_us, work_due_us)
        return min((time for time in times if time is not None), default=None)

    def words(self, now_us: int) -> list[Effect]:
        """What is due of them, and when the next is due."""
        effects: list[Effect] = []
        timing, node_id = self.fleet.site.timing, self.fleet.node_id
        if self.heartbeat_due_us is not None and self.heartbeat_due_us <= now_us:
            is_in_turn = self.heartbeat_due_us == self._turn_us
            self._beat_us, beat_us = now_us, timing.heartbeat_us
            self._turn_us = self.heartbeat_due_us = now_us + beat_us - (now_us - self._phase_us) % beat_us
            self.presence.review(now_us)
            effects += self.holds.words() + self.fleet.mirror.forgotten()
            effects += self._told.words(node_id, self.drops()) if is_in_turn else []
            effects += [Send(word) for word in self.presence.halted_ones(now_us)]
            effects += [Send(self.presence.standing_word(node)) for node in self.fleet.winners.stuck(now_us)]
        if self.ask_due_us is not None and self.ask_due_us <= now_us:
            self.ask_due_us = now_us + ASK_AGAIN_US if self._is_starting else None
            effects.append(Tell(StateRequest(node_id)))
        if self.time.due_us is not None and self.time.due_us <= now_us:
            self.time.due_us = now_us + timing.bus_time_us
            effects.append(self.bus_time(now_us))
        return effects

    def bus_time(self, now_us: int) -> Effect:
        """Bus time as this machine sends it."""
        return Send(BusTime(self.fleet.node_id, now_us % BUS_TIME_MODULUS))
