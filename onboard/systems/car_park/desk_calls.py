"""At which compartment a car is handed out, where the site does not leave that to the desk that reads the ticket.

That desk calls for its car to be received (operation RECEIVE): each compartment that gives cars out bids by the site's
policy (``BayGeneration``), the desk too, and the winner queues the ticket like one of its own. A car that is aboard a
robot still is called for once it stands: which bay suits it depends on where. A bay has at most ``MOST_TAKEN`` of them:
with more customers than that a desk calls when by what is told somebody has room, who waits longest first. The desk
answers for the ticket, in its journal, until the car has left: where whoever took it is lost, and no robot is at the
car, it calls anew under a raised version; and where nobody can bring the car to that bay, which gives the ticket back.
"""

from collections import Counter, deque
from dataclasses import dataclass, field
from typing import Any

from onboard.contract.car_park import Promise
from onboard.contract.codes import (
    CallResult,
    Criterion,
    DeskText,
    KindCode,
    LegAction,
    Operation,
    Reason,
    TaskPhase,
)
from onboard.contract.constants import ANY_STATION, NOBODY, OUTSIDE, TASK_VERSION_BITS
from onboard.contract.messages import Award, Bid, CallForProposals, CarAt, Message, Reference, TaskReport
from onboard.core.effects import Effect, Record, Report, Send
from onboard.core.negotiation import EVENT_TYPES, Awarded, Closed, RequestedTerms
from onboard.core.negotiation.winners import patience_us
from onboard.core.serial import from_bus_ms, is_newer, successor
from onboard.systems.car_park import bay_task, custody
from onboard.systems.car_park.bay_calls import BayCalls
from onboard.systems.car_park.bay_generation import MOST_TAKEN, BayGeneration
from onboard.systems.car_park.bay_memory import BayMemory, ticket_record
from onboard.systems.car_park.bay_task import SETTLING_US, BayTask
from onboard.systems.car_park.outputs import BayOutputs
from onboard.systems.car_park.records import DeskForRecord, ReceivedRecord, TicketGoneRecord
from onboard.systems.car_park.site import CarPark, DeskPolicy
from onboard.ways.mirror import WayFleet

#: A car that is aboard a robot, or in a bay, has no way to compare yet: its desk looks again after this, us.
LOOK_AGAIN_US = 2_000_000
#: Who has not waited yet calls so long after there is room again, us; who has for ``WAITED_US``, after half of it, and
#: so on: whoever hears a call leaves the room to it.
HOLD_US = 1_000_000
WAITED_US = 20_000_000
#: Of desks that all know where a car stands each has its turn so much after the one before, us: a call takes less.
TURN_US = 20_000
#: Nobody had room after all: the next try, us.
FULL_US = 10_000_000
#: Calls, and cars that others receive, that are remembered; older ones have long left.
MAX_TOLD = 256


@dataclass
class AskedTicket:
    """A ticket that was read here: its task, and who has taken it; until then from when on it is called for, bus us.

    ``since_us``: since when it waits, or its winner has it; 0: since before a restart.
    """

    task: Reference
    version: int = 1
    winner: int = NOBODY
    since_us: int = 0
    call_at_us: int | None = 0
    is_open: bool = False
    #: It was to be called for when its car had no place yet.
    is_aboard: bool = False
    #: Its customer was told that the compartment is off to which the car is on its way.
    is_told_off: bool = False


