"""The vehicle: carries out the elementary actions of its plan, reports each, and makes its own plan anew if violated.

Nobody plans for it. It moves only into slots whose rights it holds, in the order in which the plans pass (design,
section 5), so a wrong mirror costs time and nothing else. In an area every vehicle has a bay of its own.
"""

from dataclasses import dataclass, field

from onboard.contract.codes import KindCode, MachineState, Reason, TaskPhase, TokenKind
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import (
    Award,
    CallForProposals,
    CarAt,
    Heartbeat,
    ManualOrder,
    Message,
    Reference,
    TaskReport,
)
from onboard.contract.terminal import Action, Assignment, HandlerMode, MoveMode, StepResult
from onboard.contract.terminal_device import HandlerState, MoveState
from onboard.core.authority import TokenKey, segment_token
from onboard.core.behaviour import BehaviourFactory, Fleet
from onboard.core.effects import Effect, Record, Send
from onboard.core.mirror import Mirror
from onboard.core.motion_authority import Permit, authorised
from onboard.core.negotiation import Estimator, NegotiationEvent
from onboard.core.site import Machine, Segment, Site
from onboard.systems.terminal.body import VehicleParts
from onboard.systems.terminal.generation import VehicleGeneration
from onboard.systems.terminal.manual import VehicleMode
from onboard.systems.terminal.memory import box_record, read_boxes
from onboard.systems.terminal.mirror import TerminalMirror
from onboard.systems.terminal.plan import Load
from onboard.systems.terminal.planner import Planner
from onboard.systems.terminal.records import StepOverRecord
from onboard.systems.terminal.site import EntityKind, Terminal
from onboard.systems.terminal.steps import TABLE, ActionDeed, ActionFinding
from onboard.systems.terminal.traffic import Owned
from onboard.ways.cars import CarFleet, car_fleet, car_mirror
from onboard.ways.tokens import car_token

#: A failed action of the handler is tried again after this, us: a box that slipped may be gripped at the second try.
RETRY_US = 5_000_000
#: What a statement about a box says where that about a car has a wheelbase (dbc/fleet.dbc).
NO_WHEELBASE_MM = 1500


def terminal(site: Site) -> Terminal:
    """The site as what it is. Raises ``TypeError`` for another system's."""
    if not isinstance(site, Terminal):
        raise TypeError(f"site {site.name} is no container terminal")
    return site


@dataclass(frozen=True)
class VehicleFactory(BehaviourFactory):
    """Makes the vehicles of a terminal, with a planner each."""

    fleet_type = CarFleet

    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> VehicleGeneration:
        """The vehicle's task-generation function, with the picture that it looks at."""
        place = terminal(site)
        return VehicleGeneration(place, machine, TerminalMirror(place, machine.node_id, car_mirror(mirror)))

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> "Vehicle":
        """The vehicle's steps; ``estimator`` is the one made above."""
        if not isinstance(estimator, VehicleGeneration):
            raise TypeError("a vehicle needs its own task-generation function")
        return Vehicle(car_fleet(fleet), estimator)


