"""Trials of a car park: customers come and go by the scenario's arrivals."""

from collections import Counter
from collections.abc import Sequence

from bus_sim.faults.arm import arm
from bus_sim.faults.injection import AnyFault
from bus_sim.faults.scenario import Scenario
from bus_sim.run import RunOptions, Simulation, build
from bus_sim.systems.car_park.plant.customer import Customer, Outcome, State
from bus_sim.systems.car_park.plant.street import Street
from bus_sim.systems.orders import Tally
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.core.site import Site

#: Customers come so long after power-up, us.
ORIGIN_US = 10_000_000


class CarPark:
    """See ``Stage``."""

    who = "customers"

    def __init__(self, site: Site, scenario: Scenario, options: RunOptions, loop: VirtualTimeLoop) -> None:
        self.run: Simulation = build(site, options, loop)
        self._street, self._oracle = self.run.plant.street, self.run.plant.oracle
        self._street.add_all(scenario.arrivals.demand(scenario.seed), ORIGIN_US)

    @property
    def is_broken(self) -> bool:
        """See ``Stage``."""
        return bool(self._oracle.violations)

    @property
    def customers(self) -> list[Customer]:
        """All who come."""
        return self._street.customers

    @property
    def is_over(self) -> bool:
        """See ``Stage``."""
        return is_over(self._street)

    def arm(self, faults: Sequence[AnyFault]) -> None:
        """See ``Stage``."""
        arm(self.run, faults)

    def violations(self) -> list[str]:
        """See ``Stage``."""
        return [str(one) for one in self._oracle.finish()]

    def waits_since(self, time_us: int) -> int:
        """See ``Stage``."""
        return sum(_waits_since(customer, time_us) for customer in self._street.customers)

    def tally(self) -> Tally:
        """Whoever has lost the ticket does not count as waiting: no machine can help there."""
        customers, summary = self._street.customers, self._street.summary()
        outcomes = Counter(customer.visit.outcome for customer in customers)
        still = (State.COMING, State.PARKED, State.GONE)
        return Tally(
            outcomes[Outcome.SERVED] + outcomes[Outcome.CANCELLED],
            sum(outcomes[one] for one in (Outcome.FULL, Outcome.TOO_LARGE, Outcome.TICKET_UNKNOWN)),
            sum(one.state not in still and not _looks_for_ticket(one) for one in customers),
            max((*summary.in_wait_us, *summary.out_wait_us), default=0) / 1e6,
            outcomes[Outcome.FULL],
        )


def is_over(street: Street) -> bool:
    """Whoever has lost the ticket is not waited for: no machine can help there."""
    return all(
        customer.state is State.GONE
        or (customer.state is State.PARKED and customer.stay.departure_us is None)
        or _looks_for_ticket(customer)
        for customer in street.customers
    )


def _waits_since(customer: Customer, time_us: int) -> bool:
    """Whether a customer waits who waited at this time: to bring the car, or to have it back."""
    if customer.state is State.GONE or _looks_for_ticket(customer):
        return False
    visit = customer.visit
    since_us = visit.arrived_us if visit.parked_us is None else visit.asked_us
    return since_us is not None and since_us <= time_us


def _looks_for_ticket(customer: Customer) -> bool:
    return customer.state is State.AT_DESK and customer.has_lost_ticket
