"""What a compartment does before its bay is free for it: who comes in next, who goes out, and what is called for.

With drivers one behind the other outside, two come in and up to three cars go out by turns: the robot that brings one
finds the bay locked and empty behind the robot that took the other. The next car is called for while another robot
still brings the one before; whichever is there first goes out first. Drivers, who cannot be seen outside, are invited
after ``MOST_OUT`` cars at the latest. With ``call_at = "key"`` in the site file nothing is called for ahead (row P50's
order), and they take turns in any case.
"""

from collections import deque
from dataclasses import dataclass, field

from onboard.contract.codes import DeskText, Operation, Reason
from onboard.contract.constants import ANY_STATION, NOBODY
from onboard.contract.messages import BayState, Message, Reference
from onboard.core.effects import Effect, Send
from onboard.systems.car_park import bay_task, custody
from onboard.systems.car_park.bay_calls import BayCalls
from onboard.systems.car_park.bay_generation import DRIVER_US
from onboard.systems.car_park.bay_memory import BayMemory, ahead_record
from onboard.systems.car_park.bay_task import BayPhase, BayTask
from onboard.systems.car_park.fetch_times import FetchTimes
from onboard.systems.car_park.outage import Outage
from onboard.systems.car_park.outputs import BayOutputs
from onboard.systems.car_park.quiet_moves import QuietMoves
from onboard.systems.car_park.site import ANY_CLASS, CallAt, CarPark
from onboard.ways.mirror import WayFleet
from onboard.ways.site import BayUse
from onboard.ways.tokens import car_token

#: A driver who waits outside drives in within this once he is invited, us: a second to see it, and one to begin.
QUEUED_US = 2_500_000
#: So many cars go out one behind the other while nobody looked for drivers: a look costs ``QUEUED_US`` and the lead of
#: the next car's robot, some 25 s, a tenth of three of the 53 to 99 s that a car takes a bay (docs/decisions.md).
MOST_OUT = 3
#: And where the key calls, so that a look costs no more than ``QUEUED_US`` (docs/decisions.md).
MOST_OUT_BY_KEY = 1
#: With a queue outside so many cars come in, then so many go out and the one behind the last that was taken away:
#: robots of those that go out fetch at the same time, and an empty bay waits less often (docs/figures.md).
BY_TURNS = 2
#: From driving in until the input door begins to lock, us: a drive of 10 to 30 s and a walk of 4 to 8 s on average.
ENTERED_US = 26_000_000
#: Who drives in has pressed the key within this, us: the longest drive, and a person's patience once.
ENTERING_US = 45_000_000


