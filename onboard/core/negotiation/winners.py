"""Whether the winners of one initiator's calls are at work: the rule that all initiators share (docs/protocol.md, A7).

A winner has lost its task that has said nothing of its award, that has been an obstacle for long, or of which nobody
has heard any change for long. Whether the task may go to another then is for the initiator to know: it may be begun, or
what it is about may be in the winner's custody. Words that repeat themselves are no work.
"""

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field

from onboard.contract.codes import CallResult, Criterion, Reason
from onboard.contract.constants import NOBODY
from onboard.contract.messages import Award, Reference
from onboard.core.effects import Effect, Send
from onboard.core.mirror import Obstacle
from onboard.core.negotiation.events import NegotiationEvent
from onboard.core.negotiation.negotiation import Negotiation

#: A winner that is an obstacle for so long is lost, us: a restart takes some seconds, and its task is in its journal.
LOST_AFTER_US = 8_000_000
#: A winner that lives, and of which nothing changes for so long, stands, us: traffic and retries take less.
STANDS_AFTER_US = 120_000_000


def patience_us(obstacle: Obstacle) -> int:
    """How long a winner may be an obstacle: one that lives, and stands where it said that it goes, restarts nothing."""
    return 0 if obstacle.reason is Reason.FALSE_STATEMENT else LOST_AFTER_US


@dataclass
class _TaskInHand:
    """One task in hand: who has it, the call that it won, 0 for unknown, since when (bus us), how long it may stand."""

    winner: int
    call: int
    since_us: int
    stands_us: int


