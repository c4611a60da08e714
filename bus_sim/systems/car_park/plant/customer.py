"""A customer: brings a car, takes a ticket, and comes back for it; one transition table.

A customer sees what a person sees (light, doors, the desk's text, whose car stands in the bay) and acts on the world
and the desk; no message of any bus is known here.
"""

import random
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import ClassVar

from bus_sim.devices.timers import Timer, Timers
from bus_sim.systems.car_park.demand import Stay
from bus_sim.systems.car_park.plant.bodies import DRIVER_S
from bus_sim.systems.car_park.plant.compartment import CompartmentPlant
from bus_sim.systems.car_park.plant.oracle import Oracle
from bus_sim.systems.car_park.plant.rules import PlantRule
from bus_sim.systems.car_park.plant.world import CarParkWorld
from onboard.contract.announce import FetchWord
from onboard.systems.car_park.tickets import Ticket

#: From seeing that one may go to going, us: a person's reaction.
REACTION_US = 1_000_000
#: Getting from the car over the sill with the ticket in hand, s: a walk of some metres.
WALK_S = (4.0, 8.0)
#: The key is pressed, or the ticket inserted, again after this long without an answer, us: a person's patience with a
#: key.
PATIENCE_US = 15_000_000
#: A ticket is read so long before it has gone in, us: two frames' time.
READ_US = 2_000
#: A ticket that the desk does not know is tried again after this, us, and so many times in all: then one asks for help.
UNKNOWN_RETRY_US = 60_000_000
UNKNOWN_TRIES = 5


class CustomerState(Enum):
    """What the customer is doing."""

    COMING = "coming"
    QUEUEING = "queueing"
    DRIVING_IN = "driving in"
    AWAITING_TICKET = "awaiting ticket"
    WALKING_OUT = "walking out"
    PARKED = "parked"
    AT_DESK = "at the desk"
    AWAITING_DOOR = "awaiting the door"
    DRIVING_OUT = "driving out"
    GONE = "gone"


class CustomerEvent(Enum):
    """What the customer sees, or what falls due."""

    ARRIVE = "arrive"
    INVITED = "invited"
    TIMER = "timer"
    TICKET = "ticket"
    FULL = "full"
    TOO_LARGE = "too large"
    NO_CHARGING = "no place to charge"
    LEAVE = "leave"
    CANCEL = "cancel"
    WAIT = "please wait"
    UNKNOWN = "unknown ticket"
    READY = "car ready"
    SENT = "go to another compartment"
    DOOR_OPEN = "door open"


#: Whoever reads these at a desk has to do with the compartment that they are about.
_GOES_THERE = (CustomerEvent.SENT, CustomerEvent.READY)


class VisitOutcome(Enum):
    """How the visit ended; STAYING until then."""

    STAYING = "staying"
    SERVED = "served"
    FULL = "refused: full"
    TOO_LARGE = "refused: too large"
    NO_CHARGING = "refused: no place to charge"
    CANCELLED = "cancelled"
    TICKET_UNKNOWN = "ticket unknown"
    WRONG_CAR = "wrong car"


