"""What of a run the bounds need: which customer had to do with which bay, from when to when, and where the car was."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from bus_sim.systems.car_park.bounds.free_flow import Acts
from bus_sim.systems.car_park.plant.bodies import Aboard
from bus_sim.systems.car_park.plant.customer import Customer, CustomerState, VisitOutcome
from bus_sim.systems.car_park.plant.plant import Plant
from bus_sim.systems.car_park.plant.world import WorldChange
from onboard.core.site import Station

#: So often a shuttle reaches for a car after it was asked for: at its place and into the bay, into the bay, not at all.
FROM_PLACE, FROM_ROBOT, FROM_BAY = 2, 1, 0


class BayVisit(NamedTuple):
    """A customer at a bay: brings a car, or (``goes_out``) has it given; loop times in us.

    ``strokes``: how often a shuttle reached for the car, after it was driven in or asked for, as far as that is sure
    (``FROM_ROBOT`` of a car that comes in, or ``FROM_BAY`` where it went out again from there); ``place`` where it
    stood as it was asked for, where that is a place and no shuttle was there.
    """

    bay: Station
    goes_out: bool
    since_us: int
    through_us: int
    acts: Acts
    strokes: int
    place: Station | None = None

    @property
    def waited_us(self) -> int:
        """From coming to walking away with a ticket, or from the ticket in the desk to driving out."""
        return self.through_us - self.since_us


@dataclass
class _SeenVisit:
    """Of one customer: the bay driven into; and when asking for the car, its place, and whether a robot carried it."""

    came_to: Station | None = None
    place: Station | None = None
    is_aboard: bool = False


class VisitLog:
    """Looks at the customers of a plant from now on; ``seed`` is that of the run."""

    def __init__(self, plant: Plant, seed: int) -> None:
        self._plant = plant
        self._seed = seed
        self._seen: dict[Customer, _SeenVisit] = {}
        #: When each car, by its name, was last taken aboard wholly: its shuttle home.
        self._carried_us: dict[str, int] = {}
        plant.street.watch(self._on_step)
        plant.world.watch(self._on_change)

    def visits(self, counts: Callable[[int], bool]) -> list[BayVisit]:
        """Of all who have their ticket, or their car, those who came, or asked, at a loop time (us) that counts."""
        found: list[BayVisit] = []
        for customer in self._plant.street.customers:
            visit, seen = customer.visit, self._seen.get(customer, _SeenVisit())
            acts, carried_us = Acts.of(customer.stay, self._seed), self._carried_us.get(customer.stay.car.name)
            came_us, parked_us, asked_us, gone_us = visit.arrived_us, visit.parked_us, visit.asked_us, visit.gone_us
            if came_us is not None and parked_us is not None and seen.came_to is not None and counts(came_us):
                # Nobody has had the bay after one that is still in it.
                is_out = carried_us is None and self._plant.world.where[customer.stay.car.name] is None
                strokes = FROM_BAY if is_out else FROM_ROBOT
                found.append(BayVisit(seen.came_to, False, came_us, parked_us, acts, strokes))
            left, is_served = customer.compartment, visit.outcome is VisitOutcome.SERVED
            if is_served and left is not None and asked_us is not None and gone_us is not None and counts(asked_us):
                is_carried = seen.is_aboard or (carried_us is not None and carried_us > asked_us)
                strokes = FROM_PLACE if seen.place is not None else FROM_ROBOT if is_carried else FROM_BAY
                found.append(BayVisit(left.body.station, True, asked_us, gone_us, acts, strokes, seen.place))
        return found

    def _on_step(self, customer: Customer) -> None:
        visit, now_us, seen = customer.visit, self._plant.timers.now_us(), self._seen.setdefault(customer, _SeenVisit())
        if customer.state is CustomerState.PARKED and visit.parked_us == now_us and customer.compartment is not None:
            seen.came_to = customer.compartment.body.station
        elif customer.state is CustomerState.AT_DESK and visit.asked_us == now_us:
            world = self._plant.world
            where = world.where.get(customer.stay.car.name)
            if isinstance(where, Aboard):
                seen.is_aboard = not world.robots[where.node_id].is_out(now_us)
            # Who has just put it down, or reaches for it already, needs less than a stroke.
            elif where is not None and world.bay_at(where) is None and world.shuttle_in(where) is None:
                seen.place = where

    def _on_change(self, change: WorldChange, node_id: int, now_us: int) -> None:
        if change is WorldChange.SHUTTLE and not self._plant.world.robots[node_id].is_out(now_us):
            car = self._plant.world.car_aboard(node_id)
            if car is not None:
                self._carried_us[car.name] = now_us
