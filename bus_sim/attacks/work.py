"""Forged words about work: calls, bids, awards, reports, plans."""

from dataclasses import replace

from bus_sim.attacks.attack import Attack, AttackerNode
from onboard.contract.codes import CallResult, Reason, TaskPhase
from onboard.contract.constants import ANY_STATION, NOBODY
from onboard.contract.messages import (
    Award,
    Bid,
    CallForProposals,
    Itinerary,
    Message,
    Progress,
    Reference,
    TaskReport,
    Waiting,
)


class CheapestBids(Attack):
    """Bids nothing for every call, and would do none of it."""

    def hear(self, message: Message, now_us: int) -> None:
        """A call is answered by a bid of cost 0."""
        if isinstance(message, CallForProposals):
            self.node.say(Bid(self.node.node_id, message.sender, message.call, 0, 0))


class ForgedCalls(Attack):
    """Every call is made once more by the attacker, and awarded to whoever bids for it, or to anybody."""

    def hear(self, message: Message, now_us: int) -> None:
        """A call is repeated and awarded; a bid for any call is awarded at once."""
        me, machines = self.node.node_id, sorted(self.node.site.machines)
        if isinstance(message, CallForProposals):
            self.node.say(replace(message, sender=me))
            self._award(message, self.node.chance.choice(machines))
        elif isinstance(message, Bid) and message.initiator == me:
            self.node.say(Award(me, message.call, message.sender, Reference(me, 1), 1, CallResult.AWARDED, Reason.NONE))

    def _award(self, call: CallForProposals, winner: int) -> None:
        self.node.say(Award(self.sender(call), call.call, winner, call.task, 1, CallResult.AWARDED, Reason.NONE))

    def sender(self, call: CallForProposals) -> int:
        """Under whose number an award is said."""
        return self.node.node_id


class AwardsAsCaller(ForgedCalls):
    """Every call is awarded to anybody, under the number of whoever made it."""

    def hear(self, message: Message, now_us: int) -> None:
        """A call is awarded in its maker's name."""
        if isinstance(message, CallForProposals):
            self._award(message, self.node.chance.choice(sorted(self.node.site.machines)))

    def sender(self, call: CallForProposals) -> int:
        """Node-ID of whoever made the call."""
        return call.sender


class FalseReports(Attack):
    """Says of every task that it is done, or given back."""

    def __init__(self, node: AttackerNode) -> None:
        super().__init__(node)
        self._phases = list(TaskPhase)

    def hear(self, message: Message, now_us: int) -> None:
        """An award or a report is followed by a report in the attacker's words."""
        if isinstance(message, Award | TaskReport) and message.task.origin != NOBODY:
            phase = self.node.chance.choice(self._phases)
            self.node.say(TaskReport(self.node.node_id, message.task, phase, ANY_STATION, Reason.NONE))


class FalsePlans(Attack):
    """Every plan and every word of progress is told once more, as the attacker's own and elsewhere."""

    def hear(self, message: Message, now_us: int) -> None:
        """Plans under the next version, progress one place further, and that everybody waits for everybody."""
        me = self.node.node_id
        match message:
            case Itinerary():
                self.node.say(replace(message, sender=me, version=message.version % 255 + 1))
            case Progress():
                self.node.say(replace(message, sender=me, index=message.index % 200 + 1))
                self.node.say(Waiting(me, message.track, message.index, message.sender, Reason.TOKEN_HELD_BY_OTHER))
            case _:
                pass