@dataclass
class Pipeline:
    """One compartment's look ahead; it calls, and the compartment moves doors. Times are bus us."""

    fleet: WayFleet
    park: CarPark
    calls: BayCalls
    memory: BayMemory
    tickets: deque[Reference]
    outputs: BayOutputs
    #: Since when drivers are invited, and whether the last one came at once: then there is a queue outside.
    free_from_us: int | None = None
    is_queued: bool = False
    #: Who comes in has until then to press the key; 0 while the bay is empty.
    entering_until_us: int = 0
    #: Cars that have gone out since drivers were last invited.
    outs: int = 0
    #: Drivers who have come in since a car last went out.
    ins: int = 0
    _looked_us: int = 0
    #: Who asked for the bay though nothing is known of a task for it.
    _wanted_by: int = NOBODY
    outage: Outage = field(init=False)
    moves: QuietMoves = field(init=False)
    times: FetchTimes = field(init=False)

    def __post_init__(self) -> None:
        self.moves = QuietMoves(self.fleet, self.park, self.calls, self.memory, self.tickets)
        self.times = FetchTimes(self.fleet, self.memory, self.outputs, self.moves.stays)
        self.outage = Outage(self.fleet, self.calls, self.outputs, self.tickets)

    @property
    def is_on(self) -> bool:
        """Whether this site calls before the key, and before the bay is locked."""
        return self.park.call_at is CallAt.ARRIVAL

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        """What is said of cars that are moved while nobody waits, and of when they will be fetched."""
        return self.moves.hear(message, now_us) + self.times.hear(message, now_us)

    def next_wake(self, phase: BayPhase) -> int | None:
        """When whoever comes in has not pressed the key, an invited driver has not come, no robot does, or all rest."""
        again_us = self.calls.in_vain.next_wake(self._looked_us)
        due = (self._next_look(phase), again_us, self.moves.next_wake(), self.times.next_wake())
        return min((one for one in due if one is not None), default=None)

    def _next_look(self, phase: BayPhase) -> int | None:
        if phase is BayPhase.ENTERING:
            return self.entering_until_us
        if phase is not BayPhase.FREE:
            return self.outage.next_wake(phase)
        waits = self._is_drivers_turn and bool(self.tickets or self.calls.ahead)
        if self.free_from_us is None or not waits:
            return None
        due_us = self.free_from_us + QUEUED_US
        # Somebody in the bay, or a door that does not stay open: whatever ends that is told.
        return due_us if due_us > self._looked_us else None

    @property
    def _is_drivers_turn(self) -> bool:
        """Drivers queue and are let in, or might: nobody has looked for long. Where the key calls, by single turns."""
        if self.park.bay_uses.get(self.fleet.node_id) is BayUse.EXIT:
            return self.is_queued
        if self.is_on and self.is_queued:
            return self.outs >= BY_TURNS or 0 < self.ins < BY_TURNS
        return self.outs >= (MOST_OUT if self.is_on else MOST_OUT_BY_KEY)

    def void(self) -> list[Effect]:
        """After a restart: who was driving in was called for without a record, and is called for anew by the key.

        What was called last is known by its record or its car's right, or was such a call; or a task long over, of
        which nobody minds to hear so again.
        """
        if not self.is_on:
            return []
        node, last, tokens = self.fleet.node_id, self.memory.number, self.fleet.tokens
        called = [Reference(node, number) for number in (last, last - 1) if number > 0]
        lost = [one for one in called if self.calls.named(one) is None and not tokens.is_known(car_token(*one))]
        return [Send(bay_task.void_award(node, one)) for one in lost]

    # --- a driver comes in -------------------------------------------------------------------------------------

    def enters(self, now_us: int) -> list[Effect]:
        """Somebody is in the free bay: call for a robot before the car is measured, where any place will do."""
        if self.free_from_us is not None:
            self.is_queued, self.free_from_us = now_us - self.free_from_us <= QUEUED_US, None
            self.outs, self.ins, self._wanted_by = 0, self.ins + 1, NOBODY
        if not self.is_on or not self.fleet.tokens.is_synced:
            # Who does not know yet whether its journal is whole gives no number away.
            return []
        is_told_by_size = bool(self.park.classes) or self.park.measures_width
        if self.entering_until_us or is_told_by_size or not bay_task.has_room(ANY_CLASS, self.park, self.fleet.mirror):
            return []
        self.entering_until_us = now_us + ENTERING_US
        car, number = self.memory.next_reference(self.fleet)
        ready_us = now_us + ENTERED_US + self.park.timing.door_us
        return [number, *self.calls.call_for_who_comes(car, ready_us, now_us)]

    # --- a car goes out ----------------------------------------------------------------------------------------

    def is_out_next(self, now_us: int) -> tuple[bool, list[Effect]]:
        """The bay is empty: whether it is locked for a car that is to come out, and what is said to have it fetched."""
        bay_task.forget_tickets(self.tickets, self.fleet.mirror)
        self.entering_until_us = 0
        self.free_from_us = now_us if self.free_from_us is None else self.free_from_us
        was_open_for_all = now_us - self.free_from_us >= QUEUED_US
        brought = self._take_up_brought()
        if self._is_drivers_turn and not was_open_for_all:
            return False, brought
        if was_open_for_all:
            self.is_queued, self.outs = False, 0
        # After a restart the journal may know of a task whose bay was not noted yet.
        called = self.call(now_us, now_us) if self.is_on and self.calls.ahead is None else []
        is_out = self._is_to_come() or (not self.is_on and self._first_that_stands(now_us) is not None)
        self.outs += is_out
        self.ins = 0 if is_out else self.ins
        return is_out, brought + called

    def _is_to_come(self) -> bool:
        """Whether the bay is to be locked for the next car, or for one that nobody could fetch, if it was won now."""
        ahead = self.calls.ahead
        return ahead is not None and bool(ahead.winner or not ahead.refusals)

    def wants(self, robot: int) -> Reason:
        """A robot asks for the bay, of which it has no task here; it may have had one before the journal was lost."""
        ahead = self.calls.ahead
        is_its = ahead is not None and ahead.winner == robot
        self._wanted_by = NOBODY if is_its or self.free_from_us is None else robot
        return Reason.TOKEN_NOT_GRANTABLE_YET

    def _take_up_brought(self) -> list[Effect]:
        """The car that such a robot has aboard was asked for here: it is the next to go out."""
        robot, self._wanted_by = self._wanted_by, NOBODY
        cars = self.fleet.mirror.cars.items() if robot != NOBODY and self.calls.ahead is None else ()
        aboard = [car for car, record in cars if (record.custodian, record.station) == (robot, ANY_STATION)]
        if not aboard or not self.calls.brings(robot):
            return []
        task, number = self.memory.next_reference(self.fleet)
        car, wheelbase_mm = aboard[0], self.fleet.mirror.cars[aboard[0]].wheelbase_mm
        ahead = self.calls.ahead = BayTask(task, Operation.RETRIEVE, car, wheelbase_mm)
        return [number, ahead_record(task, car, wheelbase_mm), *self.calls.won_by(ahead, robot, 0)]

    def look_ahead(self, phase: BayPhase, bay: BayState, now_us: int) -> list[Effect]:
        """Call for who is next, tell who waits in vain, and use the time while nobody is here or waits."""
        effects = self._look_ahead(phase, now_us) + self.outage.review(phase, now_us) + self.times.review(now_us)
        return effects + self.moves.review(phase, now_us, is_empty=not (bay.load_kg or bay.person_inside))

    def _look_ahead(self, phase: BayPhase, now_us: int) -> list[Effect]:
        """Call for the next car while the bay still works, once it is known when it can take it."""
        self._looked_us = now_us
        if self.calls.forgot and phase is BayPhase.FREE:
            self.calls.forgot = False
            return [self.outputs.show(DeskText.INSERT_AGAIN, Reference(0, 0))]
        job = self.calls.job
        if job is None or self.calls.ahead is not None or not self.tickets or not self.is_on:
            return []
        door_us, is_parked = self.park.timing.door_us, job.operation is Operation.PARK
        if self._is_drivers_turn:
            return []
        if phase is BayPhase.HANDOVER and not is_parked:
            return self.call(now_us + DRIVER_US + door_us, now_us)
        # Another robot fetches the next one while that of the job is on its way.
        taken_us = self.calls.done_at_us(job, now_us) if job.winner and not job.is_given_back else None
        driver_us = 0 if is_parked else DRIVER_US + door_us
        return [] if taken_us is None else self.call(max(taken_us, now_us) + driver_us + door_us, now_us)

    def call(self, ready_us: int, now_us: int) -> list[Effect]:
        """Call for the first car that is asked for and stands; the bay can take it from ``ready_us`` on."""
        bay_task.forget_tickets(self.tickets, self.fleet.mirror)
        car = self._first_that_stands(now_us)
        if car is None:
            return []
        self.tickets.remove(car)
        noted: list[Effect] = []
        ahead = self.calls.in_vain.task(car)
        if ahead is None:
            task, number = self.memory.next_reference(self.fleet)
            ahead = BayTask(task, Operation.RETRIEVE, car, self.fleet.mirror.cars[car].wheelbase_mm)
            noted.append(number)
        ahead.ready_us, self.calls.ahead = ready_us, ahead
        noted.append(ahead_record(ahead.task, car, ahead.wheelbase_mm))
        return noted + self.calls.call_for(ahead, now_us)

    def _first_that_stands(self, now_us: int) -> Reference | None:
        """The car that was asked for first, but for those aboard: a robot that has stopped keeps its own for long.

        And but for those that nobody could fetch a moment ago.
        """
        in_vain = self.calls.in_vain
        stands = (car for car in self.tickets if custody.place_of(self.fleet, car) is not None)
        return next((car for car in stands if not in_vain.waits(car, now_us)), None)
