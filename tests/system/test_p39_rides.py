"""Lift availability is checked by a call before the bid (row P39), on the small site with ``rides = "before"``."""

import dataclasses

import pytest

from bus_sim.sites import find_site
from onboard.contract.codes import CallResult, Grade, KindCode, LegAction, Operation
from onboard.contract.messages import Award, Bid, CallForProposals, Itinerary, Reference, TokenGrant
from onboard.core.serial import from_bus_ms
from onboard.systems.car_park.site import CarPark, RideCalls, car_park
from onboard.ways.lifts import gate, platform
from onboard.ways.site import way_site
from tests.system.scene import Scene, play, stays

CARS = 4


def asking(name: str = "small") -> CarPark:
    return dataclasses.replace(car_park(find_site(name)), rides=RideCalls.BEFORE)


@pytest.fixture(scope="module")
def scene() -> Scene:
    """Four cars that come close together and are fetched again."""
    demand = stays(*[(20.0 * number, 500.0 + 40.0 * number) for number in range(CARS)])
    found = play(asking(), demand)
    found.assert_sound()
    return found


def calls(scene: Scene) -> dict[tuple[int, int], tuple[int, CallForProposals]]:
    return {(call.sender, call.call): (time_us, call) for time_us, call in scene.all(CallForProposals)}


def nested(scene: Scene) -> list[tuple[int, CallForProposals]]:
    return [(time_us, call) for time_us, call in calls(scene).values() if call.hold_ms]


def test_p39_every_bid_with_a_ride_follows_nested_calls_inside_the_outer_deadline(scene: Scene) -> None:
    heard = calls(scene)
    guard_us = 2 * scene.simulation.site.timing.deadline_guard_us
    assert nested(scene)
    for time_us, call in nested(scene):
        assert (call.operation, call.kind, call.depth) == (Operation.RIDE, KindCode.LIFT, 1)
        outer_us, outer = heard[call.parent.origin, call.parent.number]
        deadline_us = from_bus_ms(outer.deadline_ms, outer_us)
        assert outer_us < time_us
        assert from_bus_ms(call.deadline_ms, time_us) < deadline_us - guard_us
        assert from_bus_ms(call.deadline_ms, time_us) + call.hold_ms * 1000 > deadline_us


def test_p39_the_lifts_answer_from_their_schedule_before_the_robot_bids(scene: Scene) -> None:
    heard = calls(scene)
    lifts = {node for node, one in scene.simulation.site.machines.items() if one.kind is KindCode.LIFT}
    answers = [(t, bid) for t, bid in scene.all(Bid) if bid.sender in lifts]
    outer_bids = [(t, bid) for t, bid in scene.all(Bid) if bid.sender not in lifts]
    assert len(outer_bids) >= 2 * CARS
    for bid_us, bid in outer_bids:
        parent = Reference(bid.initiator, bid.call)
        asked = [call for _, call in nested(scene) if (call.sender, call.parent) == (bid.sender, parent)]
        assert asked, "both robots stand on upper floors: no task without a ride"
        for call in asked:
            (answer_us, answer), *_ = [
                one for one in answers if (one[1].initiator, one[1].call) == (call.sender, call.call)
            ]
            assert answer_us < from_bus_ms(call.deadline_ms, answer_us) < bid_us
            ready_us = from_bus_ms(call.deadline_ms, answer_us) + call.ready_ms * 1000
            assert from_bus_ms(answer.cost, answer_us) >= ready_us
    assert heard


def test_p39_options_are_awarded_only_after_the_outer_award(scene: Scene) -> None:
    heard = calls(scene)
    awards = scene.all(Award)
    won_us = {
        (award.sender, award.call, award.winner): time_us
        for time_us, award in reversed(awards)
        if award.result is CallResult.AWARDED
    }
    confirmed = 0
    for time_us, award in awards:
        call = heard[award.sender, award.call][1]
        if not call.hold_ms or award.result is not CallResult.AWARDED:
            continue
        confirmed += 1
        assert won_us[call.parent.origin, call.parent.number, award.sender] < time_us
    assert confirmed >= CARS


def test_p39_an_option_is_never_driven_for(scene: Scene) -> None:
    """Gate and platform go only to robots whose firm itinerary rides that lift."""
    site = scene.simulation.site
    plans: dict[int, Itinerary] = {}
    granted = 0
    for said in scene.said:
        message = said.message
        if isinstance(message, Itinerary) and message.grade is Grade.FIRM:
            plans[message.sender] = message
        for track in way_site(site).lifts:
            if not isinstance(message, TokenGrant) or message.sender != site.stewards[track] or message.token_kind:
                continue
            if message.token in (platform(track).number, gate(track).number) and message.holder >= 11:
                granted += 1
                legs = plans[message.holder].legs
                assert any(leg.action is LegAction.RIDE and leg.track == track for leg in legs)
    assert granted >= 4 * CARS


def test_p39_nothing_is_held_once_all_is_done(scene: Scene) -> None:
    for controller in scene.simulation.controllers.values():
        negotiation = controller.holon.negotiation
        assert not [key for key, one in negotiation.participants.items() if one.is_committed]
        assert negotiation.initiators == []
    closed = {(a.sender, a.call): a.result for _, a in scene.all(Award)}
    for key in calls(scene):
        assert closed[key] in (CallResult.AWARDED, CallResult.WITHDRAWN, CallResult.REFUSED), key


@pytest.mark.parametrize("rides", list(RideCalls))
def test_p04_five_cars_asked_for_in_the_same_seconds_are_all_fetched(rides: RideCalls) -> None:
    """Robots bid for several of them at once, each bid behind the ones before."""
    site = dataclasses.replace(car_park(find_site("standard")), rides=rides)
    found = play(site, stays(*[(float(number), 400.0) for number in range(5)]), limit_s=1_500)
    found.assert_sound()
    summary = found.simulation.plant.street.summary()
    assert (summary.parked, summary.served, summary.inside) == (5, 5, 0)


def test_p39_four_robots_ask_two_lifts_for_cars_that_come_at_one_moment() -> None:
    demand = stays(*[(float(number // 3), None) for number in range(6)])
    found = play(asking("standard"), demand, extra_s=150)
    found.assert_sound()
    assert found.simulation.plant.street.summary().parked == 6
    lifts = {node for node, one in found.simulation.site.machines.items() if one.kind is KindCode.LIFT}
    assert {bid.sender for _, bid in found.all(Bid) if bid.sender in lifts} == lifts
    wholes = {call.parent for _, call in nested(found)}
    # Whoever is in the spur of the street needs no lift.
    assert len(wholes) >= 5
    askers = [len({call.sender for _, call in nested(found) if call.parent == whole}) for whole in wholes]
    assert sum(askers) < 3 * len(askers), "who hears a better one ask waits for its bid, and then often asks nobody"
