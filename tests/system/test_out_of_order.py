"""Who waits at a desk for a robot that does not come reads that, and reads when it is worth waiting again."""

import pytest

from bus_sim.campaign.report import RunVerdict
from bus_sim.faults.arm import arm
from bus_sim.faults.injection import parse_injection
from bus_sim.systems.car_park.demand import Arrivals
from bus_sim.systems.car_park.simulation import Simulation
from onboard.config.site import parse_site
from onboard.contract.codes import DeskText, Reason
from onboard.contract.messages import DeskOrder, Halted
from onboard.systems.car_park.outage import OUT_AFTER_US
from onboard.systems.car_park.site import car_park
from tests.sites import one_floor
from tests.system.scenarios import played
from tests.system.scene import Scene, play, stays

#: Two cars are parked by then; the owner of the first comes at 200 s, that of the second at 210 s.
COME_S, NEXT_S = 200, 210
FIRST, SECOND = 1, 2


def scene(fault: str) -> Scene:
    def break_it(simulation: Simulation) -> None:
        arm(simulation, (parse_injection(fault),))

    return play(one_floor(), stays((0, COME_S), (60, NEXT_S)), before=break_it, limit_s=700)


def texts(scene: Scene, number: int) -> list[DeskText]:
    """What the desk shows the owner of a car, each as often as it is another than before."""
    shown = [one.text for _, one in scene.all(DeskOrder) if one.car.number == number]
    return [text for text, before in zip(shown, [None, *shown], strict=False) if text is not before]


def test_who_waits_behind_a_robot_that_stands_is_told_so_and_told_when_it_goes_on() -> None:
    stuck = scene(f"actuator_stuck:target=MR1,at_s={COME_S + 15},for_s=100")
    since_us, word = stuck.first(Halted)
    assert (word.reason, word.needs_person) == (Reason.ACTUATOR_FAULT, True)
    told_us, _ = stuck.first(DeskOrder, lambda one: one.text is DeskText.OUT_OF_ORDER)
    assert OUT_AFTER_US - 3_000_000 <= told_us - since_us <= OUT_AFTER_US + 3_000_000
    for number in (FIRST, SECOND):
        assert texts(stuck, number)[-4:] == [
            DeskText.PLEASE_WAIT,
            DeskText.OUT_OF_ORDER,
            DeskText.PLEASE_WAIT,
            DeskText.CAR_READY,
        ]
    assert stuck.simulation.plant.street.summary().served == 2


def test_nobody_hears_so_for_a_machine_that_is_only_started_again() -> None:
    crash = scene(f"crash:target=MR1,at_s={COME_S + 15},restart_s=10")
    assert all(DeskText.OUT_OF_ORDER not in texts(crash, number) for number in (FIRST, SECOND))
    assert crash.simulation.plant.street.summary().served == 2


@pytest.mark.parametrize("at_s", [COME_S - 20, COME_S + 15])
def test_a_robot_that_is_off_is_told_to_those_who_wait(at_s: int) -> None:
    """Before the first has asked nobody has the task, and all robots of the site stand."""
    off = scene(f"crash:target=MR1,at_s={at_s},restart_s=900")
    assert all(texts(off, number)[-1] is DeskText.OUT_OF_ORDER for number in (FIRST, SECOND))


@pytest.mark.parametrize(("at_s", "limit_s"), [(845, 1_000), (865, 1_300)], ids=["it has the task", "it is in the way"])
def test_whom_a_robot_with_a_fault_keeps_waiting_is_told_why(at_s: int, limit_s: int) -> None:
    """Found by a campaign (small, all faults, 30126), in which MR1 failed at its next place; here it is stuck there."""
    report = played(
        "small",
        30126,
        Arrivals(6, 120, 60, 200),
        "sensor_off:at_s=681.147476,target=MR2",
        f"actuator_stuck:at_s={at_s},target=MR1,for_s=600",
        limit_s=limit_s,
    )
    assert (report.verdict, report.waiting, report.told) == (RunVerdict.TOLD, 0, 4)
    assert (report.violations, report.stalls) == ((), ())


#: One bay, two robots, and more than one way round.
ONE_BAY = """
[site]
name = "one-bay"
[floors]
count = 3
positions = 12
sides = ["far"]
[[lifts]]
name = "ER1"
node = 100
end = "left"
[[lifts]]
name = "ER2"
node = 101
doors = ["p(*,10)N"]
[[spurs]]
at = "p(1,8)"
side = "near"
length = 1
[[spurs]]
at = "p(*,6)"
side = "far"
length = 1
[[compartments]]
name = "IOC1"
node = 1
at = "p(1,6)"
side = "near"
[[robots]]
name = "MR1"
node = 11
home = "p(195,1)"
[[robots]]
name = "MR2"
node = 12
home = "p(192,1)"
[negotiation]
call_at = "arrival"
place = "random"
"""


def test_a_car_that_a_robot_keeps_aboard_holds_up_nobody_else_at_its_bay() -> None:
    """All whose tickets came after its own waited at that bay for as long as it stood (drawn car parks, 3987)."""
    site = car_park(parse_site(ONE_BAY, "one-bay.toml"))
    fault = parse_injection("actuator_stuck:target=MR2,at_s=75,for_s=3000")
    kept = play(site, stays((0, 300), (60, 310), (120, 320)), before=lambda one: arm(one, (fault,)), limit_s=1_500)
    assert [texts(kept, number)[-1] for number in (1, 2, 3)] == [
        DeskText.OUT_OF_ORDER,
        DeskText.CAR_READY,
        DeskText.CAR_READY,
    ]
