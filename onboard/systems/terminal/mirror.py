"""What a machine of a terminal believes of the others: plans, boxes, lanes; built from bus traffic alone."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from onboard.contract.codes import CallResult, Grade, KindCode, MachineState
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import Award, CarAt, Heartbeat, Message, Reference, SyncRequest
from onboard.contract.terminal import LaneState, PlanHead, PlanStep, PlanTask, StepReport, StepResult, TaskTerms
from onboard.core.effects import Effect, Send
from onboard.core.serial import from_bus_ms, is_newer
from onboard.systems.terminal.plan import NO_STEP, ActionPlan, Load, PlanReader
from onboard.systems.terminal.site import EntityKind, StationKind, Terminal
from onboard.systems.terminal.traffic import Traffic
from onboard.ways.cars import CarMirror

#: Dates remembered at most: of the newest tasks.
MOST_DATES = 512
#: States in which a vehicle goes on only when somebody has come: in a person's hand, or stopped.
OUT_STATES = (MachineState.WAITING, MachineState.STOPPED)


@dataclass
class TerminalMirror:
    """One machine's picture. ``where`` is the area in which each vehicle was last, or will be when its plan ends."""

    site: Terminal
    node_id: int
    fleet: CarMirror
    traffic: Traffic = field(init=False)
    where: dict[int, int] = field(default_factory=dict)
    #: Boxes at each station, the lowest, or first, first.
    standing: dict[int, list[int]] = field(default_factory=dict)
    lanes: dict[int, LaneState] = field(default_factory=dict)
    #: How often a box that was to be fetched by a plan was in that plan no more: others may lie under it.
    given_up: int = 0
    #: Tasks that were taken back from a machine whose plan has them still.
    void: set[tuple[Reference, int]] = field(default_factory=set)
    _readers: dict[int, PlanReader] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.traffic = Traffic(self.site)
        self.where = {node: self.site.machines[node].home.track for node in self.site.vehicles}
        for number, box in enumerate(self.site.boxes, start=1):
            self.standing.setdefault(box.station, []).append(number)
        self._see_stacks()

    def hear(self, message: Message, now_us: int) -> None:
        """Take up what another machine says, or what I say myself."""
        match message:
            case PlanHead() | PlanStep() | PlanTask():
                self._on_plan(message, now_us)
            case StepReport(result=StepResult.DONE):
                self._on_report(message, now_us)
            case LaneState():
                self.on_lane(message, now_us)
            case TaskTerms(before_ms=before_ms) if before_ms:
                self.traffic.before[message.task] = from_bus_ms(before_ms, now_us)
                while len(self.traffic.before) > MOST_DATES:
                    del self.traffic.before[next(iter(self.traffic.before))]
            case CarAt():
                self._on_box(message)
            case Award(winner=0, result=CallResult.REJECTED):
                self._take_back(message)
            case Award() if self.void:
                self.void.discard((message.task, message.winner))

    def _take_back(self, award: Award) -> None:
        """Nobody has a task any more, though a plan has it: whose that is may be silent, and hears so in the end."""
        owned = self.traffic.carrying(award.task)
        desk = self.site.machines.get(award.sender)
        if owned is None or owned.plan.owner == self.node_id or desk is None or desk.kind is not KindCode.DESK:
            return
        self.void.add((award.task, owned.plan.owner))
        owned.plan, self.traffic.changes = self._without_void(owned.plan), self.traffic.changes + 1
        self.given_up += 1

    def _without_void(self, plan: ActionPlan) -> ActionPlan:
        return replace(plan, loads=tuple(load for load in plan.loads if (load.task, plan.owner) not in self.void))

    def _on_plan(self, message: PlanHead | PlanStep | PlanTask, now_us: int) -> None:
        sender = message.sender
        if sender not in self.where:
            return
        known = self.traffic.plans.get(sender)
        head = self.fleet.itineraries.get(sender)
        is_of_head = head is not None and head.version == message.version
        if known is not None and is_newer(known.plan.version, message.version, 8) and not is_of_head:
            return
        reader = self._readers.setdefault(sender, PlanReader(self.site))
        plan = reader.feed(message, now_us)
        if plan is not None:
            self.take_up(plan, now_us)

    def take_up(self, plan: ActionPlan, now_us: int) -> None:
        """A whole plan; one without steps means that there is none."""
        known = self.traffic.plans.get(plan.owner)
        if self.void:
            tasks = {load.task for load in plan.loads}
            self.void = {(task, owner) for task, owner in self.void if owner != plan.owner or task in tasks}
            plan = self._without_void(plan)
        if known is not None and known.plan == plan:
            return
        if known is not None:
            boxes = {load.box for load in plan.loads}
            self.given_up += any(
                known.current <= one.pick < NO_STEP and one.box not in boxes for one in known.plan.loads
            )
        self.traffic.take_up(plan, now_us)
        # Who gives up what it had planned is where it has come to.
        steps = plan.steps or (known.plan.steps[: known.current + 1] if known is not None else ())
        if steps:
            self.stands(plan.owner, steps[-1].entity)

    def stands(self, node: int, entity: int) -> None:
        """Where a machine is free, or will be: in an area also where it comes out of a station."""
        place = self.site.entities[entity]
        self.where[node] = place.area or place.number

    def _on_report(self, report: StepReport, now_us: int) -> None:
        self.traffic.report(report.sender, report.version, report.step, from_bus_ms(report.at_ms, now_us))

    def on_lane(self, state: LaneState, now_us: int) -> None:
        """The newest word on a lane counts."""
        known = self.lanes.get(state.lane)
        since_us = from_bus_ms(state.since_ms, now_us)
        if known is not None and from_bus_ms(known.since_ms, now_us) > since_us:
            return
        if known is not None and known.blocked == state.blocked:
            return
        self.lanes[state.lane] = state
        self.traffic.changes += 1
        if state.blocked:
            self.traffic.blocked[state.lane] = since_us
        else:
            self.traffic.blocked.pop(state.lane, None)

    def _on_box(self, statement: CarAt) -> None:
        record = self.fleet.cars.get(statement.car)
        number = statement.car.number
        if record is None or statement.car.origin != self.site.desk or not 0 < number <= len(self.site.boxes):
            return
        station = record.station if record.station != ANY_STATION else 0
        if any(number in row for at, row in self.standing.items() if at == station):
            return
        for row in self.standing.values():
            if number in row:
                row.remove(number)
        if station in self.site.entities:
            self.standing.setdefault(station, []).append(number)
        self._see_stacks()

    def _see_stacks(self) -> None:
        self.traffic.below = {
            box: tuple(row[:place])
            for station, row in self.standing.items()
            if station in self.site.entities and self.site.entities[station].station is StationKind.STACK
            for place, box in enumerate(row)
        }
        self.traffic.changes += 1

    def on_beat(self, beat: Heartbeat, now_us: int) -> list[Effect]:
        """Note who does not go on; whoever told a newer plan than I have whole is asked to say it again."""
        if beat.state in OUT_STATES or self.traffic.out or self.fleet.aside:
            self._see_out(now_us)
        itinerary = self.fleet.itineraries.get(beat.sender)
        if itinerary is None or beat.sender not in self.where:
            return []
        owned = self.traffic.plans.get(beat.sender)
        if itinerary.grade is Grade.FIRM:
            is_behind = owned is None or owned.plan.version != itinerary.version
        else:
            is_behind = owned is not None
        return [Send(SyncRequest(self.node_id, beat.sender))] if is_behind else []

    def _see_out(self, now_us: int) -> None:
        known, peers, aside = self.traffic.out, self.fleet.peers, self.fleet.aside
        found = [
            node for node in self.site.vehicles if node in aside or (node in peers and peers[node].state in OUT_STATES)
        ]
        if found != list(known):
            self.traffic.changes += 1
            self.traffic.out = {node: known.get(node, now_us) for node in found}

    def kept_by(self, node: int) -> list[CarAt]:
        """What a machine vouches for: boxes at stations of which it is the custodian, those of a stack from below."""
        found = []
        for station, row in self.standing.items():
            for number in row:
                car = self.site.box(number)
                record = self.fleet.cars.get(car)
                if record is not None and (record.custodian, record.station) == (node, station):
                    found.append(CarAt(node, car, station, record.version, record.wheelbase_mm))
        return found

    def remember(self, statements: Iterable[CarAt]) -> None:
        """What I said before the power failed, from my journal: older than whatever others say meanwhile."""
        for statement in statements:
            if self.fleet.on_car(statement):
                self._on_box(statement)

    def station_of(self, box: int) -> int:
        """The station at which a box stands, 0 where it stands nowhere."""
        return next((station for station, row in self.standing.items() if box in row), 0)

    def is_free(self, box: int) -> bool:
        """Whether all that stands on a box is to be fetched by somebody's plan."""
        return all(self.in_plans(upper) is not None for upper in self.above(box))

    def above(self, box: int) -> list[int]:
        """Boxes that stand on a box."""
        return [upper for upper, lower in self.traffic.below.items() if box in lower]

    def in_plans(self, box: int) -> int | None:
        """The machine whose plan carries a box."""
        for owner, owned in self.traffic.plans.items():
            if any(load.box == box and load.put >= owned.current for load in owned.plan.loads):
                return owner
        return None

    def load_of(self, box: int) -> Load | None:
        """As what a plan carries a box; None where none does."""
        coming = ((load, owned) for owned in self.traffic.plans.values() for load in owned.plan.loads)
        return next((load for load, owned in coming if load.box == box and load.put >= owned.current), None)

    def entry_slot(self, entity: int, node: int) -> int:
        """The body slot by which a vehicle comes into an entity: its own bay in an area."""
        place = self.site.entities[entity]
        rank = self.site.vehicles.index(node)
        if place.kind is EntityKind.AREA:
            return rank + 1
        return rank % place.capacity + 1 if place.kind is EntityKind.CROSSING else 1

    def long_blocked(self, now_us: int) -> frozenset[int]:
        """Lanes that are blocked for longer than one waits for them, and where I cannot pass who does not go on."""
        patience_us, traffic = self.site.patience_us, self.traffic
        lanes = {lane for lane, since in traffic.blocked.items() if now_us - since >= patience_us}
        if traffic.out:
            lanes |= {self._in_my_way(owner) for owner in traffic.stuck(now_us) if owner != self.node_id}
        return frozenset(lanes)

    def _in_my_way(self, owner: int) -> int:
        """The entity in which a machine stands, where I cannot pass it; 0: none."""
        owned = self.traffic.plans[owner]
        number = owned.plan.steps[owned.current].entity
        place = self.site.entities[number]
        is_wide = place.kind is EntityKind.AREA or (
            place.kind is EntityKind.CROSSING
            and self.entry_slot(number, owner) != self.entry_slot(number, self.node_id)
        )
        return 0 if is_wide else number
