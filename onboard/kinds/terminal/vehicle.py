"""The vehicle: carries out the elementary actions of its plan, reports each, and makes its own plan anew if violated.

Nobody plans for it. It moves only into slots whose rights it holds, in the order in which the plans pass (design,
section 5), so a wrong mirror costs time and nothing else. In an area every vehicle has a bay of its own.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from onboard.core.authority import MotionState, TokenKey, authorised, car_token, segment_token
from onboard.core.behaviour import Fleet
from onboard.core.codes import ANY_STATION, Grade, KindCode, MachineState, Reason, TaskPhase, TokenKind
from onboard.core.effects import Effect, Record, Report, Send
from onboard.core.messages import CallForProposals, CarAt, Itinerary, Message, Reference, Stamp, TaskReport
from onboard.core.mirror import Mirror
from onboard.core.negotiation import Awarded, Estimator, NegotiationEvent, PreAssigned, Released
from onboard.core.serial import successor, to_bus_ms
from onboard.core.site import Machine, Segment, Site
from onboard.kinds.terminal.body import Body
from onboard.kinds.terminal.generation import VehicleGeneration, job_of
from onboard.kinds.terminal.memory import plan_record, read_plan, step_record
from onboard.kinds.terminal.messages import (
    Action,
    Assignment,
    HandlerMode,
    HandlerState,
    MoveMode,
    MoveState,
    StepReport,
    StepResult,
)
from onboard.kinds.terminal.mirror import TerminalMirror
from onboard.kinds.terminal.plan import Load, Plan, PlanReader, to_frames
from onboard.kinds.terminal.search import Job
from onboard.kinds.terminal.site import EntityKind, Terminal
from onboard.kinds.terminal.traffic import Owned

#: A failed action of the handler is tried again after this, us. Ours.
RETRY_US = 5_000_000
#: A violated plan that cannot be bettered is looked at again after this, us. Ours.
AGAIN_US = 10_000_000
#: A task that was won and is in no plan yet is spoken of again after this, us. Ours.
SAY_US = 20_000_000
#: Plans are adopted in turns of bus time, one vehicle so long after the other, us: each sees what the one before has
#: told, so that no two plans are made at once around the same gaps. Ours.
TURN_US = 50_000
#: What a statement about a box says where that about a car has a wheelbase (dbc/fleet.dbc).
NO_WHEELBASE_MM = 1500
_NO_STAMP = Stamp(0, 0, 0)


def terminal(site: Site) -> Terminal:
    """The site as what it is. Raises ``TypeError`` for another system's."""
    if not isinstance(site, Terminal):
        raise TypeError(f"site {site.name} is no container terminal")
    return site


class VehicleFactory:
    """Makes vehicles."""

    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> VehicleGeneration:
        """The vehicle's task-generation function, with the picture that it looks at."""
        place = terminal(site)
        return VehicleGeneration(place, machine, TerminalMirror(place, machine.node_id, mirror))

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> "Vehicle":
        """The vehicle's steps; ``estimator`` is the one made above."""
        if not isinstance(estimator, VehicleGeneration):
            raise TypeError("a vehicle needs its own task-generation function")
        return Vehicle(fleet, estimator)


