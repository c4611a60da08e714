"""Where the time of each compartment goes: who or what holds its bay, and who waits before it; seen in the plant."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import partial

from bus_sim.systems.car_park.plant.compartment import CompartmentPlant
from bus_sim.systems.car_park.plant.customer import Customer, CustomerState
from bus_sim.systems.car_park.plant.plant import Plant
from onboard.contract.codes import DoorName, DoorPosition

#: A bay that is free for longer than this while somebody could use it is idle, us: a driver needs a second to go.
IDLE_AFTER_US = 5_000_000
#: Positions of a door that has not come to its end.
_MOVING = (DoorPosition.OPENING, DoorPosition.CLOSING, DoorPosition.CLOSED)


class BayHold(Enum):
    """What a compartment's bay waits for."""

    FREE = "free"
    PERSON = "person"
    DOOR = "door"
    SHUTTLE = "shuttle"
    ROBOT = "robot"


@dataclass(frozen=True)
class BayFigures:
    """One compartment: cars, and shares of time, 0 to 1, that make 1 together without ``idle`` and ``kept``.

    ``idle`` is the part of ``free`` that lasted for more than ``IDLE_AFTER_US`` while somebody queued with a car or a
    robot stood before the bay with a car for it; ``kept`` the part of ``robot`` that lasted so long with a bay locked
    and empty, for a car that is on its way, while somebody queued. ``queue`` counts cars outside, ``asking`` people who
    wait for theirs.
    """

    compartment: str
    cars_in: int
    cars_out: int
    free: float
    idle: float
    kept: float
    person: float
    door: float
    shuttle: float
    robot: float
    queue_mean: float
    queue_most: int
    asking_mean: float
    asking_most: int


@dataclass
class _Bay:
    """What is counted of one compartment; times in us."""

    hold: BayHold = BayHold.FREE
    since_us: int = 0
    held_us: Counter[BayHold] = field(default_factory=Counter)
    #: Whether nobody is in it though somebody could use it, since when, and for how long in all.
    wasted: BayHold | None = None
    wasted_from_us: int = 0
    wasted_us: Counter[BayHold] = field(default_factory=Counter)
    cars_in: int = 0
    cars_out: int = 0
    #: Waiting now, their time in all, and most at once: with a car outside, with a ticket.
    waiting: tuple[int, int] = (0, 0)
    waited_us: tuple[int, int] = (0, 0)
    most: tuple[int, int] = (0, 0)