#: (state, event) -> (next state, what the customer does). Pairs not listed change nothing.
TABLE: dict[tuple[CustomerState, CustomerEvent], tuple[CustomerState, str]] = {
    (CustomerState.COMING, CustomerEvent.ARRIVE): (CustomerState.QUEUEING, "arrive"),
    (CustomerState.QUEUEING, CustomerEvent.INVITED): (CustomerState.DRIVING_IN, "drive_in"),
    (CustomerState.DRIVING_IN, CustomerEvent.TIMER): (CustomerState.AWAITING_TICKET, "get_out"),
    (CustomerState.AWAITING_TICKET, CustomerEvent.TIMER): (CustomerState.AWAITING_TICKET, "press_key"),
    (CustomerState.AWAITING_TICKET, CustomerEvent.TICKET): (CustomerState.WALKING_OUT, "walk_out"),
    (CustomerState.AWAITING_TICKET, CustomerEvent.FULL): (CustomerState.DRIVING_OUT, "turn_back"),
    (CustomerState.AWAITING_TICKET, CustomerEvent.TOO_LARGE): (CustomerState.DRIVING_OUT, "turn_back_too_large"),
    (CustomerState.AWAITING_TICKET, CustomerEvent.NO_CHARGING): (CustomerState.DRIVING_OUT, "turn_back_unchargeable"),
    (CustomerState.WALKING_OUT, CustomerEvent.FULL): (CustomerState.DRIVING_OUT, "turn_back"),
    (CustomerState.WALKING_OUT, CustomerEvent.NO_CHARGING): (CustomerState.DRIVING_OUT, "turn_back_unchargeable"),
    (CustomerState.WALKING_OUT, CustomerEvent.TIMER): (CustomerState.PARKED, "walk_away"),
    (CustomerState.PARKED, CustomerEvent.FULL): (CustomerState.AWAITING_DOOR, "come_back"),
    (CustomerState.PARKED, CustomerEvent.NO_CHARGING): (CustomerState.AWAITING_DOOR, "come_back_unchargeable"),
    (CustomerState.PARKED, CustomerEvent.LEAVE): (CustomerState.AT_DESK, "insert_ticket"),
    (CustomerState.PARKED, CustomerEvent.CANCEL): (CustomerState.AT_DESK, "cancel"),
    (CustomerState.AT_DESK, CustomerEvent.TIMER): (CustomerState.AT_DESK, "insert_ticket"),
    (CustomerState.AT_DESK, CustomerEvent.WAIT): (CustomerState.AT_DESK, "be_patient"),
    (CustomerState.AT_DESK, CustomerEvent.SENT): (CustomerState.AT_DESK, "be_patient"),
    (CustomerState.AT_DESK, CustomerEvent.UNKNOWN): (CustomerState.AT_DESK, "try_later"),
    (CustomerState.AT_DESK, CustomerEvent.READY): (CustomerState.AWAITING_DOOR, "be_patient"),
    (CustomerState.AWAITING_DOOR, CustomerEvent.WAIT): (CustomerState.AT_DESK, "wait_again"),
    (CustomerState.AWAITING_DOOR, CustomerEvent.DOOR_OPEN): (CustomerState.DRIVING_OUT, "fetch"),
    (CustomerState.DRIVING_OUT, CustomerEvent.TIMER): (CustomerState.GONE, "drive_away"),
}


@dataclass(frozen=True, slots=True)
class WordAtDesk:
    """What a customer first reads of when the car will be there: within ``spread_us`` of ``ready_us``, loop time."""

    read_us: int
    ready_us: int
    spread_us: int


@dataclass
class CustomerVisit:
    """What is measured of one customer; times in us of loop time, None while not reached.

    ``ready_us``: when the desk said that the car is there.
    """

    outcome: VisitOutcome = VisitOutcome.STAYING
    arrived_us: int | None = None
    parked_us: int | None = None
    asked_us: int | None = None
    ready_us: int | None = None
    gone_us: int | None = None
    promised: WordAtDesk | None = None
    #: What the desk answered last to a time that was announced; ASKED until then.
    announced: FetchWord | None = None

    @property
    def in_wait_us(self) -> int | None:
        """From arrival in the queue to walking away with a ticket."""
        return _span(self.arrived_us, self.parked_us)

    @property
    def ready_wait_us(self) -> int | None:
        """From the ticket in the desk to reading that the car is ready: without the driver's own time."""
        return _span(self.asked_us, self.ready_us)

    @property
    def out_wait_us(self) -> int | None:
        """From the ticket in the desk to driving out."""
        return _span(self.asked_us, self.gone_us)


def _span(begin_us: int | None, end_us: int | None) -> int | None:
    return end_us - begin_us if begin_us is not None and end_us is not None else None


