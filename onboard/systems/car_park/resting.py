"""Where a robot with nothing to do waits: near the next call, by the calls that were heard, given where others stand.

Where robots run on batteries, it goes to charge first, as it needs (``charging.py``); then, on any site, to where it
can bid for a car that nobody could bid for (``out_of_reach.py``).

It minds its own plan alone and says nothing new: its move is an itinerary without work, which yields to whoever carries
or fetches (``onboard.ways.retreats``), and from which it bids as from a way back. What it knows of the demand it has
heard since power-up; a restart begins anew.

The measure is that of a p-median where each facility is busy half of the time: a call is met by the nearest robot every
second time, by the next one every second time of those left, and so on (Daskin, "A Maximum Expected Covering Location
Model", 1983, has the same independent chance of being busy).
"""

from collections import Counter, deque
from collections.abc import Iterable
from dataclasses import dataclass, field

from onboard.contract.battery import BatteryLevel
from onboard.contract.codes import Grade, KindCode, LegAction, Operation, Reason
from onboard.contract.messages import BatteryState, CallForProposals, Itinerary, Message, Stamp
from onboard.core.effects import Effect
from onboard.core.serial import to_bus_ms
from onboard.core.site import Segment, Station
from onboard.systems.car_park.clearance import MAX_EXPANSIONS
from onboard.systems.car_park.fetch_costs import met_us, moved_from
from onboard.systems.car_park.generation import CarParkGeneration
from onboard.systems.car_park.going_around import GoingAround
from onboard.systems.car_park.out_of_reach import OutOfReach
from onboard.systems.car_park.program import MAX_STEPS, Program, steps_of
from onboard.systems.car_park.site import CarPark, RestAt, class_of_end
from onboard.ways.mirror import WayFleet
from onboard.ways.occupancy import final_position
from onboard.ways.refuges import open_refuges, refuges
from onboard.ways.reservations import FOREVER
from onboard.ways.roads import roads_of
from onboard.ways.sipp import NoRoute, planning
from onboard.ways.site import BayUse

#: So many calls are remembered: the older ones are forgotten as new ones come, in a rush sooner than at night.
MOST_CALLS = 32
#: From the last work, or the last call heard, to setting off, us: a call is open for a second, and who is called does
#: not go. Robots wait by so much more each, in the order of their node-IDs, so that each hears where those before go.
REST_US, STAGGER_US = 10_000_000, 250_000
#: A move has to save so much of each call to come, us: else robots would swing between places that are as good.
MARGIN_US = 2_000_000
#: Where somebody is in the way it is tried again so much later, us.
RETRY_US = 5_000_000
#: Who charges first, and so is not called, sets off so long after its last work, us: a contact is sensed by then.
LOW_REST_US = 2_000_000


