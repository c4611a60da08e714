"""Calls for rides: what a robot asks of lifts before its bid (row P39)."""

from collections.abc import Iterable

from onboard.contract.codes import Criterion, KindCode, LegAction, Operation
from onboard.contract.messages import CallForProposals
from onboard.core.negotiation import RequestedTerms, SubCallAnswer
from onboard.systems.car_park.program import CarStep
from onboard.ways.lifts import sill
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


def answer_for(terms: RequestedTerms, answers: Iterable[SubCallAnswer]) -> SubCallAnswer | None:
    """The last lift's answer to a call for this ride, or None."""
    stations = (terms.from_station, terms.to_station)
    found = [one for one in answers if one.winner and (one.terms.from_station, one.terms.to_station) == stations]
    return found[-1] if found else None
