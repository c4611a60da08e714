"""A script that runs one compartment and one robot through the device messages alone: no negotiation, no plans."""

from collections import deque
from collections.abc import Callable, Iterator

from onboard.contract.codes import (
    DeskInput,
    DeskText,
    DoorAction,
    DoorName,
    DoorPosition,
    DriveMode,
    LightColour,
    ShuttleAction,
    ShuttleMode,
)
from onboard.contract.messages import (
    BayState,
    DeskEvent,
    DeskOrder,
    DoorOrder,
    DoorState,
    DriveOrder,
    DriveState,
    LightOrder,
    Message,
    Reference,
    ShuttleOrder,
    ShuttleState,
)
from onboard.core.site import Station
from onboard.systems.car_park.site import car_park
from onboard.systems.car_park.tickets import TicketCodes
from tests.plant.support import COMPARTMENT, ROBOT, Bench

NO_CAR = Reference(0, 0)
Script = Iterator[Callable[[], bool]]


class Valet:
    """Serves customers one after the other. ``capacity`` places are used; ``deaf`` desk events of a kind are missed."""

    def __init__(self, bench: Bench, capacity: int = 20, deaf_to_cancel: bool = False) -> None:
        self.bench = bench
        self.bay = bench.site.compartments[COMPARTMENT]
        self.free = deque(bench.site.places[:capacity])
        self.parked: dict[Reference, tuple[Station, int]] = {}
        self.tickets: deque[Reference] = deque()
        self.deaf_to_cancel = deaf_to_cancel
        self.cancelled: Reference | None = None
        self.key = False
        self.number = self.sequence = 0
        self.seen: dict[type[Message], Message] = {}
        self.events: set[int] = set()
        for node in (COMPARTMENT, ROBOT):
            for _, message in bench.links[node].said:
                self.hear(message)
            bench.links[node].controllers.append(self.hear)
        self.script = self.work()
        self.condition: Callable[[], bool] = lambda: True
        self.tick()

    def hear(self, message: Message) -> None:
        self.seen[type(message)] = message
        if not isinstance(message, DeskEvent) or message.sequence in self.events:
            return
        self.events.add(message.sequence)
        if message.event is DeskInput.KEY:
            self.key = True
        elif message.event is DeskInput.TICKET:
            known = message.car in self.parked
            if known:
                self.tickets.append(message.car)
            self.desk(DeskText.PLEASE_WAIT if known else DeskText.UNKNOWN_TICKET, message.car)
        elif not self.deaf_to_cancel:
            self.cancelled = message.car

    def tick(self) -> None:
        for _ in range(50):
            if not self.condition():
                break
            self.condition = next(self.script)
        self.bench.timers.call_at(self.bench.timers.now_us() + 100_000, self.tick)

    # --- orders, each with the condition that ends it ----------------------------------------------------------

    def next(self) -> int:
        self.sequence = self.sequence % 255 + 1
        return self.sequence

    def desk(self, text: DeskText, car: Reference = NO_CAR) -> None:
        number = self.next()
        for half in TicketCodes().halves(COMPARTMENT, number, car) if text is DeskText.TAKE_TICKET else ():
            self.bench.links[COMPARTMENT].order(half)
        self.bench.links[COMPARTMENT].order(DeskOrder(COMPARTMENT, number, text, car))

    def light(self, colour: LightColour) -> None:
        self.bench.links[COMPARTMENT].order(LightOrder(COMPARTMENT, colour))

    def door(self, door: DoorName, action: DoorAction) -> Callable[[], bool]:
        self.bench.links[COMPARTMENT].order(DoorOrder(COMPARTMENT, self.next(), door, action))
        wanted = DoorPosition.OPEN if action is DoorAction.OPEN else DoorPosition.LOCKED
        name = "input_door" if door is DoorName.INPUT else "output_door"
        return lambda: getattr(self.seen[DoorState], name) is wanted

    def drive(self, station: Station) -> Callable[[], bool]:
        number, target_mm = self.next(), self.bench.site.position_mm(station.segment)

        def arrived() -> bool:
            state = self.seen[DriveState]
            assert isinstance(state, DriveState)
            if state.mode is DriveMode.STANDING and state.position_mm == target_mm:
                return True
            self.bench.links[ROBOT].order(DriveOrder(ROBOT, number, target_mm, 1500))
            return False

        return arrived

    def shuttle(self, action: ShuttleAction, station: Station, wheelbase_mm: int) -> Callable[[], bool]:
        number = self.next()
        self.bench.links[ROBOT].order(ShuttleOrder(ROBOT, number, action, station.side, wheelbase_mm))
        end = ShuttleMode.HOME if action is ShuttleAction.RETRACT else ShuttleMode.REACHED

        def done() -> bool:
            state = self.seen[ShuttleState]
            assert isinstance(state, ShuttleState)
            assert state.mode is not ShuttleMode.FAULT, self.bench.shuttles[ROBOT].fault
            return state.sequence == number and state.mode is end

        return done

    # --- the script --------------------------------------------------------------------------------------------

    def bay_state(self) -> BayState:
        state = self.seen[BayState]
        assert isinstance(state, BayState)
        return state

    def work(self) -> Script:
        while True:
            yield self.door(DoorName.INPUT, DoorAction.OPEN)
            bay = self.bay_state()
            if not bay.load_kg and not bay.person_inside:
                self.light(LightColour.GREEN)
            yield lambda: self.key or bool(self.tickets)
            if self.key:
                self.key = False
                yield from self.admit()
            else:
                yield from self.fetch(self.tickets.popleft())

    def admit(self) -> Script:
        bay = self.bay_state()
        if not bay.load_kg:
            return
        self.light(LightColour.RED)
        if bay.length_mm > car_park(self.bench.site).cars.max_length_mm or not self.free:
            self.desk(DeskText.CAR_TOO_LARGE if self.free else DeskText.FULL)
            yield self.is_empty
            return
        self.number += 1
        car = Reference(COMPARTMENT, self.number)
        self.desk(DeskText.TAKE_TICKET, car)
        yield lambda: not self.bay_state().person_inside
        if self.cancelled is None:
            yield self.after(self.bench.timers.now_us() + 5_000_000)
        if self.cancelled == car:
            self.desk(DeskText.CAR_READY, car)
            yield self.is_empty
            return
        yield self.door(DoorName.INPUT, DoorAction.CLOSE)
        place = self.free.popleft()
        yield from self.carry(self.bay, place, bay.wheelbase_mm)
        self.parked[car] = (place, bay.wheelbase_mm)

    def fetch(self, car: Reference) -> Script:
        self.light(LightColour.RED)
        locked = self.door(DoorName.INPUT, DoorAction.CLOSE)
        yield lambda: locked() or not self.is_empty()
        if not self.is_empty():
            # Somebody still drove in: they go first.
            self.tickets.appendleft(car)
            return
        place, wheelbase_mm = self.parked.pop(car)
        yield from self.carry(place, self.bay, wheelbase_mm)
        self.free.append(place)
        yield self.door(DoorName.INPUT, DoorAction.OPEN)
        self.desk(DeskText.CAR_READY, car)
        yield self.is_empty

    def carry(self, source: Station, sink: Station, wheelbase_mm: int) -> Script:
        for station, action in ((source, ShuttleAction.GRIP), (sink, ShuttleAction.RELEASE)):
            yield self.drive(station)
            if station == self.bay:
                yield self.door(DoorName.OUTPUT, DoorAction.OPEN)
            for step in (ShuttleAction.REACH, action, ShuttleAction.RETRACT):
                yield self.shuttle(step, station, wheelbase_mm)
            if station == self.bay:
                yield self.door(DoorName.OUTPUT, DoorAction.CLOSE)

    def is_empty(self) -> bool:
        return not self.bay_state().load_kg and not self.bay_state().person_inside

    def after(self, time_us: int) -> Callable[[], bool]:
        return lambda: self.bench.timers.now_us() >= time_us or self.cancelled is not None
