"""The mission desk: one more holon (row M39). It turns missions into calls, has boxes in its books and keeps rights.

It plans for nobody. As steward it grants the right to a slot in the order in which the plans pass there, and a box to
whoever plans to carry it.
"""

from dataclasses import dataclass, field
from functools import partial

from onboard.contract.codes import (
    CallResult,
    Criterion,
    KindCode,
    MachineState,
    ManualMode,
    Operation,
    Reason,
    TaskPhase,
    TokenKind,
)
from onboard.contract.messages import (
    NO_REFERENCE,
    CallForProposals,
    CarAt,
    Halted,
    Heartbeat,
    ManualOrder,
    ManualState,
    Message,
    Reference,
    TaskReport,
    TokenGrant,
)
from onboard.contract.terminal import BoxOrder, PlanHead, StepReport, TaskTerms
from onboard.contract.terminal_device import LaneSensor, ManualKey, MissionAnswer, MissionKey
from onboard.core.authority import TokenKey
from onboard.core.behaviour import BehaviourFactory, Fleet
from onboard.core.effects import Effect, Halt, Record, Report, Send, Tell
from onboard.core.mirror import Mirror
from onboard.core.negotiation import EVENT_TYPES, Closed, Estimator, NegotiationEvent, RequestedTerms
from onboard.core.serial import to_bus_ms
from onboard.core.site import Machine, Site
from onboard.systems.terminal.cameras import Cameras
from onboard.systems.terminal.memory import box_record, read_boxes
from onboard.systems.terminal.mirror import TerminalMirror
from onboard.systems.terminal.missions import MissionBook, Transport
from onboard.systems.terminal.rights import verdict
from onboard.systems.terminal.routes import least_end_ms
from onboard.systems.terminal.site import Terminal
from onboard.systems.terminal.vehicle import terminal
from onboard.systems.terminal.waiting import WaitingOrders
from onboard.systems.terminal.won import WonBoxes
from onboard.ways.cars import CarFleet, car_fleet, car_mirror
from onboard.ways.tokens import car_token
from onboard.work.manual import GIVE_BACK_US, says_held
from onboard.work.order_life import OrderEvent
from onboard.work.plain import NoEstimator

#: After a refusal, and while no robot is about to be free, the desk looks again after this, us: plans change within
#: seconds.
LOOK_US = 5_000_000
#: An order by hand that its vehicle has not answered is said again after this, us (dbc/terminal.dbc).
MANUAL_AGAIN_US = 1_000_000
#: After power-up whoever has won a task that was called for has said so after this, us: twice what it takes until it
#: says so again (``planner.SAY_US``), and some more.
DOUBT_US = 12_000_000


class DeskGeneration(NoEstimator):
    """A desk does no transports; it holds the picture of the terminal."""

    def __init__(self, mirror: TerminalMirror) -> None:
        self.mirror = mirror


@dataclass(frozen=True)
class TerminalDeskFactory(BehaviourFactory):
    """Makes the desk of a terminal, with keyboard and cameras."""

    fleet_type = CarFleet

    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> DeskGeneration:
        """What the desk knows of others' plans; it bids for nothing."""
        return DeskGeneration(TerminalMirror(terminal(site), machine.node_id, car_mirror(mirror)))

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> "Desk":
        """The desk's steps; ``estimator`` is the one made above."""
        if not isinstance(estimator, DeskGeneration):
            raise TypeError("a desk needs its own picture")
        return Desk(car_fleet(fleet), estimator)


