"""A lift is off, and cars behind it cannot be fetched: nobody who can be served waits for that, or at the wrong bay."""

import pytest

from bus_sim.faults.arm import arm
from bus_sim.faults.injection import parse_injection
from bus_sim.systems.car_park.simulation import Simulation
from onboard.config.site import parse_site
from onboard.contract.codes import DeskText
from onboard.contract.messages import DeskOrder
from onboard.systems.car_park.site import CarPark, car_park
from tests.sites import at_the_key
from tests.system.scene import Scene, play, stays
from tests.system.test_out_of_order import texts

#: One place on the street, which the first car gets; the second goes upstairs.
SITE = """
[site]
name = "upstairs"
[floors]
count = 2
positions = 8
without = ["p(1,*)F", "p(1,1-3)N", "p(1,5-6)N", "p(1,8)N"]
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
home = "p(192,1)"
[[robots]]
name = "MR2"
node = 12
home = "p(2,6)"
"""
#: When the lift is off and back, and the owners of the car upstairs and of that on the street come, s after power-up;
#: at last somebody with another car.
OFF_S, BACK_S, UPSTAIRS_S, STREET_S, COMES_S = 300, 1_200, 360, 410, 510
STREET, UPSTAIRS = 1, 2
#: The lift fails while the robot is aboard of it that fetches the car upstairs, s.
RIDES_S = 395


def upstairs() -> CarPark:
    return car_park(parse_site(SITE, "upstairs.toml"))


def scene(site: CarPark, *faults: str) -> Scene:
    lift = f"crash:target=ER1,at_s={OFF_S},restart_s={BACK_S - OFF_S}"

    def break_it(simulation: Simulation) -> None:
        arm(simulation, tuple(parse_injection(fault) for fault in (lift, *faults)))

    days = stays((0, STREET_S - 10), (90, UPSTAIRS_S - 10), (COMES_S - 10, BACK_S + 100))
    return play(site, days, before=break_it, limit_s=3_000)


def shown_s(one: Scene, text: DeskText, car: int) -> float:
    """When the desk says something of a car first, s."""
    return one.first(DeskOrder, lambda word: word.text is text and word.car.number == car)[0] / 1e6


def ready_s(one: Scene, car: int) -> float:
    """When the desk says that a car is there, s."""
    return shown_s(one, DeskText.CAR_READY, car)


@pytest.mark.parametrize("site", [upstairs(), at_the_key(upstairs())], ids=["on arrival", "with the key"])
def test_who_can_be_served_does_not_wait_behind_who_cannot(site: CarPark) -> None:
    one = scene(site)
    assert ready_s(one, STREET) < STREET_S + 100
    came_us, _ = one.first(DeskOrder, lambda word: word.text is DeskText.TAKE_TICKET, after_us=COMES_S * 1_000_000)
    assert came_us < (COMES_S + 60) * 1_000_000
    assert BACK_S < ready_s(one, UPSTAIRS) < BACK_S + 200
    summary = one.simulation.plant.street.summary()
    assert (summary.parked, summary.served) == (3, 3)
    assert one.simulation.plant.oracle.finish() == []


def test_who_cannot_reads_so_until_the_lift_is_back() -> None:
    one = scene(upstairs())
    assert texts(one, UPSTAIRS)[-4:] == [
        DeskText.PLEASE_WAIT,
        DeskText.OUT_OF_ORDER,
        DeskText.PLEASE_WAIT,
        DeskText.CAR_READY,
    ]
    assert shown_s(one, DeskText.OUT_OF_ORDER, UPSTAIRS) < UPSTAIRS_S + 60
    assert DeskText.OUT_OF_ORDER not in texts(one, STREET)


@pytest.mark.parametrize("at_s", [UPSTAIRS_S + 2, UPSTAIRS_S + 8, UPSTAIRS_S + 30, STREET_S + 20])
def test_its_ticket_outlives_a_restart_of_the_desk(at_s: int) -> None:
    one = scene(upstairs(), f"crash:target=IOC1,at_s={at_s},restart_s=5")
    assert one.simulation.plant.street.summary().served == 3
    assert ready_s(one, UPSTAIRS) < BACK_S + 250
    assert one.simulation.plant.oracle.finish() == []


