"""A robot of the cell: carries its part of a goal, and is manager of the rest (rows C15 to C18; ``rests``).

Custody of a part is a token with one holder: who holds it may take the part up, and gives it on when the part lies
where the contract says, to the sub-contractor and nobody else. A contract in hand is an ``Undertaking``; at most one of
them is ``active``, the most urgent whose part this robot may take (row C15).
"""

from dataclasses import dataclass, field

from onboard.contract.cell import ArmMode, ArmPhase, ArmProgress, GoalTooDeep, GripAction, GripMode
from onboard.contract.cell_device import ArmState, GripState
from onboard.contract.codes import KindCode, MachineState, Reason
from onboard.contract.messages import ManualOrder, ManualState, Message, Reference, TaskReport
from onboard.core.authority import TokenKey
from onboard.core.behaviour import BehaviourFactory, Fleet
from onboard.core.effects import Effect, Send
from onboard.core.mirror import Mirror
from onboard.core.negotiation import Awarded, Closed, Estimator, NegotiationEvent, PreAssigned, Released
from onboard.core.records import last_boot
from onboard.core.site import Machine, Site
from onboard.systems.cell.contracts import Contract, part_token
from onboard.systems.cell.custody import PartCustody, token_of
from onboard.systems.cell.generation import ArmGeneration
from onboard.systems.cell.geometry import Point
from onboard.systems.cell.goal_frames import contract_messages
from onboard.systems.cell.gripper import ArmGripper
from onboard.systems.cell.memory import Undertaking, lost_record, stage_record, undertakings, won_record
from onboard.systems.cell.motion import ArmDriver
from onboard.systems.cell.records import ContractStage
from onboard.systems.cell.rests import GoalRests
from onboard.systems.cell.site import Cell
from onboard.systems.cell.steps import TABLE, ArmDeed, ArmFinding
from onboard.work.manual import GIVE_BACK_US, Manual
from onboard.work.undertaking import TaskEvent, Undertakings

