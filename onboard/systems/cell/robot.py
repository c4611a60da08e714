"""A robot of the cell: carries its part of a goal, and is manager of the rest (rows C05 to C07, C15 to C18).

Custody of a part is a token with one holder: who holds it may take the part up, and gives it on when the part lies
where the contract says, to the sub-contractor and nobody else. A contract in hand is an ``Undertaking``; at most one of
them is ``active``, the most urgent whose part this robot may take (row C15).
"""

from dataclasses import dataclass, field

from onboard.contract.cell import ArmMode, ArmPhase, ArmProgress, GoalTooDeep, GripAction, GripMode, PartAt
from onboard.contract.cell_device import ArmState, GripOrder, GripState
from onboard.contract.codes import CallResult, KindCode, MachineState, Reason, TaskPhase, TokenKind
from onboard.contract.messages import Message, Reference, SyncRequest, TaskReport
from onboard.core.authority import TokenKey
from onboard.core.behaviour import BehaviourFactory, Fleet
from onboard.core.effects import Effect, Send
from onboard.core.mirror import Mirror
from onboard.core.motion_authority import authorised
from onboard.core.negotiation import Awarded, Closed, Estimator, NegotiationEvent, PreAssigned, Released
from onboard.core.records import last_boot
from onboard.core.site import Machine, Site
from onboard.systems.cell.contracts import Contract, Goal, part_token
from onboard.systems.cell.generation import ArmGeneration, call_terms
from onboard.systems.cell.geometry import Point
from onboard.systems.cell.goal_frames import contract_messages
from onboard.systems.cell.memory import Undertaking, lost_record, stage_record, undertakings, won_record
from onboard.systems.cell.motion import ArmDriver
from onboard.systems.cell.records import ContractStage
from onboard.systems.cell.site import Cell
from onboard.systems.cell.steps import TABLE, ArmDeed, ArmFinding
from onboard.work.device_link import DeviceLink
from onboard.work.undertaking import TaskEvent, Undertakings

#: Where a robot is, is told this often while it moves, us (dbc/cell.dbc).
PROGRESS_US = 2_000_000
#: A sub-goal that found nobody is called for again after this, us: an arm that was busy may be free.
CALL_AGAIN_US = 5_000_000
#: A sub-contractor that has the part is asked this often how it stands, us; so a lost word costs time only.
ASK_AGAIN_US = 20_000_000
#: An order to the gripper is said again after this while it is not obeyed, us (dbc/cell.dbc).
GRIP_AGAIN_US = 1_000_000


@dataclass(frozen=True)
class ArmFactory(BehaviourFactory):
    """Makes robots of a cell."""

    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> ArmGeneration:
        """What its bids come from. Raises ``TypeError`` for a site that is no cell."""
        if not isinstance(site, Cell):
            raise TypeError("a robot of a cell needs a cell")
        return ArmGeneration(site, machine, site.arms[machine.node_id].home)

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> "ArmRobot":
        """The robot's steps; ``estimator`` is the one made above."""
        if not isinstance(estimator, ArmGeneration):
            raise TypeError("a robot needs its own task-generation function")
        return ArmRobot(fleet, estimator)