@dataclass
class Resting:
    """One robot's look at where it should wait. All times are bus time in us."""

    fleet: WayFleet
    park: CarPark
    generation: CarParkGeneration
    going_around: GoingAround
    #: From where the cars were to be taken of the calls heard last; at first, of one at each compartment.
    _heard: deque[Segment] = field(default_factory=lambda: deque(maxlen=MOST_CALLS))
    _due_us: int | None = None
    #: The plan after which it was looked last.
    _version: int = -1

    def __post_init__(self) -> None:
        uses, node = self.park.bay_uses, self.fleet.node_id
        bays = [(n, one) for n, one in sorted(self.park.compartments.items()) if uses.get(n) is not BayUse.EXIT]
        self._heard.extend(station.segment for _, station in bays)
        self._rest_us = REST_US + STAGGER_US * self.park.robots.index(node)
        self.out_of_reach = OutOfReach(self.park)

    @property
    def is_on(self) -> bool:
        """Whether robots of this site go where calls are likely, or to chargers, or to where a car is within reach."""
        goes = self.park.rest_at is RestAt.DEMAND or self.park.battery is not None
        return goes or bool(self.out_of_reach.refused)

    @property
    def program(self) -> Program:
        """The order program in hand."""
        return self.generation.program

    def hear(self, message: Message, now_us: int) -> None:
        """A call tells where robots are needed, a plan where one will stand, a level whether others bid."""
        self.generation.costs.hear(message, now_us)
        if self.out_of_reach.hear(message):
            self._due_us = now_us + self._rest_us
        if not self.is_on:
            return
        if isinstance(message, BatteryLevel):
            self.generation.charging.hear(message, now_us)
        if isinstance(message, CallForProposals) and message.operation in (Operation.PARK, Operation.RETRIEVE):
            self._due_us = now_us + self._rest_us
            is_customers = moved_from(self.park, message) is None
            if message.attempt == 1 and class_of_end(message.from_station) is None and is_customers:
                here = Station.from_number(message.from_station).segment
                self._heard.extend([here] if roads_of(self.park).knows(here) else [])
        elif isinstance(message, Itinerary) and message.grade is Grade.FIRM and self._due_us is None:
            self._due_us = now_us + self._rest_us

    def sense(self, state: BatteryState, now_us: int) -> list[Effect]:
        """The gauge tells how full the battery is; a task that it cannot pay for any more is given back untouched."""
        effects = self.generation.charging.sense(state, now_us)
        here = self.program.standing if self.program.step is None else None
        if here is not None and self._due_us is None and self.generation.charging.wants(here):
            self._due_us = now_us + self._pause_us
        lost = self.going_around.untouched() if self.program.remaining else []
        if lost and not self.generation.charging.pays(self.program.remaining, now_us):
            effects += self.going_around.drop(lost[-1:], now_us)
            effects += self.going_around.forfeit(lost[-1], Reason.IMPOSSIBLE, now_us)
        return effects

    @property
    def _pause_us(self) -> int:
        return LOW_REST_US if self.generation.charging.is_low else self._rest_us

    def next_wake(self) -> int | None:
        """When a robot that has nothing to do looks whether it should wait elsewhere, bus us."""
        return self._due_us if self.is_on and self.program.step is None else None

    def sets_off(self, now_us: int) -> bool:
        """Whether a robot with nothing to do goes elsewhere, where that ``is_on``: its program leads there then."""
        if self.program.version != self._version:
            self._version, self._due_us = self.program.version, max(self._due_us or 0, now_us + self._pause_us)
        if self._due_us is None or now_us < self._due_us:
            return False
        self._due_us = None
        here = self.program.standing
        if here is None or self.generation.is_held or self.generation.tentative or not self.going_around.is_at_ease:
            return False
        there = self._aims(here, now_us)
        if not there:
            return False
        self._due_us = now_us + RETRY_US
        return self._plan(here, there, now_us)

    def _aims(self, here: Segment, now_us: int) -> frozenset[Segment]:
        """Where it should wait instead of here: any of these."""
        charging = self.generation.charging
        if charging.wants(here):
            return charging.chargers(here, now_us)
        if self.out_of_reach.refused:
            others = list(self._others())
            open_ones = open_refuges(self.park, self.fleet.mirror.others_standing())
            there = self.out_of_reach.refuge(here, others, open_ones)
            if there is None and not others:
                # Who is left alone is in nobody's way.
                there = self.out_of_reach.refuge(here, others, refuges(self.park))
            if there is not None:
                return frozenset((there,))
        best = None if self.park.rest_at is RestAt.NEAREST or charging.stays(here) else self._best(here)
        return frozenset() if best is None else frozenset([best])

    def _plan(self, here: Segment, there: frozenset[Segment], now_us: int) -> bool:
        """Whether a way leads around all plans, at once or, where it has to go, behind who is before; then it goes."""
        mirror = self.fleet.mirror
        floors = mirror.lift_floors(now_us, now_us)
        taken, node = mirror.reservations, self.fleet.node_id
        search = planning(self.park, taken, node, here, now_us, (), there, MAX_EXPANSIONS, floors)
        route = self.generation.effort.whole(search)
        if isinstance(route, NoRoute) or len(route.legs) >= MAX_STEPS:
            return False
        is_wanted = self.generation.charging.wants(here) or bool(self.out_of_reach.refused)
        if route.legs[0].action is LegAction.STAND and not is_wanted:
            return False
        self.program.replace(list(steps_of(route, ())), Stamp(to_bus_ms(now_us), node, 0))
        return True

    def _best(self, here: Segment) -> Segment | None:
        """The refuge from which calls are met soonest; None where that is not sooner by more than the margin."""
        demand = Counter(self._heard)
        others = list(self._others())
        roads = roads_of(self.park)
        met = {one: [roads.shortest_us(other, one) for other in others] for one in demand}

        def mean_us(place: Segment) -> int:
            return sum(count * met_us((*met[one], roads.shortest_us(place, one))) for one, count in demand.items())

        if not demand:
            return None
        places = self._places(set(demand))
        least_us, best = min(((mean_us(place), place) for place in places), default=(FOREVER, here))
        gain_us = (mean_us(here) - least_us) // len(self._heard)
        return best if gain_us >= MARGIN_US else None

    def _others(self) -> Iterable[Segment]:
        """Where the other robots that take part stand, or said that they will."""
        mirror, machines = self.fleet.mirror, self.park.machines
        for node, itinerary in sorted(mirror.itineraries.items()):
            if node in (self.fleet.node_id, *mirror.aside) or machines[node].kind is not KindCode.ROBOT:
                continue
            place = final_position(self.park, itinerary)
            if place is not None:
                yield place

    def _places(self, demand: set[Segment]) -> list[Segment]:
        """Open refuges that can be the best of their stretch: its ends, and those from which a car was to be taken."""
        found = open_refuges(self.park, self.fleet.mirror.others_standing())
        beside = [(one, {one._replace(index=one.index - 1), one._replace(index=one.index + 1)}) for one in found]
        return sorted(one for one, both in beside if one in demand or not both <= found)
