"""Which desk: a ticket is good at every one, and by the site's policy the car comes to the compartment that suits."""

from functools import cache, partial

import pytest

from bus_sim.faults.controllers import machine_named
from bus_sim.systems.car_park.plant.customer import VisitOutcome
from bus_sim.systems.car_park.simulation import Simulation
from onboard.config.site import parse_site
from onboard.contract.codes import CallResult, DeskInput, DeskText, Operation, Reason, TaskPhase
from onboard.contract.messages import Award, Bid, CallForProposals, DeskEvent, DeskOrder, TaskReport
from onboard.systems.car_park.bay_generation import MOST_TAKEN, BayGeneration
from onboard.systems.car_park.compartment import Compartment
from onboard.systems.car_park.site import CarPark, car_park
from onboard.trace.story.why import WaitingStory, task_lines
from onboard.trace.words import Words
from tests.system.scene import Scene, play, stays
from tests.thinned import some

#: Cars come in at IOC1, whose desk is nobody's farther than the other, and stand beside IOC2.
TWO = """
[site]
name = "test"
[floors]
count = 1
positions = 12
without = ["p(1,1-7)"]
[negotiation]
desk = "{desk}"
[[compartments]]
name = "IOC1"
node = 1
at = "p(1,3)"
[[compartments]]
name = "IOC2"
node = 2
at = "p(1,9)"
use = "{use}"
[[robots]]
name = "MR1"
node = 11
home = "p(1,12)"
"""


def two(desk: str, use: str = "both") -> CarPark:
    return car_park(parse_site(TWO.format(desk=desk, use=use), "test.toml"))


def assert_served(scene: Scene, cars: int) -> None:
    scene.assert_sound()
    outcomes = [one.visit.outcome for one in scene.simulation.plant.street.customers]
    assert outcomes == [VisitOutcome.SERVED] * cars


def ready_at(scene: Scene) -> list[int]:
    """The compartments where a car is ready, in the order of the cars; a desk's order is said several times."""
    return list({one.car: one.sender for _, one in scene.all(DeskOrder) if one.text is DeskText.CAR_READY}.values())


@cache
def fetched(desk: str) -> Scene:
    """One car that is parked and asked for at the first desk."""
    scene = play(two(desk), stays((0, 200)))
    assert_served(scene, 1)
    assert scene.first(DeskEvent, lambda one: one.event is DeskInput.TICKET)[1].sender == 1
    return scene


def test_unless_the_site_says_more_the_car_comes_to_the_desk_that_reads_its_ticket() -> None:
    scene = fetched("any")
    assert ready_at(scene) == [1]
    assert not any(one.text is DeskText.GO_TO for _, one in scene.all(DeskOrder))
    assert not any(one.operation is Operation.RECEIVE for _, one in scene.all(CallForProposals))


def test_nearest_the_car_comes_to_the_compartment_beside_it_and_the_customer_is_told_which() -> None:
    scene = fetched("nearest")
    asked_us, _ = scene.first(DeskEvent, lambda one: one.event is DeskInput.TICKET)
    told_us, told = scene.first(DeskOrder, lambda one: one.text is DeskText.GO_TO)
    fetch_us, fetch = scene.first(CallForProposals, lambda one: one.operation is Operation.RETRIEVE)
    assert (told.sender, told.compartment, fetch.sender) == (1, 2, 2)
    assert asked_us < fetch_us < told_us + 200_000 < asked_us + 1_500_000, "one call's window"
    assert ready_at(scene) == [2]
    assert scene.simulation.plant.street.customers[0].compartment is scene.simulation.plant.compartments[2]


def test_a_log_tells_where_a_car_was_asked_for_and_to_which_compartment_it_came() -> None:
    scene = fetched("nearest")
    words, story = Words(scene.simulation.site), WaitingStory(scene.simulation.site)
    for said in scene.said:
        if said.bus == "fleet":
            story.feed(said.message, said.time_us)
    story.finish()
    (asked,) = [one for one in story.tasks.values() if one.operation is Operation.RECEIVE]
    first = task_lines(asked, words, 0)[0]
    assert "receive at IOC2, called by IOC1" in first and "served; waited 1.0" in first