class Customer:
    """One customer with one car. ``on_step`` is told after every transition; the street sets ``compartment``."""

    def __init__(
        self,
        stay: Stay,
        world: CarParkWorld,
        oracle: Oracle,
        timers: Timers,
        seed: int,
        choose: Callable[["Customer"], CompartmentPlant],
        on_step: Callable[["Customer"], None],
    ) -> None:
        self.stay = stay
        self.state = CustomerState.COMING
        self.visit = CustomerVisit()
        self.ticket: Ticket | None = None
        self.compartment: CompartmentPlant | None = None
        #: Dawdles so long in the compartment before driving out, us; set by faults.
        self.dawdle_us = 0
        #: Has read to which compartment the car comes; until then one stands beside a desk and in no bay's way.
        self.is_sent = False
        #: Has read at the desk that nobody comes for now; until something else is read there.
        self.is_told_off = False
        #: Has nothing to put into the desk; set by faults.
        self.has_lost_ticket = False
        self._world = world
        self._oracle = oracle
        self._timers = timers
        self._choose = choose
        self._on_step = on_step
        self._chance = random.Random(f"customer:{seed}:{stay.car.name}")
        self._timer: Timer | None = None
        self._tries = 0
        self._leave_us: int | None = None
        self._announced_us: int | None = None
        self._answered: Callable[[FetchWord], None] = lambda _: None
        self._refusal = VisitOutcome.SERVED

    def begin(self, origin_us: int) -> None:
        """Take up the plan for the day; ``origin_us`` is the loop time of the demand's time zero."""
        self._timers.call_at(origin_us + self.stay.arrival_us, lambda: self.on(CustomerEvent.ARRIVE))
        if self.stay.departure_us is not None:
            self._leave_us = origin_us + self.stay.departure_us
        if self.stay.announced_us is not None:
            self._announced_us = origin_us + self.stay.announced_us
        if self.stay.cancel_us is not None:
            self._timers.call_at(origin_us + self.stay.cancel_us, lambda: self.on(CustomerEvent.CANCEL))

    def begin_parked(self, ticket: Ticket, origin_us: int) -> None:
        """The car stands inside since before loop time 0, which no figure counts."""
        self.state, self.ticket, self.visit.parked_us = CustomerState.PARKED, ticket, -1
        if self.stay.departure_us is not None:
            self._timers.call_at(origin_us + self.stay.departure_us, self.leave_now)

    @property
    def is_leaving(self) -> bool:
        """Whether a time to leave is set, or the customer came for the car already."""
        return self._leave_us is not None

    def leave_now(self) -> None:
        """Come for the car now, or as soon as it is parked, whatever was planned."""
        self._leave_us = self._timers.now_us()
        self.on(CustomerEvent.LEAVE)

    def on(self, event: CustomerEvent) -> None:
        """See something, or have something fall due."""
        following = TABLE.get((self.state, event))
        if following is None:
            return
        self.state = following[0]
        self._ACTIONS[following[1]](self)
        self._on_step(self)

    def reads(self, event: CustomerEvent, where: CompartmentPlant | None) -> None:
        """A desk's text about this customer's car: one goes where it says, and where the car is ready."""
        self.is_told_off = event is CustomerEvent.FULL
        if event is CustomerEvent.READY and self.visit.ready_us is None:
            self.visit.ready_us = self._timers.now_us()
        if self.state is CustomerState.AT_DESK and event in _GOES_THERE and where is not None:
            self.compartment, self.is_sent = where, True
        self.on(event)

    def reads_when(self, in_us: int, spread_us: int) -> None:
        """A desk's word when this customer's car will be there; the first one is kept."""
        if self.visit.promised is None:
            now_us = self._timers.now_us()
            self.visit.promised = WordAtDesk(now_us, now_us + in_us, spread_us)

    def announce(self, fetch_us: int, answered: Callable[[FetchWord], None] = lambda _: None) -> None:
        """Say at the desk when the car will be fetched, loop time; ``answered`` is called with what it shows.

        Nothing is said without a ticket, or of a time that is past.
        """
        self._answered = answered
        in_s = (fetch_us - self._timers.now_us()) // 1_000_000
        if self.ticket is not None and not self.has_lost_ticket and in_s > 0:
            self.visit.announced = FetchWord.ASKED
            self._place.announce(self.ticket, in_s)

    def reads_answer(self, word: FetchWord) -> None:
        """What the desk shows of the time that was announced."""
        self.visit.announced = word
        self._answered(word)

    @property
    def _place(self) -> CompartmentPlant:
        if self.compartment is None:
            raise ValueError(f"{self.stay.car.name} is at no compartment")
        return self.compartment

    def _wait(self, delay_us: int) -> None:
        self._be_patient()
        self._timer = self._timers.call_at(self._timers.now_us() + delay_us, lambda: self.on(CustomerEvent.TIMER))

    def _be_patient(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _draw_us(self, span_s: tuple[float, float]) -> int:
        return round(self._chance.uniform(*span_s) * 1e6)

    # --- coming ------------------------------------------------------------------------------------------------

    def _arrive(self) -> None:
        self.visit.arrived_us = self._timers.now_us()
        self.compartment = self._choose(self)

    def _drive_in(self) -> None:
        self._world.begin_crossing(self._place.node_id)
        self._world.person_enters(self._place.node_id)
        self._wait(self._draw_us(DRIVER_S))

    def _get_out(self) -> None:
        self._world.car_enters(self._place.node_id, self.stay.car)
        self._press_key()

    def _press_key(self) -> None:
        # Patience first: the answer may come before the call returns.
        self._wait(PATIENCE_US)
        self._place.press_key(charging=self.stay.car.charging)

    def _walk_out(self) -> None:
        walk_us = self._draw_us(WALK_S)
        self._wait(walk_us)
        if self._announced_us is not None:
            announced_us = self._announced_us
            self._timers.call_at(self._timers.now_us() + REACTION_US, lambda: self.announce(announced_us))
        if self._leave_us is not None:
            leave_us = max(self._leave_us, self._timers.now_us() + walk_us)
            self._timers.call_at(leave_us - READ_US, self._let_read)

    def _let_read(self) -> None:
        """About to come for the car, at the desk that is chosen then."""
        if self.ticket is not None and not self.has_lost_ticket and self.visit.asked_us is None:
            self._choose(self).read_ticket(self.ticket)

    def _walk_away(self) -> None:
        self.visit.parked_us = self._timers.now_us()
        self._world.person_leaves(self._place.node_id)
        if self._leave_us is not None:
            when_us = max(self._leave_us, self._timers.now_us())
            self._timers.call_at(when_us, lambda: self.on(CustomerEvent.LEAVE))

    # --- refused -----------------------------------------------------------------------------------------------

    def _turn_back(self) -> None:
        self._refusal = VisitOutcome.FULL
        self._drive_out()

    def _turn_back_too_large(self) -> None:
        self._refusal = VisitOutcome.TOO_LARGE
        self._drive_out()

    def _turn_back_unchargeable(self) -> None:
        self._refusal = VisitOutcome.NO_CHARGING
        self._drive_out()

    def _come_back(self) -> None:
        """Told FULL after walking away: the car is still in the bay."""
        self._refusal = VisitOutcome.FULL

    def _come_back_unchargeable(self) -> None:
        self._refusal = VisitOutcome.NO_CHARGING

    # --- going -------------------------------------------------------------------------------------------------

    def _insert_ticket(self) -> None:
        # Whoever pressed cancel in vain has become an ordinary customer.
        self._refusal = VisitOutcome.SERVED
        if self.visit.asked_us is None:
            self.visit.asked_us = self._timers.now_us()
            self.compartment = self._choose(self)
        self._wait(PATIENCE_US)
        if self.ticket is not None and not self.has_lost_ticket:
            self._place.insert_ticket(self.ticket)

    def _wait_again(self) -> None:
        """Called to the door, and then told to wait: a robot comes for the car after all."""
        if self.visit.asked_us is None:
            self._insert_ticket()

    def _cancel(self) -> None:
        """While the car is still in the bay the cancel key may do; else, or without an answer, the ticket does."""
        if self._place.car != self.stay.car or self.ticket is None:
            self._insert_ticket()
            return
        self._refusal = VisitOutcome.CANCELLED
        self.visit.asked_us = self._timers.now_us()
        self._wait(PATIENCE_US)
        self._place.press_cancel(self.ticket)

    def _try_later(self) -> None:
        self._tries += 1
        if self._tries < UNKNOWN_TRIES:
            self._wait(UNKNOWN_RETRY_US)
            return
        self._be_patient()
        self.state = CustomerState.GONE
        self.visit.outcome = VisitOutcome.TICKET_UNKNOWN

    def _fetch(self) -> None:
        if self._place.car != self.stay.car:
            there = self._place.car.name if self._place.car is not None else "no car"
            self._oracle.report(PlantRule.OWN_CAR, f"{self.stay.car.name} is called, {there} stands in the bay")
            self.state = CustomerState.GONE
            self.visit.outcome = VisitOutcome.WRONG_CAR
            return
        self._world.person_enters(self._place.node_id)
        self._drive_out()

    def _drive_out(self) -> None:
        self._world.begin_crossing(self._place.node_id)
        self._wait(self._draw_us(DRIVER_S) + self.dawdle_us)

    def _drive_away(self) -> None:
        self.visit.gone_us = self._timers.now_us()
        self.visit.outcome = self._refusal
        self._world.car_leaves(self._place.node_id, self.stay.car)
        self._world.person_leaves(self._place.node_id)

    _ACTIONS: ClassVar[dict[str, Callable[["Customer"], None]]] = {
        "arrive": _arrive,
        "drive_in": _drive_in,
        "get_out": _get_out,
        "press_key": _press_key,
        "walk_out": _walk_out,
        "walk_away": _walk_away,
        "turn_back": _turn_back,
        "turn_back_too_large": _turn_back_too_large,
        "turn_back_unchargeable": _turn_back_unchargeable,
        "come_back": _come_back,
        "come_back_unchargeable": _come_back_unchargeable,
        "insert_ticket": _insert_ticket,
        "wait_again": _wait_again,
        "cancel": _cancel,
        "be_patient": _be_patient,
        "try_later": _try_later,
        "fetch": _fetch,
        "drive_away": _drive_away,
    }
