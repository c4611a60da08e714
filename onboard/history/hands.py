"""Whom a person holds, by the machine's own word."""

from dataclasses import dataclass

from onboard.contract.codes import ManualMode
from onboard.contract.constants import ACTING
from onboard.contract.messages import Heartbeat, ManualState


@dataclass(frozen=True, slots=True)
class HandTold:
    """A machine says who has a hand in it."""

    word: ManualState


class Hands:
    """A fold over words about hands, by node-ID."""

    def __init__(self) -> None:
        #: Whether who is held has come to rest.
        self.held: dict[int, bool] = {}
        #: Let go since their last heartbeats: the state in those was that of a held machine.
        self.let_go: set[int] = set()

    def is_at_rest(self, node: int) -> bool:
        """Whether a machine is held and has come to rest."""
        return self.held.get(node, False)

    def on_manual(self, word: ManualState) -> HandTold:
        """A machine is held, has come to rest, or is let go."""
        if word.manual_mode is not ManualMode.AUTOMATIC:
            self.held[word.sender] = word.at_rest
        elif self.held.pop(word.sender, None) is not None:
            self.let_go.add(word.sender)
        return HandTold(word)

    def on_beat(self, beat: Heartbeat) -> bool:
        """Whether its sender was let go since the last one. Who acts is not held: its word of that may be lost."""
        if beat.state in ACTING:
            self.held.pop(beat.sender, None)
        is_let_go = beat.sender in self.let_go
        self.let_go.discard(beat.sender)
        return is_let_go
