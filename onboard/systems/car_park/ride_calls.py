"""Calls for rides: what a robot asks of lifts, before its bid or after winning (row P39)."""

from collections.abc import Iterable
from dataclasses import replace

from onboard.contract.codes import Criterion, KindCode, LegAction, Operation
from onboard.contract.messages import CallForProposals, Reference
from onboard.core.effects import Effect
from onboard.core.negotiation import RequestedTerms, SubCallAnswer
from onboard.systems.car_park.program import CarStep
from onboard.ways.lifts import sill
from onboard.ways.mirror import WayFleet
from onboard.ways.site import WaySite


def rides_of(steps: Iterable[CarStep]) -> list[CarStep]:
    """The rides of a plan, in order."""
    return [step for step in steps if step.action is LegAction.RIDE]


def ride_terms(site: WaySite, call: CallForProposals, step: CarStep) -> RequestedTerms:
    """The call for one ride of a plan for ``call``, wanted when the plan has the carrier stand aboard."""
    return RequestedTerms(
        task=call.task,
        operation=Operation.RIDE,
        kind=KindCode.LIFT,
        criterion=Criterion.FINISH_TIME,
        from_station=sill(site, step.track, step.from_index).number,
        to_station=sill(site, step.track, step.to_index).number,
        load=call.car,
        load_mm=call.wheelbase_mm,
        ready_us=step.begin_us,
    )


def calls_after_winning(
    site: WaySite, call: CallForProposals, steps: Iterable[CarStep], confirmed: tuple[SubCallAnswer, ...] = ()
) -> list[RequestedTerms]:
    """A call for each ride of a plan for the task won by ``call``, but for those that a confirmed option answers."""
    parent = Reference(call.sender, call.call)
    number = max((answer.part for answer in confirmed), default=0)
    wanted = []
    for step in rides_of(steps):
        terms = ride_terms(site, call, step)
        if answer_for(terms, confirmed) is None:
            number += 1
            wanted.append(replace(terms, parent=parent, depth=call.depth + 1, part=number))
    return wanted


def call_lifts(
    fleet: WayFleet,
    call: CallForProposals,
    steps: Iterable[CarStep],
    now_us: int,
    confirmed: tuple[SubCallAnswer, ...] = (),
) -> list[Effect]:
    """Each ride is a call, made after winning (step 15) where no lift has promised it before (row P39)."""
    effects: list[Effect] = []
    for terms in calls_after_winning(fleet.site, call, steps, confirmed):
        effects += fleet.negotiation.open(terms, now_us)
    return effects


def answer_for(terms: RequestedTerms, answers: Iterable[SubCallAnswer]) -> SubCallAnswer | None:
    """The last lift's answer to a call for this ride, or None."""
    stations = (terms.from_station, terms.to_station)
    found = [one for one in answers if one.winner and (one.terms.from_station, one.terms.to_station) == stations]
    return found[-1] if found else None
