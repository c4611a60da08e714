"""A compartment's devices: two interlocked doors, light, desk with ticket printer, and the bay's sensors (row P30).

The interlock is wired, not programmed: whatever a controller orders, a door opens only while the other is LOCKED, and
the output door only while the light curtain sees nobody (row P60).
"""

from collections.abc import Callable

from bus_sim.devices.link import DeviceBusLink
from bus_sim.devices.timers import Timer, Timers
from bus_sim.systems.car_park.plant.bodies import CarBody
from bus_sim.systems.car_park.plant.door import Door
from bus_sim.systems.car_park.plant.world import BayBody, CarParkWorld, WorldChange
from onboard.contract.announce_device import DeskFetch, DeskFetchAnswer
from onboard.contract.car_park_device import DeskPromise
from onboard.contract.codes import DeskInput, DeskText, DoorName, DoorPosition, LightColour
from onboard.contract.messages import (
    BayState,
    DeskEvent,
    DeskOrder,
    DoorOrder,
    DoorState,
    LightOrder,
    Message,
    Reference,
    TicketPrint,
    TicketRead,
)
from onboard.core.serial import successor
from onboard.systems.car_park.site import car_park
from onboard.systems.car_park.tickets import Ticket, TicketHalves, split
from onboard.ways.site import WaySite

#: DoorState and BayState are repeated this often where nothing changes (dbc/device.dbc).
REPEAT_US = 10_000_000
#: DeskEvent is said so many times, this far apart, us, as one lost frame must not lose a customer (dbc/device.dbc).
DESK_TIMES = 3
DESK_GAP_US = 50_000
#: No car: the reference on the desk and in DeskEvent of the key.
NO_CAR = Reference(0, 0)


