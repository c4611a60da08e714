"""A robot's task-generation function: what a goal would cost, with the sub-goals that it takes (rows C06 to C10)."""

from dataclasses import dataclass, field, replace
from itertools import chain

from onboard.contract.codes import Criterion, KindCode, Operation
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import CallForProposals, Reference
from onboard.core.negotiation import CallKey, NeededAnswers, Proposal, RequestedTerms, SubCallAnswer
from onboard.core.serial import from_bus_ms, successor
from onboard.core.site import Machine
from onboard.systems.cell.contracts import Arm, ArmMove, Contract, Goal, filtered, moves
from onboard.systems.cell.depths import Depths
from onboard.systems.cell.fields import MAX_CHAIN
from onboard.systems.cell.geometry import Point, distance_m, shortest_way, way_length_m
from onboard.systems.cell.goal_frames import GoalsHeard, cost_of_bid, goal_messages, offer_messages
from onboard.systems.cell.site import Cell

#: Sub-goals remembered, so that one and the same part of a goal keeps its name when it is looked at again.
MAX_NAMES = 512


@dataclass
class ArmGeneration:
    """Estimates for calls of operation REACH. The robot keeps ``position`` and ``engaged`` up to date.

    ``engaged`` are the contracts that it has won and not yet carried out, by task (row C16); ``promised`` those that
    its standing bids offer, by call. Costs of bids are thousandths of the paper's unit (``Criterion.LENGTH``).
    """

    site: Cell
    machine: Machine
    position: Point
    number: int = 0
    #: Whether a person has a hand in: then it bids for nothing.
    is_held: bool = False
    goals_heard: GoalsHeard = field(default_factory=GoalsHeard)
    engaged: dict[Reference, Contract] = field(default_factory=dict)
    promised: dict[CallKey, Contract] = field(default_factory=dict)
    #: Goals that it has in hand or has carried out: not to be bid for again.
    known: set[Reference] = field(default_factory=set)
    depths: Depths = field(default_factory=Depths)
    #: Goals and sub-goals that this robot looked at, and those that it passed over, by why (rows C12, C13).
    looked_at: int = 0
    passed_over: dict[str, int] = field(default_factory=dict)
    _names: dict[tuple[Reference, Point], int] = field(default_factory=dict)

    @property
    def arm(self) -> Arm:
        """This robot as the site file describes it."""
        return self.site.arms[self.machine.node_id]

    # --- the Estimator -----------------------------------------------------------------------------------------

    def floor(self, call: CallForProposals, now_us: int) -> int:
        """The way from start to end for the least unit cost of all; 0 where the goal's frames were lost."""
        goal = self.goals_heard.goal(call)
        return 0 if goal is None else self._least(goal)

    def lower_bound(self, call: CallForProposals, now_us: int) -> int | None:
        """The robot's own way to the part, and from there the least of all; None where the goal is not for it."""
        goal = self._goal(call)
        if goal is None:
            return None
        self.looked_at += 1
        reason = filtered(goal, self.arm)
        if reason is not None:
            self.passed_over[reason.name] = self.passed_over.get(reason.name, 0) + 1
            return None
        found = self._moves(goal)
        if not found:
            return None
        own = 0.0 if self._others(goal) else self.arm.unit_cost * way_length_m(found[0].approach)
        return _mm(own) + self._least(goal)

    def estimate(self, call: CallForProposals, now_us: int) -> Proposal | NeededAnswers | None:
        """A bid where the robot reaches the goal, else the sub-goals of up to three offers; None to decline."""
        goal = self._goal(call)
        if goal is None:
            return None
        put_us = {move: self._put_down_us(call, goal, move, now_us) for move in self._moves(goal)}
        limit_us = from_bus_ms(goal.time_limit_ms, now_us) if goal.time_limit_ms else None
        found = [move for move in put_us if limit_us is None or put_us[move] <= limit_us]
        if not found:
            return None
        if found[0].via == goal.end:
            own, node = self._own_cost(goal, found[0]), self.machine.node_id
            return _proposal(Contract(goal, node, found[0], own, own, (node,)))
        if goal.level >= goal.deepest:
            self.depths.reach(goal.part)
            return None
        # Only time limits ask when the part will be there; without one a sub-goal looked at again is the same.
        parts = tuple(
            replace(call_terms(self.sub_goal(goal, move.via)), ready_us=0 if limit_us is None else put_us[move])
            for move in found
        )
        least = min(_mm(self._own_cost(goal, move)) + self._least_from(move.via, goal.end) for move in found)
        by_task = dict(zip((terms.task for terms in parts), found, strict=True))
        return NeededAnswers(least, parts, lambda answers, _: self._combine(goal, by_task, answers))

    # --- sub-goals ---------------------------------------------------------------------------------------------

    def sub_goal(self, goal: Goal, via: Point) -> Goal:
        """The rest of a goal from ``via`` on; looked at again it has the same name."""
        name = (goal.task, via)
        if name not in self._names:
            if len(self._names) >= MAX_NAMES:
                del self._names[next(iter(self._names))]
            self.number = self._names[name] = successor(self.number, 16)
        return goal.part_of(self.machine.node_id, self._names[name], via)

    def _combine(
        self, goal: Goal, by_task: dict[Reference, ArmMove], answers: tuple[SubCallAnswer, ...]
    ) -> Proposal | None:
        """The offer whose part and sub-contract cost least together; None where no sub-goal found anybody (C06)."""
        best: tuple[Contract, int] | None = None
        for answer in answers:
            move = by_task.get(answer.terms.task)
            offer = self.goals_heard.offer(answer.winner, answer.terms.task) if answer.winner else None
            if move is None or offer is None:
                continue
            own = self._own_cost(goal, move)
            nodes = (self.machine.node_id, *offer.nodes)[:MAX_CHAIN]
            contract = Contract(goal, self.machine.node_id, move, own, own + offer.cost, nodes)
            if best is None or contract.cost < best[0].cost:
                best = contract, answer.part
        return None if best is None else _proposal(best[0], (best[1],))

    # --- costs -------------------------------------------------------------------------------------------------

    def _own_cost(self, goal: Goal, move: ArmMove) -> float:
        """What a goal adds to the robot's way, with all else that it has won or offered done in the order of C15.

        For an idle robot it is the paper's C_j L_j. Offers for other sub-goals of one part exclude each other.
        """
        others = self._others(goal)
        if not others:
            return move.cost(self.arm)
        with_it = sorted([*others, (goal, move)], key=lambda one: one[0].urgency)
        return self.arm.unit_cost * (self._tour_m(with_it) - self._tour_m(others))

    def _others(self, goal: Goal) -> list[tuple[Goal, ArmMove]]:
        every = chain(self.engaged.values(), self.promised.values())
        found = {one.goal.part: (one.goal, one.move) for one in every if one.goal.part != goal.part}
        return sorted(found.values(), key=lambda one: one[0].urgency)

    def _tour_m(self, stops: list[tuple[Goal, ArmMove]]) -> float:
        here, length_m = self.position, 0.0
        for goal, move in stops:
            way = shortest_way(here, goal.start, self.arm.area, self.site.obstacles)
            length_m += way_length_m(way or (here, goal.start)) + way_length_m(move.carry)
            here = move.via
        return length_m

    def _moves(self, goal: Goal) -> tuple[ArmMove, ...]:
        return moves(goal, self.arm, self.position, self.site.obstacles)

    def _put_down_us(self, call: CallForProposals, goal: Goal, move: ArmMove, now_us: int) -> int:
        """When the part would be put down (bus us), everything more urgent done before (rows C14, C15)."""
        begin_us = from_bus_ms(call.deadline_ms, now_us)
        before = [one for one in self._others(goal) if one[0].urgency < goal.urgency]
        there_us = begin_us + self._us(self._tour_m(before) + way_length_m(move.approach))
        there_us += 2 * len(before) * self.site.timing.grip_us
        taken_us = max(there_us, begin_us + call.ready_ms * 1000) + self.site.timing.grip_us
        return taken_us + self._us(way_length_m(move.carry)) + self.site.timing.grip_us

    def _us(self, length_m: float) -> int:
        return int(length_m * 1_000_000_000 / self.arm.speed_mm_s)

    def _least(self, goal: Goal) -> int:
        return self._least_from(goal.start, goal.end)

    def _least_from(self, start: Point, end: Point) -> int:
        return int(1000 * self.site.least_unit_cost * distance_m(start, end))

    def _goal(self, call: CallForProposals) -> Goal | None:
        """The goal of a call that this robot may answer: not one that it has in hand, and none while it is held."""
        if self.is_held or call.operation is not Operation.REACH or call.criterion is not Criterion.LENGTH:
            return None
        if call.task in self.known:
            return None
        return self.goals_heard.goal(call)


def call_terms(goal: Goal) -> RequestedTerms:
    """What a call for a goal asks for; its places and path go ahead in frames of their own."""
    return RequestedTerms(
        goal.task,
        Operation.REACH,
        KindCode.ARM,
        Criterion.LENGTH,
        goal.task.number,
        ANY_STATION,
        goal.part,
        0,
        detail=goal_messages(goal),
    )


def _mm(cost: float) -> int:
    return int(1000 * cost)


def _proposal(contract: Contract, parts: tuple[int, ...] = ()) -> Proposal:
    return Proposal(cost_of_bid(contract.cost), None, (contract,), (), parts, offer_messages(contract))
