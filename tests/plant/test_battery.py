"""A robot's battery in the plant: what work draws, what a charger gives, and what an empty one does."""

from bus_sim.devices.link import MessageFilter
from bus_sim.systems.car_park.plant.battery import RobotBattery
from onboard.contract.codes import ShuttleAction, Side
from onboard.contract.messages import BatteryState
from onboard.core.site import Segment, Station
from onboard.systems.car_park.battery import Battery
from tests.plant.support import ROBOT, SECOND, Bench, HandTimers, ListLink

#: The robot of the bench begins here; the other charger is where nobody drives.
HOME = Segment(1, 12)
#: Holds 7200 Ws.
BATTERY = Battery(2, 100, 200, 50, 10, 40, 25, 50, 80, (HOME, Segment(1, 1)))


class GaugeLink(ListLink):
    """What the gauge says, and what keeps orders from the drives."""

    def __init__(self, timers: HandTimers) -> None:
        super().__init__(timers)
        self.incoming: list[MessageFilter] = []


class PowerBench(Bench):
    """A bench whose robot has a battery."""

    def __init__(self) -> None:
        super().__init__()
        self.dead = frozenset[Segment]()
        self.gauge = GaugeLink(self.timers)
        self.battery = RobotBattery(ROBOT, BATTERY, self.world, self.timers, self.gauge, lambda: self.dead)
        self.battery.start()

    def spent_ws(self) -> float:
        """What is missing to a full battery now."""
        self.battery.look()
        return self.battery.capacity_ws - self.battery.charge_ws

    def told(self) -> BatteryState:
        return self.gauge.last(BatteryState)


def test_rest_and_driving_are_drawn_and_a_car_aboard_makes_it_more() -> None:
    bench = PowerBench()
    bench.dead = frozenset(BATTERY.chargers)
    bench.battery.look()
    bench.timers.run_for(60 * SECOND)
    assert bench.spent_ws() == 10 * 60
    # Three segments of 2.4 m at 1.5 m/s and 0.5 m/s^2: 4.8 + 3 s.
    bench.drive_to_index(9, 1)
    assert round(bench.spent_ws() - 10 * 120) == 100 * 7.8
    bench.store(Station(1, 9, Side.FAR))
    before = bench.spent_ws()
    for number, action in enumerate((ShuttleAction.REACH, ShuttleAction.GRIP, ShuttleAction.RETRACT), start=1):
        bench.shuttle(action, number)
    # The shuttle is out from its first motion until it is home: two strokes of 8.7 s, and what was between them.
    assert round(bench.spent_ws() - before - 10 * 60) == 50 * (40 + 8.7)
    before = bench.spent_ws()
    bench.drive_to_index(12, 2)
    assert round(bench.spent_ws() - before - 10 * 60) == 200 * 7.8


def test_a_robot_that_stands_at_a_charger_is_charged_until_it_is_full_and_its_gauge_tells_it() -> None:
    bench = PowerBench()
    bench.battery.set_charge(0.5)
    assert bench.told() == BatteryState(ROBOT, 500, charging=True)
    # 3600 Ws at 40 - 10 W.
    bench.timers.run_for(120 * SECOND - 1)
    assert bench.told().charge_permille < 1000
    bench.timers.run_for(1 + SECOND)
    assert bench.told() == BatteryState(ROBOT, 1000, charging=True)
    bench.timers.run_for(60 * SECOND)
    assert bench.battery.charge_ws == bench.battery.capacity_ws
    bench.drive_to_index(11, 1)
    assert bench.told().charging is False
    gaps = [later - before for (before, _), (later, _) in zip(said(bench), said(bench)[1:], strict=False)]
    assert max(gaps) <= 30 * SECOND


def said(bench: PowerBench) -> list[tuple[int, BatteryState]]:
    return bench.gauge.all(BatteryState)


def test_a_dead_charger_gives_nothing() -> None:
    bench = PowerBench()
    bench.battery.set_charge(0.5)
    bench.dead = frozenset([HOME])
    bench.battery.look()
    assert bench.told() == BatteryState(ROBOT, 500, charging=False)
    bench.timers.run_for(36 * SECOND)
    assert bench.spent_ws() == 3600 + 360


def test_an_empty_battery_moves_nothing_until_it_is_charged() -> None:
    bench = PowerBench()
    emptied: list[int] = []
    bench.battery.on_empty = lambda: emptied.append(bench.timers.now_us())
    bench.dead = frozenset(BATTERY.chargers)
    bench.battery.set_charge(0.01)
    bench.timers.run_for(7_200_000 - 10)
    assert (bench.gauge.incoming, emptied) == ([], [])
    bench.timers.run_for(20)
    assert bench.told().charge_permille == 0
    assert len(bench.gauge.incoming) == len(emptied) == 1
    bench.timers.run_for(60 * SECOND)
    bench.battery.set_charge(1.0)
    assert (bench.gauge.incoming, len(emptied)) == ([], 1)


def test_it_ages() -> None:
    bench = PowerBench()
    bench.dead = frozenset(BATTERY.chargers)
    bench.battery.ageing = 10.0
    bench.battery.look()
    bench.timers.run_for(10 * SECOND)
    assert bench.spent_ws() == 10 * 10 * 10


def test_the_gauge_answers_when_the_controller_asks() -> None:
    bench = PowerBench()
    before = len(said(bench))
    bench.gauge.ask()
    assert len(said(bench)) == before + 1
