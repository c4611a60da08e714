"""A robot's task-generation function: when it would have finished a transport (rows G28, G31).

Ways avoid edges by which other robots have told that they come the opposite way, where that pays (row G31). Under the
paper's rules they do not: those are certified for shortest ways only.
"""

from dataclasses import dataclass, field
from itertools import pairwise

from onboard.contract.codes import Criterion, KindCode, Operation
from onboard.contract.graph import RobotAt
from onboard.contract.messages import CallForProposals, Reference
from onboard.core.negotiation import CallKey, Proposal, RequestedTerms
from onboard.core.serial import from_bus_ms, to_bus_ms
from onboard.core.site import Machine
from onboard.systems.graph.errands import Errand
from onboard.systems.graph.fields import NO_NODE
from onboard.systems.graph.network import NOWHERE, Direction
from onboard.systems.graph.rules import Rules
from onboard.systems.graph.site import FactoryGraph


@dataclass
class Position:
    """Where a robot is: in ``node``, or on the way to it from ``behind``; it must not turn back to ``behind``."""

    node: int
    behind: int = NOWHERE
    is_on_edge: bool = False


@dataclass
class RobotPlanning:
    """Estimates for calls of operation TRANSPORT. The robot keeps ``position`` and ``errands`` up to date.

    ``others`` is what other robots said last of where they are and go; ``promised`` are tasks of standing bids.
    """

    site: FactoryGraph
    machine: Machine
    position: Position
    errands: dict[Reference, Errand] = field(default_factory=dict)
    promised: dict[CallKey, Errand] = field(default_factory=dict)
    others: dict[int, RobotAt] = field(default_factory=dict)
    #: A person has a hand in (row M38): no new tasks.
    is_held: bool = False

    # --- ways --------------------------------------------------------------------------------------------------

    def extra_mm(self) -> dict[Direction, int]:
        """What it costs to go against robots that have told their way: their edge's length again, for the wait."""
        if self.site.rules is not Rules.EDGE_AND_NODE:
            return {}
        graph, found = self.site.graph, dict[Direction, int]()
        for node, at in sorted(self.others.items()):
            ahead = [one for one in (at.node, at.ahead1, at.ahead2, at.ahead3) if one in graph.neighbours]
            if at.on_edge:
                ahead.insert(0, at.behind)
            if node == self.machine.node_id:
                continue
            for start, end in pairwise(ahead):
                if end in graph.neighbours.get(start, ()):
                    found[end, start] = found.get((end, start), 0) + graph.length_mm(start, end)
        return found

    def way(self, goal: int) -> tuple[int, ...] | None:
        """The nodes from the one ahead to a goal, both included; None where there is no way."""
        return self.site.graph.way(self.position.behind, self.position.node, goal, self.extra_mm())

    # --- the Estimator -----------------------------------------------------------------------------------------

    def floor(self, call: CallForProposals, now_us: int) -> int:
        """Whoever stands in the first node already and finds every edge free."""
        return least_finish_ms(self.site, call, now_us)

    def lower_bound(self, call: CallForProposals, now_us: int) -> int | None:
        """All that is to be done before, then this, by shortest ways; None where it cannot be done."""
        return self._cost(call, now_us, {})

    def estimate(self, call: CallForProposals, now_us: int) -> Proposal | None:
        """The same around other robots' ways."""
        cost = self._cost(call, now_us, self.extra_mm())
        if cost is None:
            return None
        return Proposal(cost, None, (Errand(call.task, (call.from_station, call.to_station)),), ())

    def _cost(self, call: CallForProposals, now_us: int, extra_mm: dict[Direction, int]) -> int | None:
        graph = self.site.graph
        wanted = (call.from_station, call.to_station)
        if call.operation is not Operation.TRANSPORT or call.criterion is not Criterion.FINISH_TIME:
            return None
        if self.is_held or any(node not in graph.neighbours for node in wanted) or call.task in self.errands:
            return None
        before = [one for one in self.promised.values() if one.task != call.task]
        stops = [stop for one in (*self.errands.values(), *before) for stop in one.stops]
        stops += wanted
        here, behind, length_mm = self.position.node, self.position.behind, 0
        for stop in stops:
            way = graph.way(behind, here, stop, extra_mm)
            if way is None:
                return None
            for ends in pairwise(way):
                length_mm += graph.length_mm(*ends) + extra_mm.get(ends, 0)
            here, behind = stop, NOWHERE
        return _finish_ms(self.site, call, now_us, length_mm, len(stops))


def least_finish_ms(site: FactoryGraph, call: CallForProposals, now_us: int) -> int:
    """Bus ms before which nobody can have done a transport: from the first node at once, and every edge free."""
    length_mm = site.graph.distance_mm(NOWHERE, call.from_station, call.to_station) or 0
    return _finish_ms(site, call, now_us, length_mm, 2)


def _finish_ms(site: FactoryGraph, call: CallForProposals, now_us: int, length_mm: int, stops: int) -> int:
    """Bus ms at which so long a way and so many loadings are over, begun when the call is decided."""
    begin_us = from_bus_ms(call.deadline_ms, now_us)
    return to_bus_ms(begin_us + length_mm * 1_000_000 // site.speed_mm_s + stops * site.load_ms * 1000)


def call_terms(task: Reference, start: int, end: int) -> RequestedTerms:
    """What a call for a transport asks for (row G28)."""
    return RequestedTerms(task, Operation.TRANSPORT, KindCode.VEHICLE, Criterion.FINISH_TIME, start, end, task, 0)


def told_way(way: tuple[int, ...]) -> tuple[int, int, int]:
    """The three nodes after the one ahead, as RobotAt tells them."""
    one, two, three = (*way[1:4], *(NO_NODE,) * 3)[:3]
    return one, two, three
