"""Cars are brought nearer while nobody waits (``quiet_moves``), and whoever calls for anything else comes first."""

from dataclasses import replace
from functools import cache

import pytest

from bus_sim.faults.arm import arm
from bus_sim.faults.injection import parse_injection
from bus_sim.systems.car_park.plant.customer import VisitOutcome
from onboard.config.site import parse_site, site_digest
from onboard.contract.announce import FetchWord
from onboard.contract.codes import CallResult, Operation, TaskPhase
from onboard.contract.messages import Award, CallForProposals, CarAt, Reference, TaskReport
from onboard.core.site import Station
from onboard.systems.car_park.fetch_costs import fetch_us, moved_from
from onboard.systems.car_park.place_costs import GAIN_US
from onboard.systems.car_park.quiet_moves import PATIENCE_US, QUIET_US
from onboard.systems.car_park.site import CarPark, PlacePolicy, car_park
from tests.system.scene import Scene, play, stays

TEXT = """
[site]
name = "quiet"
[floors]
count = 3
positions = 8
without = ["p(2-3,1-5)"]
[[compartments]]
name = "IOC1"
node = 1
at = "p(1,4)"
[[lifts]]
name = "ER1"
node = 5
end = "left"
[[spurs]]
at = "p(1,6)"
[[robots]]
name = "MR1"
node = 11
home = "p(2,3)"
[[robots]]
name = "MR2"
node = 12
home = "p(3,5)"
"""
#: The name of the car that is parked upstairs, where no alley is used yet.
CAR = Reference(1, 2)


@cache
def site(*, quiet_moves: bool = True) -> CarPark:
    found = replace(car_park(parse_site(TEXT, "quiet.toml")), place=PlacePolicy.BALANCED, quiet_moves=quiet_moves)
    return replace(found, digest=site_digest(found))


@cache
def scene(
    *times_s: tuple[float, float | None], quiet_moves: bool = True, limit_s: float = 900, faults: tuple[str, ...] = ()
) -> Scene:
    injections = [parse_injection(fault) for fault in faults]
    park, coming = site(quiet_moves=quiet_moves), stays(*times_s)
    found = play(park, coming, limit_s=limit_s, plant=lambda simulation: arm(simulation, injections))
    found.assert_sound()
    asked = [one.visit.outcome for one in found.simulation.plant.street.customers if one.visit.asked_us is not None]
    assert asked == [VisitOutcome.SERVED] * len(asked)
    return found


def moves(found: Scene) -> list[tuple[int, CallForProposals]]:
    """Calls by which a car is moved, the first of each."""
    calls = {one.call: (us, one) for us, one in reversed(found.all(CallForProposals, "fleet"))}
    return sorted((us, one) for us, one in calls.values() if moved_from(site(), one) is not None)


def places(found: Scene, car: Reference) -> list[Station]:
    """Where a car stood, one place after the other."""
    known = {place.number for place in site().places}
    told = dict.fromkeys(one.station for _, one in found.all(CarAt, "fleet") if one.car == car and one.station in known)
    return [Station.from_number(number) for number in told]


def told(found: Scene, task: Reference) -> list[TaskPhase]:
    """What robots said of a task, in order."""
    said = [one for _, one in found.all(TaskReport, "fleet") if one.sender in (11, 12)]
    return list(dict.fromkeys(one.phase for one in said if one.task == task))


def waits_s(found: Scene) -> list[float]:
    visits = [one.visit for one in found.simulation.plant.street.customers]
    return [one.out_wait_us / 1e6 for one in visits if one.out_wait_us is not None]


def test_a_car_upstairs_is_brought_nearer_while_it_is_quiet_and_fetched_from_there() -> None:
    found = scene((0, None), (100, 600))
    ((called_us, call),) = moves(found)
    parked_us, _ = found.first(TaskReport, lambda one: (one.task, one.phase) == (CAR, TaskPhase.DONE))
    assert called_us >= parked_us + QUIET_US
    far, near = places(found, CAR)
    assert call.from_station == far.number and call.sender == 1
    assert fetch_us(site(), near.segment, 1) <= fetch_us(site(), far.segment, 1) - GAIN_US
    assert told(found, call.task)[-1] is TaskPhase.DONE
    _, fetched = found.first(CallForProposals, lambda one: one.operation is Operation.RETRIEVE)
    assert fetched.from_station == near.number
    assert waits_s(found)[0] < waits_s(scene((0, None), (100, 600), quiet_moves=False))[0] - 10


def test_without_the_word_no_car_is_moved() -> None:
    assert moves(scene((0, None), (100, 600), quiet_moves=False)) == []


