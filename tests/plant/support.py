"""A clock to be turned by hand, a device bus that is a list, and a small controller's side of it."""

import heapq
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVar

from bus_sim.devices.link import MessageHandler
from bus_sim.systems.car_park.plant.bodies import CarBody
from bus_sim.systems.car_park.plant.carrier import Carrier
from bus_sim.systems.car_park.plant.compartment import CompartmentPlant
from bus_sim.systems.car_park.plant.lift import LiftDrive
from bus_sim.systems.car_park.plant.oracle import Oracle
from bus_sim.systems.car_park.plant.shuttle import Shuttle
from bus_sim.systems.car_park.plant.street import Street
from bus_sim.systems.car_park.plant.world import CarParkWorld
from onboard.config.site import parse_site
from onboard.contract.codes import DoorAction, DoorName, LightColour, ShuttleAction, Side
from onboard.contract.messages import DoorOrder, DriveOrder, LightOrder, Message, ShuttleOrder
from onboard.core.site import Station
from onboard.systems.car_park.site import CarPark, car_park
from onboard.ways.site import WaySite
from tests.sites import one_floor

M = TypeVar("M", bound=Message)
SECOND = 1_000_000
ROBOT = 11
COMPARTMENT = 1
#: Lifts of ``three_floors``: at the left and at the right end.
LEFT, RIGHT = 5, 6
CAR = CarBody("blue", 2700, 4300, 1500, 1400)


THREE_FLOORS = """
[site]
name = "test"
[floors]
count = 3
positions = 6
[floors.3]
positions = {upper}
[[compartments]]
name = "IOC1"
node = 1
at = "p(1,4)"
[[lifts]]
name = "ER1"
node = 5
end = "left"
floors = {left}
[[lifts]]
name = "ER2"
node = 6
end = "right"
[[robots]]
name = "MR1"
node = 11
home = "{home}"
[[robots]]
name = "MR2"
node = 12
home = "p(3,4)"
"""


def three_floors(home: str = "p(1,2)", upper: int = 6) -> CarPark:
    """Three alleys between two lifts; MR1 (node 11) at ``home``, MR2 at p(3,4); ``upper`` positions on floor 3.

    Where these are fewer than below, the alley begins further to the right, and the left lift does not stop there.
    """
    text = THREE_FLOORS.format(home=home, upper=upper, left=[1, 2, 3] if upper == 6 else [1, 2])
    return car_park(parse_site(text, "test.toml", crowded=True))


@dataclass
class HandTimer:
    callback: Callable[[], object] | None

    def cancel(self) -> None:
        self.callback = None


class HandTimers:
    """Timers that fire in the order of (time, setting) when the test lets time pass."""

    def __init__(self) -> None:
        self._now_us = 0
        self._count = 0
        self._heap: list[tuple[int, int, HandTimer]] = []

    def now_us(self) -> int:
        return self._now_us

    def call_at(self, when_us: int, callback: Callable[[], object]) -> HandTimer:
        timer = HandTimer(callback)
        self._count += 1
        heapq.heappush(self._heap, (max(when_us, self._now_us), self._count, timer))
        return timer

    def run_until(self, time_us: int) -> None:
        while self._heap and self._heap[0][0] <= time_us:
            self._now_us, _, timer = heapq.heappop(self._heap)
            if timer.callback is not None:
                timer.callback()
        self._now_us = time_us

    def run_for(self, span_us: int) -> None:
        self.run_until(self._now_us + span_us)