class BayTimes:
    """Looks at all compartments of a plant whenever one of them, or the street, changes."""

    def __init__(self, plant: Plant) -> None:
        self._plant = plant
        self._names = {node: plant.world.site.machines[node].name for node in plant.compartments}
        self._bays: Mapping[int, _Bay] = {node: _Bay() for node in plant.compartments}
        self._begin_us = 0
        for node, compartment in plant.compartments.items():
            compartment.watch(partial(self._look, node))
        plant.street.watch(self._on_step)
        self.begin()

    def begin(self) -> None:
        """Count from now on; what is held, and who waits, is as it is."""
        self._begin_us = now_us = self._plant.timers.now_us()
        self._bays = {node: _Bay(since_us=now_us) for node in self._bays}
        for node in self._bays:
            self._look(node)

    def figures(self) -> tuple[BayFigures, ...]:
        """What was counted until now, in the order of node-IDs."""
        for node in self._bays:
            self._look(node)
        span_us = max(1, self._plant.timers.now_us() - self._begin_us)
        return tuple(self._of(node, bay, span_us) for node, bay in sorted(self._bays.items()))

    def _of(self, node: int, bay: _Bay, span_us: int) -> BayFigures:
        return BayFigures(
            compartment=self._names[node],
            cars_in=bay.cars_in,
            cars_out=bay.cars_out,
            idle=bay.wasted_us[BayHold.FREE] / span_us,
            kept=bay.wasted_us[BayHold.ROBOT] / span_us,
            queue_mean=bay.waited_us[0] / span_us,
            queue_most=bay.most[0],
            asking_mean=bay.waited_us[1] / span_us,
            asking_most=bay.most[1],
            **{hold.value: bay.held_us[hold] / span_us for hold in BayHold},
        )

    def _on_step(self, customer: Customer) -> None:
        place, now_us = customer.compartment, self._plant.timers.now_us()
        if place is not None:
            bay = self._bays[place.node_id]
            bay.cars_in += customer.visit.parked_us == now_us and customer.state is CustomerState.PARKED
            bay.cars_out += customer.visit.gone_us == now_us and customer.visit.parked_us is not None
            self._look(place.node_id)

    def _look(self, node: int) -> None:
        """Count the time since the last look, and see how it stands now."""
        bay, compartment, now_us = self._bays[node], self._plant.compartments[node], self._plant.timers.now_us()
        passed_us = now_us - bay.since_us
        bay.held_us[bay.hold] += passed_us
        bay.waited_us = (
            bay.waited_us[0] + passed_us * bay.waiting[0],
            bay.waited_us[1] + passed_us * bay.waiting[1],
        )
        bay.since_us, bay.hold = now_us, held_by(compartment)
        states = Counter(customer.state for customer in self._plant.street.waiting(node))
        bay.waiting = states[CustomerState.QUEUEING], states[CustomerState.AT_DESK]
        bay.most = max(bay.most[0], bay.waiting[0]), max(bay.most[1], bay.waiting[1])
        wasted = self._wasted(bay, compartment)
        if wasted is bay.wasted:
            return
        passed_us = now_us - max(bay.wasted_from_us, self._begin_us)
        if bay.wasted is not None and passed_us > IDLE_AFTER_US:
            bay.wasted_us[bay.wasted] += passed_us
        bay.wasted, bay.wasted_from_us = wasted, now_us

    def _wasted(self, bay: _Bay, compartment: CompartmentPlant) -> BayHold | None:
        """How nobody is in a bay that somebody could use: invited to it, or shut out."""
        is_queue = bay.waiting[0] > 0
        if bay.hold is BayHold.FREE:
            return BayHold.FREE if is_queue or self._is_brought(compartment) else None
        return BayHold.ROBOT if bay.hold is BayHold.ROBOT and is_queue and compartment.is_empty else None

    def _is_brought(self, compartment: CompartmentPlant) -> bool:
        """Whether a robot stands before the bay with a car whose owner asks for it there, not with one from the bay."""
        world = self._plant.world
        robot = world.robot_before(compartment.body.station)
        car = None if robot is None else world.car_aboard(robot)
        askers = (one for one in self._plant.street.waiting(compartment.node_id) if one.state is CustomerState.AT_DESK)
        return car is not None and any(asker.stay.car == car for asker in askers)


def held_by(compartment: CompartmentPlant) -> BayHold:
    """What holds a bay now. An open output door is the shuttle's, even before it reaches in and after it is home."""
    doors = compartment.body.doors
    is_input_open = doors[DoorName.INPUT] is DoorPosition.OPEN
    if is_input_open and compartment.is_empty:
        return BayHold.FREE
    if doors[DoorName.OUTPUT] is DoorPosition.OPEN:
        return BayHold.SHUTTLE
    if compartment.body.persons or compartment.body.crossing or is_input_open:
        return BayHold.PERSON
    return BayHold.DOOR if any(position in _MOVING for position in doors.values()) else BayHold.ROBOT


def bay_lines(bays: tuple[BayFigures, ...]) -> list[str]:
    """The figures as a person reads them: a row for each compartment."""
    head = "bay       in   out   free  idle  kept person  door shuttle no robot  queue most  asking most"
    return [head, *(_line(one) for one in bays)] if bays else []


def _line(bay: BayFigures) -> str:
    shares = (bay.free, bay.idle, bay.kept, bay.person, bay.door, bay.shuttle, bay.robot)
    return (
        f"{bay.compartment:<7}{bay.cars_in:>5}{bay.cars_out:>6}"
        + "".join(f"{share:>{width}.1%}" for share, width in zip(shares, (7, 6, 6, 7, 6, 8, 9), strict=True))
        + f"{bay.queue_mean:>7.1f}{bay.queue_most:>5}{bay.asking_mean:>8.1f}{bay.asking_most:>5}"
    )