def test_whoever_drives_in_meanwhile_comes_first() -> None:
    found = scene((0, None), (100, None), (224, None), limit_s=300)
    ((called_us, call),) = moves(found)
    given_up_us, _ = found.first(Award, lambda one: (one.task, one.result) == (call.task, CallResult.WITHDRAWN))
    assert called_us < given_up_us < called_us + 2_000_000
    assert TaskPhase.STARTED not in told(found, call.task), "nobody has touched the car"
    assert len(places(found, CAR)) == 1
    third = Reference(1, 4)
    assert TaskPhase.LOADED in told(found, third)


def test_where_calls_come_often_no_car_is_moved() -> None:
    times = (0, None), (60, None), (100, None), (230, None), (450, None)
    assert moves(scene(*times[:3], times[4])) != []
    assert moves(scene(*times)) == []


def test_who_asks_for_a_car_that_is_under_way_gets_it_from_where_it_is_left() -> None:
    found = scene((0, None), (100, 250))
    ((_, call),) = moves(found)
    assert told(found, call.task)[-1] is TaskPhase.DONE, "what is begun ends as any parking does"
    left_us, _ = found.first(TaskReport, lambda one: (one.task, one.phase) == (call.task, TaskPhase.DONE))
    us, fetched = found.first(CallForProposals, lambda one: one.operation is Operation.RETRIEVE)
    assert us < left_us + 2_000_000
    assert fetched.from_station == places(found, CAR)[-1].number


@pytest.mark.parametrize(
    "crash",
    [
        "crash:target=MR1,at_s=240,restart_s=10",
        "crash:target=IOC1,at_s=258,restart_s=20",
    ],
)
def test_a_move_that_a_crash_falls_into_ends_all_the_same(crash: str) -> None:
    found = scene((0, None), (100, 400), faults=(crash,))
    ((_, call),) = moves(found)
    assert told(found, call.task)[-1] is TaskPhase.DONE
    assert len(places(found, CAR)) == 2


def test_a_steward_that_missed_the_award_ends_the_move() -> None:
    """It lets nobody have the car, and its compartment takes the task back; whoever asks for it is served."""
    found = scene((0, None), (100, 400), faults=("crash:target=ER1,at_s=234.5,restart_s=10",))
    ((_, call),) = moves(found)
    void_us, _ = found.first(Award, lambda one: (one.task, one.result) == (call.task, CallResult.WITHDRAWN))
    assert void_us < 300_000_000
    assert TaskPhase.LOADED not in told(found, call.task)


def test_nobody_waits_for_a_move_for_ever() -> None:
    crash = parse_injection("crash:target=MR1,at_s=240,restart=no")
    coming = stays((0, None), (100, None), (600, None))
    found = play(site(), coming, limit_s=650, plant=lambda simulation: arm(simulation, [crash]), extra_s=0)
    ((called_us, call),) = moves(found)
    void_us, _ = found.first(Award, lambda one: (one.task, one.result) == (call.task, CallResult.WITHDRAWN))
    assert abs(void_us - called_us - PATIENCE_US) < 1_000_000


@cache
def announcing(*stays_s: tuple[float, float]) -> Scene:
    """Cars that nobody fetches yet; their drivers say at the desk when they will come, s."""
    coming = stays(*((come_s, None) for come_s, _ in stays_s))
    leaving = [replace(one, announced_us=round(s * 1e6)) for one, (_, s) in zip(coming.stays, stays_s, strict=True)]
    found = play(site(), replace(coming, stays=tuple(leaving)), limit_s=900, extra_s=500)
    found.assert_sound()
    assert {one.visit.announced for one in found.simulation.plant.street.customers} == {FetchWord.NOTED}
    return found


#: Two cars upstairs, of which either is announced for the sooner.
SECOND_FIRST, THIRD_FIRST = ((0, 20_000), (60, 2_400), (120, 2_700)), ((0, 20_000), (60, 2_700), (120, 2_400))


def test_a_car_is_brought_nearer_before_the_time_that_its_driver_has_announced_and_not_hours_before() -> None:
    assert {call.car for _, call in moves(announcing(*SECOND_FIRST))} == {CAR, Reference(1, 3)}
    assert moves(announcing((0, 20_000), (60, 20_000), (120, 20_000))) == []


def test_of_cars_that_are_announced_the_first_to_be_fetched_is_moved_first() -> None:
    assert [one.car for _, one in moves(announcing(*SECOND_FIRST))][:1] == [CAR]
    assert [one.car for _, one in moves(announcing(*THIRD_FIRST))][:1] == [Reference(1, 3)]


def test_where_calls_come_often_only_cars_are_moved_that_are_announced_and_due() -> None:
    found = announcing((0, 20_000), (60, 2_400), (100, 20_000), (230, 20_000), (450, 20_000))
    assert {call.car for _, call in moves(found)} == {CAR}