class ListLink:
    """A device bus of one machine: what the devices said, with times, and a way to give orders."""

    def __init__(self, timers: HandTimers) -> None:
        self.said: list[tuple[int, Message]] = []
        self.controllers: list[Callable[[Message], None]] = []
        self._timers = timers
        self._handlers: list[MessageHandler] = []
        self._answers: list[Callable[[], None]] = []

    def send(self, message: Message) -> None:
        self.said.append((self._timers.now_us(), message))
        for controller in self.controllers:
            controller(message)

    def subscribe(self, on_message: MessageHandler) -> None:
        self._handlers.append(on_message)

    def answer(self, say: Callable[[], None]) -> None:
        self._answers.append(say)

    def ask(self) -> None:
        for say in self._answers:
            say()

    def order(self, message: Message) -> None:
        for handler in self._handlers:
            handler(message, self._timers.now_us())

    def all(self, kind: type[M]) -> list[tuple[int, M]]:
        return [(time_us, message) for time_us, message in self.said if isinstance(message, kind)]

    def last(self, kind: type[M]) -> M:
        return self.all(kind)[-1][1]


@dataclass
class Bench:
    """A plant without controllers."""

    site: WaySite = field(default_factory=one_floor)
    timers: HandTimers = field(default_factory=HandTimers)

    def __post_init__(self) -> None:
        self.links: dict[int, ListLink] = {node: ListLink(self.timers) for node in self.site.machines}
        self.world = CarParkWorld(self.site, self.timers)
        self.oracle = Oracle(self.world)
        self.shuttles: dict[int, Shuttle] = {}
        self.carriers: dict[int, Carrier] = {}
        self.compartments: dict[int, CompartmentPlant] = {}
        self.lifts: dict[int, LiftDrive] = {}
        for node in self.world.robots:
            link = self.links[node]
            shuttle = self.shuttles[node] = Shuttle(node, self.site, self.world, self.timers, link)
            self.carriers[node] = Carrier(node, self.site, self.world, self.timers, link, shuttle.is_home)
            shuttle.start()
            self.carriers[node].start()
        for node in self.world.platforms:
            self.lifts[node] = LiftDrive(node, self.site, self.world, self.timers, self.links[node])
            self.lifts[node].start()
        for node in self.world.bays:
            self.compartments[node] = CompartmentPlant(node, self.site, self.world, self.timers, self.links[node])
            self.compartments[node].start()
        self.street = Street(self.compartments, self.world, self.oracle, self.timers, seed=5)

    @property
    def rules(self) -> list[str]:
        """Names of the invariants found broken up to now."""
        return [violation.rule.name for violation in self.oracle.finish()]

    def position_mm(self, node: int = ROBOT) -> float:
        return self.world.robots[node].motion.at(self.timers.now_us())[0]

    def drive(self, target_mm: int, sequence: int, node: int = ROBOT, for_us: int = 60 * SECOND) -> None:
        """Repeat one drive order every 200 ms, as a controller does, for a time."""
        end_us = self.timers.now_us() + for_us
        while self.timers.now_us() < end_us:
            self.links[node].order(DriveOrder(node, sequence, target_mm, 1500))
            self.timers.run_for(min(200_000, end_us - self.timers.now_us()))

    def drive_to_index(self, index: int, sequence: int, node: int = ROBOT) -> None:
        self.drive((index - 1) * 2400, sequence, node)

    def shuttle(self, action: ShuttleAction, sequence: int, side: Side = Side.FAR, wheelbase_mm: int = 2700) -> None:
        self.links[ROBOT].order(ShuttleOrder(ROBOT, sequence, action, side, wheelbase_mm))
        self.timers.run_for(20 * SECOND)

    def door(self, door: DoorName, action: DoorAction) -> None:
        self.links[COMPARTMENT].order(DoorOrder(COMPARTMENT, 1, door, action))
        self.timers.run_for(4 * SECOND)

    def light(self, colour: LightColour) -> None:
        self.links[COMPARTMENT].order(LightOrder(COMPARTMENT, colour))

    def store(self, station: Station, car: CarBody = CAR) -> None:
        """A car that stands at a place from the beginning."""
        self.world.cars[car.name] = car
        self.world.where[car.name] = station
        # Told to nobody: the oracle takes it as the stock it found.
        self.oracle.take_stock()
