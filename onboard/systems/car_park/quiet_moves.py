"""Cars that are brought nearer while nobody waits, so that whoever fetches them waits for less.

The compartment at which a car came in offers that: so each car is one machine's, and nobody has to agree on anything.
It calls for the car to be parked anew, robots bid for it as for any task, and each names the place by what the fetch
will cost from there (``place_costs.py``). It is a cheap task: whoever calls for anything else takes it back, as long as
the car was not touched, and what is begun ends as any parking does. No journal has it: after a restart of the
compartment its robot hears that nobody wants it, or ends it.
"""

from collections import deque
from dataclasses import dataclass, field
from typing import NamedTuple

from onboard.contract.codes import CallResult, LegAction, Operation, Reason, TaskPhase
from onboard.contract.constants import NOBODY
from onboard.contract.messages import CallForProposals, Itinerary, Message, Reference, TaskReport, TokenRefusal
from onboard.core.effects import Effect, Report, Send
from onboard.core.negotiation import EVENT_TYPES, Closed
from onboard.core.serial import from_bus_ms
from onboard.core.site import Station
from onboard.systems.car_park import bay_task, custody
from onboard.systems.car_park.bay_calls import BayCalls
from onboard.systems.car_park.bay_memory import BayMemory
from onboard.systems.car_park.bay_task import BayPhase, BayTask
from onboard.systems.car_park.fetch_costs import fetch_us, moved_from
from onboard.systems.car_park.free_places import FreePlaces
from onboard.systems.car_park.place_costs import GAIN_US
from onboard.systems.car_park.program import Program
from onboard.systems.car_park.site import ANY_CLASS, CarPark, open_end
from onboard.systems.car_park.stays import Stays
from onboard.ways.mirror import WayFleet
from onboard.ways.reservations import FOREVER

#: From the last call that was heard until a car is moved, us; each compartment waits for so much longer than the one
#: before it, in the order of their node-IDs, so that it hears what those before have called for.
QUIET_US, STAGGER_US = 10_000_000, 2_000_000
#: With so many customers' calls in so long a time, us, no car is moved: a move takes 90 s, and whoever calls meanwhile
#: waits for its robot, or behind it in the alley: at 16 calls an hour nothing was gained (docs/figures.md).
BUSY_CALLS, BUSY_US = 4, 1_800_000_000
#: With nothing to move it is looked again after this, us: a car becomes due, or a robot has done its work.
LOOK_AGAIN_US = 30_000_000
#: A car is moved when it is expected to be fetched within so long, us: an earlier move is as good, but its place may be
#: wanted by others until then. Whose driver nothing is known of counts as one who may come at any time.
AHEAD_US = 2 * 3_600_000_000
#: The same where its driver has said when, us: people are off by some ten minutes, and a near place that is taken
#: sooner is not there for who comes before. Such a move is made in busy times too: what it saves is sure, and soon.
ANNOUNCED_AHEAD_US = 45 * 60_000_000
#: So often a car is moved at most: each time is a risk for it, and metres.
MOST_MOVES = 2
#: A move that is not over by then is taken back, us: the longest ways of the shipped sites take half of it.
PATIENCE_US = 300_000_000
#: A car for whose move nobody bid, or whose robot gave it back, is left alone for so long, us.
LEAVE_ALONE_US = 600_000_000


class Gain(NamedTuple):
    """What moving a car to the best free place saves, us. The greatest is moved: of announced ones the first to come.

    ``sooner_us``: how much sooner than ``FOREVER`` its driver said to come; 0 where nothing was said.
    """

    sooner_us: int
    saved_us: int
    car: Reference
    source: Station


