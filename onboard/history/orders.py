"""What persons say to all: segments that nobody can pass, and emergency stops."""

from collections.abc import Iterable
from dataclasses import dataclass

from onboard.contract.constants import ACTING, MOBILE_KINDS
from onboard.contract.messages import Blocked, Clear, EmergencyStop, Heartbeat
from onboard.core.site import Machine, Segment


@dataclass(frozen=True, slots=True)
class SlotTold:
    """A segment cannot be passed, or can be passed again."""

    word: Blocked | Clear

    @property
    def is_blocked(self) -> bool:
        """Whether nobody can pass from now on, or everybody again."""
        return isinstance(self.word, Blocked)


@dataclass(frozen=True, slots=True)
class StopTold:
    """Somebody orders all machines of the site to stand."""

    word: EmergencyStop


class SiteOrders:
    """A fold over what concerns a whole site."""

    def __init__(self, machines: Iterable[Machine]) -> None:
        #: Segments are coded in 16 bits, so there are never more than that.
        self.blocked: dict[Segment, Blocked] = {}
        #: The last stop, until somebody who travels says that it acts.
        self.stop: EmergencyStop | None = None
        self._travellers = {machine.node_id for machine in machines if machine.kind in MOBILE_KINDS}

    def on_slot(self, word: Blocked | Clear) -> SlotTold:
        """Take up a word about one segment."""
        segment = Segment(word.track, word.index)
        if isinstance(word, Blocked):
            self.blocked[segment] = word
        else:
            self.blocked.pop(segment, None)
        return SlotTold(word)

    def on_stop(self, word: EmergencyStop) -> StopTold:
        """A stop counts from any node, and the newest one only."""
        self.stop = word
        return StopTold(word)

    def on_beat(self, beat: Heartbeat) -> bool:
        """Whether a stop is over: who is held by one says so, and one that acts was let go, or the stop is old."""
        is_over = self.stop is not None and beat.state in ACTING and beat.sender in self._travellers
        if is_over:
            self.stop = None
        return is_over