class CompartmentPlant:
    """Doors, light, desk and sensors of one compartment, and what a person standing before it sees.

    ``watch`` tells whenever something visible changed; ``watch_desk`` tells every text that the desk shows, with the
    car's number; TAKE_TICKET prints a ticket of that number, once its code has come. A DeskOrder like the last
    one is not shown again.
    """

    def __init__(self, node_id: int, site: WaySite, world: CarParkWorld, timers: Timers, link: DeviceBusLink) -> None:
        self.node_id = node_id
        self.light = LightColour.RED
        self.text = DeskText.WELCOME
        self.text_car = NO_CAR
        #: The compartment that the desk's text names; 0: none.
        self.text_compartment = 0
        self.tickets_printed: list[Ticket] = []
        self._world = world
        self._timers = timers
        self._link = link
        self._desk_sequence = 0
        self._desk_order: DeskOrder | None = None
        self._halves = TicketHalves()
        #: What was read for the act that comes next.
        self._read: Ticket | None = None
        self._told: BayState | None = None
        self._repeat_timer: Timer | None = None
        self._watchers: list[Callable[[], None]] = []
        self._desk_watchers: list[Callable[[DeskText, Reference], None]] = []
        self._promise_watchers: list[Callable[[DeskPromise], None]] = []
        self._answer_watchers: list[Callable[[DeskFetchAnswer], None]] = []
        travel_us = car_park(site).timing.door_us
        self._sees_width = car_park(site).measures_width
        self.doors = {
            DoorName.INPUT: Door(
                timers,
                travel_us,
                lambda: self._is_locked(DoorName.OUTPUT),
                lambda: not (self.body.persons or self.body.crossing),
                lambda position: self._door_moved(DoorName.INPUT, position),
            ),
            DoorName.OUTPUT: Door(
                timers,
                travel_us,
                lambda: self._is_locked(DoorName.INPUT) and not self.body.persons,
                lambda: world.shuttle_in(self.body.station) is None,
                lambda position: self._door_moved(DoorName.OUTPUT, position),
            ),
        }
        link.subscribe(self._on_message)
        link.answer(self._say_all)
        world.watch(self._on_change)

    def start(self) -> None:
        """Power on: say what doors, light and bay are, then again slowly."""
        self._say_all()

    @property
    def body(self) -> BayBody:
        """The compartment as it is."""
        return self._world.bays[self.node_id]

    @property
    def car(self) -> CarBody | None:
        """The car in the bay."""
        return next(iter(self._world.cars_at(self.body.station)), None)

    @property
    def is_empty(self) -> bool:
        """Whether neither car nor person is in the bay or on its sill."""
        return self.car is None and not self.body.persons and not self.body.crossing

    @property
    def is_input_open(self) -> bool:
        """Whether one could walk or drive in."""
        return self.doors[DoorName.INPUT].position is DoorPosition.OPEN

    @property
    def invites(self) -> bool:
        """What a waiting driver looks at: light green, input door open, bay empty."""
        return self.light is LightColour.GREEN and self.is_input_open and self.is_empty

    def watch(self, watcher: Callable[[], None]) -> None:
        """Call ``watcher`` after every visible change."""
        self._watchers.append(watcher)

    def watch_desk(self, watcher: Callable[[DeskText, Reference], None]) -> None:
        """Call ``watcher`` with every text shown."""
        self._desk_watchers.append(watcher)

    def watch_promises(self, watcher: Callable[[DeskPromise], None]) -> None:
        """Call ``watcher`` with every promise shown."""
        self._promise_watchers.append(watcher)

    def watch_answers(self, watcher: Callable[[DeskFetchAnswer], None]) -> None:
        """Call ``watcher`` with what is shown of every announced time."""
        self._answer_watchers.append(watcher)

    # --- what people do at the desk ----------------------------------------------------------------------------

    def press_key(self, *, charging: bool = False) -> None:
        """The key: "park my car", or "park it where it is charged"."""
        self._desk_event(DeskInput.CHARGING_KEY if charging else DeskInput.KEY, NO_CAR)

    def read_ticket(self, ticket: Ticket) -> None:
        """A ticket goes in: it is read before it has gone in whole, which is the act."""
        self._read = ticket
        self._say_code(successor(self._desk_sequence, 8), ticket)

    def insert_ticket(self, ticket: Ticket) -> None:
        """A ticket: "fetch my car"."""
        self._desk_event(DeskInput.TICKET, ticket.car, ticket)

    def press_cancel(self, ticket: Ticket) -> None:
        """The cancel key with a ticket in the slot: "I want it back at once"."""
        self._desk_event(DeskInput.CANCEL, ticket.car, ticket)

    def announce(self, ticket: Ticket, in_s: int) -> None:
        """A ticket is shown, and its driver says in how many seconds the car will be fetched."""
        self._desk_sequence = successor(self._desk_sequence, 8)
        said = DeskFetch(self.node_id, self._desk_sequence, ticket.car, in_s)
        self._say_act(said, ticket)
        for time in range(1, DESK_TIMES):
            self._timers.call_at(self._timers.now_us() + time * DESK_GAP_US, lambda: self._say_act(said, ticket))

    def _desk_event(self, event: DeskInput, car: Reference, ticket: Ticket | None = None) -> None:
        self._desk_sequence = successor(self._desk_sequence, 8)
        said, was_read = DeskEvent(self.node_id, self._desk_sequence, event, car), self._read
        self._read = None
        if ticket is not None and was_read != ticket:
            self._say_code(said.sequence, ticket)
        self._link.send(said)
        for time in range(1, DESK_TIMES):
            self._timers.call_at(self._timers.now_us() + time * DESK_GAP_US, lambda: self._say_act(said, ticket))

    def _say_act(self, said: DeskEvent | DeskFetch, ticket: Ticket | None) -> None:
        if ticket is not None:
            self._say_code(said.sequence, ticket)
        self._link.send(said)

    def _say_code(self, sequence: int, ticket: Ticket) -> None:
        for half, code in enumerate(split(ticket.code)):
            self._link.send(TicketRead(self.node_id, sequence, half, code))

    # --- orders ------------------------------------------------------------------------------------------------

    def _on_message(self, message: Message, _: int) -> None:
        if isinstance(message, DoorOrder):
            self.doors[message.door].order(message.action)
            self._say_doors()
        elif isinstance(message, LightOrder):
            changed = message.colour is not self.light
            self.light = message.colour
            self._say_doors()
            if changed:
                self._notify()
        elif isinstance(message, TicketPrint):
            self._halves.take(message)
        elif isinstance(message, DeskOrder) and message != self._desk_order:
            self._obey(message)
        elif isinstance(message, DeskPromise):
            for watcher in self._promise_watchers:
                watcher(message)
        elif isinstance(message, DeskFetchAnswer):
            for answered in self._answer_watchers:
                answered(message)

    def _obey(self, order: DeskOrder) -> None:
        code = self._halves.code(order.sequence)
        is_ticket = order.text is DeskText.TAKE_TICKET
        if is_ticket and code is None:
            return
        self._desk_order = order
        if is_ticket and code is not None:
            self.tickets_printed.append(Ticket(order.car, code))
        self.text_compartment = order.compartment
        self._show(order.text, order.car)

    def _show(self, text: DeskText, car: Reference) -> None:
        self.text, self.text_car = text, car
        for watcher in list(self._desk_watchers):
            watcher(text, car)

    # --- sensors -----------------------------------------------------------------------------------------------

    def door_state(self) -> DoorState:
        """Both doors and the light now."""
        positions = self.body.doors
        return DoorState(self.node_id, positions[DoorName.INPUT], positions[DoorName.OUTPUT], self.light)

    def bay_state(self) -> BayState:
        """What load cells, measuring curtain and presence sensors see now.

        The curtain measures widths where the site limits them.
        """
        car = self.car
        in_front = self._world.carrier_in_front(self.body.station)
        person = self.body.persons > 0 or self.body.crossing
        if car is None:
            return BayState(self.node_id, 0, 0, 0, 0, person, in_front, 0)
        sizes = (car.mass_kg, car.length_mm, car.height_mm, car.wheelbase_mm)
        return BayState(self.node_id, *sizes, person, in_front, car.width_mm if self._sees_width else 0)

    def _is_locked(self, door: DoorName) -> bool:
        return self.body.doors[door] is DoorPosition.LOCKED

    def _door_moved(self, door: DoorName, position: DoorPosition) -> None:
        self._world.set_door(self.node_id, door, position)
        self._say_doors()
        self._notify()

    def _on_change(self, change: WorldChange, node_id: int, now_us: int) -> None:
        if change is WorldChange.DOOR:
            return
        if change is not WorldChange.CARRIER:
            for door in self.doors.values():
                door.way_changed()
        if self.bay_state() != self._told:
            self._say_bay()
            self._notify()

    def _notify(self) -> None:
        for watcher in list(self._watchers):
            watcher()

    # --- what is said ------------------------------------------------------------------------------------------

    def _say_doors(self) -> None:
        self._link.send(self.door_state())

    def _say_bay(self) -> None:
        self._told = self.bay_state()
        self._link.send(self._told)

    def _say_all(self) -> None:
        self._say_doors()
        self._say_bay()
        if self._repeat_timer is not None:
            self._repeat_timer.cancel()
        self._repeat_timer = self._timers.call_at(self._timers.now_us() + REPEAT_US, self._say_all)
