"""What a compartment promises follows from how its last promises went, and from nothing of other cases."""

from dataclasses import replace

from onboard.contract.base import Reference, Stamp
from onboard.contract.car_park import Promise
from onboard.contract.codes import Grade, LegAction, Operation
from onboard.contract.messages import Itinerary, Leg
from onboard.core.effects import Send
from onboard.core.serial import to_bus_ms
from onboard.holon.holon import Holon
from onboard.systems.car_park.bay_task import BayPhase, BayTask
from onboard.systems.car_park.compartment import Compartment
from onboard.systems.registry import factory_for
from tests.sites import one_floor

SITE = replace(one_floor(robots=2), promises=True)
BAY, ROBOT, OTHER = 1, 11, 12
TRIP_US, DOOR_US = 60_000_000, 2_700_000


def compartment() -> Compartment:
    machine = SITE.machines[BAY]
    holon = Holon(SITE, machine, factory_for(SITE, machine.kind), boot=1)
    assert isinstance(holon.behaviour, Compartment)
    return holon.behaviour


def works_until(bay: Compartment, robot: int, end_us: int) -> None:
    """The robot's plan is to work at the bay until then."""
    track, index, side = bay.station
    leg = Leg(LegAction.WORK, track, index, index, side, to_bus_ms(end_us))
    bay.fleet.mirror.itineraries[robot] = Itinerary(robot, 1, Grade.FIRM, Stamp(0, BAY, 1), (leg,))


def served(bay: Compartment, number: int, late_us: int, *, others: bool = False) -> Promise:
    """One who asks is told, and the car is there so long after its robot is done."""
    now_us = number * 600_000_000
    car = Reference(BAY, number)
    works_until(bay, ROBOT, now_us + TRIP_US)
    works_until(bay, OTHER, now_us + (TRIP_US if others else -TRIP_US))
    bay.calls.job = BayTask(car, Operation.RETRIEVE, car, 2_700, winner=ROBOT)
    said = [one.message for one in bay.promises.review(BayPhase.AWAITING, now_us) if isinstance(one, Send)]
    assert not bay.promises.review(BayPhase.HANDOVER, now_us + TRIP_US + late_us), "it is told once"
    bay.calls.job = None
    bay.promises.review(BayPhase.FREE, now_us + 2 * TRIP_US)
    (word,) = said
    assert isinstance(word, Promise)
    return word


def lateness_us(number: int) -> int:
    """The door takes this and up to two tenths of a second more, by turns."""
    return DOOR_US + number % 5 * 50_000


def test_what_a_door_takes_is_learned_from_who_was_served() -> None:
    bay = compartment()
    first = served(bay, 1, lateness_us(1))
    assert first.spread_ms * 1_000 == SITE.timing.door_us, "by the site's own constants: none or two times its way"
    last = [served(bay, number, lateness_us(number)) for number in range(2, 60)][-1]
    assert last.spread_ms == 500
    done_ms = to_bus_ms(59 * 600_000_000 + TRIP_US)
    assert 0 < done_ms + 2_900 - last.ready_ms <= 700


def test_where_others_work_it_is_learned_by_itself() -> None:
    bay = compartment()
    quiet = busy = served(bay, 1, DOOR_US)
    for number in range(2, 40):
        quiet = served(bay, number, lateness_us(number))
        busy = served(bay, 100 + number, DOOR_US + number % 10 * 1_000_000, others=True)
    assert quiet.spread_ms == 500
    assert 4_000 <= busy.spread_ms <= 5_000


def test_who_leaves_without_the_car_teaches_nothing() -> None:
    bay = compartment()
    words = [served(bay, number, lateness_us(number)).spread_ms for number in range(1, 30)]
    car = Reference(BAY, 200)
    bay.tickets.append(car)
    bay.promises.review(BayPhase.FREE, 200 * 600_000_000)
    bay.promises.review(BayPhase.FREE, 200 * 600_000_000 + 10_000_000)
    bay.tickets.clear()
    assert bay.promises.review(BayPhase.FREE, 201 * 600_000_000) == []
    assert served(bay, 202, lateness_us(202)).spread_ms == words[-1]


def test_behind_four_cars_what_they_took_lately_is_in_what_is_told() -> None:
    """Four cars' constants are more than can be told: their late end alone left out every car that came."""
    bay, each_us, kept = compartment(), 75_000_000, 0
    for number in range(1, 9):
        now_us = number * 10_000_000_000
        queue = [Reference(BAY, 10 * number + place) for place in range(4)]
        bay.tickets.extend(queue)
        bay.promises.review(BayPhase.FREE, now_us)
        said = bay.promises.review(BayPhase.FREE, now_us + 4_000_000)
        last = [one.message for one in said if isinstance(one, Send)][-1]
        assert isinstance(last, Promise) and last.car == queue[-1]
        there_us = now_us + 4_000_000 + 4 * each_us
        kept += abs(to_bus_ms(there_us) - last.ready_ms) <= last.spread_ms
        bay.tickets.clear()
        bay.calls.job = BayTask(queue[-1], Operation.RETRIEVE, queue[-1], 2_700, winner=ROBOT)
        bay.promises.review(BayPhase.HANDOVER, there_us)
        bay.calls.job = None
        bay.promises.review(BayPhase.FREE, there_us + 1_000_000)
    assert kept >= 7