@dataclass
class Winners:
    """Tasks of this machine that others have in hand. All times are bus time in us."""

    node_id: int
    negotiation: Negotiation
    obstacles: Mapping[int, Obstacle]
    _tasks: dict[Reference, _TaskInHand] = field(default_factory=dict)
    #: The newest sign of work of each machine and since when it is so.
    _signs: dict[int, tuple[Hashable, int]] = field(default_factory=dict)
    _kept: set[Reference] = field(default_factory=set)
    _blamed: dict[int, int] = field(default_factory=dict)

    def takes(self, task: Reference, winner: int, now_us: int, call: int = 0, stands_us: int = STANDS_AFTER_US) -> None:
        """Somebody has a task from now on, as after a restart of mine; ``call`` is which it has won, 0 for unknown.

        It may stand for ``stands_us`` where what it does changes nothing that is told for longer than traffic does.
        """
        if self.negotiation.trust.winner(task) is None:
            self.negotiation.trust.given(task, winner, 0, Criterion.MONEY)
        self._tasks[task] = _TaskInHand(winner, call, now_us, stands_us)

    def works(self, node: int, sign: Hashable, now_us: int) -> None:
        """What a machine told of its place or its work; only what differs from before is a sign of work."""
        known = self._signs.get(node)
        if known is None or known[0] != sign:
            self._signs[node] = sign, now_us

    def begin_anew(self, now_us: int) -> None:
        """I was held, or asleep: what others did not do meanwhile is no sign that they are lost."""
        for known in self._tasks.values():
            known.since_us = now_us
        self.negotiation.was_held(now_us)

    def over(self, task: Reference) -> None:
        """Done, given back, or nobody's any more."""
        self._tasks.pop(task, None)

    def has(self, task: Reference, node: int) -> bool:
        """Whether a machine is the one that has a task now: what any other says of it does not count."""
        known = self._tasks.get(task)
        return known is not None and known.winner == node

    def lost(self, task: Reference, now_us: int) -> Reason:
        """Why the winner of a task does not do it: NODE_SILENT, why it is an obstacle, FALSE_STATEMENT, or NONE."""
        if self.negotiation.silent_winner(task, now_us):
            return Reason.NODE_SILENT
        known = self._tasks.get(task)
        if known is None:
            return Reason.NONE
        obstacle = self.obstacles.get(known.winner)
        if obstacle is not None:
            since_us = max(obstacle.since_us, known.since_us)
            return obstacle.reason if now_us - since_us >= patience_us(obstacle) else Reason.NONE
        return Reason.FALSE_STATEMENT if now_us >= self._stands_at_us(known) else Reason.NONE

    def stands(self, task: Reference, now_us: int) -> bool:
        """Whether nothing of who has a task has changed for too long, whyever."""
        known = self._tasks.get(task)
        return known is not None and now_us >= self._stands_at_us(known)

    def keeps(self, task: Reference) -> None:
        """A winner that is lost keeps its task, as it is begun: only a person can help where it lives and stands."""
        self._kept.add(task)

    def stuck(self, now_us: int) -> list[int]:
        """Machines that keep a task, live and stand, until something of them changes."""
        if not (self._kept or self._blamed):
            return []
        self._kept = {task for task in self._kept if self.lost(task, now_us) is Reason.FALSE_STATEMENT}
        self._blamed = {
            node: since_us for node, since_us in self._blamed.items() if self._worked_us(node, since_us) <= since_us
        }
        live = self._blamed.keys() - self.obstacles.keys()
        return sorted({self._tasks[task].winner for task in self._kept if task in self._tasks} | live)

    def blame(self, task: Reference, now_us: int) -> None:
        """Whoever lost a task that others have begun for it leaves them with it: told until it shows a sign of work."""
        known = self._tasks.get(task)
        node = known.winner if known is not None else self.negotiation.silent_winner(task, now_us)
        if node:
            self.blame_node(node, now_us)

    def blame_node(self, node: int, now_us: int) -> None:
        """All wait for it, and it shows no sign of work."""
        self._blamed[node] = now_us

    def take_back(self, task: Reference, reason: Reason, now_us: int) -> list[Effect]:
        """Nobody has a task any more, and who had it is left out of its next calls; it may be called for anew."""
        known = self._tasks.pop(task, None)
        silent = self.negotiation.silent_winner(task, now_us)
        if silent and self.negotiation.trust.winner(task) is None:
            # An option that was confirmed and not heard counts like any other award.
            self.negotiation.trust.given(task, silent, 0, Criterion.MONEY)
        said = self.negotiation.abandon(task, reason, now_us)
        effects: list[Effect] = [item for item in said if not isinstance(item, NegotiationEvent)]
        return effects if known is None or effects else [self._rejects(task, known.call, reason)]

    def let_go(self, task: Reference) -> list[Effect]:
        """Nobody needs a task any more: who has it hears so, and is none the worse for it."""
        known = self._tasks.pop(task, None)
        return [self._rejects(task, 0 if known is None else known.call, Reason.CANCELLED)]

    def remind(self, task: Reference, node: int) -> list[Effect]:
        """Who believes that it has a task which is another's hears the award again, or that nobody has it."""
        known = self._tasks.get(task)
        if known is None:
            return [self._rejects(task, 0, Reason.LEFT_OUT)]
        if known.winner == node or not known.call:
            return []
        return [Send(Award(self.node_id, known.call, known.winner, task, 1, CallResult.AWARDED, Reason.NONE))]

    def may_claim(self, task: Reference, node: int, now_us: int) -> bool:
        """Whether who says that it has a task of which its initiator has forgotten the winner may be right."""
        return node not in self.negotiation.trust.left_out(task, now_us, last_attempt=False)

    def _rejects(self, task: Reference, call: int, reason: Reason) -> Send:
        return Send(Award(self.node_id, call, NOBODY, task, 1, CallResult.REJECTED, reason))

    def _stands_at_us(self, known: _TaskInHand) -> int:
        return max(self._worked_us(known.winner, known.since_us), known.since_us) + known.stands_us

    def _worked_us(self, node: int, otherwise_us: int) -> int:
        return self._signs.get(node, (None, otherwise_us))[1]