def test_a_desk_bids_in_its_own_call_and_only_who_is_better_does_too() -> None:
    scene = fetched("nearest")
    _, call = scene.first(CallForProposals, lambda one: one.operation is Operation.RECEIVE)
    bids = [one for _, one in scene.all(Bid, "fleet") if (one.initiator, one.call) == (1, call.call)]
    assert [one.sender for one in bids] == [1, 2] and bids[1].cost < bids[0].cost
    own = play(two("own"), stays((0, 200)))
    bids = [one for _, one in own.all(Bid, "fleet") if one.initiator == 1]
    _, call = own.first(CallForProposals, lambda one: one.operation is Operation.RECEIVE)
    assert [one.sender for one in bids if one.call == call.call] == [1]
    _, award = own.first(Award, lambda one: one.call == call.call)
    assert (award.winner, award.result) == (1, CallResult.AWARDED)


def test_own_the_car_comes_out_where_it_came_in() -> None:
    assert ready_at(fetched("own")) == [1]
    scene = play(two("own", "exit"), stays((0, 200)))
    assert_served(scene, 1)
    assert ready_at(scene) == [1]


def test_own_it_comes_out_there_whoever_asks_before_it_stands_at_a_place() -> None:
    """Two cars come in, one at each; the driver of the second asks at the first desk while a robot has the other."""
    scene = play(two("own"), stays((0, 3_000), (2, 30)))
    asked_us, asked = scene.first(DeskEvent, lambda one: one.event is DeskInput.TICKET)
    parked_us, _ = scene.first(TaskReport, lambda one: one.phase is TaskPhase.DONE and one.task == asked.car)
    assert (asked.sender, asked.car.origin) == (1, 2) and asked_us < parked_us
    assert ready_at(scene)[0] == 2


def test_who_asks_when_the_suited_compartment_has_as_many_as_it_takes_is_sent_to_the_other() -> None:
    scene = play(two("nearest"), stays(*((60 * number, 600 + number) for number in range(MOST_TAKEN + 1))))
    assert_served(scene, MOST_TAKEN + 1)
    assert sorted(ready_at(scene)) == [1, *[2] * MOST_TAKEN]


def test_a_car_that_is_asked_for_on_its_way_to_its_place_comes_to_the_compartment_beside_that() -> None:
    """In a rush drivers are back before their cars stand: these came to whichever desk read the ticket."""
    scene = play(two("nearest"), stays((0, 52)))
    asked_us, asked = scene.first(DeskEvent, lambda one: one.event is DeskInput.TICKET)
    parked_us, _ = scene.first(TaskReport, lambda one: one.phase is TaskPhase.DONE and one.task == asked.car)
    assert asked.sender == 1 and asked_us < parked_us
    assert_served(scene, 1)
    assert ready_at(scene) == [2]


#: Around the moment at which the first desk's customer is told, s; the last when a robot has won the car.
AROUND = (-1.2, -0.6, -0.05, -0.001, 0.0005, 0.01, 0.2, 3.0, 20.0)


CASES = [
    # The first is the steward of all segments too: without it nothing moves.
    *(("IOC1", one, 5.0) for one in AROUND),
    *(("IOC2", one, 5.0) for one in AROUND),
    *(("IOC2", one, None) for one in AROUND),
]


def off(simulation: Simulation, machine: str, at_us: int, lasts_s: float | None) -> None:
    """The controller of a machine has no power for so long, or for good."""
    one = machine_named(simulation, machine)
    simulation.plant.timers.call_at(at_us, partial(simulation.crash, one))
    if lasts_s is not None:
        again = partial(simulation.start_controller, one)
        simulation.plant.timers.call_at(at_us + round(lasts_s * 1e6), again)


