"""A robot counts on others giving way only where it finds no way around them, and where they have somewhere to go."""

from onboard.contract.codes import Criterion, Grade, KindCode, LegAction, Operation, Side
from onboard.contract.messages import CallForProposals, Itinerary, Leg, Reference, Stamp
from onboard.core.site import Segment, Station
from onboard.systems.car_park.generation import YIELDING_US, CarParkGeneration
from onboard.systems.car_park.program import Program
from onboard.systems.car_park.site import car_park
from onboard.ways.mirror import WayMirror
from onboard.ways.site import way_site
from tests.system.test_giving_way import BUSY, IDLE, tower

CAR = Reference(1, 7)


def fetch(from_index: int) -> CallForProposals:
    """Bring the car at p(2,i) to the compartment."""
    return CallForProposals(
        sender=1,
        call=3,
        task=Reference(1, 9),
        operation=Operation.RETRIEVE,
        kind=KindCode.ROBOT,
        criterion=Criterion.FINISH_TIME,
        attempt=1,
        depth=0,
        from_station=Station(2, from_index, Side.NEAR).number,
        to_station=Station(1, 3, Side.NEAR).number,
        deadline_ms=1_000,
        car=CAR,
        wheelbase_mm=2_700,
    )


def robot_at(mine: Segment, others: Segment) -> CarParkGeneration:
    site = tower()
    mirror = WayMirror(way_site(site), BUSY)
    for node, place in ((IDLE, others), (BUSY, mine)):
        leg = Leg(LegAction.STAND, place.track, place.index, place.index, Side.NEAR, 1)
        mirror.on_itinerary(Itinerary(node, 1, Grade.FIRM, Stamp(0, node, 0), (leg,)), 0)
    return CarParkGeneration(car_park(site), site.machines[BUSY], mirror, Program(way_site(site), standing=mine))


def test_p38_a_way_around_is_taken_at_once_and_one_through_counts_on_time_to_give_way() -> None:
    free, _ = robot_at(Segment(3, 3), Segment(2, 6)).solve(fetch(5), 0)
    through, tried = robot_at(Segment(3, 3), Segment(2, 3)).solve(fetch(5), 0)
    assert free is not None and through is not None
    passes_us = next(step.end_us for step in through.steps if step.action is LegAction.TRAVEL and step.to_index == 5)
    assert passes_us > 1_000_000 + YIELDING_US
    assert free.finish_us < through.finish_us
    # The first alternative was that nobody gives way: impossible.
    assert [one.finish_us is None for one in tried] == [True, False]


def test_p45_a_machine_that_cannot_get_out_of_the_way_is_not_counted_on() -> None:
    # Whoever stands at p(2,3) has the dead end behind it and the robot itself before it.
    solution, tried = robot_at(Segment(2, 2), Segment(2, 5)).solve(fetch(6), 0)
    assert solution is None
    assert [one.finish_us is None for one in tried] == [True, False]