def test_whose_robot_waits_for_a_lift_that_is_off_is_told_so() -> None:
    """Aboard of it, with the car: the desk said PLEASE_WAIT to all who waited at that bay until the lift was back."""
    late_s = 20
    days = stays((0, STREET_S - 10), (90, UPSTAIRS_S - 10))
    off = parse_injection(f"crash:target=ER1,at_s={RIDES_S},restart_s=600")
    one = play(upstairs(), days, before=lambda simulation: arm(simulation, (off,)), limit_s=2_000)
    for car in (STREET, UPSTAIRS):
        assert abs(shown_s(one, DeskText.OUT_OF_ORDER, car) - (RIDES_S + 30)) < late_s
        assert texts(one, car)[-3:] == [DeskText.OUT_OF_ORDER, DeskText.PLEASE_WAIT, DeskText.CAR_READY]
    assert one.simulation.plant.street.summary().served == 2


#: Two compartments, one on each side of a lift; the only place, upstairs, is nearer to the second, but by that lift.
BESIDE = """
[site]
name = "beside"
[floors]
count = 2
positions = 7
without = [
    "p(1,1)", "p(1,7)", "p(1,2)F", "p(1,3)", "p(1,4)", "p(1,5)N", "p(1,6)", "p(2,1-5)", "p(2,7)", "p(2,6)F",
    "p(*,A2,1)", "p(1,A2,2)F", "p(2,A2,2)", "p(*,A2,3-4)", "p(*,A2,6-7)", "p(1,A2,5)N", "p(2,A2,5)",
]
[[alleys]]
name = "A2"
positions = 7
[[lifts]]
name = "L0"
node = 100
end = "left"
[[lifts]]
name = "L1"
node = 101
doors = ["p(*,7)", "p(*,A2,1)"]
[[spurs]]
at = "p(1,5)"
side = "far"
[[spurs]]
at = "p(1,A2,5)"
side = "far"
[[compartments]]
name = "C1"
node = 1
at = "p(1,2)"
[[compartments]]
name = "C2"
node = 2
at = "p(1,A2,2)"
[[robots]]
name = "MR1"
node = 201
home = "p(192,1)"
[[robots]]
name = "MR2"
node = 202
home = "p(193,1)"
[negotiation]
desk = "nearest"
"""
FIRST_BAY, SECOND_BAY = 1, 2


def between(**off_s: float) -> Scene:
    """The car is asked for at 410 s; lifts by name, off from 300 s on, and for how long."""
    faults = [
        parse_injection(f"crash:target={lift},at_s={OFF_S},restart_s={lasts_s}") for lift, lasts_s in off_s.items()
    ]
    site = car_park(parse_site(BESIDE, "beside.toml"))
    return play(
        site, stays((0, STREET_S - 10)), before=lambda simulation: arm(simulation, tuple(faults)), limit_s=3_000
    )


def sent_to(one: Scene) -> list[int]:
    """To which compartments the customer is sent, one after the other."""
    told = [word.compartment for _, word in one.all(DeskOrder) if word.text is DeskText.GO_TO]
    return [bay for bay, before in zip(told, [0, *told], strict=False) if bay != before]


def ready_at(one: Scene) -> tuple[int, float]:
    """At which desk the car is ready first, and when, s."""
    time_us, word = one.first(DeskOrder, lambda word: word.text is DeskText.CAR_READY)
    return word.sender, time_us / 1e6


def test_whom_his_bay_cannot_serve_is_sent_to_one_that_can() -> None:
    one = between(L1=2_000)
    assert sent_to(one) == [SECOND_BAY, FIRST_BAY]
    words = [word for _, word in one.all(DeskOrder) if word.text is DeskText.GO_TO]
    assert {word.sender for word in words if word.compartment == FIRST_BAY} == {FIRST_BAY, SECOND_BAY}, (
        "where he stands"
    )
    bay, at_s = ready_at(one)
    assert bay == FIRST_BAY and at_s < STREET_S + 240
    assert one.simulation.plant.oracle.finish() == []


def test_whom_none_can_serve_is_not_sent_round_and_round_until_one_can() -> None:
    back_s = OFF_S + 1_200
    one = between(L1=2_000, L0=1_200)
    assert sent_to(one) == [SECOND_BAY, FIRST_BAY, SECOND_BAY, FIRST_BAY]
    told_us, _ = one.first(DeskOrder, lambda word: word.text is DeskText.OUT_OF_ORDER)
    again_us, _ = one.first(DeskOrder, lambda word: word.text is DeskText.GO_TO, after_us=told_us)
    assert told_us < (STREET_S + 500) * 1_000_000 < back_s * 1_000_000 < again_us
    bay, at_s = ready_at(one)
    assert bay == FIRST_BAY and at_s < back_s + 200
    assert one.simulation.plant.oracle.finish() == []