@dataclass
class Vehicle:
    """One vehicle: its devices, its plan, and what it does next."""

    fleet: CarFleet
    generation: VehicleGeneration
    kind: KindCode = KindCode.VEHICLE
    body: VehicleParts = field(init=False)
    planner: Planner = field(init=False)
    manual: VehicleMode = field(init=False)
    _retry_at_us: int | None = None
    _may_retry: bool = False
    _told_blocked: bool = False

    def __post_init__(self) -> None:
        self.body = VehicleParts(self.fleet.node_id)
        self.planner = Planner(self.fleet, self.generation, self.body)
        self.manual = VehicleMode(self.fleet.node_id)

    # --- the Behaviour -----------------------------------------------------------------------------------------

    @property
    def site(self) -> Terminal:
        """The terminal in which it drives."""
        return self.generation.site

    @property
    def mirror(self) -> TerminalMirror:
        """My picture of the others."""
        return self.generation.mirror

    @property
    def owned(self) -> Owned | None:
        """The plan of this vehicle that is being carried out; None without one."""
        return self.mirror.traffic.plans.get(self.fleet.node_id)

    @property
    def state(self) -> MachineState:
        """STARTING until drive and handler are known, WAITING in a person's hand, for heartbeats."""
        if not self.body.is_known:
            return MachineState.STARTING
        if not self.manual.is_automatic:
            return MachineState.WAITING
        return MachineState.IDLE if self.owned is None else MachineState.WORKING

    @property
    def itinerary_version(self) -> int:
        """The version of the plan in hand, 0 without one."""
        return self.planner.version if self.owned is not None else 0

    def start(self, now_us: int) -> list[Effect]:
        """After a restart the journal knows the plan and how far it has come."""
        self.mirror.remember(read_boxes(self.fleet.node_id, self.site.desk, self.fleet.entries))
        self.planner.start(now_us)
        self.manual.replay(self.fleet.entries)
        self.generation.is_held = not self.manual.is_automatic
        return []

    def sense(self, message: Message, now_us: int) -> list[Effect]:
        """States of drive and handler; with the first of both the vehicle takes its place."""
        if isinstance(message, MoveState | HandlerState):
            was_known = self.body.is_known
            self.body.sense(message, now_us)
            if self.owned is None and self.body.move is not None and self.body.move.entity in self.site.entities:
                # Also after a start: what was carried out before is in no journal.
                self.mirror.stands(self.fleet.node_id, self.body.move.entity)
            if self.body.is_known and not was_known:
                return [*self._settle_in(now_us), *self.statements(now_us)]
        return []

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        """Everybody's plans, reports, boxes and lanes; a central planner's order is as good as an award."""
        self.mirror.hear(message, now_us)
        if isinstance(message, ManualOrder) and message.machine == self.fleet.node_id:
            effects = self.manual.step_by_hand(message, self.owned)
            self.generation.is_held = not self.manual.is_automatic
            self.planner.unbegun.begin_anew()
            return effects
        if isinstance(message, Assignment) and message.vehicle == self.fleet.node_id:
            return self.planner.assigned(message, now_us)
        if isinstance(message, CallForProposals):
            self.planner.called(message)
        if isinstance(message, Award) and message.winner != self.fleet.node_id:
            return self.planner.lost(message, now_us)
        if isinstance(message, Heartbeat):
            return self.mirror.on_beat(message, now_us)
        return []

    def negotiated(self, event: NegotiationEvent, now_us: int) -> list[Effect]:
        """Tasks won are the planner's."""
        return self.planner.negotiated(event, now_us)

    def may_grant(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        """Rights come from a steward and go back there."""
        return Reason.TOKEN_NOT_GRANTABLE_YET

    def advance(self, now_us: int) -> list[Effect]:
        """One step of the plan, where its condition is met."""
        if not self.body.is_known:
            return []
        if self._retry_at_us is not None and self._retry_at_us <= now_us:
            self._retry_at_us, self._may_retry = None, True
        effects = self._repeat(now_us) + self._give_back(now_us) + self.manual.rests(self.body.is_at_rest)
        effects += self.planner.in_turn(now_us)
        owned = self.owned
        if effects:
            return effects
        effects = self.planner.speak(now_us)
        if effects or owned is None:
            return effects
        return self._step(owned, now_us)

    def next_wake(self) -> int | None:
        """Repeats and retries of the devices, and the planner's turn."""
        times = (self.body.due_us, self._retry_at_us, self.planner.next_wake())
        return min((time for time in times if time is not None), default=None)

    def statements(self, now_us: int) -> list[Effect]:
        """My plan, how far it has come, the box that I carry, those put down that no desk keeps yet, my rights."""
        effects = self.planner.statement(now_us)
        effects += [Send(one) for one in self.mirror.kept_by(self.fleet.node_id)]
        handler = self.body.handler
        if handler is not None and handler.box and self.fleet.tokens.holds(self._box_token(handler.box)):
            effects.append(Send(self._box_at(handler.box, ANY_STATION)))
        return effects + self.manual.statement() + self.fleet.tokens.statements()

    def _repeat(self, now_us: int) -> list[Effect]:
        effects, move = self.body.repeat(now_us), self.body.move
        due_us = self.body.go_on_us
        if move is not None and due_us is not None and due_us <= now_us and not self.body.is_moving:
            effects += self.body.go_on(self._permit(move.entity, move.slot), now_us)
        return effects

    # --- motion -----------------------------------------------------------------------------------------------

    def _done(self, owned: Owned, now_us: int) -> list[Effect]:
        """The step in hand is over: reported, deleted, the next begins now (row M30)."""
        step = owned.current
        report = self.planner.report(owned, step, now_us)
        self.mirror.hear(report, now_us)
        self._told_blocked = False
        effects: list[Effect] = [Record(StepOverRecord(owned.plan.version, step, now_us)), Send(report)]
        if self.owned is None:
            effects += self.planner.over(now_us)
        return effects

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

    def _step(self, owned: Owned, now_us: int) -> list[Effect]:
        """One line of ``TABLE`` for the action in hand."""
        action = owned.plan.steps[owned.current].action
        match TABLE[action, self._found(action, owned)]:
            case ActionDeed.END | ActionDeed.END_ABOARD | ActionDeed.END_PUT_DOWN as deed:
                return self._of_load(deed, owned, now_us) + self._done(owned, now_us)
            case ActionDeed.TELL_OBSTACLE:
                self._told_blocked = True
                return self._report(StepResult.BLOCKED, owned, now_us)
            case ActionDeed.TELL_FAILURE:
                self._retry_at_us = now_us + RETRY_US
                return self._report(StepResult.FAILED, owned, now_us)
            case ActionDeed.ASK_FOR_BOX:
                return self.fleet.tokens.want(self._box_token(self._box(owned)), now_us)
            case ActionDeed.HANDLE:
                self._may_retry = False
                return self._handle(action, 0 if action in (Action.DOCK, Action.UNDOCK) else self._box(owned), now_us)
            case ActionDeed.NEXT_SLOT | ActionDeed.CROSS | ActionDeed.NEXT_ENTITY | ActionDeed.BACK_TO_AREA as deed:
                return self._move_on(deed, owned, now_us)
        return []

    def _report(self, result: StepResult, owned: Owned, now_us: int) -> list[Effect]:
        return [Send(self.planner.report(owned, owned.current, now_us, result))]

    def _found(self, action: Action, owned: Owned) -> ActionFinding:
        """What drive, handler, rights and mirror come to."""
        move, handler = self.body.move, self.body.handler
        assert move is not None and handler is not None
        match action:
            case Action.GOTO:
                return self._found_on_way(move, owned)
            case Action.DOCK:
                if handler.gear is HandlerMode.DOCKED and not self.body.is_handling:
                    return ActionFinding.DONE
                return self._found_at_station(handler, owned) if self.body.stands_ready else ActionFinding.AT_WORK
            case Action.PICK_UP:
                box = self._box(owned)
                if not self.fleet.tokens.holds(self._box_token(box)):
                    return ActionFinding.NO_RIGHT
                is_aboard = handler.box == box and not self.body.is_handling
                return ActionFinding.DONE if is_aboard else self._found_at_station(handler, owned)
            case Action.PUT_DOWN:
                is_put = handler.box == 0 and not self.body.is_handling
                return ActionFinding.DONE if is_put else self._found_at_station(handler, owned)
            case Action.UNDOCK:
                return self._found_leaving(move, handler, owned)

    def _found_on_way(self, move: MoveState, owned: Owned) -> ActionFinding:
        """Across the entity in hand, slot by slot, into the next one (M11: inside, the way is the drive's)."""
        following = owned.plan.steps[owned.current + 1].entity
        if move.entity == following:
            return ActionFinding.DONE
        if self.body.is_moving:
            return ActionFinding.AT_WORK
        if move.mode is MoveMode.BLOCKED and not self._told_blocked:
            return ActionFinding.OBSTACLE
        if not self.manual.may_begin(owned):
            return ActionFinding.HELD
        here = self.site.entities[move.entity]
        if here.kind is EntityKind.LANE and move.slot < here.capacity:
            return ActionFinding.IN_LANE
        if here.kind is EntityKind.AREA and self.body.towards() != following:
            return ActionFinding.CROSSES_ELSEWHERE
        if following in self.mirror.traffic.blocked:
            return ActionFinding.CLOSED
        return ActionFinding.AT_END

    def _found_at_station(self, handler: HandlerState, owned: Owned) -> ActionFinding:
        if self.body.is_handling or self._retry_at_us is not None:
            return ActionFinding.AT_WORK
        if not self.manual.may_begin(owned):
            return ActionFinding.HELD
        is_news = handler.gear is HandlerMode.FAILED and not self._may_retry
        return ActionFinding.FAILED if is_news else ActionFinding.READY

    def _found_leaving(self, move: MoveState, handler: HandlerState, owned: Owned) -> ActionFinding:
        """Undocked and back in the bay of the area: the station is free."""
        if move.entity == self._area(owned):
            return ActionFinding.DONE
        if handler.gear is not HandlerMode.FREE or self.body.is_handling:
            return self._found_at_station(handler, owned)
        if self.body.is_moving:
            return ActionFinding.AT_WORK
        return ActionFinding.AT_END if self.manual.may_begin(owned) else ActionFinding.HELD

    def _area(self, owned: Owned) -> int:
        return self.site.entities[owned.plan.steps[owned.current].entity].area

    def _move_on(self, deed: ActionDeed, owned: Owned, now_us: int) -> list[Effect]:
        """Into the slot, across the area or into the entity that comes next."""
        move, steps, current = self.body.move, owned.plan.steps, owned.current
        assert move is not None
        following = self._area(owned) if deed is ActionDeed.BACK_TO_AREA else steps[current + 1].entity
        if deed is ActionDeed.NEXT_SLOT:
            return self._enter(move.entity, move.slot + 1, following, now_us)
        if deed is ActionDeed.CROSS:
            return self.body.go(self._permit(move.entity, move.slot), move.entity, move.slot, following, now_us)
        onward = steps[current + 2].entity if current + 2 < len(steps) else 0
        return self._enter(following, self.mirror.entry_slot(following, self.fleet.node_id), onward, now_us)

    def _enter(self, entity: int, slot: int, towards: int, now_us: int) -> list[Effect]:
        """Ask for the right to a slot and go there once it is held and the slot in hand is crossed."""
        permit = self._permit(entity, slot)
        if not permit:
            return [effect for key in permit.rights for effect in self.fleet.tokens.want(key, now_us)]
        return self.body.go(permit, entity, slot, towards, now_us) if self.body.stands_ready else []

    def _permit(self, entity: int, slot: int, *also: TokenKey) -> Permit:
        """To be in a slot: of an area nobody holds a right, its vehicles keep clear of each other there."""
        is_open = self.site.entities[entity].kind is EntityKind.AREA
        rights = [] if is_open else [segment_token(Segment(entity, slot))]
        return authorised(self.fleet.motion, [*rights, *also])

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
        for key in [one for one in tokens.mine() if one.kind is TokenKind.SEGMENT and one not in keep]:
            effects += tokens.give(key, self.site.stewards[key.number >> 8], now_us)
        for box in sorted(self.planner.unbegun.given_back):
            effects += self._give_back_box(box, now_us)
        return effects

    def _give_back_box(self, box: int, now_us: int) -> list[Effect]:
        """The right to a box that I was to fetch, and that came after I had given the task back."""
        key, handler, tokens = self._box_token(box), self.body.handler, self.fleet.tokens
        if self.mirror.in_plans(box) == self.fleet.node_id:
            self.planner.unbegun.given_back.discard(box)
            return []
        is_aboard = self.body.is_handling or handler is None or handler.box == box
        return [] if is_aboard or not tokens.holds(key) else tokens.give(key, self.site.desk, now_us)

    def _wanted_slots(self) -> list[TokenKey]:
        """The slot that comes next by the plan."""
        owned, move = self.owned, self.body.move
        if owned is not None and not self.manual.may_begin(owned):
            return []
        if owned is None or move is None or owned.current + 1 >= len(owned.plan.steps):
            return []
        here = self.site.entities[move.entity]
        if here.kind is EntityKind.LANE and move.slot < here.capacity:
            return [segment_token(Segment(move.entity, move.slot + 1))]
        following = owned.plan.steps[owned.current + 1].entity
        return [segment_token(Segment(following, self.mirror.entry_slot(following, self.fleet.node_id)))]

    # --- at stations -------------------------------------------------------------------------------------------

    def _load(self, owned: Owned) -> Load:
        step = owned.current
        return next(load for load in owned.plan.loads if step in (load.pick, load.put))

    def _box(self, owned: Owned) -> int:
        return self._load(owned).box

    def _handle(self, action: Action, box: int, now_us: int) -> list[Effect]:
        """Order the handler, with the right to the slot, and to the box where there is one."""
        move = self.body.move
        assert move is not None
        of_box = [self._box_token(box)] if box else []
        return self.body.handle(self._permit(move.entity, move.slot, *of_box), action, box, now_us)

    def _of_load(self, deed: ActionDeed, owned: Owned, now_us: int) -> list[Effect]:
        """What is said of the box that was just picked up or put down; nothing of any other action."""
        if deed is ActionDeed.END:
            return []
        load, station = self._load(owned), owned.plan.steps[owned.current].entity
        if deed is ActionDeed.END_ABOARD:
            return [*self._state_box(load.box, ANY_STATION), self._phase(load.task, TaskPhase.LOADED, 0)]
        effects: list[Effect] = [Record(box_record(self._box_at(load.box, station)))]
        effects += self._state_box(load.box, station)
        key = self._box_token(load.box)
        if self.fleet.tokens.holds(key):
            effects += self.fleet.tokens.give(key, self.site.desk, now_us)
        return [*effects, self._phase(load.task, TaskPhase.DONE, station)]

    def _phase(self, task: Reference, phase: TaskPhase, station: int) -> Effect:
        return Send(TaskReport(self.fleet.node_id, task, phase, station or ANY_STATION, Reason.NONE))

    def _box_token(self, box: int) -> TokenKey:
        return car_token(*self.site.box(box))

    def _box_at(self, box: int, station: int) -> CarAt:
        version = self.fleet.tokens.version_of(self._box_token(box))
        return CarAt(self.fleet.node_id, self.site.box(box), station, version, NO_WHEELBASE_MM)

    def _state_box(self, box: int, station: int) -> list[Effect]:
        statement = self._box_at(box, station)
        self.fleet.mirror.on_car(statement)
        self.mirror.hear(statement, 0)
        return [Send(statement)]