@dataclass
class QuietMoves:
    """One compartment's. All times are bus time in us."""

    fleet: WayFleet
    park: CarPark
    calls: BayCalls
    memory: BayMemory
    tickets: deque[Reference]
    stays: Stays = field(default_factory=Stays)
    free: FreePlaces = field(init=False)
    _quiet_from_us: int | None = None
    _called_us: int = 0
    #: The last tasks that somebody waited for, here or elsewhere, and since when: as many as make it busy.
    _wanted: deque[tuple[Reference, int]] = field(default_factory=lambda: deque(maxlen=BUSY_CALLS))
    _moved: dict[Reference, int] = field(default_factory=dict)
    _alone_until_us: dict[Reference, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.free = FreePlaces(self.park, self.fleet.node_id, self.fleet.mirror, Program(self.park), {})
        self._rest_us = QUIET_US + STAGGER_US * sorted(self.park.compartments).index(self.fleet.node_id)
        self._stewards = set(self.park.stewards.values())
        #: So many robots may have work when one more is asked to move a car: the others are there for customers.
        self._most_at_work = max(1, len(self.park.robots) // 2) - 1

    @property
    def task(self) -> BayTask | None:
        """The move that is called for, or awarded."""
        return self.calls.move

    @task.setter
    def task(self, task: BayTask | None) -> None:
        self.calls.move = task

    # --- what is heard -----------------------------------------------------------------------------------------

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        """Learn of stays; a call for anything else takes the move back, and its robot or a steward ends it."""
        if not self.park.quiet_moves:
            return []
        self.stays.hear(message, now_us)
        if isinstance(message, CallForProposals) and message.operation in (Operation.PARK, Operation.RETRIEVE):
            self._quiet_from_us = now_us + self._rest_us
            if moved_from(self.park, message):
                return []
            self._note(message.task, now_us)
            return self.give_up(now_us)
        if isinstance(message, TokenRefusal) and self.task is not None:
            # Who keeps the car was off when it was awarded, and lets nobody have it.
            is_unknown = self.task.is_unknown_to(message, self.fleet.mirror)
            return self._leave_alone(now_us) if is_unknown else []
        if not isinstance(message, TaskReport) or message.task.origin != self.fleet.node_id:
            return []
        is_lost = message.phase is TaskPhase.FORFEITED
        if self._is_move(message.task) and (is_lost or message.phase is TaskPhase.DONE):
            self._over(is_done=not is_lost, now_us=now_us)
        # A steward that took the right back says so until it hears that nobody wants the task any more.
        is_unanswered = is_lost and message.sender in self._stewards and self.calls.named(message.task) is None
        return [self._void(message.task)] if is_unanswered else []

    def closed(self, event: Closed, now_us: int) -> list[Effect]:
        """The own call for a move is over."""
        task = self.task
        if task is None or not self._is_move(event.call.task):
            return []
        if event.result is not CallResult.AWARDED:
            self._over(is_done=False, now_us=now_us)
            return []
        task.winner, task.call = event.winner, event.call.call
        if not custody.is_mine(self.fleet, task.car):
            return []
        return self.calls.stewardship.won(task.car, task.winner, task.task, task.version)

    def give_up(self, now_us: int) -> list[Effect]:
        """Somebody waits: nobody need move a car that was not touched."""
        task, self.task = self.task, None
        if task is None:
            return []
        # Its winner has not failed.
        self.fleet.negotiation.trust.done(task.task, NOBODY, now_us)
        outcome = self.fleet.negotiation.call_off(task.task, Reason.CANCELLED, now_us)
        effects = [item for item in outcome if not isinstance(item, EVENT_TYPES)]
        told = [self._void(task.task)] if task.winner else []
        return [*effects, *self.calls.stewardship.call_off(task.task), *told]

    def _void(self, task: Reference) -> Effect:
        return Send(bay_task.void_award(self.fleet.node_id, task))

    def _is_move(self, task: Reference) -> bool:
        return self.task is not None and self.task.task == task

    def _note(self, task: Reference, now_us: int) -> None:
        if all(task != known for known, _ in self._wanted):
            self._wanted.append((task, now_us))

    def _leave_alone(self, now_us: int) -> list[Effect]:
        """This move comes to nothing: it is taken back, and its car is left alone for a while."""
        assert self.task is not None
        self._alone_until_us[self.task.car] = now_us + LEAVE_ALONE_US
        return self.give_up(now_us)

    def _over(self, *, is_done: bool, now_us: int) -> None:
        assert self.task is not None
        car, self.task = self.task.car, None
        self._moved[car] = self._moved.get(car, 0) + is_done
        self._alone_until_us[car] = now_us + (0 if is_done else LEAVE_ALONE_US)

    # --- what is offered ---------------------------------------------------------------------------------------

    def next_wake(self) -> int | None:
        """When it has been quiet for long enough, or a move takes too long, bus us."""
        if not self.park.quiet_moves:
            return None
        return self._quiet_from_us if self.task is None else self._called_us + PATIENCE_US

    def review(self, phase: BayPhase, now_us: int, *, is_empty: bool) -> list[Effect]:
        """Offer a move where nobody waits, or take one back where somebody does."""
        if not self.park.quiet_moves:
            return []
        if phase is not BayPhase.FREE or not is_empty or self.tickets or self.calls.in_hand():
            self._quiet_from_us = None
            for task in self.calls.in_hand():
                self._note(task.task, now_us)
            return self.give_up(now_us)
        if self.task is not None and now_us >= self._called_us + PATIENCE_US:
            return self._leave_alone(now_us)
        is_due = self._quiet_from_us is not None and now_us >= self._quiet_from_us
        if is_due or self._quiet_from_us is None:
            self._quiet_from_us = now_us + self._rest_us
        if not is_due or self.task is not None or not self.fleet.tokens.is_synced:
            return []
        is_busy = len(self._wanted) == BUSY_CALLS and now_us < self._wanted[0][1] + BUSY_US
        if is_busy and not self.stays.announced_us:
            self._quiet_from_us = max(self._quiet_from_us, self._wanted[0][1] + BUSY_US)
            return []
        at_work = sum(_is_at_work(plan, now_us) for plan in self.fleet.mirror.itineraries.values())
        best = max(self._gains(now_us, is_busy=is_busy), default=None) if at_work <= self._most_at_work else None
        if best is None:
            self._quiet_from_us = now_us + LOOK_AGAIN_US
            return []
        return self._call_for(best, now_us)

    def _gains(self, now_us: int, *, is_busy: bool) -> list[Gain]:
        """Cars of this compartment that are to be fetched soon, and could stand nearer; in busy times if announced."""
        me, park = self.fleet.node_id, self.park
        least_us: dict[int, int] = {}
        found = []
        for car in list(self.fleet.mirror.cars):
            source = custody.place_of(self.fleet, car) if car.origin == me else None
            if source is None or not self._is_due(car, now_us) or (is_busy and car not in self.stays.announced_us):
                continue
            number = park.place_class.get(source.number, ANY_CLASS)
            if number not in least_us:
                costs = (fetch_us(park, one.segment, me) for one in self.free.of(now_us, number))
                least_us[number] = min(costs, default=FOREVER)
            saved_us = fetch_us(park, source.segment, me) - least_us[number]
            if saved_us >= GAIN_US:
                announced_us = self.stays.announced_us.get(car, FOREVER)
                found.append(Gain(FOREVER - announced_us, saved_us, car, source))
        return found

    def _is_due(self, car: Reference, now_us: int) -> bool:
        if self._moved.get(car, 0) >= MOST_MOVES or self._alone_until_us.get(car, now_us) > now_us:
            return False
        fetched_us = self.stays.fetched_us(car)
        ahead_us = ANNOUNCED_AHEAD_US if car in self.stays.announced_us else AHEAD_US
        return fetched_us is None or fetched_us <= now_us + ahead_us

    def _call_for(self, best: Gain, now_us: int) -> list[Effect]:
        name, number = self.memory.next_reference(self.fleet)
        self._called_us = now_us
        self.task = BayTask(name, Operation.PARK, best.car, self.fleet.mirror.cars[best.car].wheelbase_mm)
        sink = open_end(self.park.place_class.get(best.source.number, ANY_CLASS))
        terms = self.task.terms(best.source.number, sink, self.calls.floor)
        told = f"car {best.car.number} is moved while it is quiet: {best.saved_us // 1_000_000} s nearer"
        return [number, Report(told), *self.fleet.negotiation.open(terms, now_us)]


def _is_at_work(plan: Itinerary, now_us: int) -> bool:
    """Whether a machine carries or fetches by its plan; what is done stays in the plan until it has another."""
    return any(leg.action is LegAction.WORK and from_bus_ms(leg.end_ms, now_us) > now_us for leg in plan.legs)
