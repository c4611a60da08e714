"""The compartment's task-generation function: when could this bay receive a car for its customer?

Independent of the others' plans (row P21), unlike the robot's: it knows only its own doors and its own queue, and where
the site lets the car come to the compartment that suits it (``DeskPolicy``) the way of the car to each bay.
"""

from collections.abc import Callable, Container
from dataclasses import dataclass, field, replace
from functools import cached_property

from onboard.contract.codes import Criterion, Operation
from onboard.contract.messages import CallForProposals, Reference
from onboard.core.negotiation import Awarded, CallKey, NegotiationEvent, PreAssigned, Proposal, Released
from onboard.core.serial import from_bus_ms, to_bus_ms
from onboard.core.site import Machine
from onboard.systems.car_park.site import CarPark, DeskPolicy
from onboard.ways.kinematics import run_duration_us
from onboard.ways.site import BayUse

#: A driver gets in and drives out within this, us: 10 to 30 s (constants of the SimPy study in the systems list).
DRIVER_US = 20_000_000
#: Each car that a bay has before another makes it as much less suitable as a way so much longer, us. Not the time that
#: one takes there: its robot, for which most customers wait, may well come from beside this bay (docs/figures.md).
BEFORE_US = 5_000_000
#: A bay takes no more cars that another could have: in a rush each comes out beside where it stands, and who is the
#: fifth goes elsewhere. Two took cars through a site's one alley, and 154 tasks an hour were 138 (docs/figures.md).
MOST_TAKEN = 4
#: Where cars come out at which they came in, any other bay is worse by this than whatever is between two, us.
NOT_OWN_US = 3_600_000_000
#: A bay to which nobody could bring the car is worse than any to which nobody has tried to.
GIVEN_UP_US = 2 * NOT_OWN_US
#: The operating sequence for a car that is to be given out, in the order of its steps.
PROGRAM = (
    "turn the light red",
    "lock the input door",
    "call for a robot",
    "open the output door",
    "receive the car",
    "lock the output door",
    "open the input door",
    "show whose car is ready",
)


@dataclass
class BayGeneration:
    """Estimates for calls of operation RECEIVE. ``is_free`` and ``queue`` are kept up to date by the compartment.

    ``least_ms`` is when a car can be at a bay at the earliest (bus ms), by a call to fetch it there; ``cars`` are those
    of which this machine knows where they are: after a restart it does not of one whose custodian is off.
    """

    site: CarPark
    machine: Machine
    least_ms: Callable[[CallForProposals, int], int]
    cars: Container[Reference]
    is_free: bool = False
    queue: int = 0
    #: Cars to be handed out here, and calls in which a bid for one more stands.
    taken: int = 0
    tentative: set[CallKey] = field(default_factory=set)
    #: Cars that nobody could bring here.
    given_up: set[Reference] = field(default_factory=set)

    def floor(self, call: CallForProposals, now_us: int) -> int:
        """A free bay has only to lock its input door, and is the one that the car comes to soonest (bus ms)."""
        ready_us = self._ready_us(call, now_us)
        bays = self.exits() if self._is_by_way(call) else []
        return to_bus_ms(min((self._there_us(call, node, now_us) for node in bays), default=ready_us))

    def lower_bound(self, call: CallForProposals, now_us: int) -> int | None:
        """When this bay stands locked and empty (bus ms), or None for anything but RECEIVE.

        For a car that may go to any bay: when it is here, and later by what those before it and the site's policy cost.
        """
        if self.site.bay_uses.get(self.machine.node_id) is BayUse.ENTRY:
            return None
        if call.operation is not Operation.RECEIVE or call.criterion is not Criterion.FINISH_TIME:
            return None
        before = self.queue + (0 if self.is_free else 1)
        if self.site.desk is DeskPolicy.NEAREST and not self._has_room(CallKey(call.sender, call.call)):
            return None
        if not self._is_by_way(call):
            return to_bus_ms(self._ready_us(call, now_us) + before * self.cycle_us())
        if call.car not in self.cars:
            return None
        me, is_given_up = self.machine.node_id, call.car in self.given_up
        if self.site.desk is DeskPolicy.OWN and call.car.origin == me and not is_given_up:
            return self.floor(call, now_us)
        worse_us = before * BEFORE_US + (GIVEN_UP_US if is_given_up else 0)
        return to_bus_ms(self._there_us(call, me, now_us) + worse_us)

    def cost(self, call: CallForProposals, now_us: int) -> int:
        """The bid of this bay in an own call of its desk (bus ms); only where it gives cars out."""
        found = self.lower_bound(call, now_us)
        assert found is not None, "a compartment where cars only come in bids for none"
        return found

    @property
    def may_take(self) -> bool:
        """Whether the desk of this bay bids in its own calls."""
        has_room = self.site.desk is DeskPolicy.OWN or self._has_room(None)
        return has_room and self.machine.node_id in self.exits()

    def note(self, event: NegotiationEvent) -> None:
        """A bid stands, or does no more: what may be won counts as taken."""
        if isinstance(event, PreAssigned):
            self.tentative.add(event.call_key)
        elif isinstance(event, Released | Awarded):
            self.tentative.discard(event.call_key)

    def _has_room(self, call: CallKey | None) -> bool:
        return self.taken + len(self.tentative - {call}) < MOST_TAKEN

    def exits(self) -> list[int]:
        """Compartments that give cars out."""
        return [node for node in self.site.compartments if self.site.bay_uses.get(node) is not BayUse.ENTRY]

    def _is_by_way(self, call: CallForProposals) -> bool:
        """Whether the site lets a car come to the bay that suits it, and it stands at a place."""
        return self.site.desk is not DeskPolicy.ANY and call.from_station in self._place_numbers

    @cached_property
    def _place_numbers(self) -> frozenset[int]:
        return frozenset(place.number for place in self.site.places)

    def _there_us(self, call: CallForProposals, node: int, now_us: int) -> int:
        """When the car can be at the bay of ``node``, nobody in its way and nobody before it there, bus us."""
        bay = self.site.compartments[node].number
        fetched = replace(call, operation=Operation.RETRIEVE, to_station=bay, ready_ms=0)
        there_us = from_bus_ms(self.least_ms(fetched, now_us), now_us)
        is_other = self.site.desk is DeskPolicy.OWN and node != call.car.origin
        return there_us + (NOT_OWN_US if is_other else 0)

    def _ready_us(self, call: CallForProposals, now_us: int) -> int:
        return from_bus_ms(call.deadline_ms, now_us) + self.site.timing.door_us

    def estimate(self, call: CallForProposals, now_us: int) -> Proposal | None:
        """The same as the bound: nothing that others plan changes it. The program is what the bay will do."""
        cost = self.lower_bound(call, now_us)
        return None if cost is None else Proposal(cost, None, PROGRAM, ())

    def cycle_us(self) -> int:
        """One customer served: both doors twice, the shuttle's stroke twice, grip, and the driver."""
        park = self.site
        stroke_us = run_duration_us(park.shuttle_reach_mm, park.shuttle)
        return 4 * self.site.timing.door_us + 2 * stroke_us + self.site.timing.grip_us + DRIVER_US