#: Where a robot is, is told this often while it moves, us (dbc/cell.dbc).
PROGRESS_US = 2_000_000


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
    driver: ArmDriver = field(init=False)
    gripper: ArmGripper = field(init=False)
    custody: PartCustody = field(init=False)
    rests: GoalRests = field(init=False)
    manual: Manual = field(init=False)
    #: Since when it stands in a person's hand, us; None where none of its parts can be given back.
    _stands_since_us: int | None = None
    _progress_at_us: int | None = None
    _told: tuple[ArmPhase, ArmMode] | None = None

    def __post_init__(self) -> None:
        site = self.generation.site
        self.driver = ArmDriver(self.fleet.motion, self.generation.arm, site.obstacles, site.timing.drive_refresh_us)
        self.fleet.negotiation.is_sound = self.generation.goals_heard.is_sound
        # Names of goals of an earlier life may still be about.
        self.generation.number = last_boot(self.fleet.entries) << 8
        self.gripper = ArmGripper(self.fleet.motion, self.fleet.node_id)
        self.manual = Manual(self.fleet.node_id)
        self.manual.replay(self.fleet.entries)
        self.generation.is_held = not self.manual.is_automatic
        self.tasks = Undertakings(
            self.fleet,
            is_begun=lambda one: one.stage is not ContractStage.WON or self.custody.may_take(one),
            may_give=lambda one, node: node == one.manager,
            lose=self._lose,
            changed=self._engage,
        )
        self.custody = PartCustody(self.fleet.node_id, self.fleet.tokens, self.tasks)
        self.rests = GoalRests(self.fleet, self.tasks)
        for one in undertakings(self.fleet.entries).values():
            if one.stage is ContractStage.OVER:
                self.tasks.remember(one.task)
            else:
                self.tasks.in_hand[one.task] = one
                self.rests.remember(one)
        self._engage()

    # --- the Behaviour -----------------------------------------------------------------------------------------

    @property
    def state(self) -> MachineState:
        """STARTING until drive and gripper are heard, OBSTACLE in a person's hand, else IDLE or WORKING."""
        if self._is_blind:
            return MachineState.STARTING
        if self.manual.at_rest:
            return MachineState.OBSTACLE
        return MachineState.IDLE if self.active is None else MachineState.WORKING

    @property
    def _is_blind(self) -> bool:
        return self.driver.state is None or self.gripper.state is None

    @property
    def itinerary_version(self) -> int:
        """A robot of a cell has no itinerary along tracks."""
        return 0

    def start(self, now_us: int) -> list[Effect]:
        """Nothing moves before the position is sensed."""
        self.rests.start(now_us)
        return []

    def sense(self, message: Message, now_us: int) -> list[Effect]:
        """Drive and gripper; a change of what the robot does is told."""
        match message:
            case ArmState():
                self.driver.sense(message)
                if self.driver.position is not None:
                    self.generation.position = self.driver.position
            case GripState():
                self.gripper.sense(message)
        return self._progress(now_us)

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        """Goals and offers; sub-contractors' reports; a person; calls and awards for what is in hand already."""
        self.generation.goals_heard.hear(message)
        self.generation.depths.hear(message)
        match message:
            case TaskReport():
                return self.rests.on_report(message, now_us)
            case ArmProgress():
                self.fleet.winners.works(message.sender, (message.x_mm, message.y_mm, message.arm_phase), now_us)
            case ManualOrder() if message.machine == self.fleet.node_id:
                return self._on_manual(message)
            case ManualState():
                return self.rests.on_manual(message)
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
                return self.rests.on_closed(event, now_us)
        return []

    def may_grant(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        """A part's custody goes to the sub-contractor, to nobody else."""
        return self.custody.may_grant(key, requester)

    def advance(self, now_us: int) -> list[Effect]:
        """Ask for custody, choose the most urgent part, and take one step for it."""
        if self._is_blind:
            return []
        effects: list[Effect] = [Send(GoalTooDeep(self.fleet.node_id, part)) for part in self.generation.depths.take()]
        effects += self._want_parts(now_us) + self.rests.manage(now_us) + self.custody.give_back(now_us)
        if self.active is None:
            effects += self._step(now_us)
        if self.active is not None:
            effects += self._step(now_us)
        if self._progress_at_us is not None and self._progress_at_us <= now_us:
            self._told = None
            effects += self._progress(now_us)
        return effects + self._stand(now_us)

    def next_wake(self) -> int | None:
        """When an order, a call, a question or a word is due; nothing is before the devices have told how they are."""
        if self._is_blind:
            return None
        if self.generation.depths.due:
            return 0
        times = [self.driver.link.due_us, self.gripper.link.due_us, self._progress_at_us, self._leaves_us]
        times.append(self.rests.next_wake())
        return min((time for time in times if time is not None), default=None)

    def statements(self, now_us: int) -> list[Effect]:
        """What is in hand and what is over, where I am, parts in my custody, and tokens."""
        effects = self.tasks.reports()
        self._told = None
        effects += self._progress(now_us) + self.manual.statement() + self.custody.words()
        return effects + self.fleet.tokens.statements()

    # --- a person's hand ---------------------------------------------------------------------------------------

    def _on_manual(self, order: ManualOrder) -> list[Effect]:
        """Held, it stands where it is on its way; a grip that has begun is ended (row M38)."""
        effects = self.manual.ordered(order)
        if not (self.generation.is_held or self.manual.is_automatic):
            self.custody.want_no_more()
        self.generation.is_held = not self.manual.is_automatic
        if self.manual.is_automatic:
            self.tasks.left.clear()
        return effects

    def _want_parts(self, now_us: int) -> list[Effect]:
        return [] if self.generation.is_held else self.custody.want(now_us)

    def _stand(self, now_us: int) -> list[Effect]:
        """Held, it says when it has come to rest; what it has not begun then is another's after a while."""
        state = self.driver.state
        stands = state is not None and state.arm_mode is ArmMode.RESTING and not self.gripper.is_at_work
        effects = self.manual.rests(stands)
        if not self.manual.at_rest or not self.custody.not_begun:
            self._stands_since_us = None
        elif self._stands_since_us is None:
            self._stands_since_us = now_us
        elif now_us >= self._stands_since_us + GIVE_BACK_US:
            effects += self.custody.leave(now_us)
        return effects

    @property
    def _leaves_us(self) -> int | None:
        return self._stands_since_us + GIVE_BACK_US if self._stands_since_us is not None else None

    # --- contracts ---------------------------------------------------------------------------------------------

    def _take_on(self, contract: Contract, successor_node: int, now_us: int) -> list[Effect]:
        goal, via = contract.goal, contract.move.via
        sub_goal = None if via == goal.end else self.generation.sub_goal(goal, via)
        one = Undertaking(contract, goal.task.origin, sub_goal, successor=successor_node)
        self.tasks.meet(one.task, TaskEvent.WIN, one)
        self.rests.begin(one, now_us)
        said = [Send(message) for message in contract_messages(contract)]
        return [won_record(one), self.tasks.report(one.task), *said]

    def _engage(self) -> None:
        waiting = (one for one in self.tasks.in_hand.values() if one.stage in (ContractStage.WON, ContractStage.TAKEN))
        self.generation.engaged = {one.task: one.contract for one in waiting}
        self.generation.known = {*self.tasks.in_hand, *self.tasks.over}

    def _lose(self, one: Undertaking) -> list[Effect]:
        """Its manager gave to another, or to nobody, what I have not begun: whose part I have not got."""
        self.fleet.tokens.forget(token_of(one))
        return [lost_record(one), *self.rests.lose(one)]

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
            if one.stage in (ContractStage.WON, ContractStage.TAKEN) and self.custody.may_take(one)
        ]
        return min(
            ready, key=lambda one: (one.stage is not ContractStage.TAKEN, one.contract.goal.urgency), default=None
        )

    def _found(self, one: Undertaking | None) -> ArmFinding:
        """What contracts, tokens and the devices' last words come to for ``one``, in hand or to be chosen."""
        if one is None or (self.active is None and self.generation.is_held):
            return ArmFinding.NO_RIGHT if self.tasks.in_hand else ArmFinding.NOTHING
        if self.active is None:
            return ArmFinding.HALF_TAKEN if one.stage is ContractStage.TAKEN else ArmFinding.MAY_TAKE
        found = self._found_in_hand(one)
        begins = found in (ArmFinding.ELSEWHERE, ArmFinding.THERE) and not self.gripper.is_at_work
        return ArmFinding.HELD if begins and self.generation.is_held else found

    def _found_in_hand(self, one: Undertaking) -> ArmFinding:
        match self.phase:
            case ArmPhase.TAKING:
                return self._found_taking(one)
            case ArmPhase.PUTTING:
                return ArmFinding.GRIPPED if self.gripper.mode is GripMode.OPEN else ArmFinding.THERE
        goal = one.contract.goal.start if self.phase is ArmPhase.TO_PART else one.contract.move.via
        return ArmFinding.THERE if self.driver.stands_at(goal) else ArmFinding.ELSEWHERE

    def _found_taking(self, one: Undertaking) -> ArmFinding:
        """Also after a restart in which the part was put down, and that not yet journalled."""
        mode = self.gripper.mode
        if self.gripper.holds(one.contract.goal.part):
            return ArmFinding.GRIPPED
        if mode is GripMode.BUSY:
            return ArmFinding.GRIPPING
        if mode is GripMode.OPEN and self.gripper.link.wanted is None and self.driver.stands_at(one.contract.move.via):
            return ArmFinding.LIES
        return ArmFinding.THERE if self.driver.stands_at(one.contract.goal.start) else ArmFinding.ELSEWHERE

    def _do(self, deed: ArmDeed, one: Undertaking | None, now_us: int) -> list[Effect]:
        if one is None or deed is ArmDeed.WAIT:
            self.gripper.link.pause()
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
                action = GripAction.TAKE if deed is ArmDeed.TAKE else GripAction.PUT
                return self.gripper.order(action, goal.part, now_us)
            case ArmDeed.LIFTED:
                self.gripper.link.rest()
                return [self.custody.part_at(one)]
            case ArmDeed.REST | ArmDeed.LEAVE:
                self.active = self.active if deed is ArmDeed.REST else None
                self.gripper.link.pause()
                return self.driver.rest()
            case ArmDeed.PUT_DOWN:
                return self._put(one, now_us)
        return []

    def _put(self, one: Undertaking, now_us: int) -> list[Effect]:
        one.stage = ContractStage.PUT
        self.active = None
        self.rests.put_down(one, now_us)
        self._engage()
        self.gripper.link.rest()
        effects: list[Effect] = [stage_record(one), self.custody.part_at(one)]
        if one.sub_goal is None:
            effects += self.rests.achieve(one)
        return effects

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
