"""What lifts answer and what robots make of it (rows P39, P49), machine by machine; and the session lock beside it."""

import dataclasses

import pytest

from bus_sim.sites import find_site
from bus_sim.systems.car_park.baselines.session_lock import SessionLocks
from onboard.contract.codes import Criterion, Grade, KindCode, LegAction, Operation, Side
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import CallForProposals, Itinerary, Leg, Reference, Stamp
from onboard.core.mirror import Mirror
from onboard.core.negotiation import CallKey, NeededAnswers, Proposal, RequestedTerms, SubCallAnswer
from onboard.core.serial import from_bus_ms, to_bus_ms
from onboard.core.site import Segment
from onboard.systems.car_park.alternatives import Solution
from onboard.systems.car_park.asking import TOLERANCE_US, AskingGeneration
from onboard.systems.car_park.generation import CarParkGeneration
from onboard.systems.car_park.lift_generation import LiftGeneration, Promise
from onboard.systems.car_park.ride_calls import ride_terms, rides_of
from onboard.systems.car_park.robot import ParkingRobotFactory
from onboard.systems.car_park.site import CarPark, RideCalls, car_park
from onboard.ways.lift_uses import GATE_US, ride_us, run_up_us
from onboard.ways.mirror import WayMirror
from onboard.ways.sipp import Route, Visit, plan_route

NOW_US = 100_000_000
CAR = Reference(1, 7)


def site_with(rides: RideCalls) -> CarPark:
    return dataclasses.replace(car_park(find_site("small")), rides=rides)


def park(number: int = 1) -> CallForProposals:
    """The compartment's call, a second before its deadline."""
    source = car_park(find_site("small")).compartments[1].number
    deadline_ms = to_bus_ms(NOW_US + 1_000_000)
    return CallForProposals(
        1, number, CAR, Operation.PARK, KindCode.ROBOT, Criterion.FINISH_TIME, 1, 0, deadline_ms, source, ANY_STATION,
        CAR, 2700,
    )  # fmt: skip


def robot(node: int, rides: RideCalls = RideCalls.BEFORE, mirror: Mirror | None = None) -> CarParkGeneration:
    """The task-generation function of a robot that stands at home."""
    site = site_with(rides)
    machine = site.machines[node]
    generation = ParkingRobotFactory().estimator(site, machine, mirror or WayMirror(site, node))
    generation.program.standing = machine.home
    return generation


def firm(node: int, number: int = 1) -> Itinerary:
    """What a robot tells when it has won the call."""
    generation = robot(node, RideCalls.PLANNED)
    solution, _ = generation.solve(park(number), NOW_US)
    assert solution is not None
    deadline_ms = park().deadline_ms
    generation.program.replace(list(solution.steps), Stamp(deadline_ms, 1, number))
    return generation.program.itinerary(node, NOW_US)


# --- the lift ------------------------------------------------------------------------------------------------------


def lift() -> LiftGeneration:
    """The left lift of the small site, standing on the first floor, with an empty mirror."""
    site = site_with(RideCalls.BEFORE)
    return LiftGeneration(site, site.machines[5], WayMirror(site, 5))


