"""The input/output compartment (IOC): bay, two doors, light, desk; custodian of cars, steward of tokens, initiator.

The order of the 21 steps (Pujo et al. 2006, Fig. 9) is kept but for one hazard in it: the output door opens only when
the input door is locked and the robot stands before it (docs/decisions.md, flag 5).
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

from onboard.contract.announce_device import DeskFetch
from onboard.contract.codes import (
    CallResult,
    DeskInput,
    DeskText,
    DoorAction,
    DoorName,
    DoorPosition,
    KindCode,
    LightColour,
    MachineState,
    Operation,
    OperatorAction,
    Reason,
    TokenKind,
)
from onboard.contract.constants import OUTSIDE
from onboard.contract.messages import (
    BayState,
    CarAt,
    DeskEvent,
    DoorState,
    Message,
    OperatorOrder,
    Reference,
    SyncRequest,
    TaskReport,
    TicketRead,
    TokenRefusal,
    TokenRequest,
)
from onboard.core.authority import TokenKey, station_token
from onboard.core.behaviour import NEVER_US, OverheardWord
from onboard.core.effects import Effect, Report
from onboard.core.negotiation import Awarded, AwardedAgain, Closed, NegotiationEvent
from onboard.core.site import Station
from onboard.systems.car_park import bay_task, custody, in_vain
from onboard.systems.car_park.bay_calls import BayCalls
from onboard.systems.car_park.bay_generation import BayGeneration
from onboard.systems.car_park.bay_memory import BayMemory, job_over_record, job_record
from onboard.systems.car_park.bay_task import DESK_INPUT, BayPhase, BayTask
from onboard.systems.car_park.desk_calls import DeskCalls
from onboard.systems.car_park.least_bids import LeastBids
from onboard.systems.car_park.outputs import BayOutputs
from onboard.systems.car_park.pipeline import Pipeline
from onboard.systems.car_park.promises import Promises
from onboard.systems.car_park.site import ANY_CLASS, car_park
from onboard.systems.car_park.stewardship import Stewardship
from onboard.systems.car_park.ticket_slot import TicketSlot
from onboard.systems.car_park.tickets import TicketCodes
from onboard.ways.mirror import WayFleet
from onboard.ways.site import BayUse
from onboard.ways.tokens import car_token


@dataclass
class Compartment:
    """One compartment. At most one task uses its bay; tickets wait in the order in which they came."""

    fleet: WayFleet
    generation: BayGeneration
    codes: TicketCodes = field(default_factory=TicketCodes)
    kind: KindCode = KindCode.COMPARTMENT
    phase: BayPhase = BayPhase.STARTING
    doors: DoorState | None = None
    bay: BayState | None = None
    tickets: deque[Reference] = field(default_factory=deque)
    stewardship: Stewardship = field(init=False)
    memory: BayMemory = field(init=False)
    outputs: BayOutputs = field(init=False)
    slot: TicketSlot = field(init=False)
    calls: BayCalls = field(init=False)
    desks: DeskCalls = field(init=False)
    pipeline: Pipeline = field(init=False)
    promises: Promises = field(init=False)
    _key: DeskInput | None = None
    _robot_waits: bool = False

    def __post_init__(self) -> None:
        self.stewardship = Stewardship(self.fleet)
        self.outputs = BayOutputs(self.fleet.node_id, self.fleet.motion, station_token(self.station), self.codes)
        self._park = car_park(self.fleet.site)
        self._use = self._park.bay_uses.get(self.fleet.node_id, BayUse.BOTH)
        bids = LeastBids(self.fleet)
        self.memory = BayMemory(self.fleet.node_id, station_token(self.station)).read(self.fleet.entries)
        self.stewardship.replay(self.memory)
        self.tickets.extend(self.memory.tickets)
        self.calls = BayCalls(self.fleet, self.station, self.stewardship, self.memory, bids.floor, self._on_won)
        self.calls.take_up()
        self.pipeline = Pipeline(self.fleet, self._park, self.calls, self.memory, self.tickets, self.outputs)
        self.slot = TicketSlot(self.outputs, self.fleet.drops, self.pipeline.times.at_desk)
        self.desks = DeskCalls(self.fleet, self._park, self.memory, self.generation, self.outputs, self.tickets)
        self.promises = Promises(self._park, self.generation, self.calls, self.tickets, self.outputs)
        self._table: dict[BayPhase, Callable[[int], list[Effect]]] = {
            BayPhase.STARTING: self._when_starting,
            BayPhase.FREE: self._when_free,
            BayPhase.LOCKING: self._when_locking,
            BayPhase.AWAITING: self._when_awaiting,
            BayPhase.OPENING: self._when_opening,
            BayPhase.SERVING: self._when_serving,
            BayPhase.CLOSING: self._when_closing,
            BayPhase.HANDOVER: self._when_handover,
            BayPhase.RESERVING: self._when_reserving,
            BayPhase.ENTERING: self._when_entering,
        }

    # --- the Behaviour -----------------------------------------------------------------------------------------

    @property
    def job(self) -> BayTask | None:
        """The task that has the bay."""
        return self.calls.job

    @job.setter
    def job(self, task: BayTask | None) -> None:
        self.calls.job = task

    @property
    def station(self) -> Station:
        """The bay, as the site has it for this compartment."""
        assert self.fleet.machine.station is not None
        return self.fleet.machine.station

    @property
    def state(self) -> MachineState:
        """STARTING until bay and doors are known, then IDLE or WORKING, for heartbeats."""
        return bay_task.STATES.get(self.phase, MachineState.WORKING)

    @property
    def itinerary_version(self) -> int:
        """A compartment does not move."""
        return 0

    def start(self, now_us: int) -> list[Effect]:
        """Nothing is ordered before doors and bay are sensed."""
        return []

    def sense(self, message: Message, now_us: int) -> list[Effect]:
        """Doors and bay are noted, and orders said again; a new desk event is taken up once."""
        if isinstance(message, DoorState | BayState):
            self.doors = message if isinstance(message, DoorState) else self.doors
            self.bay = message if isinstance(message, BayState) else self.bay
            return self.outputs.again(message, now_us)
        if isinstance(message, DeskEvent | DeskFetch | TicketRead):
            return self.slot.take(message, now_us, partial(self._at_desk, now_us=now_us))
        return []

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        """Awards tell who may fetch a stored car; a car given into my custody is stated anew; an operator's press."""
        return self.pipeline.hear(message, now_us) + self._heard(message, now_us)

    def _heard(self, message: Message, now_us: int) -> list[Effect]:
        answered, lost = self.desks.hear(message, now_us)
        if answered or lost is not None:
            given_up, waited = self.calls.give_up(lost, self.phase, now_us)
            return answered + given_up + (self._to_free() if waited else [])
        if isinstance(message, OperatorOrder) and message.compartment == self.fleet.node_id:
            urgent = message.action is OperatorAction.URGENT_TICKET
            return self._at_desk(DESK_INPUT[message.action], message.car, now_us, urgent=urgent)
        if isinstance(message, TaskReport):
            is_starting, heard = self.phase is BayPhase.STARTING, self.stewardship.hear(message, now_us)
            return heard + self.calls.on_report(message, now_us, is_starting=is_starting)
        if isinstance(message, TokenRequest | SyncRequest) and self.calls.has_any:
            return self.calls.on_request(message, now_us)
        answer = self.calls.refused_to_winner(message, now_us) if isinstance(message, TokenRefusal) else None
        return self.stewardship.hear(message, now_us) if answer is None else answer

    def negotiated(self, event: NegotiationEvent, now_us: int) -> list[Effect]:
        """An own call closed: note the winner, or tell why not. Awarded a RECEIVE: the car is fetched to this bay."""
        self.generation.note(event)
        if isinstance(event, Awarded):
            steps = Report("program: " + "; ".join(event.proposal.program))
            noted = [*self.desks.won(event), *self._take_ticket(event.call.car, now_us, mine=True)]
            return [steps, *noted, self.desks.accepts(event.call.task)]
        if isinstance(event, AwardedAgain):
            return [self.desks.accepts(event.call.task)]
        if isinstance(event, Closed) and event.call.operation is Operation.RECEIVE:
            return self.desks.closed(event, now_us)
        task = self.calls.named(event.call.task) if isinstance(event, Closed) else None
        if not isinstance(event, Closed) or task is None:
            return self.pipeline.moves.closed(event, now_us) if isinstance(event, Closed) else []
        if event.result is CallResult.AWARDED:
            return self.calls.won_by(task, event.winner, event.call.call)
        if event.result is CallResult.REJECTED:
            # The winner gave the task back before it began: it is called anew, by the custodian of the car.
            return self.calls.call_again(task, now_us)
        return self._refused(task, event.reason, now_us)

    def _on_won(self, task: BayTask) -> None:
        if task is self.job:
            self._robot_waits = False
            if self.phase is BayPhase.HANDOVER:
                self._go(BayPhase.LOCKING)

    def may_grant(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        """Bay and the car in it: to the winner while the output door is open. All else by the steward's rules."""
        if self.job is not None and key in (station_token(self.station), car_token(*self.job.car)):
            if key.kind is TokenKind.CAR and self.fleet.mirror.car_station(self.job.car) != self.station:
                return self.stewardship.may_grant(key, requester, now_us)
            if requester != self.job.winner or self.calls.has_another(requester):
                self.calls.asks_too = requester
                return Reason.TOKEN_NOT_GRANTABLE_YET
            self._robot_waits = True
            is_open = self._is(DoorName.OUTPUT, DoorPosition.OPEN) and self._is(DoorName.INPUT, DoorPosition.LOCKED)
            if self.phase is not BayPhase.SERVING or not is_open:
                return Reason.DOOR_NOT_READY
            self.job.was_granted |= key.kind is TokenKind.STATION
            return Reason.NONE
        is_bay = key == station_token(self.station)
        return self.pipeline.wants(requester) if is_bay else self.stewardship.may_grant(key, requester, now_us)

    def advance(self, now_us: int) -> list[Effect]:
        """One step of the phase table, where its condition is met."""
        self.generation.taken = self.calls.outs() + len(self.tickets)
        effects = self.calls.review(now_us) + self.desks.review(now_us)
        if self.doors is None or self.bay is None:
            return effects
        effects += self._table[self.phase](now_us) + self.pipeline.look_ahead(self.phase, self.bay, now_us)
        return effects + (self.promises.review(self.phase, now_us) if self._park.promises else [])

    def next_wake(self) -> int | None:
        """When a refused call is made again, or a winner counts as lost."""
        times = [self.calls.next_wake(self.phase), self.pipeline.next_wake(self.phase), self.desks.next_wake()]
        times += [self.promises.next_wake()] if self._park.promises else []
        return min((one for one in times if one is not None), default=None)

    def looks_from(self) -> int:
        """It looks often whether an award of its own was never heard, or nothing shows of its winner."""
        return 0 if any(not (task.winner and self.calls.is_shown(task)) for task in self.calls.in_hand()) else NEVER_US

    def heeds(self, message: OverheardWord) -> bool:
        """Others' slots, cars and places are nothing to it."""
        return False

    def statements(self, now_us: int) -> list[Effect]:
        """The cars in my custody and the tokens that I hold."""
        told = self.desks.statements() + self.promises.statements() + self.pipeline.times.statements()
        return self.stewardship.car_statements() + self.fleet.tokens.statements() + told

    # --- the desk ----------------------------------------------------------------------------------------------

    def _at_desk(self, event: DeskInput, car: Reference, now_us: int, *, urgent: bool = False) -> list[Effect]:
        if self.fleet.has_no_rights:
            # Its journal is lost: until a person has made its rights anew it can do nothing for anybody.
            return [self.outputs.show(DeskText.OUT_OF_ORDER, car)]
        if event in bay_task.KEYS:
            self._key = event
            return []
        # Whoever cancels wants the car back at once: the same as coming for it.
        return self._take_ticket(car, now_us, urgent=urgent)

    def _take_ticket(self, car: Reference, now_us: int, *, urgent: bool = False, mine: bool = False) -> list[Effect]:
        job, taken = self.job, self.desks.take(car, self.calls, now_us, urgent=urgent, mine=mine)
        return taken + (self._give_back(job) if job is not None and job.car == car and job.may_be_given_back else [])

    # --- the phases --------------------------------------------------------------------------------------------

    def _when_starting(self, now_us: int) -> list[Effect]:
        if self.memory.job is not None:
            return self._take_up_job(now_us) + self.pipeline.void()
        if self.stewardship.left is not None and self.memory.was_granted:
            return self._park_again(self.stewardship.left, now_us)
        effects = self.outputs.door(DoorName.OUTPUT, DoorAction.CLOSE)
        is_shut = self._is(DoorName.OUTPUT, DoorPosition.LOCKED)
        return effects + (self.pipeline.void() + self._to_free() if is_shut else [])

    def _park_again(self, left: CarAt, now_us: int) -> list[Effect]:
        """My journal is lost and my rights are new: whatever was meant with the car in my bay, it is parked."""
        self.stewardship.left, self.memory.car_class = None, bay_task.class_in(self.bay, self._park)
        noted = self.stewardship.parks_again(left, self.memory, self.bay)
        return [*noted, *self._take_up_job(now_us), self.outputs.light_up(LightColour.RED)]

    def _take_up_job(self, now_us: int) -> list[Effect]:
        """After a restart in the middle of a task: journal, tokens and sensors tell how far it has come."""
        assert self.memory.job is not None
        task, operation, car, wheelbase_mm = self.memory.job
        winner, version = self.stewardship.winner_of(car, task)
        self.job = BayTask(task, operation, car, wheelbase_mm, winner, version)
        self.job.was_granted, self.job.car_class = self.memory.was_granted, self.memory.car_class
        if self.job.was_granted:
            self._go(BayPhase.SERVING)
            return self._when_serving(now_us)
        # Whoever won meanwhile says so when asked, which every machine does at power-up.
        settling = [] if self.job.winner else self.calls.settle(self.job, now_us)
        self._go(BayPhase.LOCKING)
        is_unsaid = operation is Operation.PARK and car not in self.fleet.mirror.cars
        said = custody.state(self.fleet, car, self.station.number, wheelbase_mm) if is_unsaid else []
        return settling + said + self._when_locking(now_us)

    def _to_free(self) -> list[Effect]:
        over: list[Effect] = [job_over_record()] if self.job is not None else []
        self.job, self._robot_waits, self._key = None, False, None
        self.pipeline.free_from_us = None
        self._go(BayPhase.FREE)
        return over + self.outputs.door(DoorName.INPUT, DoorAction.OPEN)

    def _when_free(self, now_us: int) -> list[Effect]:
        assert self.bay is not None and self.doors is not None
        if not self._is(DoorName.INPUT, DoorPosition.OPEN):
            return []
        if self.stewardship.left is not None:
            return self._park_again(self.stewardship.left, now_us) if self.bay.load_kg else self.stewardship.gone()
        if self._key is not None:
            key, self._key = self._key, None
            return self._admit(key, now_us)
        if self.bay.load_kg or self.bay.person_inside:
            comes = not self.bay.load_kg and self.outputs.light is LightColour.GREEN
            called = self.pipeline.enters(now_us) if comes else []
            self._go(BayPhase.ENTERING if called else BayPhase.FREE)
            return called or self._invite(self.bay)
        is_out_next, called = self.pipeline.is_out_next(now_us)
        if not is_out_next:
            return called + self._invite(self.bay)
        self._go(BayPhase.RESERVING)
        return [*called, self.outputs.light_up(LightColour.RED), *self.outputs.door(DoorName.INPUT, DoorAction.CLOSE)]

    def _invite(self, bay: BayState) -> list[Effect]:
        colour = LightColour.RED if self._use is BayUse.EXIT else LightColour.GREEN
        return [self.outputs.light_up(colour)] if self.outputs.light is not colour and not bay.load_kg else []

    def _admit(self, key: DeskInput, now_us: int) -> list[Effect]:
        """Steps 2 to 5: check the car, print the ticket, call, turn the light red and close the input door."""
        bay = self.bay
        if bay is None or not bay.load_kg or self._use is BayUse.EXIT:
            return []
        found = bay_task.admitted(bay, self._park, self.fleet.mirror, charging=key is DeskInput.CHARGING_KEY)
        if isinstance(found, DeskText):
            return [self.outputs.show(found, Reference(0, 0))]
        effects = [] if self.job is None or found == ANY_CLASS else self.calls.not_come(now_us)
        is_called = self.job is not None
        if self.job is None:
            car, number = self.memory.next_reference(self.fleet)
            self.job = BayTask(car, Operation.PARK, car, bay.wheelbase_mm, car_class=found)
            # The number first: one that is not used is no harm, one used twice would be.
            effects.append(number)
        car = self.job.car
        effects[:0] = self.outputs.prepare_ticket(car)
        effects += self.fleet.tokens.create(car_token(*car))
        effects.append(job_record(car, Operation.PARK, car, bay.wheelbase_mm, found))
        if is_called:
            effects += self.calls.has_come(bay.wheelbase_mm)
        effects += custody.state(self.fleet, car, self.station.number, bay.wheelbase_mm)
        effects.append(self.outputs.print_ticket(car))
        if not is_called:
            effects += self.calls.call_for(self.job, now_us)
        self._go(BayPhase.LOCKING)
        return [*effects, self.outputs.light_up(LightColour.RED)]

    def _when_entering(self, now_us: int) -> list[Effect]:
        """Somebody drives in, and a robot is called for: until the key is pressed, or nobody is there any more."""
        assert self.bay is not None and self.job is not None
        key, self._key = self._key, None
        admitted = [] if key is None else self._admit(key, now_us)
        is_there = self.bay.person_inside or self.bay.load_kg
        comes = key is None and is_there and now_us < self.pipeline.entering_until_us
        if comes or self.phase is BayPhase.LOCKING:
            return admitted
        self._go(BayPhase.FREE)
        return [*self.calls.not_come(now_us), *admitted]

    def _when_locking(self, now_us: int) -> list[Effect]:
        assert self.bay is not None and self.job is not None
        if self._is(DoorName.INPUT, DoorPosition.LOCKED):
            self._go(BayPhase.AWAITING)
            return self._when_awaiting(now_us)
        if self.bay.person_inside:
            # Who presses again has no ticket: the power failed before it was printed.
            asked, self._key = self._key is not None, None
            return self.outputs.reprint(self.job.car) if asked and self.job.operation is Operation.PARK else []
        return self.outputs.door(DoorName.INPUT, DoorAction.CLOSE)

    def _when_reserving(self, now_us: int) -> list[Effect]:
        """Light red, input closing for a car that is to come out; a car that still came in goes first."""
        assert self.bay is not None
        if self.bay.load_kg or self.bay.person_inside:
            self._go(BayPhase.FREE)
            return self.outputs.door(DoorName.INPUT, DoorAction.OPEN)
        if not self._is(DoorName.INPUT, DoorPosition.LOCKED):
            return []
        called = [] if self.calls.ahead is not None else self.pipeline.call(0, now_us)
        return called + (self._promote(self.calls.ahead) if self.calls.ahead is not None else self._to_free())

    def _promote(self, job: BayTask) -> list[Effect]:
        """The next one gets the bay, which is empty and locked."""
        self.job, self.calls.ahead, self._robot_waits, self._key = job, None, False, None
        self._go(BayPhase.AWAITING)
        return [job_record(job.task, Operation.RETRIEVE, job.car, job.wheelbase_mm)]

    def _when_awaiting(self, now_us: int) -> list[Effect]:
        assert self.bay is not None and self.job is not None
        if self.job.is_parked(self.bay, self.fleet.mirror, self.station):
            self._go(BayPhase.CLOSING)
            return self._when_closing(now_us)
        if self.job.retry_at_us is not None and self.job.retry_at_us <= now_us:
            has_left = self.job.has_left(self.bay, self.fleet.mirror)
            return self._left(self.job) if has_left else self.calls.call_for(self.job, now_us)
        swapped = self.calls.swap()
        self._robot_waits |= bool(swapped)
        is_locked = self._is(DoorName.INPUT, DoorPosition.LOCKED) and not self.bay.person_inside
        if not self._robot_waits or not self.job.winner or not is_locked:
            return swapped
        self._go(BayPhase.OPENING)
        return swapped + self.outputs.door(DoorName.OUTPUT, DoorAction.OPEN)

    def _when_opening(self, now_us: int) -> list[Effect]:
        self._go(BayPhase.SERVING if self._is(DoorName.OUTPUT, DoorPosition.OPEN) else BayPhase.OPENING)
        return []

    def _when_serving(self, now_us: int) -> list[Effect]:
        """The robot has had the bay and gave it back: steps 13 and 14."""
        assert self.job is not None and self.bay is not None
        if not self.job.was_granted or not self.fleet.tokens.holds(station_token(self.station)):
            return [] if self.job.was_granted else self.calls.swap()
        phase, effects = self.calls.bay_came_back(now_us, is_loaded=bool(self.bay.load_kg))
        if phase is None:
            return []
        self._robot_waits &= phase is not BayPhase.AWAITING
        self._go(BayPhase.AWAITING if phase is BayPhase.AWAITING else BayPhase.CLOSING)
        return effects + self.outputs.door(DoorName.OUTPUT, DoorAction.CLOSE)

    def _when_closing(self, now_us: int) -> list[Effect]:
        job = self.job
        assert job is not None
        if not self._is(DoorName.OUTPUT, DoorPosition.LOCKED):
            return []
        if job.operation is Operation.PARK and not job.is_given_back:
            ahead = self.calls.ahead
            return self._to_free() if ahead is None else [job_over_record(), *self._promote(ahead)]
        self._go(BayPhase.HANDOVER)
        text = DeskText.CAR_READY
        if job.is_given_back:
            job.wait(now_us)
            if job.car not in self.tickets:
                text = bay_task.refusal_text(job.car_class, self._park, self.fleet.mirror)
        return [*self.outputs.door(DoorName.INPUT, DoorAction.OPEN), self.outputs.show(text, job.car)]

    def _when_handover(self, now_us: int) -> list[Effect]:
        """A car is its driver's: fetched for him, or nobody came to park it; tried again, at once by the key."""
        assert self.bay is not None and self.job is not None
        is_open = self._is(DoorName.INPUT, DoorPosition.OPEN)
        if is_open and not self.bay.load_kg and not self.bay.person_inside:
            return self._left(self.job)
        if not self.job.is_given_back:
            return []
        self._key = self._key if self.bay.person_inside else None
        is_asked = self._key is not None and self.job.car not in self.tickets
        if not is_open or (self.bay.person_inside and not is_asked):
            self.job.wait(now_us)
        elif is_asked or (self.job.retry_at_us is not None and self.job.retry_at_us <= now_us):
            self.job.retry_at_us = now_us
            self._go(BayPhase.LOCKING)
            return self._when_locking(now_us)
        return []

    def _left(self, job: BayTask) -> list[Effect]:
        """The car has gone out with its driver, fetched or never parked."""
        effects = job.refusal(self.fleet.node_id, self.station.number)
        effects += custody.state(self.fleet, job.car, OUTSIDE, job.wheelbase_mm)
        return [*effects, self.outputs.show(DeskText.WELCOME, Reference(0, 0)), *self._to_free()]

    # --- inner works -------------------------------------------------------------------------------------------

    def _refused(self, job: BayTask, reason: Reason, now_us: int) -> list[Effect]:
        """Nobody could, and it is tried again: a car to be parked is its driver's, one to be fetched waits behind."""
        if job.is_coming:
            self._go(BayPhase.FREE)
            return self.calls.not_come(now_us)
        said = self.calls.refused(job, reason, now_us)
        if in_vain.is_put_off(job, self.fleet.mirror):
            return said
        if job.operation is Operation.PARK:
            return said + self._give_back(job)
        behind, waited = self.calls.put_behind(job, self.phase, self.tickets)
        return [*said, *behind, *self.desks.give_up(job, self.calls, now_us), *(self._to_free() if waited else [])]

    def _give_back(self, job: BayTask) -> list[Effect]:
        if self.phase is BayPhase.HANDOVER:
            return [self.outputs.show(DeskText.CAR_READY, job.car)]
        self._go(BayPhase.CLOSING)
        return self.outputs.door(DoorName.OUTPUT, DoorAction.CLOSE)

    def _is(self, door: DoorName, position: DoorPosition) -> bool:
        assert self.doors is not None
        return (self.doors.input_door if door is DoorName.INPUT else self.doors.output_door) is position

    def _go(self, phase: BayPhase) -> None:
        self.phase = phase
        self.generation.is_free = phase is BayPhase.FREE
        self.generation.queue = len(self.tickets)
