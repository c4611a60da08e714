"""A day of a car park as a queueing model: people, bays, robots and lifts with the site's own times, no messages.

The order of the bays is the compartments' own (``onboard.systems.car_park.pipeline``): who drives in is called for when
he drives in, the next car while the bay still works, and drivers are invited after ``MOST_OUT`` cars at the latest.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from heapq import heappop, heappush

from bus_sim.systems.car_park.bounds.free_flow import Acts, FreeFlow
from bus_sim.systems.car_park.demand import Demand, Stay
from bus_sim.systems.car_park.design.fleet import FleetModel, ServedCall
from bus_sim.systems.car_park.design.times import DESK_US, STEP_US
from bus_sim.systems.car_park.plant.customer import REACTION_US
from onboard.contract.messages import Reference
from onboard.core.site import Segment, Station
from onboard.systems.car_park.bay_generation import BEFORE_US, MOST_TAKEN
from onboard.systems.car_park.pipeline import BY_TURNS, MOST_OUT, MOST_OUT_BY_KEY, QUEUED_US
from onboard.systems.car_park.site import CallAt, CarPark, DeskPolicy
from onboard.ways.roads import roads_of
from onboard.ways.site import BayUse

#: From a call until its winner's plan is known, us: the call's window, and what is said after it.
KNOWN_AFTER_US = 400_000


@dataclass
class _Person:
    stay: Stay
    acts: Acts
    arrived_us: int
    place: Station | None = None
    bay: "_BayModel | None" = None
    stored_us: int = 0
    asked_us: int = 0


@dataclass
class Modelled:
    """What came of a modelled day: waits, and when people were through, in us in this order; and who was busy.

    ``ready_us`` are waits until the car is ready; ``busy`` are shares of the time from first to last event, 0 to 1: of
    robots, of lifts, of bays, means of each kind.
    """

    in_us: list[int] = field(default_factory=list)
    out_us: list[int] = field(default_factory=list)
    refused: int = 0
    parked_us: list[int] = field(default_factory=list)
    gone_us: list[int] = field(default_factory=list)
    ready_us: list[int] = field(default_factory=list)
    busy: dict[str, float] = field(default_factory=dict)


@dataclass
class _BayModel:
    node: int
    front: Segment
    use: BayUse
    drivers: "deque[_Person]" = field(default_factory=deque)
    askers: "deque[_Person]" = field(default_factory=deque)
    people: int = 0
    #: Cars that come out here and have not left yet.
    taken: int = 0
    is_free: bool = True
    open_us: int = 0
    free_from_us: int = 0
    outs: int = 0
    ins: int = 0
    is_queued: bool = False
    enters_at_us: int | None = None
    #: Next car to go out, called for already, and when it is set down.
    ahead: "tuple[_Person, ServedCall] | None" = None
    #: Names that its compartment has given, to cars that came in and to tasks.
    named: int = 0
    #: From when on, and for when, the next car may be called for; None while it may not.
    ahead_ready_us: int | None = None
    busy_us: int = 0
    #: Counts up whenever an arriving car is shown here.
    shown: int = 0

    def next_name(self) -> Reference:
        """The next name that its compartment gives."""
        self.named += 1
        return Reference(self.node, self.named)


class DayModel:
    """One demand on one site; ``play`` gives what came of it."""

    def __init__(self, site: CarPark, demand: Demand, seed: int) -> None:
        self._site, self._fleet = site, FleetModel(site)
        flow = FreeFlow.of(site)
        self._close_us, self._open_us = flow.close_us + STEP_US, flow.open_us + STEP_US
        uses = site.bay_uses
        self._bays = [
            _BayModel(node, station.segment, uses.get(node, BayUse.BOTH)) for node, station in site.compartments.items()
        ]
        self._bays.sort(key=lambda one: one.node)
        #: How long a desk's call for bids of the bays takes, where a car comes to the bay that suits it.
        self._desk_call_us = 0 if site.desk is DeskPolicy.ANY else site.timing.call_window_us + DESK_US
        #: Who has asked while no bay had room for one more car, where cars come to the bay that suits them.
        self._waiting: deque[_Person] = deque()
        self._calls_on_arrival = site.call_at is CallAt.ARRIVAL and not site.classes and not site.measures_width
        self._events: list[tuple[int, int, Callable[[int], None]]] = []
        self._number = 0
        self._found = Modelled()
        for stay in demand.stays:
            person = _Person(stay, Acts.of(stay, seed), stay.arrival_us)
            self._at(stay.arrival_us, partial(self._arrive, person))

    def play(self) -> Modelled:
        """All events in the order of their times."""
        found = self._found
        first_us = self._events[0][0] if self._events else 0
        while self._events:
            now_us, _, act = heappop(self._events)
            act(now_us)
        span_us = max([first_us + 1, *found.parked_us[-1:], *found.gone_us[-1:]]) - first_us
        fleet = self._fleet
        lifts = fleet.traffic.lifts.values()
        found.busy = {
            "robots": sum(one.busy_us for one in fleet.robots) / len(fleet.robots) / span_us,
            "lifts": sum(one.used_us for one in lifts) / max(1, len(lifts)) / span_us,
            "compartments": sum(one.busy_us for one in self._bays) / len(self._bays) / span_us,
        }
        return found

    def _at(self, time_us: int, act: Callable[[int], None]) -> None:
        self._number += 1
        heappush(self._events, (time_us, self._number, act))

    def _choose(self, closed: BayUse) -> _BayModel:
        is_shown = closed is BayUse.EXIT and self._site.desk is not DeskPolicy.ANY
        open_to = [one for one in self._bays if one.use is not closed]
        if not is_shown:
            return min(open_to, key=lambda one: (one.people, one.node))
        bay = min(open_to, key=lambda one: (one.people, not one.is_free, one.shown, one.node))
        self._number += 1
        bay.shown = self._number
        return bay

    def _desk(self, person: _Person) -> _BayModel | None:
        """Where a car comes by the site's policy; None where no bay has room for one more."""
        is_own = self._site.desk is DeskPolicy.OWN and person.bay is not None and person.bay.use is not BayUse.ENTRY
        if is_own:
            return person.bay
        if self._site.desk is DeskPolicy.NEAREST and person.place is not None:
            return self._nearest(person.place.segment)
        return self._choose(BayUse.ENTRY)

    def _nearest(self, place: Segment) -> _BayModel | None:
        """The bay whose compartment would win the call for a car there (``BayGeneration``)."""
        roads = roads_of(self._site)
        open_to = [one for one in self._bays if one.use is not BayUse.ENTRY and one.taken < MOST_TAKEN]

        def cost_us(bay: _BayModel) -> int:
            before = len(bay.askers) + (not bay.is_free)
            return roads.shortest_us(place, bay.front) + before * BEFORE_US

        return min(open_to, key=lambda one: (cost_us(one), one.node), default=None)

    # --- people ------------------------------------------------------------------------------------------------

    def _arrive(self, person: _Person, now_us: int) -> None:
        bay = person.bay = self._choose(BayUse.EXIT)
        bay.people += 1
        bay.drivers.append(person)
        self._look(bay, now_us)

    def _ask(self, person: _Person, now_us: int) -> None:
        person.asked_us = now_us
        is_aboard = self._site.desk is DeskPolicy.NEAREST and person.stored_us > now_us
        if is_aboard:
            # It is called for once it stands.
            self._at(person.stored_us, lambda then_us: self._send(person, then_us))
        else:
            self._send(person, now_us)

    def _send(self, person: _Person, now_us: int) -> None:
        bay = self._desk(person)
        if bay is None:
            self._waiting.append(person)
        else:
            self._take(bay, person, now_us)

    def _take(self, bay: _BayModel, person: _Person, now_us: int) -> None:
        """A bay is to hand out a car; where bays bid for it, once the desk's call is over."""
        bay.people += 1
        bay.taken += 1
        if self._desk_call_us:
            self._at(now_us + self._desk_call_us, lambda then_us: self._queue(bay, person, then_us))
        else:
            self._queue(bay, person, now_us)

    def _queue(self, bay: _BayModel, person: _Person, now_us: int) -> None:
        bay.askers.append(person)
        if person.stored_us > now_us:
            self._at(person.stored_us, lambda then_us: self._look(bay, then_us))
        self._look(bay, now_us)

    # --- a bay -------------------------------------------------------------------------------------------------

    def _is_asked_for(self, bay: _BayModel, now_us: int) -> bool:
        return bool(bay.askers) and bay.askers[0].stored_us <= now_us

    def _is_drivers_turn(self, bay: _BayModel) -> bool:
        if bay.use is BayUse.EXIT:
            return False
        if self._site.call_at is CallAt.KEY:
            return bay.outs >= MOST_OUT_BY_KEY
        if bay.is_queued:
            return bay.outs >= BY_TURNS or 0 < bay.ins < BY_TURNS
        return bay.outs >= MOST_OUT

    def _look(self, bay: _BayModel, now_us: int) -> None:
        """Something has changed: whoever is next for a free bay, or whose car can be called for."""
        if not bay.is_free:
            self._call_ahead(bay, now_us)
            return
        is_out = bay.ahead is not None or self._is_asked_for(bay, now_us)
        was_open = now_us >= bay.free_from_us + QUEUED_US
        if is_out and (was_open or not self._is_drivers_turn(bay)):
            if was_open:
                bay.outs, bay.is_queued = 0, False
            bay.outs, bay.ins = bay.outs + 1, 0
            self._begin_out(bay, now_us, now_us + self._close_us, now_us)
            return
        if bay.drivers:
            enters_us = max(now_us, bay.open_us) + REACTION_US
            if bay.enters_at_us is None or bay.enters_at_us < now_us:
                bay.enters_at_us = enters_us
                self._at(enters_us, lambda then_us: self._enter(bay, then_us))
        if is_out:
            self._at(bay.free_from_us + QUEUED_US, lambda then_us: self._look(bay, then_us) if bay.is_free else None)

    def _set_free(self, bay: _BayModel, now_us: int, opens_us: int) -> None:
        bay.is_free, bay.open_us, bay.free_from_us = True, opens_us, opens_us
        bay.enters_at_us = bay.ahead_ready_us = None
        self._at(opens_us, lambda then_us: self._look(bay, then_us) if bay.is_free else None)

    def _enter(self, bay: _BayModel, now_us: int) -> None:
        bay.enters_at_us = None
        if not bay.is_free or not bay.drivers:
            return
        person = bay.drivers.popleft()
        bay.is_free, bay.outs, bay.ins = False, 0, bay.ins + 1
        bay.is_queued = now_us - bay.free_from_us <= QUEUED_US
        keyed_us = now_us + person.acts.drive_in_us
        parked_us = keyed_us + STEP_US + person.acts.walk_us
        call_us = now_us if self._calls_on_arrival else keyed_us
        served = self._fleet.park(bay.front, call_us, parked_us + self._close_us, bay.next_name())
        if served is None:
            self._found.refused += 1
            bay.people -= 1
            gone_us = keyed_us + person.acts.drive_out_us
            self._at(gone_us, lambda then_us: self._set_free(bay, then_us, then_us))
            return
        person.place, person.stored_us = served.place, served.done_us
        self._at(parked_us, lambda then_us: self._walk_away(bay, person, then_us))
        bay.busy_us += served.at_bay_us + self._close_us + self._open_us - now_us
        locked_us = served.at_bay_us + self._close_us
        known_us = call_us + self._site.timing.call_window_us + KNOWN_AFTER_US
        self._at(known_us, lambda then_us: self._brings(bay, locked_us, then_us))
        self._at(locked_us, lambda then_us: self._taken(bay, then_us))

    def _walk_away(self, bay: _BayModel, person: _Person, now_us: int) -> None:
        bay.people -= 1
        self._found.in_us.append(now_us - person.arrived_us)
        self._found.parked_us.append(now_us)
        leaves_us = person.stay.departure_us
        if leaves_us is not None:
            self._at(max(now_us, leaves_us), lambda then_us: self._ask(person, then_us))

    def _taken(self, bay: _BayModel, now_us: int) -> None:
        """The bay is empty and locked on both sides: the next car comes in from behind, or the input door opens."""
        bay.ahead_ready_us = None
        if bay.ahead is not None:
            # Its input door does not open in between.
            bay.busy_us -= self._open_us
            self._begin_out(bay, now_us, now_us, now_us)
        else:
            self._set_free(bay, now_us, now_us + self._open_us)

    def _may_call_ahead(self, bay: _BayModel, ready_us: int, now_us: int) -> None:
        bay.ahead_ready_us = ready_us
        self._call_ahead(bay, now_us)

    def _call_ahead(self, bay: _BayModel, now_us: int) -> None:
        ready_us = bay.ahead_ready_us
        if ready_us is None or bay.ahead is not None or not self._is_asked_for(bay, now_us):
            return
        if self._site.call_at is CallAt.ARRIVAL:
            bay.ahead = self._fetch(bay, now_us, ready_us)

    def _fetch(self, bay: _BayModel, now_us: int, ready_us: int) -> "tuple[_Person, ServedCall]":
        person = bay.askers.popleft()
        bay.next_name()
        assert person.place is not None, "who asks has parked"
        return person, self._fleet.retrieve(person.place, bay.front, now_us, ready_us)

    def _begin_out(self, bay: _BayModel, now_us: int, locked_us: int, since_us: int) -> None:
        bay.is_free = False
        known_us = now_us + (0 if bay.ahead else self._site.timing.call_window_us + KNOWN_AFTER_US)
        person, served = bay.ahead or self._fetch(bay, now_us, locked_us)
        bay.ahead, bay.ahead_ready_us = None, None
        handed_us = max(served.at_bay_us, locked_us) + self._close_us
        gone_us = handed_us + self._open_us + REACTION_US + person.acts.drive_out_us
        bay.busy_us += gone_us - since_us
        self._found.ready_us.append(handed_us - person.asked_us)
        self._at(known_us, lambda then_us: self._brings(bay, gone_us + self._close_us, then_us))
        self._at(gone_us, lambda then_us: self._drive_away(bay, person, then_us))

    def _brings(self, bay: _BayModel, ready_us: int, now_us: int) -> None:
        """It is known when a robot comes, with a car or for one; another may fetch the next one meanwhile."""
        if not self._is_drivers_turn(bay):
            self._may_call_ahead(bay, ready_us, now_us)

    def _drive_away(self, bay: _BayModel, person: _Person, now_us: int) -> None:
        bay.people -= 1
        bay.taken -= 1
        self._found.out_us.append(now_us - person.asked_us)
        self._found.gone_us.append(now_us)
        self._set_free(bay, now_us, now_us)
        while self._waiting and (suits := self._desk(self._waiting[0])) is not None:
            self._take(suits, self._waiting.popleft(), now_us)
