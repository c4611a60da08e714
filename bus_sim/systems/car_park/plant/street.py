"""The street before the compartments: queues of arriving cars, people at the desks, and what they had to wait."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial

from bus_sim.devices.timers import Timers
from bus_sim.systems.car_park.demand import Demand, Stay
from bus_sim.systems.car_park.plant.compartment import CompartmentPlant
from bus_sim.systems.car_park.plant.customer import REACTION_US, Customer, CustomerEvent, CustomerState, VisitOutcome
from bus_sim.systems.car_park.plant.oracle import Oracle
from bus_sim.systems.car_park.plant.world import CarParkWorld
from onboard.contract.announce_device import DeskFetchAnswer
from onboard.contract.car_park_device import DeskPromise
from onboard.contract.codes import DeskText
from onboard.contract.messages import Reference
from onboard.systems.car_park.site import DeskPolicy, car_park
from onboard.systems.car_park.tickets import Ticket
from onboard.ways.site import BayUse

#: What a text on the desk means to the customer whom it concerns.
TEXTS: dict[DeskText, CustomerEvent] = {
    DeskText.TAKE_TICKET: CustomerEvent.TICKET,
    DeskText.FULL: CustomerEvent.FULL,
    # Turned away as well, if not for want of room.
    DeskText.OUT_OF_ORDER: CustomerEvent.FULL,
    DeskText.CAR_TOO_LARGE: CustomerEvent.TOO_LARGE,
    DeskText.NO_CHARGING: CustomerEvent.NO_CHARGING,
    DeskText.PLEASE_WAIT: CustomerEvent.WAIT,
    DeskText.UNKNOWN_TICKET: CustomerEvent.UNKNOWN,
    # A minute later the desk takes tickets again.
    DeskText.TOO_MANY_TRIES: CustomerEvent.UNKNOWN,
    DeskText.CAR_READY: CustomerEvent.READY,
    DeskText.GO_TO: CustomerEvent.SENT,
}


@dataclass(frozen=True, slots=True)
class StreetSummary:
    """The customers' day: how many, and waiting times in us in the order of the visits.

    ``parked`` came in and took a ticket; ``served`` of them drove out again; ``inside`` are parked now; ``queueing``
    wait with their car to come in, ``asking`` for their car to come out.
    """

    arrived: int
    parked: int
    served: int
    inside: int
    queueing: int
    asking: int
    refused_full: int
    refused_too_large: int
    refused_no_charging: int
    cancelled: int
    in_wait_us: tuple[int, ...] = field(repr=False)
    out_wait_us: tuple[int, ...] = field(repr=False)
    ready_wait_us: tuple[int, ...] = field(repr=False)


class Street:
    """All customers of a run. Each goes to the compartment with the fewest before, of equals to the lowest node-ID.

    Where a site's desks tell to which compartment a car comes, a sign shows arriving cars their lane as well: of those
    with as few before one whose bay is free, and of these the one to which nobody was shown for longest.
    """

    def __init__(
        self, compartments: dict[int, CompartmentPlant], world: CarParkWorld, oracle: Oracle, timers: Timers, seed: int
    ) -> None:
        self.customers: list[Customer] = []
        self.tickets_uncollected = 0
        self._compartments = compartments
        self._world = world
        self._oracle = oracle
        self._timers = timers
        self._seed = seed
        self._by_ticket: dict[Reference, Customer] = {}
        self._watchers: list[Callable[[Customer], None]] = []
        #: When an arriving car was shown to a compartment last, us, where a sign shows them.
        self._shown_us: dict[int, int] = {}
        #: Customers at each compartment in the order of their coming, with a car to park and with a ticket.
        self._waiting: dict[int, list[Customer]] = {node: [] for node in compartments}
        for node_id, compartment in compartments.items():
            compartment.watch(partial(self._look, node_id))
            compartment.watch_desk(partial(self._read, node_id))
            compartment.watch_promises(self._read_when)
            compartment.watch_answers(self._read_answer)

    def watch(self, watcher: Callable[[Customer], None]) -> None:
        """Call ``watcher`` after each step of a customer, once it is clear who waits where."""
        self._watchers.append(watcher)

    def waiting(self, node_id: int) -> Sequence[Customer]:
        """Who has to do with a compartment now, in the order of their coming."""
        return self._waiting[node_id]

    def add(self, stay: Stay, origin_us: int = 0) -> Customer:
        """A customer for one stay; ``origin_us`` is the loop time of the stay's time zero."""
        customer = Customer(stay, self._world, self._oracle, self._timers, self._seed, self._choose, self._after_step)
        self.customers.append(customer)
        customer.begin(origin_us)
        return customer

    def add_all(self, demand: Demand, origin_us: int = 0) -> None:
        """A customer for every stay of a demand."""
        for stay in demand.stays:
            self.add(stay, origin_us)

    def add_parked(self, stay: Stay, ticket: Ticket, origin_us: int = 0) -> Customer:
        """A customer whose car stands inside already, with its ticket; nothing of how it came in is counted."""
        customer = Customer(stay, self._world, self._oracle, self._timers, self._seed, self._choose, self._after_step)
        self.customers.append(customer)
        self._by_ticket[ticket.car] = customer
        customer.begin_parked(ticket, origin_us)
        return customer

    @property
    def is_over(self) -> bool:
        """Whether everybody who had a time to leave has left, and nobody waits for anything."""
        return all(c.state is CustomerState.GONE or self._stays_for_good(c) for c in self.customers)

    def summary(self, since_us: int = 0) -> StreetSummary:
        """What happened so far, or since a loop time; waiting of those who came, or asked, since then."""
        visits = [customer.visit for customer in self.customers]
        outcomes = [visit.outcome for visit in visits if _is_since(visit.gone_us, since_us)]
        fetched = [one for one in visits if one.outcome is VisitOutcome.SERVED and _is_since(one.asked_us, since_us)]
        states = [customer.state for customer in self.customers]
        return StreetSummary(
            arrived=sum(_is_since(visit.arrived_us, since_us) for visit in visits),
            parked=sum(_is_since(visit.parked_us, since_us) for visit in visits),
            served=outcomes.count(VisitOutcome.SERVED),
            inside=states.count(CustomerState.PARKED),
            queueing=states.count(CustomerState.QUEUEING),
            asking=states.count(CustomerState.AT_DESK) + states.count(CustomerState.AWAITING_DOOR),
            refused_full=outcomes.count(VisitOutcome.FULL),
            refused_too_large=outcomes.count(VisitOutcome.TOO_LARGE),
            refused_no_charging=outcomes.count(VisitOutcome.NO_CHARGING),
            cancelled=outcomes.count(VisitOutcome.CANCELLED),
            in_wait_us=self.in_waits_us(since_us),
            out_wait_us=tuple(one.out_wait_us for one in fetched if one.out_wait_us is not None),
            ready_wait_us=tuple(one.ready_wait_us for one in fetched if one.ready_wait_us is not None),
        )

    def in_waits_us(self, since_us: int, until_us: int | None = None) -> tuple[int, ...]:
        """Waiting of all who came from one loop time on, or until another, and have their ticket, in us."""
        visits = [customer.visit for customer in self.customers]
        return tuple(
            visit.in_wait_us
            for visit in visits
            if visit.in_wait_us is not None
            and visit.arrived_us is not None
            and since_us <= visit.arrived_us
            and (until_us is None or visit.arrived_us < until_us)
        )

    def _stays_for_good(self, customer: Customer) -> bool:
        return customer.state is CustomerState.PARKED and customer.stay.departure_us is None

    # --- who goes where ----------------------------------------------------------------------------------------

    def _choose(self, customer: Customer) -> CompartmentPlant:
        closed = BayUse.EXIT if customer.ticket is None else BayUse.ENTRY
        uses = self._world.site.bay_uses
        open_to = [node for node in self._waiting if uses.get(node, BayUse.BOTH) is not closed]
        is_shown = customer.ticket is None and car_park(self._world.site).desk is not DeskPolicy.ANY
        node_id = min(open_to, key=lambda node: (self._before(node), *(self._lane(node) if is_shown else ()), node))
        if is_shown:
            self._shown_us[node_id] = self._timers.now_us()
        return self._compartments[node_id]

    def _lane(self, node: int) -> tuple[bool, int]:
        """What the sign goes by between lanes of one length: whether the bay is taken, and when it was shown last."""
        return not self._compartments[node].invites, self._shown_us.get(node, -1)

    def _before(self, node: int) -> int:
        """Who has to do with a bay; who was not told yet to which the car comes stands aside, where desks tell that."""
        is_any = car_park(self._world.site).desk is DeskPolicy.ANY
        return sum(is_any or one.is_sent or one.state is not CustomerState.AT_DESK for one in self._waiting[node])

    def _after_step(self, customer: Customer) -> None:
        """Keep the lists of who waits where, and let people look at what they now wait for."""
        for waiting in self._waiting.values():
            if customer in waiting:
                waiting.remove(customer)
        if customer.compartment is None:
            return
        node_id = customer.compartment.node_id
        if customer.state not in (CustomerState.PARKED, CustomerState.GONE):
            self._waiting[node_id].append(customer)
            self._waiting[node_id].sort(key=_came_us)
        for watcher in self._watchers:
            watcher(customer)
        self._look(node_id)

    # --- what people see ---------------------------------------------------------------------------------------

    def _look(self, node_id: int) -> None:
        """After a visible change: whoever may go now goes after the reaction time, if it still holds then."""
        if self._who_may_go(node_id) is not None:
            self._timers.call_at(self._timers.now_us() + REACTION_US, lambda: self._go(node_id))

    def _go(self, node_id: int) -> None:
        found = self._who_may_go(node_id)
        if found is not None:
            found[0].on(found[1])

    def _who_may_go(self, node_id: int) -> tuple[Customer, CustomerEvent] | None:
        compartment = self._compartments[node_id]
        if not compartment.is_input_open:
            return None
        for customer in self._waiting[node_id]:
            if customer.state is CustomerState.AWAITING_DOOR:
                return customer, CustomerEvent.DOOR_OPEN
        for customer in self._waiting[node_id]:
            if customer.state is CustomerState.QUEUEING:
                return (customer, CustomerEvent.INVITED) if compartment.invites else None
        return None

    def _read(self, node_id: int, text: DeskText, car: Reference) -> None:
        """A text concerns the customer of that ticket; a ticket and texts without a number whoever pressed the key."""
        if text is DeskText.INSERT_AGAIN:
            for customer in list(self._waiting[node_id]):
                if customer.state is CustomerState.AT_DESK:
                    customer.on(CustomerEvent.UNKNOWN)
            return
        event = TEXTS.get(text)
        if event is None:
            return
        reader = self._by_ticket.get(car)
        if reader is None:
            reader = self._at_key(node_id)
            if text is DeskText.TAKE_TICKET:
                self._take(reader, self._compartments[node_id].tickets_printed[-1])
        if reader is not None:
            there = self._compartments[node_id].text_compartment if event is CustomerEvent.SENT else node_id
            reader.reads(event, self._compartments.get(there))

    def _read_when(self, word: DeskPromise) -> None:
        reader = self._by_ticket.get(word.car)
        if reader is not None:
            reader.reads_when(word.in_ms * 1_000, word.spread_ms * 1_000)

    def _read_answer(self, word: DeskFetchAnswer) -> None:
        reader = self._by_ticket.get(word.car)
        if reader is not None:
            reader.reads_answer(word.fetch_word)

    def _at_key(self, node_id: int) -> Customer | None:
        waiting = self._waiting[node_id]
        return next((customer for customer in waiting if customer.state is CustomerState.AWAITING_TICKET), None)

    def _take(self, customer: Customer | None, ticket: Ticket) -> None:
        if customer is None:
            self.tickets_uncollected += 1
            return
        customer.ticket = ticket
        self._by_ticket[ticket.car] = customer


def _is_since(moment_us: int | None, since_us: int) -> bool:
    return moment_us is not None and moment_us >= since_us


def _came_us(customer: Customer) -> int:
    visit = customer.visit
    return visit.asked_us if visit.asked_us is not None else visit.arrived_us or 0