@pytest.mark.parametrize(("machine", "after_s", "lasts_s"), some(CASES, 9))
def test_whoever_is_lost_the_customer_gets_the_car(machine: str, after_s: float, lasts_s: float | None) -> None:
    told_us, _ = fetched("nearest").first(DeskOrder, lambda one: one.text is DeskText.GO_TO)

    faults = partial(off, machine=machine, at_us=told_us + round(after_s * 1e6), lasts_s=lasts_s)
    scene = play(two("nearest"), stays((0, 200)), before=faults, limit_s=500)
    if (machine, lasts_s) == ("IOC2", None) and after_s > 1:
        # A robot has the car, and waits before the bay that is off.
        scene.first(DeskOrder, lambda one: (one.sender, one.text) == (1, DeskText.OUT_OF_ORDER), after_us=told_us)
        return
    assert [one.visit.outcome for one in scene.simulation.plant.street.customers] == [VisitOutcome.SERVED]
    assert scene.simulation.plant.oracle.finish() == []
    if (machine, lasts_s) == ("IOC2", None):
        last = [one for _, one in scene.all(TaskReport) if one.phase is TaskPhase.DONE][-1]
        assert ready_at(scene) == [1] and last.task.origin == 1


#: Before the customer is told, s: it is in the journal of whoever has won the call, and nobody has heard so.
@pytest.mark.parametrize("after_s", [-0.007, -0.005])
def test_a_ticket_that_another_took_meanwhile_is_not_fetched_for_by_who_comes_back(after_s: float) -> None:
    told_us, _ = fetched("nearest").first(DeskOrder, lambda one: one.text is DeskText.GO_TO)
    faults = partial(off, machine="IOC2", at_us=told_us + round(after_s * 1e6), lasts_s=15.0)
    scene = play(two("nearest"), stays((0, 200)), before=faults, limit_s=500)
    assert_served(scene, 1)
    fetched_for = {
        one.task for at_us, one in scene.all(TaskReport) if one.phase is TaskPhase.LOADED and at_us > told_us
    }
    assert len(fetched_for) == 1
    assert not any(one.sender == 2 and one.winner for at_us, one in scene.all(Award) if at_us > told_us)


def asks_again(simulation: Simulation, at_us: int) -> None:
    """The first customer's ticket is read at the other desk as well, before the car stands."""
    street = simulation.plant.street

    def reads() -> None:
        ticket = street.customers[0].ticket
        assert ticket is not None
        simulation.plant.compartments[2].insert_ticket(ticket)

    simulation.plant.timers.call_at(at_us, reads)


@pytest.mark.parametrize("later_s", [0.5, 1.0, 1.5])
def test_who_asks_at_two_desks_before_the_car_stands_is_told_at_both_where_it_comes(later_s: float) -> None:
    asked_us, _ = play(two("nearest"), stays((0, 52))).first(DeskEvent, lambda one: one.event is DeskInput.TICKET)
    again = partial(asks_again, at_us=asked_us + round(later_s * 1e6))
    scene = play(two("nearest"), stays((0, 52)), before=again)
    assert_served(scene, 1)
    calls = [one for _, one in scene.all(CallForProposals) if one.operation is Operation.RECEIVE]
    told = {one.sender: one.compartment for _, one in scene.all(DeskOrder) if one.text is DeskText.GO_TO}
    assert (len(calls), told, ready_at(scene)) == (1, {1: 2, 2: 2}, [2])


def test_a_bay_bids_for_no_car_of_which_it_knows_nothing() -> None:
    """Started again while the car's custodian was off it won, told its customer UNKNOWN_TICKET, and won again."""
    _, call = fetched("nearest").first(CallForProposals, lambda one: one.operation is Operation.RECEIVE)
    park = two("nearest")
    for known in ((), (call.car,)):
        bay = BayGeneration(park, park.machines[2], lambda _, now_us: now_us // 1_000, known)
        assert (bay.lower_bound(call, 0) is None) is not bool(known)


def test_a_ticket_that_a_bay_has_given_up_and_won_again_is_dropped_for_another_all_the_same() -> None:
    scene = play(two("nearest"), stays((0, 200)))
    bay = scene.simulation.controllers[2].holon.behaviour
    assert isinstance(bay, Compartment)
    _, call = scene.first(CallForProposals, lambda one: one.operation is Operation.RECEIVE)
    bay.desks.hear(call, 0)
    bay.desks.received[call.car] = call.task, 1
    bay.generation.given_up.add(call.car)
    newer = Award(1, call.call, 1, call.task, 2, CallResult.AWARDED, Reason.NONE)
    _, dropped = bay.desks.hear(newer, 0)
    assert dropped == call.car and call.car not in bay.desks.received
    assert bay.outputs.shown == (DeskText.GO_TO, call.car)