@dataclass
class DeskCalls:
    """One compartment's part. ``tickets`` are those that its own bay serves."""

    fleet: WayFleet
    park: CarPark
    memory: BayMemory
    generation: BayGeneration
    outputs: BayOutputs
    tickets: deque[Reference]
    asked: dict[Reference, AskedTicket] = field(default_factory=dict)
    #: Tickets read at another desk and taken over here: their task there, and its version.
    received: dict[Reference, tuple[Reference, int]] = field(default_factory=dict)
    #: Which compartment hands a car out, by the awards that were heard; for who asks again at another desk.
    _told: dict[Reference, int] = field(default_factory=dict)
    _cars_of_calls: dict[tuple[int, int], Reference] = field(default_factory=dict)
    #: Calls of others for cars to be received, until when each is open, bus us; and since when there is room for more.
    _open_us: dict[tuple[int, int], int] = field(default_factory=dict)
    _room_us: int | None = 0
    _looked_us: int = 0
    #: Machines that were out when this machine last looked.
    _out: frozenset[int] = frozenset()

    def __post_init__(self) -> None:
        in_hand = {one[index] for one, index in ((self.memory.job, 2), (self.memory.ahead, 1)) if one is not None}
        for car, known in self.memory.received.items():
            self.received[car] = known
            if car not in self.tickets and car not in in_hand:
                # It was noted whose ticket it is, and the power failed.
                self.tickets.append(car)
        for car, (task, version, winner) in self.memory.desks.items():
            # Who has taken one that was still called for says so when it is asked, which all are at a restart.
            self.asked[car] = AskedTicket(task, version, winner)

    @property
    def is_on(self) -> bool:
        """Whether the site's policy is any other than that a car comes to the desk that reads its ticket."""
        return self.park.desk is not DeskPolicy.ANY

    # --- a ticket is read --------------------------------------------------------------------------------------

    def take(
        self, car: Reference, calls: BayCalls, now_us: int, *, urgent: bool = False, mine: bool = False
    ) -> list[Effect]:
        """What is done with a ticket, ``calls`` being those of this bay; an urgent one, and one won, is its own."""
        record = self.fleet.mirror.cars.get(car)
        if record is None or record.station == OUTSIDE:
            return [self.outputs.show(DeskText.UNKNOWN_TICKET, car)]
        about = calls.of_car(car)
        is_here = urgent or mine or about is not None or car in self.tickets
        elsewhere = None if is_here else self._elsewhere(car, now_us)
        if elsewhere is not None:
            return elsewhere
        if self.fleet.node_id not in self.generation.exits() and (about is None or about is not calls.job):
            return [self.outputs.show(DeskText.OUT_OF_ORDER, car)]
        in_hand = about is not None and about.operation is Operation.RETRIEVE
        new = not in_hand and bay_task.queue_ticket(self.tickets, car, urgent=urgent)
        noted: list[Effect] = [ticket_record(car, urgent=urgent)] if new else []
        is_back = about is not None and about is calls.job and about.may_be_given_back
        return noted if is_back else [*noted, self.outputs.show(DeskText.PLEASE_WAIT, car)]

    def _elsewhere(self, car: Reference, now_us: int) -> list[Effect] | None:
        """A ticket for whichever compartment suits its car; None where this one keeps it."""
        if not self.is_on:
            return None
        if car in self.asked:
            return [self._word(car, self.asked[car].winner)]
        elsewhere = self._told_to(car)
        if elsewhere != NOBODY:
            return [self._word(car, elsewhere)]
        place = custody.place_of(self.fleet, car)
        obstacles = self.fleet.mirror.obstacles.machines
        others = [node for node in self.generation.exits() if node != self.fleet.node_id and node not in obstacles]
        # A car that is aboard still is called for from its place; where it is this bay's by the site's word, by none.
        is_own = place is None and self.park.desk is DeskPolicy.OWN and car.origin == self.fleet.node_id
        if is_own or not others:
            return None
        task, number = self.memory.next_reference(self.fleet)
        self.asked[car] = AskedTicket(task, since_us=now_us)
        return [number, self._note(car), self.outputs.show(DeskText.PLEASE_WAIT, car)]

    def _told_to(self, car: Reference) -> int:
        """Which other compartment that lives hands a car out, by what was heard; NOBODY where none."""
        node = self._told.get(car, NOBODY)
        return NOBODY if node == self.fleet.node_id or node in self.fleet.mirror.obstacles.machines else node

    def _asked_for_elsewhere(self) -> list[Effect]:
        """Who asked at two desks hears at both where the car comes: the other one's call was first."""
        waiting = [car for car, one in self.asked.items() if not (one.winner or one.is_open)]
        mine = dict.fromkeys(self.received, self.fleet.node_id)
        told = {car: node for car in waiting if (node := self._told_to(car) or mine.get(car, NOBODY)) != NOBODY}
        for car in told:
            del self.asked[car]
        return [self._word(car, node) for car, node in told.items()]

    def _word(self, car: Reference, winner: int) -> Effect:
        """What the customer reads: where the car comes, or that this is to be known soon."""
        if winner == NOBODY:
            return self.outputs.show(DeskText.PLEASE_WAIT, car)
        return self.outputs.show(DeskText.GO_TO, car, winner)

    def _note(self, car: Reference) -> Effect:
        one = self.asked[car]
        return Record(DeskForRecord(car, one.task, one.version, one.winner))

    # --- the desk that has read it -----------------------------------------------------------------------------

    def review(self, now_us: int) -> list[Effect]:
        """Call for those that nobody has taken, and anew for those whose winner is lost."""
        self._looked_us = now_us
        effects: list[Effect] = []
        for car in [car for car in (*self.asked, *self.received) if self._has_left(car)]:
            self.asked.pop(car, None)
            self.received.pop(car, None)
        self._remember_given_up()
        effects += self._asked_for_elsewhere()
        rooms = self._rooms(now_us) if self.asked else 0
        if rooms <= 0:
            self._room_us = None
        elif self._room_us is None:
            self._room_us = now_us
        for car, one in list(self.asked.items()):
            if one.winner and not one.since_us:
                one.since_us = now_us
            effects += self._hear_myself(one, now_us)
            if self._is_lost(car, one, now_us):
                effects += self._free(car, one, Reason.NODE_SILENT, now_us)
            elif self._is_off(car, one, now_us) and not one.is_told_off:
                # A robot has it in hand, and waits for that bay as its customer does; or it is off with the car aboard.
                one.is_told_off = True
                effects.append(self.outputs.show(DeskText.OUT_OF_ORDER, car))
            due_us = self._call_at_us(one)
            if rooms > 0 and due_us is not None and due_us <= now_us:
                called = self._call(car, one, now_us)
                effects += called
                rooms -= bool(called)
        return effects

    def _remember_given_up(self) -> None:
        """Until a car has left, or a machine is back: there may be a way again."""
        given_up, out = self.generation.given_up, frozenset(self.fleet.mirror.obstacles.machines)
        given_up -= given_up if self._out - out else {car for car in given_up if self._has_left(car)}
        self._out = out

    def _call_at_us(self, one: AskedTicket) -> int | None:
        """When a ticket is called for; None while it is, or somebody has it, or there is no room, bus us."""
        if one.winner or one.is_open or one.call_at_us is None or self._room_us is None:
            return None
        held_us = HOLD_US * WAITED_US // (WAITED_US + max(0, self._room_us - one.since_us))
        return max(one.call_at_us, self._room_us + held_us if self._room_us > one.since_us else 0)

    def _rooms(self, now_us: int) -> int:
        """How many cars compartments that live can have beyond those that are called for; at least one by ``OWN``."""
        if self.park.desk is DeskPolicy.OWN:
            return len(self.asked)
        obstacles, here, node = self.fleet.mirror.obstacles.machines, self.fleet.mirror.cars, self.fleet.node_id
        taken = Counter(bay for car, bay in self._told.items() if car in here and here[car].station != OUTSIDE)
        taken[node] = self.generation.taken
        rooms = sum(max(0, MOST_TAKEN - taken[bay]) for bay in self.generation.exits() if bay not in obstacles)
        self._open_us = {call: until_us for call, until_us in self._open_us.items() if until_us > now_us}
        return rooms - len(self._open_us) - sum(one.is_open for one in self.asked.values())

    def _has_left(self, car: Reference) -> bool:
        """By its custodian's word: a car of which nothing is known may be anywhere.

        Who was alone when it started hears of others' cars later, and while a robot takes one nobody says where it is.
        """
        return bay_task.is_gone(car, self.fleet.mirror)

    def _call(self, car: Reference, one: AskedTicket, now_us: int) -> list[Effect]:
        place = custody.place_of(self.fleet, car)
        if place is None or car not in self.fleet.mirror.cars:
            one.call_at_us, one.is_aboard = now_us + LOOK_AGAIN_US, True
            return []
        others_us = [until_us for call, until_us in self._open_us.items() if self._cars_of_calls.get(call) == car]
        if one.is_aboard or others_us:
            # Its driver may have asked at another desk as well, which hears at the same time that it stands now.
            turn_us = TURN_US * sum(node < self.fleet.node_id for node in self.park.compartments)
            one.call_at_us, one.is_aboard = (
                max([now_us + turn_us, *(until_us + HOLD_US for until_us in others_us)]),
                False,
            )
            return []
        if not one.since_us:
            # After a restart: who has taken it says so first, and what was said before is void.
            one.since_us, one.call_at_us = now_us, now_us + SETTLING_US
            one.version = successor(one.version, TASK_VERSION_BITS)
            return [self._note(car)]
        one.is_open = True
        terms = RequestedTerms(
            task=one.task,
            operation=Operation.RECEIVE,
            kind=KindCode.COMPARTMENT,
            criterion=Criterion.FINISH_TIME,
            from_station=place.number,
            to_station=ANY_STATION,
            load=car,
            load_mm=self.fleet.mirror.cars[car].wheelbase_mm,
            task_version=one.version,
            floor=self.generation.floor,
        )
        said = list(self.fleet.negotiation.open(terms, now_us))
        calls = [effect.message for effect in said if isinstance(effect, Send)]
        mine = [call for call in calls if isinstance(call, CallForProposals)] if self.generation.may_take else []
        for call in mine:
            # Others hear at once what they have to beat.
            bid = Bid(call.sender, call.sender, call.call, self.generation.cost(call, now_us), 0)
            self.fleet.negotiation.receive(bid, now_us)
            said.append(Send(bid))
        return said

    def _hear_myself(self, one: AskedTicket, now_us: int) -> list[Effect]:
        """An own call that this machine has won itself is over with its award."""
        node, negotiation = self.fleet.node_id, self.fleet.negotiation
        if not one.is_open or negotiation.trust.winner(one.task) != node:
            return []
        heard = TaskReport(node, one.task, TaskPhase.AWARDED, self.outputs.bay.number, Reason.NONE)
        outcome = negotiation.receive(heard, now_us)
        return [effect for event in outcome if isinstance(event, Closed) for effect in self.closed(event, now_us)]

    def _free(self, car: Reference, one: AskedTicket, reason: Reason, now_us: int) -> list[Effect]:
        """Whoever had it has it no more, and it is called for anew: noted before anybody hears of it."""
        one.winner, one.version = NOBODY, successor(one.version, TASK_VERSION_BITS)
        one.is_open, one.since_us, one.call_at_us = False, one.since_us or now_us, now_us
        outcome = self.fleet.negotiation.abandon(one.task, reason, now_us)
        self._told.pop(car, None)
        return [self._note(car), *(item for item in outcome if not isinstance(item, EVENT_TYPES))]

    def _is_lost(self, car: Reference, one: AskedTicket, now_us: int) -> bool:
        """Whether who has it has not heard of it, or is off, and nobody is at the car or has it on the way."""
        if not one.winner:
            return self.fleet.negotiation.silent_winner(one.task, now_us) != NOBODY
        place = custody.place_of(self.fleet, car)
        if place is None or not self._is_off(car, one, now_us):
            return False
        plans = self.fleet.mirror.itineraries.values()
        works = [leg for plan in plans for leg in plan.legs if leg.action is LegAction.WORK]
        there = [leg for leg in works if (leg.track, leg.to_index, leg.side) == tuple(place)]
        # Of who brought it there the plan may stand still.
        return all(from_bus_ms(leg.end_ms, now_us) < one.since_us for leg in there)

    def _is_off(self, car: Reference, one: AskedTicket, now_us: int) -> bool:
        due_us = self._lost_at_us(car, one)
        return due_us is not None and now_us >= due_us

    def _lost_at_us(self, car: Reference, one: AskedTicket) -> int | None:
        """When the bay that has taken it, or else the robot that the car is aboard of, counts as lost, bus us."""
        record = self.fleet.mirror.cars.get(car)
        carrier = record.custodian if record is not None and record.station == ANY_STATION else NOBODY
        obstacle = self.fleet.mirror.obstacles.machines.get(one.winner or carrier)
        return None if obstacle is None else max(obstacle.since_us, one.since_us) + patience_us(obstacle)

    def next_wake(self) -> int | None:
        """When one is called for, or its winner may count as lost: looked at again and again from then on, bus us."""
        waiting = [self._call_at_us(one) for one in self.asked.values()]
        lost = [self._lost_at_us(car, one) for car, one in self.asked.items() if not one.is_told_off or one.winner]
        times = [max(due_us, self._looked_us + LOOK_AGAIN_US) for due_us in lost if due_us is not None]
        times += [due_us for due_us in waiting if due_us is not None]
        if self._room_us is None and any(not (one.winner or one.is_open) for one in self.asked.values()):
            times += self._open_us.values()
        return min(times, default=None)

    def closed(self, event: Closed, now_us: int) -> list[Effect]:
        """An own call for a car to be received is over: its customer is told where."""
        car = event.call.car
        one = self.asked.get(car)
        if one is None or one.task != event.call.task or not one.is_open:
            return []
        if event.result is CallResult.AWARDED:
            return self._taken_by(car, one, event.winner, now_us)
        if event.result is CallResult.REJECTED:
            return self._free(car, one, event.reason, now_us)
        one.is_open, one.call_at_us = False, now_us + FULL_US
        if any(bay not in self.fleet.mirror.obstacles.machines for bay in self.generation.exits()):
            return []
        return [self.outputs.show(DeskText.OUT_OF_ORDER, car), Report(f"no compartment can hand out car {car.number}")]

    def _taken_by(self, car: Reference, one: AskedTicket, winner: int, now_us: int) -> list[Effect]:
        one.winner, one.since_us, one.is_open, one.is_told_off = winner, now_us, False, False
        self._told[car] = winner
        if winner != self.fleet.node_id:
            return [self._note(car), self._word(car, winner)]
        # In this life it stays known whose it is: whoever had won it before, and was off, may have it in its journal.
        bay_task.queue_ticket(self.tickets, car, urgent=False)
        return [ticket_record(car, urgent=False), self._word(car, winner)]

    # --- the compartment that takes it -------------------------------------------------------------------------

    def won(self, event: Awarded) -> list[Effect]:
        """A ticket that was read at another desk is this compartment's: noted, with its task there."""
        version = 1 if event.award is None else event.award.task_version
        if not self.is_on or event.call.car not in self.fleet.mirror.cars:
            return []
        self.received[event.call.car] = event.call.task, version
        return [Record(ReceivedRecord(event.call.car, event.call.task, version))]

    def give_up(self, task: BayTask, calls: BayCalls, now_us: int) -> list[Effect]:
        """Nobody can bring a car here whose ticket waits: its desk calls for another bay, or this if all have tried.

        Once for each car until a machine is back: where no bay can be reached its customer is not sent round and round.
        Not at all while no robot can come: at another bay it would be the same.
        """
        car, node, obstacles = task.car, self.fleet.node_id, self.fleet.mirror.obstacles.machines
        others = [bay for bay in self.generation.exits() if bay != node and bay not in obstacles]
        if obstacles.keys() >= set(self.park.robots):
            return []
        asked, received = self.asked.get(car), self.received.get(car)
        is_mine = received is not None or (asked is not None and asked.winner == node)
        if not (self.is_on and others and is_mine and car in self.tickets) or car in self.generation.given_up:
            return []
        self.generation.given_up.add(car)
        self.tickets.remove(car)
        gone = [*calls.call_off(task, now_us), Record(TicketGoneRecord(car))]
        if received is not None:
            del self.received[car]
            gone.append(self.accepts(received[0], TaskPhase.FORFEITED, Reason.NO_BID))
        return gone + ([] if asked is None else self._free(car, asked, Reason.NO_BID, now_us))

    def statements(self) -> list[Effect]:
        """Who was away hears which tickets are whose: mine of other desks, and those that were read here."""
        mine = [self.accepts(task) for task, _ in self.received.values()]
        return [*mine, *(Send(self._award(one)) for one in self.asked.values() if one.winner)]

    def accepts(self, task: Reference, phase: TaskPhase = TaskPhase.AWARDED, why: Reason = Reason.NONE) -> Effect:
        """That this bay has a car to hand out that was asked for under ``task``, or not."""
        return Send(TaskReport(self.fleet.node_id, task, phase, self.outputs.bay.number, why))

    def _award(self, one: AskedTicket) -> Award:
        return Award(self.fleet.node_id, 0, one.winner, one.task, one.version, CallResult.AWARDED, Reason.NONE)

    # --- what is heard -----------------------------------------------------------------------------------------

    def hear(self, message: Message, now_us: int) -> tuple[list[Effect], Reference | None]:
        """What is answered, and the car whose ticket is another's now."""
        if not self.is_on:
            return [], None
        match message:
            case CallForProposals() if message.operation is Operation.RECEIVE:
                key = message.sender, message.call
                self._cars_of_calls[key], self._open_us[key] = message.car, from_bus_ms(message.deadline_ms, now_us)
                _shorten(self._cars_of_calls)
            case CallForProposals() if message.operation is Operation.RETRIEVE:
                self._tell(message.car, message.sender)
            case Award() if message.result is CallResult.AWARDED:
                self._open_us.pop((message.sender, message.call), None)
                return self._on_award(message)
            case TaskReport() if message.sender in self.park.compartments:
                return self._on_report(message, now_us), None
            case CarAt() if message.sender != self.fleet.node_id and bay_task.is_gone(message.car, self.fleet.mirror):
                # Whatever was not heard of who takes it: nobody need wait for it any more.
                return [], message.car
            case Promise() if message.car in self.asked:
                ready_us, spread_us = from_bus_ms(message.ready_ms, now_us), message.spread_ms * 1_000
                return [self.outputs.promise(message.car, ready_us, spread_us, now_us)], None
        return [], None

    def _on_award(self, award: Award) -> tuple[list[Effect], Reference | None]:
        car = self._cars_of_calls.get((award.sender, award.call))
        if car is not None:
            self._tell(car, award.winner)
        mine = next((one for one, (task, _) in self.received.items() if task == award.task), None)
        if mine is None and car in self.generation.given_up and award.winner != self.fleet.node_id:
            # Its customer was sent to this bay, and stands here.
            return [self._word(car, award.winner)], None
        if mine is not None and award.winner != self.fleet.node_id:
            if not is_newer(award.task_version, self.received[mine][1], TASK_VERSION_BITS):
                return [], None
            del self.received[mine]
            if mine in self.tickets:
                self.tickets.remove(mine)
            # Its customer was sent here.
            return [Record(TicketGoneRecord(mine)), self._word(mine, award.winner)], mine
        is_known = self.fleet.negotiation.knows(award.sender, award.call) or (award.call and mine is None)
        if award.winner != self.fleet.node_id or is_known:
            return [], None
        # Its desk tells who was away what it knows: a ticket of which nothing is known here is given back.
        lost = TaskPhase.FORFEITED, Reason.JOURNAL_LOST
        return [self.accepts(award.task) if mine else self.accepts(award.task, *lost)], None

    def _tell(self, car: Reference, node: int) -> None:
        self._told.pop(car, None)
        self._told[car] = node
        _shorten(self._told)

    def _on_report(self, report: TaskReport, now_us: int) -> list[Effect]:
        car = next((car for car, one in self.asked.items() if one.task == report.task), None)
        if car is None:
            return []
        one = self.asked[car]
        if report.phase is TaskPhase.FORFEITED and report.sender == one.winner:
            return self._free(car, one, report.reason, now_us)
        if report.phase is not TaskPhase.AWARDED or report.sender == one.winner:
            return []
        if one.winner:
            return [Send(self._award(one))]
        # After a restart: it was awarded, and the power failed before that was noted.
        return [] if one.is_open else self._taken_by(car, one, report.sender, now_us)


def _shorten(table: dict[Any, Any]) -> None:
    while len(table) > MAX_TOLD:
        del table[next(iter(table))]
