"""Signs of life: when each machine was heard, what it told of itself, what it waits for and what it was refused."""

from dataclasses import dataclass

from onboard.contract.codes import MachineState, Reason
from onboard.contract.messages import Diagnostic, Heartbeat, TokenRefusal, Waiting
from onboard.history.places import PlaceTold

#: Heartbeats missed after which a machine counts as silent, as the machines themselves count (onboard/core/mirror.py).
SILENT_BEATS = 3


@dataclass(frozen=True, slots=True)
class Beat:
    """A heartbeat, the one before it, and when its sender was heard last before it, us of the log, 0 for never."""

    beat: Heartbeat
    before: Heartbeat | None
    heard_us: int
    #: Whether it says another state of its sender than what was known.
    is_news: bool
    #: Whether it shows that an emergency stop is over.
    ends_stop: bool

    @property
    def is_restart(self) -> bool:
        """Whether its sender has started anew."""
        return self.before is not None and self.before.boot != self.beat.boot


@dataclass(frozen=True, slots=True)
class WaitTold:
    """A machine says that it waits, and for what."""

    word: Waiting


class MachineLives:
    """A fold over what machines say of themselves; times in us of the log, all by node-ID."""

    def __init__(self, heartbeat_us: int) -> None:
        #: The last message of any kind, and the last heartbeat.
        self.heard_us: dict[int, int] = {}
        self.beats_us: dict[int, int] = {}
        self.beats: dict[int, Heartbeat] = {}
        self.states: dict[int, MachineState] = {}
        #: Waits that were told, and refusals heard, and not ended by motion or a new start.
        self.waits: dict[int, tuple[int, Waiting]] = {}
        self.refusals: dict[int, tuple[int, TokenRefusal]] = {}
        #: Who started anew and has not moved since.
        self.fresh: set[int] = set()
        #: What each has dropped since its start, by its own count.
        self.dropped: dict[int, dict[Reason, int]] = {}
        self._patience_us = SILENT_BEATS * heartbeat_us

    def silent_us(self, node: int) -> int:
        """When a machine that is not heard again counts as silent."""
        return self.heard_us.get(node, 0) + self._patience_us + 1

    def is_silent(self, node: int, now_us: int) -> bool:
        """Whether a machine was never heard, or not for three of its heartbeats."""
        return node not in self.heard_us or now_us >= self.silent_us(node)

    def on_beat(self, beat: Heartbeat, time_us: int, *, is_news: bool, ends_stop: bool) -> Beat:
        """Take up a heartbeat, which is news where another state is in it, or other folds say so."""
        node = beat.sender
        is_news |= self.states.get(node) is not beat.state
        fact = Beat(beat, self.beats.get(node), self.heard_us.get(node, 0), is_news, ends_stop)
        if fact.is_restart:
            self.fresh.add(node)
            self._end_wait(node)
        self.beats_us[node], self.beats[node], self.states[node] = time_us, beat, beat.state
        return fact

    def on_place(self, told: PlaceTold) -> None:
        """Who moves, or has come into another segment, waits for nothing: who turns tells no speed."""
        if told.is_motion:
            self.fresh.discard(told.node)
            self._end_wait(told.node)

    def on_waiting(self, word: Waiting, time_us: int) -> WaitTold:
        """A wait counts until the next word of motion, or a new start."""
        self.waits[word.sender] = time_us, word
        return WaitTold(word)

    def on_refusal(self, word: TokenRefusal, time_us: int) -> None:
        """Take up a refusal: it is the requester's."""
        self.refusals[word.requester] = time_us, word

    def on_diagnostic(self, word: Diagnostic) -> None:
        """Take up what somebody says that it has dropped."""
        self.dropped.setdefault(word.sender, {})[word.reason] = word.count

    def _end_wait(self, node: int) -> None:
        self.waits.pop(node, None)
        self.refusals.pop(node, None)