@dataclass
class Desk:
    """One desk. ``calls`` are the terms of its open calls by task; ``taken`` boxes that another desk calls for."""

    fleet: CarFleet
    generation: DeskGeneration
    kind: KindCode = KindCode.DESK
    orders: MissionBook = field(init=False)
    calls: dict[Reference, RequestedTerms] = field(default_factory=dict)
    taken: dict[int, int] = field(default_factory=dict)
    interrupted: int = 0
    _look_at_us: int | None = None
    _cameras: Cameras = field(init=False)
    _won: WonBoxes = field(init=False)
    _is_new: bool = False
    _is_moved: bool = False
    #: Vehicles in which a person has a hand, and orders to vehicles that were not heard to have come.
    held: set[int] = field(default_factory=set)
    _manual: dict[int, ManualOrder] = field(default_factory=dict)
    _manual_at_us: int | None = None
    _waiting: WaitingOrders = field(init=False)
    #: Tasks of my earlier life that were called for, and until when their winners may say so.
    _doubtful: set[Reference] = field(default_factory=set)
    _doubtful_until_us: int = 0

    def __post_init__(self) -> None:
        self.orders = MissionBook(self.site, self.fleet.node_id)
        self.orders.replay(self.fleet.entries)
        self._cameras = Cameras(self.fleet.node_id, self.mirror)
        self._won = WonBoxes(self.fleet.node_id, self.orders, self.mirror)
        self._waiting = WaitingOrders(self.orders, self.mirror)

    @property
    def site(self) -> Terminal:
        """The terminal whose orders it takes."""
        return self.mirror.site

    @property
    def mirror(self) -> TerminalMirror:
        """The desk's picture of the terminal."""
        return self.generation.mirror

    # --- the Behaviour -----------------------------------------------------------------------------------------

    @property
    def state(self) -> MachineState:
        """WORKING while an order or a mission is open, for heartbeats."""
        return MachineState.WORKING if self.orders.open or self.orders.missions else MachineState.IDLE

    @property
    def itinerary_version(self) -> int:
        """Always 0, for a desk goes nowhere."""
        return 0

    def start(self, now_us: int) -> list[Effect]:
        """Tasks that were won go on; those that were called for may have been, and are called for again if not."""
        self._doubtful = {one for one in self.orders.open if one not in self.orders.won}
        self._doubtful_until_us = now_us + DOUBT_US
        self._won.show(self.orders.won, now_us)
        self._look_at_us = now_us + LOOK_US
        self.mirror.remember(read_boxes(self.fleet.node_id, self.fleet.node_id, self.fleet.entries))
        for task, winner in self.orders.won.items():
            self.fleet.winners.takes(task, winner, now_us)
        return []

    def sense(self, message: Message, now_us: int) -> list[Effect]:
        """Missions and manual orders from the keyboard, and lanes as the cameras see them."""
        match message:
            case MissionKey():
                return self._typed(message, now_us)
            case LaneSensor():
                return self._cameras.see(message, now_us)
            case ManualKey() if message.vehicle in self.site.vehicles:
                order = ManualOrder(self.fleet.node_id, message.vehicle, message.number, message.manual_mode)
                self._manual[message.vehicle], self._manual_at_us = order, now_us + MANUAL_AGAIN_US
                return [Send(order)]
        return []

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        """Plans, reports, boxes; what another desk calls for; what became of my tasks."""
        self.mirror.hear(message, now_us)
        match message:
            case CallForProposals(operation=Operation.TRANSPORT):
                self.taken[message.car.number] = now_us + self.site.timing.call_window_us + LOOK_US
            case TaskReport():
                return self._reported(message, now_us)
            case Heartbeat():
                if message.state is not MachineState.WAITING:
                    # Whoever missed that it was let go hears it go on.
                    self.held.discard(message.sender)
                return self.mirror.on_beat(message, now_us)
            case PlanHead():
                self._is_new = True
            case StepReport():
                self.fleet.winners.works(message.sender, (message.version, message.step), now_us)
            case CarAt() | TokenGrant():
                self._is_moved = True
            case ManualState() | Halted():
                self._on_held(message)
            case BoxOrder() if message.desk == self.fleet.node_id:
                return self._ordered(message, now_us)
        return []

    def negotiated(self, event: NegotiationEvent, now_us: int) -> list[Effect]:
        """An own call is over."""
        if not isinstance(event, Closed):
            return []
        task = event.call.task
        self.calls.pop(task, None)
        if event.result is CallResult.AWARDED:
            return self.won(task, event.winner, now_us, event.call.call)
        if event.result is CallResult.REFUSED and task in self.orders.open:
            self._waiting.refused.add(self.orders.open[task].mission)
        self.orders.give_back(task, OrderEvent.NOT_WON)
        self._look_at_us = now_us + (LOOK_US if event.result is CallResult.REFUSED else 1)
        return [Record(self.orders.record())]

    def may_grant(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        """Slots in the plans' order; a box to the machine whose plan carries it."""
        return verdict(self.mirror, key, requester)

    def advance(self, now_us: int) -> list[Effect]:
        """Open the next call where a robot is about to be free; tell blocked lanes again; look after won tasks."""
        effects = self._take_over() if self._is_moved else []
        effects += self._cameras.repeat(now_us)
        if self._manual_at_us is not None and self._manual_at_us <= now_us:
            self._manual_at_us = now_us + MANUAL_AGAIN_US if self._manual else None
            effects += [Send(order) for order in self._manual.values()]
        if self._is_new or (self._look_at_us is not None and self._look_at_us <= now_us):
            self._is_new = False
            self._look_at_us = now_us + LOOK_US if self.orders.missions or self.orders.open else None
            effects += self._look_after(now_us) + self.call_next(now_us) + self._waiting.news(now_us)
        return effects

    def next_wake(self) -> int | None:
        """When it looks after open orders, says one again, or repeats a manual order, us."""
        return min(
            (one for one in (self._look_at_us, self._cameras.again_at_us, self._manual_at_us) if one is not None),
            default=None,
        )

    def statements(self, now_us: int) -> list[Effect]:
        """Lanes, the boxes that are not where they were at first, and the rights that I hold."""
        boxes = [Send(one) for one in self.mirror.kept_by(self.fleet.node_id)]
        return [*self._cameras.told(), *boxes, *self.fleet.tokens.statements()]

    def _take_over(self) -> list[Effect]:
        """A box in my books was put down, and its right came back: from now on I vouch for where it stands.

        The vehicle that put it down may be switched off at any time; without this nobody could tell a machine that
        was off meanwhile (campaign terminal, all, seed 11).
        """
        self._is_moved = False
        effects: list[Effect] = []
        for car, record in list(self.fleet.mirror.cars.items()):
            key = car_token(*car)
            stands = record.station in self.site.entities and record.custodian != self.fleet.node_id
            if stands and car.origin == self.fleet.node_id and self.fleet.tokens.holds(key):
                version = self.fleet.tokens.version_of(key)
                statement = CarAt(self.fleet.node_id, car, record.station, version, record.wheelbase_mm)
                self.fleet.mirror.on_car(statement)
                effects += [Record(box_record(statement)), Send(statement)]
        return effects

    # --- missions ----------------------------------------------------------------------------------------------

    def _typed(self, key: MissionKey, now_us: int) -> list[Effect]:
        """A mission; an urgent one interrupts: what was called for and not awarded waits (row M29)."""
        order = self.orders.key(key)
        is_taken = self.orders.answer(key)
        if order is None:
            return [] if is_taken is None else [Tell(MissionAnswer(self.fleet.node_id, key.mission, is_taken))]
        taken = Tell(MissionAnswer(self.fleet.node_id, key.mission, is_taken=True))
        return [*self._ranked(order.urgent, now_us), taken]

    def _ordered(self, wanted: BoxOrder, now_us: int) -> list[Effect]:
        """A box that is wanted from outside; who asks again is told how it stands."""
        task, reason = Reference(wanted.sender, wanted.number), Reason.NONE
        phase, effects = self.orders.phase_of(task), list[Effect]()
        if phase is None and self.mirror.station_of(wanted.box) == wanted.target:
            phase = TaskPhase.DONE
        elif phase is None and not self.orders.may_order(wanted.box, wanted.target):
            phase, reason = TaskPhase.REFUSED, Reason.IMPOSSIBLE
        elif phase is None:
            before_us = now_us + wanted.within_s * 1_000_000 if wanted.within_s else 0
            self.orders.order(task, wanted.box, wanted.target, before_us, urgent=wanted.urgent)
            phase, effects = TaskPhase.OPEN, self._ranked(wanted.urgent, now_us)
        return [*effects, Send(TaskReport(self.fleet.node_id, task, phase, wanted.target, reason))]

    def _ranked(self, urgent: bool, now_us: int) -> list[Effect]:
        """A new mission is journalled, and finds its place among the others."""
        effects: list[Effect] = [Record(self.orders.record())]
        if urgent:
            for task, terms in list(self.calls.items()):
                transport = self.orders.open.get(task)
                if transport is not None and not transport.urgent:
                    effects += self._withdraw(terms, now_us)
        return effects + self.call_next(now_us)

    def _on_held(self, word: ManualState | Halted) -> None:
        if says_held(word):
            self.fleet.negotiation.trust.excuse(word.sender)
        if isinstance(word, ManualState):
            self._on_manual(word)

    def _on_manual(self, state: ManualState) -> None:
        (self.held.discard if state.manual_mode is ManualMode.AUTOMATIC else self.held.add)(state.sender)
        order = self._manual.get(state.sender)
        if order is not None and order.number == state.number:
            del self._manual[state.sender]

    def _withdraw(self, terms: RequestedTerms, now_us: int) -> list[Effect]:
        self.interrupted += 1
        effects: list[Effect] = []
        for item in self.fleet.negotiation.withdraw(terms, now_us):
            if isinstance(item, EVENT_TYPES):
                effects += self.negotiated(item, now_us)
            elif not isinstance(item, Halt):
                effects.append(item)
        return effects

    def candidates(self, now_us: int) -> list[int]:
        """Robots that have no plan, or one that ends before T + delta T (M24), and are alive."""
        alive = self.fleet.mirror.alive(now_us)
        busy = set(self.orders.won.values()) - set(self.mirror.traffic.plans) | self.held
        limit_us = now_us + self.site.horizon_us
        ends = {node: self.mirror.traffic.end_of(node, now_us) for node in self.site.vehicles}
        return [node for node, end in ends.items() if end <= limit_us and node in alive and node not in busy]

    def call_next(self, now_us: int) -> list[Effect]:
        """As many calls as robots are about to be free: never all boxes at once (M27)."""
        effects: list[Effect] = []
        free = len(self.candidates(now_us))
        taken = {box for box, until_us in self.taken.items() if until_us > now_us}
        taken |= {transport.box for transport in self.orders.open.values()}
        taken |= self._in_hands()
        while len(self.calls) < free:
            transport = self.orders.next(self.mirror, taken)
            if transport is None:
                break
            taken.add(transport.box)
            effects += [Record(self.orders.record()), *self.call(transport, now_us)]
        if self.orders.missions or self.orders.open:
            self._look_at_us = self._look_at_us or now_us + LOOK_US
        return effects

    def _in_hands(self) -> set[int]:
        """Boxes that vehicles have the rights to and nobody can fetch; few, and looked for whenever one may be free."""
        beliefs, vehicles, desk = self.fleet.tokens.beliefs, self.site.vehicles, self.site.desk
        keys = [
            key for known in (beliefs.verified, beliefs.hints) for key, one in known.items() if one.holder in vehicles
        ]
        boxes = {number & 0xFFFF for kind, number in keys if kind is TokenKind.CAR and number >> 16 == desk}
        return {box for box in boxes if 0 < box <= len(self.site.boxes) and not self._station_of(box)}

    def _station_of(self, box: int) -> int:
        """Where a box stands for anybody to fetch; 0 while the right to it is with who has not told where it is.

        After a restart that is all that is known of a box whose vehicle is silent.
        """
        car = self.site.box(box)
        holder, record = self.fleet.tokens.holder_of(car_token(*car)), self.fleet.mirror.cars.get(car)
        is_told = record is not None and record.custodian == holder
        return 0 if holder in self.site.vehicles and not is_told else self.mirror.station_of(box)

    def call(self, transport: Transport, now_us: int) -> list[Effect]:
        """Call all robots for one transport."""
        date = TaskTerms(self.fleet.node_id, transport.task, to_bus_ms(transport.before_us))
        self.mirror.hear(date, now_us)
        terms = RequestedTerms(
            task=transport.task,
            operation=Operation.TRANSPORT,
            kind=KindCode.VEHICLE,
            criterion=Criterion.FINISH_TIME,
            from_station=self.mirror.station_of(transport.box),
            to_station=transport.target,
            load=self.site.box(transport.box),
            load_mm=0,
            detail=(date,),
            floor=partial(least_end_ms, self.site),
        )
        self.calls[transport.task] = terms
        return list(self.fleet.negotiation.open(terms, now_us))

    def won(self, task: Reference, winner: int, now_us: int, call: int = 0) -> list[Effect]:
        """A robot has the task, by ``call`` where it is known."""
        if not self.orders.goes_to(task, winner):
            return []
        self._doubtful.discard(task)
        self.fleet.winners.takes(task, winner, now_us, call)
        self._waiting.refused.discard(self.orders.open[task].mission)
        self.mirror.void.discard((task, winner))
        self._won.show([task], now_us)
        self._look_at_us = now_us + 1
        return [Record(self.orders.record())]

    def _reported(self, report: TaskReport, now_us: int) -> list[Effect]:
        if report.sender not in self.site.vehicles:
            self.fleet.drops[Reason.NOT_OF_KIND] += report.task in self.orders.open
            return []
        if report.task not in self.orders.open:
            # Taken back, and called for under another name, while who had it was silent.
            is_claim = report.phase is TaskPhase.AWARDED and report.task.origin == self.fleet.node_id
            return self.fleet.winners.remind(report.task, report.sender) if is_claim else []
        if report.task in self._doubtful and report.phase in (TaskPhase.AWARDED, TaskPhase.LOADED):
            return self.won(report.task, report.sender, now_us)
        if self.orders.won.get(report.task) != report.sender:
            # Who has lost a task, or never won it, says nothing that counts: where its box stands tells whether it is
            # done.
            is_claim = report.phase is TaskPhase.AWARDED and report.task not in self.calls
            return self.fleet.winners.remind(report.task, report.sender) if is_claim else []
        if report.phase is TaskPhase.DONE and self.orders.finish(report.task):
            self.fleet.winners.over(report.task)
            self._won.over(report.task)
            self._look_at_us = now_us
            return [Record(self.orders.record()), Report(f"task {report.task.number} is done")]
        if report.phase is TaskPhase.FORFEITED:
            self.fleet.winners.over(report.task)
            self._won.over(report.task)
            self.orders.give_back(report.task, OrderEvent.GIVEN_BACK)
            self._look_at_us = now_us + LOOK_US
            return [Record(self.orders.record())]
        if report.phase is TaskPhase.AWARDED:
            self._won.show([report.task], now_us)
        return []

    def _take_back(self, task: Reference, transport: Transport, now_us: int) -> list[Effect]:
        """A task whose winner is lost goes to another, while its box stands and is in nobody's plan.

        Nobody gets the right to a box but who plans to carry it; who plans it later than another gives it back.
        """
        reason = self.fleet.winners.lost(task, now_us)
        if reason is Reason.NONE:
            return []
        if not self._station_of(transport.box) or not self._is_unbegun(transport, now_us):
            self.fleet.winners.keeps(task)
            return []
        self._won.over(task)
        self.calls.pop(task, None)
        self.orders.give_back(task, OrderEvent.TAKEN_BACK)
        said = self.fleet.winners.take_back(task, reason, now_us)
        for one in said:
            if isinstance(one, Send):
                self.mirror.hear(one.message, now_us)
        return [*said, Record(self.orders.record())]

    def _is_unbegun(self, transport: Transport, now_us: int) -> bool:
        """Whether a box is in nobody's plan, or its winner is out for long and cannot have it: the right is mine."""
        owner = self.mirror.in_plans(transport.box)
        since_us = self.mirror.traffic.out.get(transport.winner, now_us)
        is_mine = self.fleet.tokens.holds(car_token(*self.site.box(transport.box)))
        return owner is None or (is_mine and owner == transport.winner and now_us - since_us >= GIVE_BACK_US)

    def _resolve(self, now_us: int) -> list[Effect]:
        """Of tasks that were called for as my power failed: who has won one says so, or has it in its plan."""
        effects: list[Effect] = []
        for task in sorted(self._doubtful):
            owned = self.mirror.traffic.carrying(task)
            if owned is not None:
                effects += self.won(task, owned.plan.owner, now_us)
            elif now_us >= self._doubtful_until_us:
                self._doubtful.discard(task)
                self.orders.give_back(task, OrderEvent.NOT_WON)
                effects.append(Record(self.orders.record()))
        return effects

    def _look_after(self, now_us: int) -> list[Effect]:
        """A won task whose box is at its target is done, though nobody was heard saying so; one in no plan is lost."""
        effects = self._resolve(now_us) if self._doubtful else []
        for task, one in list(self.orders.open.items()):
            effects += self._take_back(task, one, now_us)
        for task, winner in list(self.orders.won.items()):
            if self._won.is_done(task):
                self.orders.finish(task)
                self._won.over(task)
                self.fleet.winners.over(task)
                effects.append(Record(self.orders.record()))
            elif self._won.is_lost(task, now_us) and self._station_of(self.orders.open[task].box):
                effects += self._lost(task, winner, now_us)
        return effects + self._arrived()

    def _arrived(self) -> list[Effect]:
        """Boxes that stand where they were to come are missions no more; whoever ordered one from outside is told."""
        effects: list[Effect] = []
        for box, task in self.orders.arrived(self.mirror):
            done = TaskReport(self.fleet.node_id, task, TaskPhase.DONE, self.mirror.station_of(box), Reason.NONE)
            effects += [Report(f"box {self.site.boxes[box - 1].name} stands where it was to come")]
            effects += [Send(done)] if task != NO_REFERENCE else []
        return [*effects, Record(self.orders.record())] if effects else []

    def _lost(self, task: Reference, winner: int, now_us: int) -> list[Effect]:
        """Its winner is not to blame where another desk has the box: its word that it gives the task up was missed."""
        all_won, is_anothers = self.fleet.winners, self._won.is_anothers(task)
        said = all_won.let_go(task) if is_anothers else all_won.take_back(task, Reason.FALSE_STATEMENT, now_us)
        of_anothers = f"the box of task {task.number} is carried for another desk"
        why = of_anothers if is_anothers else f"node {winner} has lost task {task.number}"
        self._won.over(task)
        self.orders.give_back(task, OrderEvent.TAKEN_BACK)
        return [*said, Report(why), Record(self.orders.record())]