def ride_call(terms: RequestedTerms, sender: int, whole: int, call: int = 50) -> CallForProposals:
    """A robot's sub-call for a ride, as the lift hears it."""
    deadline_us = NOW_US + 400_000
    ready_ms = -(-max(0, terms.ready_us - deadline_us) // 100_000) * 100
    return CallForProposals(
        sender, call, terms.task, terms.operation, terms.kind, terms.criterion, 1, 1, to_bus_ms(deadline_us),
        terms.from_station, terms.to_station, terms.load, terms.load_mm, Reference(1, whole), 1, ready_ms, 1_500,
    )  # fmt: skip


def first_ride(node: int) -> RequestedTerms:
    generation = robot(node)
    needs = generation.estimate(park(), NOW_US)
    assert isinstance(needs, NeededAnswers)
    return needs.parts[0]


def answer_us(generation: LiftGeneration, call: CallForProposals) -> int:
    proposal = generation.estimate(call, NOW_US)
    assert proposal is not None
    return from_bus_ms(proposal.cost, NOW_US)


def test_p39_a_free_lift_is_there_when_it_is_wanted() -> None:
    terms, generation = first_ride(11), lift()
    call = ride_call(terms, 11, 1)
    indices = generation._indices(call)
    assert indices is not None
    ready_us = from_bus_ms(call.deadline_ms, NOW_US) + call.ready_ms * 1000
    assert answer_us(generation, call) == ready_us + ride_us(generation.site, 128, *indices)


def test_p39_an_option_given_to_another_bid_moves_the_next_answer_behind_it() -> None:
    generation, terms = lift(), first_ride(11)
    mine, other = ride_call(terms, 11, 1), ride_call(terms, 12, 2)
    first = generation.estimate(other, NOW_US)
    assert first is not None
    (promise,) = first.program
    alone_us = answer_us(generation, mine)
    generation.promises[CallKey(12, 50)] = promise
    behind_us = answer_us(generation, mine)
    back_us = run_up_us(generation.site, 128, promise.use.leave_index, promise.use.board_index)
    indices = generation._indices(mine)
    assert indices is not None
    assert behind_us >= promise.use.to_us + back_us + ride_us(generation.site, 128, *indices)
    assert behind_us > alone_us


def test_p39_bids_for_one_call_do_not_stand_in_each_others_way() -> None:
    """One of them wins at most."""
    generation, terms = lift(), first_ride(11)
    alone_us = answer_us(generation, ride_call(terms, 11, 1))
    rival = generation.estimate(ride_call(terms, 12, 1), NOW_US)
    assert rival is not None
    (promise,) = rival.program
    assert isinstance(promise, Promise)
    generation.promises[CallKey(12, 50)] = promise
    assert answer_us(generation, ride_call(terms, 11, 1)) == alone_us


def test_p39_a_firm_ride_of_another_is_kept_free_and_one_of_the_caller_is_not() -> None:
    generation, terms = lift(), first_ride(11)
    alone_us = answer_us(generation, ride_call(terms, 11, 1))
    generation.mirror.on_itinerary(firm(11), NOW_US)
    assert answer_us(generation, ride_call(terms, 11, 2)) == alone_us
    assert answer_us(generation, ride_call(terms, 12, 2)) > alone_us


def test_p49_a_lift_answers_for_its_own_shaft_only() -> None:
    terms = first_ride(11)
    site = site_with(RideCalls.BEFORE)
    right = LiftGeneration(site, site.machines[6], WayMirror(site, 6))
    assert right.lower_bound(ride_call(terms, 11, 1), NOW_US) is None
    assert lift().lower_bound(park(), NOW_US) is None


# --- the robot -----------------------------------------------------------------------------------------------------


def answers_to(
    parts: tuple[RequestedTerms, ...], late_us: int = 0, winner: int = 5, first: int = 1
) -> tuple[SubCallAnswer, ...]:
    """Lifts answer each part so much later than wanted."""
    found = []
    for number, terms in enumerate(parts, start=first):
        end_us = terms.ready_us + _ride_of(terms) + late_us
        found.append(SubCallAnswer(number, terms, winner, to_bus_ms(end_us)))
    return tuple(found)


def _ride_of(terms: RequestedTerms) -> int:
    site = car_park(find_site("small"))
    floors = abs((terms.from_station >> 8) - (terms.to_station >> 8))
    return run_up_us(site, 128, 1, 1 + floors) + GATE_US


def asked() -> tuple[AskingGeneration, NeededAnswers]:
    generation = robot(11)
    assert isinstance(generation, AskingGeneration)
    needs = generation.estimate(park(), NOW_US)
    assert isinstance(needs, NeededAnswers)
    return generation, needs


def test_p39_a_bid_names_what_the_mirror_gives_where_lifts_agree() -> None:
    _, needs = asked()
    bid = needs.combine(answers_to(needs.parts), NOW_US + 400_000)
    assert isinstance(bid, Proposal)
    assert bid.cost == needs.cost
    assert bid.parts == tuple(range(1, len(needs.parts) + 1))


def test_p39_a_lift_that_comes_later_makes_the_plan_and_the_bid_later() -> None:
    _, needs = asked()
    found = needs.combine(answers_to(needs.parts, 60_000_000), NOW_US + 400_000)
    assert isinstance(found, NeededAnswers), "the plan has changed: it is asked once more"
    assert from_bus_ms(found.cost, NOW_US) > from_bus_ms(needs.cost, NOW_US)
    heard = answers_to(needs.parts, 60_000_000) + answers_to(found.parts, first=len(needs.parts) + 1)
    bid = found.combine(heard, NOW_US + 600_000)
    assert isinstance(bid, Proposal)
    (solution,) = bid.program
    assert isinstance(solution, Solution)
    site = car_park(find_site("small"))
    for step in rides_of(solution.steps):
        terms = ride_terms(site, park(), step)
        answer = [one for one in heard if one.terms.from_station == terms.from_station][-1]
        assert step.end_us >= from_bus_ms(answer.cost, NOW_US) - TOLERANCE_US


def test_p39_the_mirror_is_as_before_once_the_bid_is_made() -> None:
    generation, needs = asked()
    before = [generation.mirror.reservations.uses(track, excluding=0) for track in generation.site.lifts]
    needs.combine(answers_to(needs.parts, 60_000_000), NOW_US + 400_000)
    assert [generation.mirror.reservations.uses(track, excluding=0) for track in generation.site.lifts] == before


def test_p39_where_no_lift_answers_the_bid_rests_on_the_plan_alone() -> None:
    _, needs = asked()
    silence = answers_to(needs.parts, winner=0)
    again = needs.combine(silence, NOW_US + 400_000)
    assert isinstance(again, NeededAnswers)
    bid = again.combine(silence + answers_to(again.parts, winner=0, first=len(silence) + 1), NOW_US + 600_000)
    assert isinstance(bid, Proposal)
    assert bid.parts == ()
    (solution,) = bid.program
    assert rides_of(solution.steps)


def test_p39_what_was_promised_is_carried_out_while_it_holds() -> None:
    generation, needs = asked()
    bid = needs.combine(answers_to(needs.parts), NOW_US + 400_000)
    assert isinstance(bid, Proposal)
    (promised,) = bid.program
    award_us = NOW_US + 1_005_000
    assert generation.renewed(park(), promised, award_us) == promised
    generation.mirror.on_itinerary(firm(12), NOW_US)
    assert generation.renewed(park(), promised, award_us) != promised, "somebody else has taken the way meanwhile"


# --- the session lock ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("locked", [False, True], ids=["planned on the mirror", "session lock"])
def test_p39_a_session_begins_with_the_call_and_a_planned_ride_with_boarding(locked: bool) -> None:
    mirror = WayMirror(site_with(RideCalls.PLANNED), 12)
    if locked:
        mirror.reservations = SessionLocks(mirror)
    itinerary = firm(11)
    mirror.on_itinerary(itinerary, NOW_US)
    ride = next(leg for leg in itinerary.legs if leg.action is LegAction.RIDE)
    (use, *_) = mirror.reservations.uses(ride.track, excluding=12)
    sets_out_us = from_bus_ms(itinerary.stamp.award_ms, NOW_US)
    if locked:
        assert use.from_us == sets_out_us
    else:
        assert use.from_us > sets_out_us + 1_000_000
    assert use.to_us > from_bus_ms(ride.end_ms, NOW_US)


def test_p39_nobody_rides_in_between_a_call_and_its_ride_under_a_session_lock() -> None:
    """Robot 11 calls the left lift and waits a minute on its way; robot 12 could ride in that minute."""
    site = site_with(RideCalls.PLANNED)
    legs = (
        _leg(LegAction.STAND, 2, 8, 8, 60_000),
        _leg(LegAction.TRAVEL, 2, 8, 0, 76_000),
        _leg(LegAction.RIDE, 128, 2, 1, 82_000),
        _leg(LegAction.TRAVEL, 1, 0, 3, 90_000),
    )
    planned = Itinerary(11, 1, Grade.FIRM, Stamp(to_bus_ms(NOW_US), 1, 1), legs)
    done_us = {}
    for locked in (False, True):
        mirror = WayMirror(site, 12)
        if locked:
            mirror.reservations = SessionLocks(mirror)
        mirror.on_itinerary(planned, NOW_US)
        visits = (Visit(Segment(2, 2), 1_000_000),)
        route = plan_route(
            site, mirror.reservations, 12, Segment(3, 1), NOW_US, visits, frozenset({Segment(3, 8)}), 4_000
        )
        assert isinstance(route, Route)
        done_us[locked] = route.finish_us - NOW_US
    assert done_us[False] < 30_000_000
    assert done_us[True] > 70_000_000, "by the other lift, as soon as robot 11 has left the alley, or behind it"


def _leg(action: LegAction, track: int, begin: int, end: int, end_ms: int) -> Leg:
    return Leg(action, track, begin, end, Side.NEAR, to_bus_ms(NOW_US + end_ms * 1000))
