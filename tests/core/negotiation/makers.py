"""Machines that make goods of goods: a call for one leads to sub-calls for what it is made of, at any depth.

The goods are the call's ``from_station``; costs are finishing times.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from onboard.contract.codes import Criterion, KindCode, Operation
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import CallForProposals
from onboard.core.negotiation import NeededAnswers, Proposal, RequestedTerms, SubCallAnswer, cost_difference
from onboard.core.negotiation.events import CallKey
from onboard.core.serial import BUS_MS_MODULUS, from_bus_ms
from tests.core.negotiation.fleet import CALLER, Bus, Machine, caller, terms

#: A good, and how many ms its own making takes after all its parts are there.
Recipe = tuple[int, tuple[int, ...]]


@dataclass
class Maker:
    """A task-generation function with a recipe for each good that it can make.

    With ``one_by_one`` each part is asked for when the answer to the one before is known.
    """

    recipes: Mapping[int, Recipe]
    one_by_one: bool = False
    estimates: list[CallKey] = field(default_factory=list)

    def floor(self, call: CallForProposals, now_us: int) -> int:
        """Nobody is faster than the deadline itself."""
        return call.deadline_ms

    def lower_bound(self, call: CallForProposals, now_us: int) -> int | None:
        """As if all parts were at hand."""
        if call.from_station not in self.recipes:
            return None
        return (call.deadline_ms + call.ready_ms + self.recipes[call.from_station][0]) % BUS_MS_MODULUS

    def estimate(self, call: CallForProposals, now_us: int) -> Proposal | NeededAnswers | None:
        """The bound where no part is needed."""
        self.estimates.append(CallKey(call.sender, call.call))
        bound = self.lower_bound(call, now_us)
        assert bound is not None
        _, parts = self.recipes[call.from_station]
        if not parts:
            return Proposal(bound, None, (), ())
        return self._needs(call, bound, parts[:1] if self.one_by_one else parts, now_us)

    def _needs(self, call: CallForProposals, bound: int, parts: tuple[int, ...], now_us: int) -> NeededAnswers:
        ready_us = from_bus_ms(call.deadline_ms, now_us) + call.ready_ms * 1000
        asked = tuple(goods(part, call, ready_us) for part in parts)
        return NeededAnswers(bound, asked, lambda answers, then_us: self._combine(call, bound, answers, then_us))

    def _combine(
        self, call: CallForProposals, bound: int, answers: tuple[SubCallAnswer, ...], now_us: int
    ) -> Proposal | NeededAnswers | None:
        own_ms, parts = self.recipes[call.from_station]
        if not all(answer.winner for answer in answers):
            return None
        if len(answers) < len(parts):
            return self._needs(call, bound, parts[len(answers) : len(answers) + 1], now_us)
        start = (call.deadline_ms + call.ready_ms) % BUS_MS_MODULUS
        wait_ms = max(0, *(cost_difference(answer.cost, start, Criterion.FINISH_TIME) for answer in answers))
        cost = (start + wait_ms + own_ms) % BUS_MS_MODULUS
        return Proposal(cost, None, (), (), tuple(answer.part for answer in answers))


def goods(good: int, call: CallForProposals, ready_us: int = 0) -> RequestedTerms:
    """What is asked of others for a part of ``call``."""
    return RequestedTerms(
        call.task,
        Operation.RECEIVE,
        KindCode.ROBOT,
        Criterion.FINISH_TIME,
        from_station=good,
        to_station=ANY_STATION,
        load=call.car,
        load_mm=call.wheelbase_mm,
        ready_us=ready_us,
    )


def wanted(good: int, number: int = 1) -> RequestedTerms:
    """The caller's own call for a good, as task ``number``."""
    return terms(number, from_station=good)


def works(makers: Mapping[int, Mapping[int, Recipe]], one_by_one: bool = False) -> Bus:
    """The caller, and a maker for each node-ID with its recipes."""
    machines = [Machine(node, Maker(recipes, one_by_one)) for node, recipes in makers.items()]
    return Bus([caller(), *machines])


def made_by(bus: Bus, good: int) -> list[int]:
    """Who was awarded a good, once for each award taken."""
    return [node for node, machine in bus.machines.items() for call in machine.assigned if call.from_station == good]


def own_calls(bus: Bus) -> list[CallForProposals]:
    """The caller's calls."""
    return [call for call in bus.calls() if call.sender == CALLER]