@dataclass
class Vehicle:
    """One vehicle. ``queue`` are tasks that were won and are in no plan yet; ``touched`` counts plans made anew."""

    fleet: Fleet
    generation: VehicleGeneration
    kind: KindCode = KindCode.VEHICLE
    queue: deque[Job] = field(default_factory=deque)
    touched: int = 0
    body: Body = field(init=False)
    version: int = 0
    stamp: Stamp = _NO_STAMP
    _looked_at: int = -1
    _again_at_us: int | None = None
    _patience_at_us: int | None = None
    _retry_at_us: int | None = None
    _may_retry: bool = False
    _queue_at_us: int | None = None
    _said_at_us: int | None = None
    _turn_at_us: int | None = None
    _told_blocked: bool = False
    _actions: dict[Action, Callable[[Owned, int], list[Effect]]] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self.body = Body(self.fleet.node_id)
        self._actions = {
            Action.GOTO: self._goto,
            Action.DOCK: self._dock,
            Action.PICK_UP: self._pick_up,
            Action.PUT_DOWN: self._put_down,
            Action.UNDOCK: self._undock,
        }

    # --- the Behaviour -----------------------------------------------------------------------------------------

    @property
    def site(self) -> Terminal:
        """The site."""
        return self.generation.site

    @property
    def mirror(self) -> TerminalMirror:
        """My picture of the others."""
        return self.generation.mirror

    @property
    def owned(self) -> Owned | None:
        """My plan in execution."""
        return self.mirror.traffic.plans.get(self.fleet.node_id)

    @property
    def state(self) -> MachineState:
        """Heartbeat state."""
        if not self.body.is_known:
            return MachineState.STARTING
        return MachineState.IDLE if self.owned is None else MachineState.WORKING

    @property
    def itinerary_version(self) -> int:
        """Version of the plan."""
        return self.version if self.owned is not None else 0

    def start(self, now_us: int) -> list[Effect]:
        """After a restart the journal knows the plan and how far it has come."""
        plan, over = read_plan(self.fleet.node_id, self.fleet.entries)
        if plan is None:
            return []
        self.version = plan.version
        self.mirror.take_up(plan, now_us)
        for step, ended_us in over:
            self.mirror.traffic.report(self.fleet.node_id, plan.version, step, ended_us)
        return []

    def sense(self, message: Message, now_us: int) -> list[Effect]:
        """Drive and handler."""
        if isinstance(message, MoveState | HandlerState):
            was_known = self.body.is_known
            self.body.sense(message)
            if self.body.is_known and not was_known:
                return [*self._settle_in(now_us), *self.statements(now_us)]
        return []

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        """Everybody's plans, reports, boxes and lanes; a central planner's order is as good as an award."""
        self.mirror.hear(message, now_us)
        if isinstance(message, Assignment) and message.vehicle == self.fleet.node_id:
            return self._assigned(message, now_us)
        if isinstance(message, CallForProposals) and self.queue:
            # Its desk took it for lost: whoever wins it now has it.
            self.queue = deque(job for job in self.queue if job.box != message.car.number)
            self.generation.has_queue = bool(self.queue)
        return []

    def negotiated(self, event: NegotiationEvent, now_us: int) -> list[Effect]:
        """Awarded: the plan is made a second time, around what is known now (row P20), and told."""
        match event:
            case PreAssigned(call_key=key):
                self.generation.promised.add(key)
            case Released(call_key=key):
                self.generation.promised.discard(key)
            case Awarded(call_key=key, call=call):
                self.generation.promised.discard(key)
                return self._awarded(call, now_us)
        return []

    def may_grant(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        """Rights come from a steward and go back there."""
        return Reason.TOKEN_NOT_GRANTABLE_YET

    def advance(self, now_us: int) -> list[Effect]:
        """One step of the plan, where its condition is met."""
        if not self.body.is_known:
            return []
        if self._retry_at_us is not None and self._retry_at_us <= now_us:
            self._retry_at_us, self._may_retry = None, True
        effects = self.body.repeat(now_us) + self._give_back(now_us)
        effects += self._in_turn(now_us)
        owned = self.owned
        if effects:
            return effects
        if self.queue and (self._said_at_us is None or self._said_at_us <= now_us):
            # So that the desk does not take the task for lost.
            self._said_at_us = now_us + SAY_US
            job = self.queue[0]
            return [Send(TaskReport(self.fleet.node_id, job.task, TaskPhase.AWARDED, job.target, Reason.NONE))]
        return self._actions[owned.plan.steps[owned.current].action](owned, now_us) if owned is not None else []

    def next_wake(self) -> int | None:
        """Repeats, retries, the end of patience, and my next turn where there is something to plan."""
        said = self._said_at_us if self.queue else None
        times = (self.body.due_us, self._retry_at_us, said, self._turn_at_us)
        return min((time for time in times if time is not None), default=None)

    def statements(self, now_us: int) -> list[Effect]:
        """My plan, how far it has come, the box that I carry, the rights that I hold."""
        effects = self._plan_statement(now_us)
        handler = self.body.handler
        if handler is not None and handler.box and self.fleet.tokens.holds(self._box_token(handler.box)):
            effects.append(Send(self._box_at(handler.box, ANY_STATION)))
        return effects + self.fleet.tokens.statements()

    # --- tasks -------------------------------------------------------------------------------------------------

    def _awarded(self, call: CallForProposals, now_us: int) -> list[Effect]:
        self.stamp = Stamp(to_bus_ms(now_us), call.sender, call.call & 0xFF)
        taken = Send(TaskReport(self.fleet.node_id, call.task, TaskPhase.AWARDED, call.to_station, Reason.NONE))
        self._take(job_of(self.mirror, call))
        return [taken]

    def _assigned(self, order: Assignment, now_us: int) -> list[Effect]:
        taken = Send(TaskReport(self.fleet.node_id, order.task, TaskPhase.AWARDED, order.target, Reason.NONE))
        owned = self.owned
        known = [load.task for load in owned.plan.loads] if owned is not None else []
        if order.task in known or any(job.task == order.task for job in self.queue):
            return [taken]
        before = self.mirror.traffic.before.get(order.task, 0)
        job = Job(order.box, order.task, self.mirror.station_of(order.box), order.target, before)
        if job.source:
            self._take(job)
        return [taken] if job.source else []

    def _take(self, job: Job) -> None:
        """It is planned in my next turn."""
        self.queue.append(job)
        self.generation.has_queue = True

    def _plan_next(self, now_us: int) -> list[Effect]:
        """Put the oldest task won behind what is planned; forfeit one whose box is in another's plan."""
        if not self.queue or (self._queue_at_us is not None and now_us < self._queue_at_us):
            return []
        job = self.queue[0]
        if self.mirror.in_plans(job.box) not in (None, self.fleet.node_id):
            self._drop_first()
            return [self._phase(job.task, TaskPhase.FORFEITED, job.source)]
        found = self.generation.plan(job, now_us, version=successor(self.version, 8))
        if found is None:
            self._queue_at_us = now_us + RETRY_US
            return []
        self._drop_first()
        return self._adopt(found.plan, now_us)

    def _in_turn(self, now_us: int) -> list[Effect]:
        """What is only done in my turn; I wake for the turn in which something is due."""
        turn_us = self._turn_us(now_us)
        effects: list[Effect] = []
        if turn_us == now_us:
            effects = self._plan_next(now_us) + self._mend(now_us)
            turn_us = self._turn_us(now_us + TURN_US)
        due_us = self._planning_due(now_us)
        self._turn_at_us = max(turn_us, self._turn_us(due_us)) if due_us is not None else None
        return effects

    def _planning_due(self, now_us: int) -> int | None:
        """When there is something to plan, or to look at."""
        times = [self._again_at_us, self._patience_at_us]
        if self.queue:
            times.append(self._queue_at_us or now_us)
        if self.owned is not None and self.mirror.traffic.changes != self._looked_at:
            times.append(now_us)
        return min((time for time in times if time is not None), default=None)

    def _drop_first(self) -> None:
        self.queue.popleft()
        self._queue_at_us = None
        self.generation.has_queue = bool(self.queue)

    def _turn_us(self, now_us: int) -> int:
        """When my turn to adopt plans is, or begins next; ``now_us`` itself while it is."""
        count, rank = len(self.site.vehicles), self.site.vehicles.index(self.fleet.node_id)
        behind = (now_us // TURN_US - rank) % count
        return now_us if not behind else (now_us // TURN_US + count - behind) * TURN_US

    # --- plans -------------------------------------------------------------------------------------------------

    def _adopt(self, plan: Plan, now_us: int) -> list[Effect]:
        """Journal the plan, put it between the others' and tell it."""
        plan = self._as_told(plan, now_us)
        self.version = plan.version
        self.mirror.take_up(plan, now_us)
        return [Record(plan_record(plan)), *self._plan_statement(now_us)]

    def _as_told(self, plan: Plan, now_us: int) -> Plan:
        """The plan as all others read it: in whole ms, with the durations that they know."""
        reader, read = PlanReader(self.site), None
        for frame in to_frames(plan):
            read = reader.feed(frame, now_us)  # type: ignore[arg-type]  # a plan's own frames
        assert read is not None
        loads = tuple(replace_before(load, old) for load, old in zip(read.loads, plan.loads, strict=True))
        return replace(read, loads=loads)

    def _plan_statement(self, now_us: int) -> list[Effect]:
        """Itinerary head, plan, and how far it has come."""
        owned = self.owned
        if self.version == 0:
            return []
        node = self.fleet.node_id
        plan = owned.plan if owned is not None else Plan(node, self.version, now_us, ())
        grade = Grade.FIRM if owned is not None else Grade.RELEASED
        itinerary = Itinerary(node, self.version, grade, self.stamp, ())
        self.fleet.mirror.on_itinerary(itinerary, now_us)
        effects: list[Effect] = [Send(itinerary), *(Send(frame) for frame in to_frames(plan))]
        if owned is not None and owned.current:
            effects.append(Send(self._report(owned, owned.current - 1, owned.began)))
        return effects

    def _report(self, owned: Owned, step: int, at_us: int, result: StepResult = StepResult.DONE) -> StepReport:
        entity = owned.plan.steps[step].entity
        return StepReport(self.fleet.node_id, owned.plan.version, step, result, entity, to_bus_ms(at_us))

    def _done(self, owned: Owned, now_us: int) -> list[Effect]:
        """The step in hand is over: reported, deleted, the next begins now (row M30)."""
        step = owned.current
        report = self._report(owned, step, now_us)
        self.mirror.hear(report, now_us)
        self._told_blocked = False
        effects: list[Effect] = [Record(step_record(owned.plan.version, step, now_us)), Send(report)]
        if self.owned is None:
            # The plan is over; under a version of its own, so that whoever missed the report asks.
            self.version = successor(self.version, 8)
            over = Plan(self.fleet.node_id, self.version, now_us, ())
            effects += [Record(plan_record(over)), *self._plan_statement(now_us)]
        return effects

    def _mend(self, now_us: int) -> list[Effect]:
        """Make my plan anew if it is violated, and mine only (M31); a blocked lane is waited for first (M33)."""
        owned, traffic = self.owned, self.mirror.traffic
        if owned is None or self._is_busy():
            return []
        self._patience_at_us = self._patience_end(now_us)
        due = self._again_at_us is not None and self._again_at_us <= now_us
        if traffic.changes == self._looked_at and not due:
            return []
        self._looked_at = traffic.changes
        self._again_at_us = None
        why = next((one.why for one in traffic.violations(now_us) if one.owner == self.fleet.node_id), "")
        blocked = self.mirror.long_blocked(now_us) & {step.entity for step in owned.plan.steps[owned.current + 1 :]}
        if blocked:
            why = f"lane {self.site.entities[min(blocked)].name} is blocked"
        return self._anew(owned, why, now_us, must=bool(blocked) or "wait for" in why) if why else []

    def _anew(self, owned: Owned, why: str, now_us: int, *, must: bool) -> list[Effect]:
        self._again_at_us = now_us + AGAIN_US
        plan = self.generation.again(now_us, version=successor(self.version, 8))
        end_us = self.mirror.traffic.end_of(self.fleet.node_id, now_us)
        same_way = plan is not None and [one.entity for one in plan.steps] == [
            one.entity for one in owned.plan.steps[owned.current :]
        ]
        if plan is None or (plan.end >= end_us and not must) or (same_way and "blocked" in why):
            return []
        self.touched += 1
        return [Report(f"plan made anew: {why}"), *self._adopt(plan, now_us)]

    def _is_busy(self) -> bool:
        return self.body.is_moving or self.body.is_handling

    def _patience_end(self, now_us: int) -> int | None:
        """When the next blocked lane on my way has been waited for long enough."""
        ends = [since + self.site.patience_us for since in self.mirror.traffic.blocked.values()]
        coming = min((end for end in ends if end > now_us), default=None)
        if self._patience_at_us is not None and self._patience_at_us <= now_us:
            self._looked_at = -1
        return coming if self.owned is not None else None

    # --- motion ------------------------------------------------------------------------------------------------

    def _settle_in(self, now_us: int) -> list[Effect]:
        """After power-up: the body says where the plan has come to; a step may have ended while nobody looked."""
        owned, move = self.owned, self.body.move
        assert move is not None
        if owned is None:
            return []
        steps = owned.plan.steps
        if steps[owned.current].entity != move.entity and owned.current + 1 < len(steps):
            if steps[owned.current + 1].entity == move.entity:
                return self._done(owned, now_us)
        elif owned.current == len(steps) - 1 and steps[owned.current].entity != move.entity:
            return self._done(owned, now_us)
        return []

    def _goto(self, owned: Owned, now_us: int) -> list[Effect]:
        """Cross the entity in hand, slot by slot, and enter the next one (M11: the way inside is the drive's)."""
        move, steps, current = self.body.move, owned.plan.steps, owned.current
        assert move is not None
        following = steps[current + 1].entity
        if move.entity == following:
            return self._done(owned, now_us)
        if self.body.is_moving:
            return []
        if move.mode is MoveMode.BLOCKED and not self._told_blocked:
            self._told_blocked = True
            return [Send(self._report(owned, current, now_us, StepResult.BLOCKED))]
        here = self.site.entities[move.entity]
        if here.kind is EntityKind.LANE and move.slot < here.capacity:
            return self._enter(move.entity, move.slot + 1, following, now_us)
        if here.kind is EntityKind.AREA and self.body.towards() != following:
            return self.body.go(move.entity, move.slot, following, now_us)
        if following in self.mirror.traffic.blocked:
            return []
        onward = steps[current + 2].entity if current + 2 < len(steps) else 0
        slot = self.mirror.entry_slot(following, self.fleet.node_id)
        return self._enter(following, slot, onward, now_us)

    def _enter(self, entity: int, slot: int, towards: int, now_us: int) -> list[Effect]:
        """Ask for the right to a slot and go there once it is held and the slot in hand is crossed."""
        key = segment_token(Segment(entity, slot))
        if self.site.entities[entity].kind is not EntityKind.AREA:
            allowed = authorised(
                MotionState(self.fleet.tokens, self.body.is_known, stopped=False), Segment(entity, slot)
            )
            if not allowed[0]:
                return self.fleet.tokens.want(key, now_us)
        return self.body.go(entity, slot, towards, now_us) if self.body.stands_ready else []

    def _give_back(self, now_us: int) -> list[Effect]:
        """Rights to slots behind me, and to slots that my plan does not lead to any more, go back to their stewards."""
        move = self.body.move
        if move is None or self.body.is_moving:
            return []
        keep = {segment_token(Segment(move.entity, move.slot)), *self._wanted_slots()}
        effects: list[Effect] = []
        tokens = self.fleet.tokens
        for key in [one for one in tokens.wanted if one.kind is TokenKind.SEGMENT and one not in keep]:
            tokens.forget(key)
        for key in [one for one in tokens.held if one.kind is TokenKind.SEGMENT and one not in keep]:
            effects += tokens.give(key, self.site.stewards[key.number >> 8], now_us)
        return effects

    def _wanted_slots(self) -> list[TokenKey]:
        """The slot that comes next by the plan."""
        owned, move = self.owned, self.body.move
        if owned is None or move is None or owned.current + 1 >= len(owned.plan.steps):
            return []
        here = self.site.entities[move.entity]
        if here.kind is EntityKind.LANE and move.slot < here.capacity:
            return [segment_token(Segment(move.entity, move.slot + 1))]
        following = owned.plan.steps[owned.current + 1].entity
        return [segment_token(Segment(following, self.mirror.entry_slot(following, self.fleet.node_id)))]

    # --- at stations -------------------------------------------------------------------------------------------

    def _load(self, owned: Owned) -> Load | None:
        step = owned.current
        return next((load for load in owned.plan.loads if step in (load.pick, load.put)), None)

    def _handle(self, action: Action, box: int, now_us: int) -> list[Effect]:
        if self.body.is_handling or self._retry_at_us is not None:
            return []
        assert self.body.handler is not None
        if self.body.handler.mode is HandlerMode.FAILED and not self._may_retry:
            self._retry_at_us = now_us + RETRY_US
            owned = self.owned
            assert owned is not None
            return [Send(self._report(owned, owned.current, now_us, StepResult.FAILED))]
        self._may_retry = False
        return self.body.handle(action, box, now_us)

    def _dock(self, owned: Owned, now_us: int) -> list[Effect]:
        assert self.body.handler is not None
        if self.body.handler.mode is HandlerMode.DOCKED and not self.body.is_handling:
            return self._done(owned, now_us)
        return self._handle(Action.DOCK, 0, now_us) if self.body.stands_ready else []

    def _pick_up(self, owned: Owned, now_us: int) -> list[Effect]:
        """Only with the right to the box: its custodian gives it to whoever plans to carry it."""
        load = self._load(owned)
        assert load is not None and self.body.handler is not None
        key = self._box_token(load.box)
        if not self.fleet.tokens.holds(key):
            return self.fleet.tokens.want(key, now_us)
        if self.body.handler.box == load.box and not self.body.is_handling:
            aboard = self._state_box(load.box, ANY_STATION)
            return [*aboard, self._phase(load.task, TaskPhase.LOADED, 0), *self._done(owned, now_us)]
        return self._handle(Action.PICK_UP, load.box, now_us)

    def _put_down(self, owned: Owned, now_us: int) -> list[Effect]:
        load = self._load(owned)
        assert load is not None and self.body.handler is not None
        if self.body.handler.box == 0 and not self.body.is_handling:
            station = owned.plan.steps[owned.current].entity
            effects = self._state_box(load.box, station)
            key = self._box_token(load.box)
            if self.fleet.tokens.holds(key):
                effects += self.fleet.tokens.give(key, self.site.desk, now_us)
            return [*effects, self._phase(load.task, TaskPhase.DONE, station), *self._done(owned, now_us)]
        return self._handle(Action.PUT_DOWN, load.box, now_us)

    def _undock(self, owned: Owned, now_us: int) -> list[Effect]:
        """Undocked and back in the bay of the area: the station is free."""
        move, handler = self.body.move, self.body.handler
        assert move is not None and handler is not None
        area = self.site.entities[owned.plan.steps[owned.current].entity].area
        if move.entity == area:
            return self._done(owned, now_us)
        if handler.mode is not HandlerMode.FREE or self.body.is_handling:
            return self._handle(Action.UNDOCK, 0, now_us)
        if self.body.is_moving:
            return []
        steps = owned.plan.steps
        towards = steps[owned.current + 2].entity if owned.current + 2 < len(steps) else 0
        return self._enter(area, self.mirror.entry_slot(area, self.fleet.node_id), towards, now_us)

    def _phase(self, task: Reference, phase: TaskPhase, station: int) -> Effect:
        return Send(TaskReport(self.fleet.node_id, task, phase, station or ANY_STATION, Reason.NONE))

    def _box_token(self, box: int) -> TokenKey:
        return car_token(*self.site.box(box))

    def _box_at(self, box: int, station: int) -> CarAt:
        version = self.fleet.tokens.seen.get(self._box_token(box), 0)
        return CarAt(self.fleet.node_id, self.site.box(box), station, version, NO_WHEELBASE_MM)

    def _state_box(self, box: int, station: int) -> list[Effect]:
        statement = self._box_at(box, station)
        self.fleet.mirror.on_car(statement)
        self.mirror.hear(statement, 0)
        return [Send(statement)]


def replace_before(load: Load, old: Load) -> Load:
    """A load as it was told, with the date that its owner knows."""
    return load._replace(before=old.before)
