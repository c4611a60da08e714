"""Cars that stand in a park when its power comes on, as in the morning after: in the plant, and in the journals.

Nobody drives them in, which in a large park takes hours; what a machine knows of them is what its journal would say.
They stand where they would if they had come in by turns at the compartments for entry and each had gone to the nearest
free place. Whoever keeps a place's station keeps its car under the third version of its right: the entry made it, a
robot had it, and the keeper has it since.
"""

from collections.abc import Sequence
from functools import partial
from itertools import cycle

from bus_sim.journal import SimulatedJournal
from bus_sim.systems.car_park.demand import Stay
from bus_sim.systems.car_park.plant.bodies import random_car
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import KindCode, TokenKind
from onboard.contract.messages import Reference
from onboard.core.journal_records import Entry
from onboard.core.records import BootRecord, TokenGoneRecord, TokenHeldRecord, TokenRecord
from onboard.core.site import Segment, Station, journal_owner
from onboard.systems.car_park.custody import keeper
from onboard.systems.car_park.records import CarAtRecord, NumberRecord
from onboard.systems.car_park.site import CarPark, car_park
from onboard.systems.car_park.tickets import Ticket, TicketCodes
from onboard.ways.roads import roads_of
from onboard.ways.site import BayUse
from onboard.ways.tokens import car_token


def stand(simulation: Simulation, stays: Sequence[Stay], origin_us: int = 0) -> None:
    """Put these cars into a run that is not switched on yet; ``origin_us`` is the loop time of their time zero.

    Who is fetched comes for the car then. Cars must fit every place, and there must be places for all.
    """
    site = car_park(simulation.site)
    codes = TicketCodes((simulation.secret,))
    entries: dict[int, list[Entry]] = {node: [BootRecord(1).entry] for node in site.machines}
    last: dict[int, int] = {}
    carriers = cycle([one.node_id for one in site.machines.values() if one.kind is KindCode.ROBOT])
    for stay, (origin, place) in zip(stays, _places(site, len(stays)), strict=True):
        number = last[origin] = last.get(origin, 0) + 1
        car, robot, node = Reference(origin, number), next(carriers), keeper(site, place)
        right = partial(_right, car_token(*car).number)
        entries[origin].append(right(TokenGoneRecord, 2, robot))
        entries[robot].append(right(TokenGoneRecord, 3, node))
        entries[node] += [
            CarAtRecord(car, place.number, 3, stay.car.wheelbase_mm).entry,
            right(TokenHeldRecord, 3, node),
        ]
        simulation.plant.world.stands_in(place, stay.car)
        simulation.plant.street.add_parked(stay, Ticket(car, codes.code(car)), origin_us)
    for origin, number in last.items():
        entries[origin].append(NumberRecord(number).entry)
    simulation.plant.oracle.take_stock()
    for node, machine in site.machines.items():
        owner = journal_owner(site, machine)
        simulation.journals[node] = SimulatedJournal(owner, entries=entries[node])


def stand_drawn(count: int, simulation: Simulation) -> None:
    """So many cars, the same ones each time, which nobody fetches; as ``stand`` does."""
    stand(simulation, [Stay(0, None, random_car(f"car {number}", 1)) for number in range(count)])


def _right(number: int, record: type[TokenRecord], version: int, holder: int) -> Entry:
    """A word about a car's right under one of its versions: 1 its entry's, 2 a robot's, 3 the keeper's of its place."""
    return record(TokenKind.CAR, number, version, holder).entry


def _places(site: CarPark, count: int) -> list[tuple[int, Station]]:
    """Entry and place of each car, in the order of their coming."""
    uses = site.bay_uses
    bays = [(node, bay.segment) for node, bay in site.compartments.items() if uses.get(node) is not BayUse.EXIT]
    nearest = {node: _nearest(site, front) for node, front in bays}
    taken: set[Station] = set()
    found: list[tuple[int, Station]] = []
    for number in range(count):
        node, _ = bays[number % len(bays)]
        place = next(one for one in nearest[node] if one not in taken)
        taken.add(place)
        found.append((node, place))
    return found


def _nearest(site: CarPark, front: Segment) -> list[Station]:
    """All places, the nearest to a bay first; of places as near the site's order."""
    roads = roads_of(site)
    return sorted(site.places, key=lambda one: roads.shortest_us(front, one.segment))
