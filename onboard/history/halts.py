"""Who does not act, and why: by its own last word, or by a neighbour's where that counts."""

from dataclasses import dataclass

from onboard.contract.codes import Reason
from onboard.contract.constants import STILL
from onboard.contract.messages import Halted, Heartbeat
from onboard.history.places import PlaceTold


@dataclass(frozen=True, slots=True)
class HaltTold:
    """A machine does not act; ``before``: when that was said last, us of the log, and the word."""

    word: Halted
    before: tuple[int, Halted] | None


class Halts:
    """A fold over halts; ``by_node`` has the node-ID of who halts, when that was said last (us of the log), and why."""

    def __init__(self) -> None:
        self.by_node: dict[int, tuple[int, Halted]] = {}

    def last(self, node: int, now_us: int, patience_us: int) -> Halted | None:
        """Why a machine does not act, where that was said within ``patience_us``: it is said once in each period."""
        told_us, word = self.by_node.get(node, (0, None))
        return word if now_us - told_us <= patience_us else None

    def on_halted(self, word: Halted, time_us: int, *, is_silent: bool) -> HaltTold | None:
        """Take up one word: others may speak for who is silent, or says something else than it does."""
        if not (word.sender == word.machine or word.reason is Reason.FALSE_STATEMENT or is_silent):
            return None
        fact = HaltTold(word, self.by_node.get(word.machine))
        self.by_node[word.machine] = time_us, word
        return fact

    def on_beat(self, beat: Heartbeat) -> bool:
        """Whether its sender acts again: who says so does not halt; who says it falsely is not believed."""
        is_over = beat.state not in STILL and self._reason(beat.sender) not in (None, Reason.FALSE_STATEMENT)
        if is_over:
            del self.by_node[beat.sender]
        return is_over

    def on_place(self, fact: PlaceTold) -> None:
        """Who was told to say something else than it does, because it stood, has moved."""
        here, before = fact.place, fact.before
        has_moved = before is None or (here.segment, here.offset_mm) != (before.segment, before.offset_mm)
        if has_moved and self._reason(fact.node) is Reason.FALSE_STATEMENT:
            del self.by_node[fact.node]

    def _reason(self, node: int) -> Reason | None:
        return self.by_node[node][1].reason if node in self.by_node else None