@dataclass
class ArmRobot:
    """One robot. ``tasks`` are its contracts; at most one of them is ``active``."""

    fleet: Fleet
    generation: ArmGeneration
    kind: KindCode = KindCode.ARM
    tasks: Undertakings[Undertaking] = field(init=False)
    active: Reference | None = None
    phase: ArmPhase = ArmPhase.IDLE
    grip: GripState | None = None
    driver: ArmDriver = field(init=False)
    gripper: DeviceLink[tuple[GripAction, Reference]] = field(init=False)
    _call_at_us: dict[Reference, int] = field(default_factory=dict)
    _ask_at_us: dict[Reference, int] = field(default_factory=dict)
    #: Rests of goals whose calls an earlier life made: somebody may have won one.
    _unsure: set[Reference] = field(default_factory=set)
    #: Rests of contracts that were lost while nobody had them: the calls for them are void.
    _void: list[Goal] = field(default_factory=list)
    _progress_at_us: int | None = None
    _told: tuple[ArmPhase, ArmMode] | None = None

    def __post_init__(self) -> None:
        site = self.generation.site
        self.driver = ArmDriver(self.fleet.motion, self.generation.arm, site.obstacles, site.timing.drive_refresh_us)
        self.fleet.negotiation.is_sound = self.generation.goals_heard.is_sound
        # Names of goals of an earlier life may still be about.
        self.generation.number = last_boot(self.fleet.entries) << 8
        me = self.fleet.node_id
        self.gripper = DeviceLink(lambda sequence, order: GripOrder(me, sequence, *order), GRIP_AGAIN_US)
        self.tasks = Undertakings(
            self.fleet,
            is_begun=lambda one: one.stage is not ContractStage.WON or self.fleet.tokens.holds(_part_token(one)),
            may_give=lambda one, node: node == one.manager,
            lose=self._lose,
            changed=self._engage,
        )
        for one in undertakings(self.fleet.entries).values():
            if one.stage is ContractStage.OVER:
                self.tasks.remember(one.task)
            else:
                self.tasks.in_hand[one.task] = one
                if one.sub_goal is not None and not one.successor:
                    self._call_at_us[one.task] = 0
                    self._unsure.add(one.task)
        self._engage()

    # --- the Behaviour -----------------------------------------------------------------------------------------

    @property
    def state(self) -> MachineState:
        """STARTING until drive and gripper are heard, then IDLE or WORKING, for heartbeats."""
        if self.driver.state is None or self.grip is None:
            return MachineState.STARTING
        return MachineState.IDLE if self.active is None else MachineState.WORKING

    @property
    def itinerary_version(self) -> int:
        """A robot of a cell has no itinerary along tracks."""
        return 0

    def start(self, now_us: int) -> list[Effect]:
        """Nothing moves before the position is sensed."""
        for one in self.tasks.in_hand.values():
            if one.sub_goal is not None and one.successor:
                self.fleet.winners.takes(one.sub_goal.task, one.successor, now_us)
        return []

    def sense(self, message: Message, now_us: int) -> list[Effect]:
        """Drive and gripper; a change of what the robot does is told."""
        match message:
            case ArmState():
                self.driver.sense(message)
                if self.driver.position is not None:
                    self.generation.position = self.driver.position
            case GripState():
                if self.grip is None:
                    self.gripper.go_on_from(message.sequence)
                self.grip = message
        return self._progress(now_us)

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        """Goals and offers; sub-contractors' reports; calls and awards for what is in hand already."""
        self.generation.goals_heard.hear(message)
        self.generation.depths.hear(message)
        match message:
            case TaskReport():
                return self._on_report(message, now_us)
            case ArmProgress():
                self.fleet.winners.works(message.sender, (message.x_mm, message.y_mm, message.arm_phase), now_us)
        return self.tasks.hear(message)

    def negotiated(self, event: NegotiationEvent, now_us: int) -> list[Effect]:
        """Bids of my own are kept in mind; a contract that is won is journalled before it is told."""
        match event:
            case PreAssigned(call_key=key, proposal=proposal):
                self.generation.promised[key] = proposal.program[0]
            case Released(call_key=key):
                self.generation.promised.pop(key, None)
            case Awarded(call_key=key, proposal=proposal, parts=parts):
                self.generation.promised.pop(key, None)
                return self._take_on(proposal.program[0], parts[0].winner if parts else 0, now_us)
            case Closed():
                return self._on_closed(event, now_us)
        return []

    def may_grant(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        """A part's custody goes to the sub-contractor, once the part lies where it takes over."""
        if key.kind is not TokenKind.CAR:
            return Reason.NOT_AUTHORISED
        one = self._undertaking_of(Reference(key.number >> 16, key.number & 0xFFFF))
        if one is None or one.stage is not ContractStage.PUT or one.successor != requester:
            return Reason.TOKEN_NOT_GRANTABLE_YET
        return Reason.NONE

    def advance(self, now_us: int) -> list[Effect]:
        """Ask for custody, choose the most urgent part, and take one step for it."""
        if self.driver.state is None or self.grip is None:
            return []
        effects: list[Effect] = [Send(GoalTooDeep(self.fleet.node_id, part)) for part in self.generation.depths.take()]
        effects += self._want_parts(now_us) + self._manage(now_us) + self._give_back(now_us)
        if self.active is None:
            effects += self._step(now_us)
        if self.active is not None:
            effects += self._step(now_us)
        if self._progress_at_us is not None and self._progress_at_us <= now_us:
            self._told = None
            effects += self._progress(now_us)
        return effects

    def next_wake(self) -> int | None:
        """When an order, a call, a question or a word is due; nothing is before the devices have told how they are."""
        if self.driver.state is None or self.grip is None:
            return None
        if self.generation.depths.due:
            return 0
        times = [self.driver.link.due_us, self.gripper.due_us, self._progress_at_us]
        times += [*self._call_at_us.values(), *self._ask_at_us.values()]
        return min((time for time in times if time is not None), default=None)

    def statements(self, now_us: int) -> list[Effect]:
        """What is in hand and what is over, where I am, parts in my custody, and tokens."""
        effects = self.tasks.reports()
        self._told = None
        return effects + self._progress(now_us) + self._parts() + self.fleet.tokens.statements()

    # --- contracts ---------------------------------------------------------------------------------------------

    def _take_on(self, contract: Contract, successor_node: int, now_us: int) -> list[Effect]:
        goal, via = contract.goal, contract.move.via
        sub_goal = None if via == goal.end else self.generation.sub_goal(goal, via)
        one = Undertaking(contract, goal.task.origin, sub_goal, successor=successor_node)
        self.tasks.meet(one.task, TaskEvent.WIN, one)
        if sub_goal is not None and not successor_node:
            # The option has lapsed: the rest of the goal is called for anew.
            self._call_at_us[one.task] = now_us
        said = [Send(message) for message in contract_messages(contract)]
        return [won_record(one), self.tasks.report(one.task), *said]

    def _engage(self) -> None:
        waiting = (one for one in self.tasks.in_hand.values() if one.stage in (ContractStage.WON, ContractStage.TAKEN))
        self.generation.engaged = {one.task: one.contract for one in waiting}
        self.generation.known = {*self.tasks.in_hand, *self.tasks.over}

    def _lose(self, one: Undertaking) -> list[Effect]:
        """Its manager gave to another, or to nobody, what I have not begun: whose part I have not got."""
        self.fleet.tokens.forget(_part_token(one))
        effects: list[Effect] = [lost_record(one)]
        if one.sub_goal is not None and one.successor:
            effects += self.fleet.winners.let_go(one.sub_goal.task)
        elif one.sub_goal is not None:
            self._void.append(one.sub_goal)
        self._forget_rest(one)
        return effects

    def _forget_rest(self, one: Undertaking) -> None:
        for times in (self._ask_at_us, self._call_at_us):
            times.pop(one.task, None)
        if one.sub_goal is not None:
            self.fleet.winners.over(one.sub_goal.task)

    def _on_report(self, report: TaskReport, now_us: int) -> list[Effect]:
        """A sub-contractor has the goal in hand, or has achieved it: then mine is achieved too (row C18)."""
        one = next(
            (one for one in self.tasks.in_hand.values() if one.sub_goal and one.sub_goal.task == report.task), None
        )
        if one is None:
            # A rest of mine that was awarded once, and whose contract I have lost since: nobody is to bring it there.
            is_claim = report.phase is TaskPhase.AWARDED and report.task.origin == self.fleet.node_id
            return self.fleet.winners.remind(report.task, report.sender) if is_claim else []
        assert one.sub_goal is not None
        effects: list[Effect] = []
        if not one.successor and self._may_claim(one, report, now_us):
            # It has won a call that I do not remember.
            one.successor, one.was_heard = report.sender, True
            self._unsure.discard(one.task)
            self.fleet.winners.takes(one.sub_goal.task, one.successor, now_us)
            effects.append(stage_record(one))
            self._call_at_us.pop(one.task, None)
            effects += self._withdraw_call(one.sub_goal, now_us)
        if report.sender != one.successor:
            is_claim = report.phase is TaskPhase.AWARDED
            return self.fleet.winners.remind(report.task, report.sender) if is_claim else []
        self._ask_at_us.pop(one.task, None)
        if report.phase is TaskPhase.DONE and report.sender == one.successor and one.stage is ContractStage.PUT:
            return [*effects, *self._achieve(one)]
        return effects

    def _of_rest(self, task: Reference) -> Undertaking | None:
        """The contract whose rest is another's goal by this name."""
        return next((one for one in self.tasks.in_hand.values() if one.sub_goal and one.sub_goal.task == task), None)

    def _may_claim(self, one: Undertaking, report: TaskReport, now_us: int) -> bool:
        may_claim = one.task in self._unsure and report.phase is not TaskPhase.FORFEITED
        return may_claim and self.fleet.winners.may_claim(report.task, report.sender, now_us)

    def _withdraw_call(self, rest: Goal, now_us: int) -> list[Effect]:
        """Close the call for the rest of a goal, where one is open."""
        said = self.fleet.negotiation.withdraw(call_terms(rest), now_us)
        return [item for item in said if not isinstance(item, NegotiationEvent)]

    def _on_closed(self, event: Closed, now_us: int) -> list[Effect]:
        """A call of mine is over: for an option that rests on no contract nothing follows."""
        task = event.call.task
        one = self._of_rest(task)
        if one is None or one.stage is ContractStage.OVER:
            return []
        if event.winner:
            one.successor, one.was_heard = event.winner, True
            self._unsure.discard(one.task)
            self.fleet.winners.takes(task, event.winner, now_us, event.call.call)
            return [stage_record(one)]
        if one.successor and event.result is not CallResult.REJECTED:
            return []
        one.successor, one.was_heard = 0, False
        self._call_at_us[one.task] = now_us + CALL_AGAIN_US
        return [stage_record(one)]

    def _achieve(self, one: Undertaking) -> list[Effect]:
        one.stage = ContractStage.OVER
        self.tasks.meet(one.task, TaskEvent.END)
        self._forget_rest(one)
        # The manager is told of completion and of nothing before (row C18).
        return [stage_record(one), self.tasks.report(one.task)]

    # --- manager of the rest -----------------------------------------------------------------------------------

    def _manage(self, now_us: int) -> list[Effect]:
        """Call for rests that nobody has, and ask sub-contractors that have had the part for long (row C17)."""
        effects: list[Effect] = []
        while self._void:
            effects += self._withdraw_call(self._void.pop(), now_us)
        for task, due_us in list(self._call_at_us.items()):
            one = self.tasks.in_hand.get(task)
            if one is None or one.sub_goal is None:
                del self._call_at_us[task]
            elif due_us <= now_us:
                del self._call_at_us[task]
                effects += self.fleet.negotiation.open(call_terms(one.sub_goal), now_us)
        for task, one in list(self.tasks.in_hand.items()):
            effects += self._take_back(one, now_us)
            if one.stage is ContractStage.PUT and one.sub_goal is None:
                # The controller stopped between putting the part down and saying so.
                effects += self._achieve(one)
            if one.stage is not ContractStage.PUT or not one.successor:
                self._ask_at_us.pop(task, None)
                continue
            due_us = self._ask_at_us.setdefault(task, now_us + ASK_AGAIN_US)
            if due_us <= now_us:
                self._ask_at_us[task] = now_us + ASK_AGAIN_US
                effects.append(Send(SyncRequest(self.fleet.node_id, one.successor)))
        return effects

    def _take_back(self, one: Undertaking, now_us: int) -> list[Effect]:
        """A sub-contractor that is lost while its part is in my custody: the rest is called for anew, without it."""
        if one.sub_goal is None or not self.fleet.tokens.holds(part_token(one.sub_goal.part)):
            return []
        reason = self.fleet.winners.lost(one.sub_goal.task, now_us)
        # Before the part lies where it is to be taken it has nothing to do but to wait.
        if reason is Reason.NONE or (reason is Reason.FALSE_STATEMENT and one.stage is not ContractStage.PUT):
            return []
        one.successor, one.was_heard = 0, False
        self._call_at_us[one.task] = now_us + CALL_AGAIN_US
        if one.stage is not ContractStage.WON:
            self.fleet.winners.blame(one.sub_goal.task, now_us)
        return [*self.fleet.winners.take_back(one.sub_goal.task, reason, now_us), stage_record(one)]

    # --- custody -----------------------------------------------------------------------------------------------

    def _want_parts(self, now_us: int) -> list[Effect]:
        effects: list[Effect] = []
        for one in self.tasks.in_hand.values():
            if one.stage is ContractStage.WON:
                effects += self.fleet.tokens.want(_part_token(one), now_us)
        return effects

    def _give_back(self, now_us: int) -> list[Effect]:
        """A part that lies at its goal goes back into the custody of the goal manager that named it."""
        effects: list[Effect] = []
        wanted = {one.contract.goal.part for one in self.tasks.in_hand.values()}
        for key in self.fleet.tokens.mine():
            part = Reference(key.number >> 16, key.number & 0xFFFF)
            if key.kind is TokenKind.CAR and part not in wanted:
                effects += self.fleet.tokens.give(key, part.origin, now_us)
        return effects

    def _undertaking_of(self, part: Reference) -> Undertaking | None:
        return next((one for one in self.tasks.in_hand.values() if one.contract.goal.part == part), None)

    def _parts(self) -> list[Effect]:
        """Where the parts in my custody are."""
        tokens = self.fleet.tokens
        mine = (one for one in self.tasks.in_hand.values() if tokens.holds(_part_token(one)))
        return [self._part_at(one) for one in mine if one.stage in (ContractStage.TAKEN, ContractStage.PUT)]

    def _part_at(self, one: Undertaking) -> Send:
        aboard = one.stage is ContractStage.TAKEN
        place = one.contract.goal.start if aboard else one.contract.move.via
        return Send(PartAt(self.fleet.node_id, one.contract.goal.part, place.x_mm, aboard, place.y_mm))

    # --- steps -------------------------------------------------------------------------------------------------

    def _step(self, now_us: int) -> list[Effect]:
        """One line of ``TABLE``; a new phase is told after what it follows from."""
        one = self._in_hand or self._next()
        phase, deed = TABLE[self.phase, self._found(one)]
        return self._do(deed, one, now_us) + self._to(phase, now_us)

    @property
    def _in_hand(self) -> Undertaking | None:
        return self.tasks.in_hand[self.active] if self.active is not None else None

    def _next(self) -> Undertaking | None:
        """The part that is aboard, else the most urgent of those that I may take (row C15)."""
        ready = [
            one
            for one in self.tasks.in_hand.values()
            if one.stage in (ContractStage.WON, ContractStage.TAKEN) and self.fleet.tokens.holds(_part_token(one))
        ]
        return min(
            ready, key=lambda one: (one.stage is not ContractStage.TAKEN, one.contract.goal.urgency), default=None
        )

    def _found(self, one: Undertaking | None) -> ArmFinding:
        """What contracts, tokens and the devices' last words come to for ``one``, in hand or to be chosen."""
        if one is None:
            return ArmFinding.NO_RIGHT if self.tasks.in_hand else ArmFinding.NOTHING
        if self.active is None:
            return ArmFinding.HALF_TAKEN if one.stage is ContractStage.TAKEN else ArmFinding.MAY_TAKE
        if self.phase is ArmPhase.TAKING:
            return self._found_taking(one)
        if self.phase is ArmPhase.PUTTING:
            assert self.grip is not None
            return ArmFinding.GRIPPED if self.grip.grip_mode is GripMode.OPEN else ArmFinding.THERE
        goal = one.contract.goal.start if self.phase is ArmPhase.TO_PART else one.contract.move.via
        return ArmFinding.THERE if self.driver.stands_at(goal) else ArmFinding.ELSEWHERE

    def _found_taking(self, one: Undertaking) -> ArmFinding:
        """Also after a restart in which the part was put down, and that not yet journalled."""
        assert self.grip is not None
        mode = self.grip.grip_mode
        if mode is GripMode.HOLDING and self.grip.part == one.contract.goal.part:
            return ArmFinding.GRIPPED
        if mode is GripMode.BUSY:
            return ArmFinding.GRIPPING
        if mode is GripMode.OPEN and self.gripper.wanted is None and self.driver.stands_at(one.contract.move.via):
            return ArmFinding.LIES
        return ArmFinding.THERE if self.driver.stands_at(one.contract.goal.start) else ArmFinding.ELSEWHERE

    def _do(self, deed: ArmDeed, one: Undertaking | None, now_us: int) -> list[Effect]:
        if one is None or deed is ArmDeed.WAIT:
            self.gripper.pause()
            return []
        goal, via = one.contract.goal, one.contract.move.via
        match deed:
            case ArmDeed.CHOOSE:
                self.active = one.task
            case ArmDeed.TO_START | ArmDeed.TO_END:
                return self.driver.go(goal.start if deed is ArmDeed.TO_START else via, part_token(goal.part), now_us)
            case ArmDeed.BEGIN:
                one.stage = ContractStage.TAKEN
                self._engage()
                return [*self.driver.rest(), stage_record(one)]
            case ArmDeed.TAKE | ArmDeed.PUT:
                return self._order(GripAction.TAKE if deed is ArmDeed.TAKE else GripAction.PUT, goal.part, now_us)
            case ArmDeed.LIFTED:
                self.gripper.rest()
                return [self._part_at(one)]
            case ArmDeed.REST:
                return self.driver.rest()
            case ArmDeed.PUT_DOWN:
                return self._put(one, now_us)
        return []

    def _put(self, one: Undertaking, now_us: int) -> list[Effect]:
        one.stage = ContractStage.PUT
        self.active = None
        if one.sub_goal is not None and one.successor and one.was_heard:
            self.fleet.winners.takes(one.sub_goal.task, one.successor, now_us)
        self._engage()
        self.gripper.rest()
        effects: list[Effect] = [stage_record(one), self._part_at(one)]
        if one.sub_goal is None:
            effects += self._achieve(one)
        return effects

    def _order(self, action: GripAction, part: Reference, now_us: int) -> list[Effect]:
        """Said again while it is not obeyed; a grip at nothing is tried anew."""
        assert self.grip is not None
        failed = self.grip.grip_mode is GripMode.NOTHING_THERE and self.gripper.is_obeyed(self.grip.sequence)
        permit = authorised(self.fleet.motion, [part_token(part)])
        return self.gripper.order((action, part), permit, now_us, anew=failed)

    # --- words -------------------------------------------------------------------------------------------------

    def _to(self, phase: ArmPhase, now_us: int) -> list[Effect]:
        if phase is self.phase:
            return []
        self.phase = phase
        return self._progress(now_us)

    def _progress(self, now_us: int) -> list[Effect]:
        state = self.driver.state
        if state is None:
            return []
        here = Point(state.x_mm, state.y_mm)
        told = (self.phase, state.arm_mode)
        moving = state.arm_mode is ArmMode.GOING
        due = self._told != told
        if due:
            self._told = told
            self._progress_at_us = now_us + PROGRESS_US if moving else None
        goal = self.active.number if self.active is not None else 0
        return [Send(ArmProgress(self.fleet.node_id, *here, self.phase, goal))] if due else []


def _part_token(one: Undertaking) -> TokenKey:
    return part_token(one.contract.goal.part)
