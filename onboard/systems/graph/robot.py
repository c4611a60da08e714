"""A robot on the graph: drives along its way, asks every node agent, loads at its stops (rows G05, G07 to G16).

What it may drive on is a matter of tokens: a GO only names those that it may ask for. The slot of the next node is
asked for before the edge, so that nobody who holds an edge waits for anything but its own wheels.
"""

from dataclasses import dataclass, field

from onboard.contract.codes import KindCode, MachineState, Reason, TaskPhase, TokenKind
from onboard.contract.graph import (
    BodyPlace,
    NodeAnswer,
    NodeVerdict,
    RobotAt,
    RobotMode,
    RouteAction,
    TurnSignal,
    VisitList,
)
from onboard.contract.graph_device import ApproachSensor, BodyState, RouteOrder
from onboard.contract.messages import Heartbeat, ManualOrder, Message, Reference, TaskReport
from onboard.core.authority import TokenKey
from onboard.core.behaviour import BehaviourFactory, Fleet
from onboard.core.effects import Effect, Send
from onboard.core.mirror import Mirror
from onboard.core.motion_authority import Permit, authorised
from onboard.core.negotiation import Awarded, Estimator, NegotiationEvent, PreAssigned, Released
from onboard.core.site import Machine, Site
from onboard.systems.graph.clocked import ClockedFleet
from onboard.systems.graph.errands import TRANSPORT_STOPS, Errand, errand_record, errands, lost_record
from onboard.systems.graph.fields import NO_NODE, stops_of
from onboard.systems.graph.network import NOWHERE
from onboard.systems.graph.planning import Position, RobotPlanning, told_way
from onboard.systems.graph.rights import edge_token, keeper, slot_token
from onboard.systems.graph.rules import Rules, is_of_another_site
from onboard.systems.graph.site import FactoryGraph
from onboard.systems.graph.steps import LOAD_TABLE, NODE_TABLE, Approach, NodeDeed, NodeEvent, Stay, StayDeed
from onboard.work.device_link import DeviceLink
from onboard.work.manual import Manual
from onboard.work.undertaking import TaskEvent, TaskStanding, Undertakings

#: A signal is said again after this while no answer is heard, and after that while the answer is STOP, us: who has just
#: moved past is heard in between.
SIGNAL_US, SIGNAL_AGAIN_US = 500_000, 2_000_000
#: A grant whose tokens do not come in this time is given up, and the node is asked anew, us: tokens come within one
#: round of frames.
REDEEM_US = 3_000_000
#: Where a driving robot is, is told this often, us (dbc/graph.dbc).
TOLD_US = 2_000_000


@dataclass(frozen=True)
class GraphRobotFactory(BehaviourFactory):
    """Makes robots of a factory graph."""

    fleet_type = ClockedFleet

    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> RobotPlanning:
        """What its bids come from. Raises ``TypeError`` for a site that is no graph."""
        if not isinstance(site, FactoryGraph):
            raise TypeError("a robot of a graph needs a graph")
        return RobotPlanning(site, machine, Position(machine.home.track))

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> "GraphRobot":
        """The robot's steps; ``estimator`` is the one made above."""
        if not isinstance(estimator, RobotPlanning) or not isinstance(fleet, ClockedFleet):
            raise TypeError("a robot needs its own task-generation function, and the fleet that this factory names")
        return GraphRobot(fleet, estimator)


@dataclass
class _Grant:
    """The edge to ``after`` that an agent granted, with a slot there or 0."""

    node: int
    after: int
    slot: int
    until_us: int


@dataclass
class GraphRobot:
    """One robot; of ``tasks`` in hand, which are ``planning.errands``, the first is worked on."""

    fleet: ClockedFleet
    planning: RobotPlanning
    kind: KindCode = KindCode.VEHICLE
    body: BodyState | None = None
    mode: RobotMode = RobotMode.FREE
    tasks: Undertakings[Errand] = field(init=False)
    #: Whether a host of node agents tells another site: then my map is wrong or old, and I stay where I am (row G27).
    has_other_map: bool = False
    manual: Manual = field(init=False)
    approach: Approach = Approach.AWAY
    #: What was granted, in GRANTED only.
    _grant: _Grant | None = None
    #: Node and edge that were told last, and when they are told again at the earliest.
    _signal: tuple[int, int] | None = None
    _signal_at_us: int | None = None
    _loaded_at_us: int | None = None
    _clocks: tuple[int, int] = (0, 0)
    _told_at_us: int | None = None
    _told: RobotAt | None = None
    drive: DeviceLink[tuple[RouteAction, int, int]] = field(init=False)

    def __post_init__(self) -> None:
        self.manual = Manual(self.fleet.node_id)
        self.manual.replay(self.fleet.entries)
        self.planning.is_held = not self.manual.is_automatic
        me = self.fleet.node_id
        refresh_us = self.site.timing.drive_refresh_us
        self.drive = DeviceLink(lambda sequence, order: RouteOrder(me, sequence, *order), refresh_us)
        self.tasks = Undertakings(
            self.fleet,
            is_begun=lambda errand: len(errand.stops) != TRANSPORT_STOPS or self._loaded_at_us is not None,
            may_give=lambda _, node: self._is_desk(node),
            lose=lambda errand: [lost_record(errand.task)],
            in_hand=self.planning.errands,
        )
        for task, errand in errands(self.fleet.entries).items():
            if errand.stops:
                self.planning.errands[task] = errand
            else:
                self.tasks.remember(task)
            if errand.is_cancelled:
                self.tasks.cancelled.add(task)

    @property
    def site(self) -> FactoryGraph:
        """The graph on which it drives."""
        return self.planning.site

    # --- the Behaviour -----------------------------------------------------------------------------------------

    @property
    def state(self) -> MachineState:
        """For heartbeats: OBSTACLE with another map or in a person's hand, WAITING before a node."""
        if self.body is None:
            return MachineState.STARTING
        if self.has_other_map or self.manual.at_rest:
            return MachineState.OBSTACLE
        if self.approach is Approach.STOPPED:
            return MachineState.WAITING
        return MachineState.WORKING if self.planning.errands else MachineState.IDLE

    @property
    def itinerary_version(self) -> int:
        """A robot of a graph tells its way by RobotAt."""
        return 0

    def start(self, now_us: int) -> list[Effect]:
        """Nothing moves before the position is sensed."""
        return []

    def sense(self, message: Message, now_us: int) -> list[Effect]:
        """Body and approach sensor (row G10)."""
        match message:
            case BodyState() if not self._is_somewhere(message):
                self.fleet.drops[Reason.VALUE_OUT_OF_RANGE] += 1
            case BodyState():
                if self.body is None:
                    self.drive.go_on_from(message.sequence)
                if self.body is not None and self.body.node != message.node:
                    self._meet(NodeEvent.PASSED)
                if message.body_place is not BodyPlace.ON_EDGE:
                    self._meet(NodeEvent.MET)
                self.body = message
                self._locate()
            case ApproachSensor() if self.body is not None and message.node == self.body.node:
                self._meet(NodeEvent.MET)
        return []

    def _is_somewhere(self, body: BodyState) -> bool:
        """Whether a position is one of this graph: a node, come to by one of its edges, or by none yet."""
        neighbours = self.site.graph.neighbours
        if body.node not in neighbours:
            return False
        return body.behind in neighbours[body.node] or (body.behind == NO_NODE and body.body_place is BodyPlace.IN_NODE)

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        """Answers of the node agent ahead and of no other (row G05); other robots; orders by name; awards."""
        match message:
            case NodeAnswer() if message.robot == self.fleet.node_id:
                self._on_answer(message, now_us)
            case Heartbeat() if message.sender in self.site.hosts.values():
                self.has_other_map = is_of_another_site(self.fleet.mirror, message.sender)
            case RobotAt():
                self.planning.others[message.sender] = message
            case VisitList() if message.robot == self.fleet.node_id:
                task, stops = Reference(message.sender, message.order), stops_of(message)
                return self._take_on(task, stops) if stops else self._take_back(task)
            case ManualOrder() if message.machine == self.fleet.node_id:
                effects = self.manual.ordered(message)
                self.planning.is_held = not self.manual.is_automatic
                return effects
        return self.tasks.hear(message)

    def negotiated(self, event: NegotiationEvent, now_us: int) -> list[Effect]:
        """Bids of my own are kept in mind; a task that is won is journalled before it is told."""
        promised = self.planning.promised
        match event:
            case PreAssigned(call_key=key, proposal=proposal):
                promised[key] = proposal.program[0]
            case Released(call_key=key):
                promised.pop(key, None)
            case Awarded(call_key=key, proposal=proposal):
                promised.pop(key, None)
                errand: Errand = proposal.program[0]
                return self._take_on(errand.task, errand.stops)
        return []

    def may_grant(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        """What a robot holds goes back to its keeper, to nobody else."""
        return Reason.NOT_AUTHORISED

    def advance(self, now_us: int) -> list[Effect]:
        """Load, ask, take what was granted, drive, and give back what lies behind."""
        if self.body is None:
            return []
        effects = self._load(now_us)
        effects += self._redeem(now_us) + self._ask(now_us)
        effects += self._drive(now_us) + self._give_back(now_us)
        at_rest = self.body.body_place is BodyPlace.IN_NODE and self._grant is None and self._loaded_at_us is None
        return effects + self.manual.rests(at_rest) + self._tell(now_us)

    def next_wake(self) -> int | None:
        """When a signal, an order or a word is due, or loading over."""
        times = [self._signal_at_us, self.drive.due_us, self._told_at_us, self._loaded_at_us]
        times.append(self._grant.until_us if self._grant is not None else None)
        return min((time for time in times if time is not None), default=None) if self.body is not None else None

    def statements(self, now_us: int) -> list[Effect]:
        """Tasks in hand and done, where it is, and rights."""
        self._told = None
        reports = self.tasks.reports()
        where = self._tell(now_us) if self.body is not None else []
        return reports + where + self.manual.statement() + self.fleet.tokens.statements()

    # --- tasks -------------------------------------------------------------------------------------------------

    def _take_on(self, task: Reference, stops: tuple[int, ...]) -> list[Effect]:
        if self.tasks.knows(task):
            return [self.tasks.report(task)]
        if self.has_other_map:
            return [Send(TaskReport(self.fleet.node_id, task, TaskPhase.REFUSED, 0, Reason.OTHER_SITE))]
        if not stops or any(stop not in self.site.graph.neighbours for stop in stops):
            return [Send(TaskReport(self.fleet.node_id, task, TaskPhase.REFUSED, 0, Reason.IMPOSSIBLE))]
        errand = Errand(task, stops)
        self.tasks.meet(task, TaskEvent.WIN, errand)
        return [errand_record(errand), self.tasks.report(task)]

    def _is_desk(self, node: int) -> bool:
        machine = self.site.machines.get(node)
        return machine is not None and machine.kind is KindCode.DESK

    def _take_back(self, task: Reference) -> list[Effect]:
        """Who gave an order by name wants it no more: it ends its edge, and does nothing more for it."""
        if self.tasks.standing(task) is TaskStanding.OVER:
            return [self.tasks.report(task)]
        self.tasks.meet(task, TaskEvent.END)
        self.tasks.cancelled.add(task)
        self._loaded_at_us = None
        return [errand_record(Errand(task, (), is_cancelled=True)), self.tasks.report(task)]

    @property
    def _errand(self) -> Errand | None:
        return next(iter(self.planning.errands.values()), None)

    @property
    def _goal(self) -> int | None:
        """Where it goes; held, only into the node ahead, as if it were free."""
        errand = self._errand if self.manual.is_automatic else None
        return errand.stops[0] if errand is not None else None

    def _load(self, now_us: int) -> list[Effect]:
        """Load where the next stop is, for the site's time; then go on, or be free (row G13)."""
        assert self.body is not None
        clocks = self.fleet.admissions, self.fleet.clock_sets
        if clocks != self._clocks:
            # It slept, or its clock was set: nobody knows how much of the time is over, and all of it begins anew.
            self._clocks = clocks
            self._loaded_at_us = None if self._loaded_at_us is None else now_us + self.site.load_ms * 1000
        self.mode, deed = LOAD_TABLE[self.mode, self._stay(self.body, now_us)]
        match deed:
            case StayDeed.WAIT:
                return []
            case StayDeed.DROP:
                self._loaded_at_us = None
                return []
            case StayDeed.BEGIN:
                self._loaded_at_us = now_us + self.site.load_ms * 1000
                return self._load(now_us)
            case StayDeed.GO_ON:
                return self._behind_me()

    def _stay(self, body: BodyState, now_us: int) -> Stay:
        """What errand, place and clock come to."""
        errand = self._errand
        if errand is None:
            return Stay.NO_ERRAND
        begins = self.manual.is_automatic or self._loaded_at_us is not None
        if body.body_place is not BodyPlace.IN_NODE or body.node != errand.stops[0] or not begins:
            return Stay.UNDER_WAY
        if self._loaded_at_us is None:
            return Stay.AT_STOP
        return Stay.LOADING if now_us < self._loaded_at_us else Stay.LOADED

    def _behind_me(self) -> list[Effect]:
        """The next stop of the errand in hand is done with: it goes on, or is over."""
        errand = self._errand
        assert errand is not None
        self._loaded_at_us = None
        self.planning.position.behind = NOWHERE
        left = Errand(errand.task, errand.stops[1:])
        effects: list[Effect] = [errand_record(left)]
        if left.stops:
            self.planning.errands[left.task] = left
        else:
            self.tasks.meet(left.task, TaskEvent.END)
            effects.append(self.tasks.report(left.task))
        return effects

    # --- asking ------------------------------------------------------------------------------------------------

    def _locate(self) -> None:
        assert self.body is not None
        here, body = self.planning.position, self.body
        on_edge = body.body_place is not BodyPlace.IN_NODE
        if here.node != body.node or on_edge != here.is_on_edge:
            behind = NOWHERE if body.behind == NO_NODE else body.behind
            self.planning.position = Position(body.node, behind, on_edge)
        if not on_edge and not self.planning.errands:
            self.planning.position.behind = NOWHERE

    def _wants(self) -> int | None:
        """The node after the one ahead, on the way to the next stop; None where it stays or loads."""
        goal, here = self._goal, self.planning.position
        if goal is None or goal == here.node:
            return None
        way = self.planning.way(goal)
        return way[1] if way is not None and len(way) > 1 else None

    def _ask(self, now_us: int) -> list[Effect]:
        """Near a node, tell by which edge it will be left (row G14); again while nobody answers."""
        if self.approach in (Approach.AWAY, Approach.GRANTED) or self.has_other_map:
            self._signal_at_us = None
            return []
        wants = self._wants()
        deed = self._meet(NodeEvent.STAYS if wants is None else NodeEvent.ONWARD)
        return self._tell_turn(wants, now_us) if wants is not None and deed is NodeDeed.SIGNAL else []

    def _meet(self, event: NodeEvent) -> NodeDeed:
        """One line of ``NODE_TABLE``; what is to be said of it."""
        self.approach, deed = NODE_TABLE.get((self.approach, event), (self.approach, NodeDeed.NOTHING))
        if deed is NodeDeed.FORGET:
            self._signal = self._signal_at_us = self._grant = None
        return deed

    def _tell_turn(self, wants: int, now_us: int) -> list[Effect]:
        """By which edge the node ahead will be left: when that is another, else when it is due."""
        here = self.planning.position
        if self._signal == (here.node, wants) and self._signal_at_us is not None and now_us < self._signal_at_us:
            return []
        pause_us = SIGNAL_US if self.approach is Approach.ASKING else SIGNAL_AGAIN_US
        self._signal, self._signal_at_us = (here.node, wants), now_us + pause_us
        behind = NO_NODE if here.behind == NOWHERE else here.behind
        return [Send(TurnSignal(self.fleet.node_id, here.node, behind, wants))]

    def _on_answer(self, answer: NodeAnswer, now_us: int) -> None:
        here = self.planning.position
        if answer.node != here.node or answer.sender != self.site.hosts[here.node]:
            return
        if answer.node_verdict is NodeVerdict.STOP:
            self._meet(NodeEvent.STOP)
            return
        if answer.after not in self.site.graph.neighbours[here.node] or answer.after == here.behind:
            return
        was = self.approach
        self._meet(NodeEvent.GO)
        if self.approach is not was:
            # Sent elsewhere, the robot plans anew from the node to which the edge leads (row G16).
            self._grant = _Grant(here.node, answer.after, answer.slot, now_us + REDEEM_US)

    # --- rights ------------------------------------------------------------------------------------------------

    def _redeem(self, now_us: int) -> list[Effect]:
        """Ask for the tokens of what was granted: the slot first, then the edge."""
        grant, tokens = self._grant, self.fleet.tokens
        if grant is None:
            return []
        keys = [slot_token(grant.after, grant.slot)] if grant.slot else []
        keys.append(edge_token(grant.node, grant.after))
        missing = [key for key in keys if not tokens.holds(key)]
        if missing and now_us >= grant.until_us:
            for key in keys:
                tokens.forget(key)
            self._meet(NodeEvent.LAPSED)
            return []
        if not missing:
            grant.until_us = now_us + REDEEM_US
            return []
        return tokens.want(missing[0], now_us)

    def _held(self) -> list[TokenKey]:
        home = self.fleet.machine.station
        own = [slot_token(home.track, home.index)] if home is not None else []
        return [key for key in dict.fromkeys([*self.fleet.tokens.held, *own]) if self.fleet.tokens.holds(key)]

    def _give_back(self, now_us: int) -> list[Effect]:
        """All that lies behind goes back to its keeper (rows G17, G22)."""
        assert self.body is not None
        body, grant = self.body, self._grant
        needed: set[TokenKey] = set()
        if body.body_place is not BodyPlace.IN_NODE:
            needed.add(edge_token(body.behind, body.node))
        if grant is not None:
            needed.add(edge_token(grant.node, grant.after))
        nodes = {body.node: 0} | ({grant.after: grant.slot} if grant is not None else {})
        effects: list[Effect] = []
        kept: set[int] = set()
        for key in self._held():
            node = key.number >> 8
            if key.kind is TokenKind.STATION and node in nodes and node not in kept:
                kept.add(node)
            elif key not in needed:
                effects += self.fleet.tokens.give(key, keeper(self.site, key), now_us)
        return effects

    def _permit(self, start: int, end: int) -> Permit:
        """For an edge; by some rules only with a slot at its end."""
        needs_slot = self.site.rules is Rules.EDGE_AND_NODE and not self._has_slot(end)
        return authorised(self.fleet.motion, [edge_token(start, end)]).unless(
            Reason.NOT_AUTHORISED if needs_slot else Reason.NONE
        )

    def _has_slot(self, node: int) -> bool:
        return any(key.kind is TokenKind.STATION and key.number >> 8 == node for key in self._held())

    # --- driving -----------------------------------------------------------------------------------------------

    def _drive(self, now_us: int) -> list[Effect]:
        assert self.body is not None
        permit, order = self._next_order(self.body)
        if permit is None or order is None:
            self.drive.rest()
            return []
        return self.drive.order(order, permit, now_us)

    def _next_order(self, body: BodyState) -> tuple[Permit | None, tuple[RouteAction, int, int] | None]:
        """What to do next and what permits it."""
        grant = self._grant
        if grant is not None and (onward := self._permit(grant.node, grant.after)):
            return onward, (RouteAction.GO, grant.node, grant.after)
        if body.body_place is BodyPlace.IN_NODE or not (here := self._permit(body.behind, body.node)):
            return None, None
        if self._enters(body):
            return here, (RouteAction.ENTER, body.node, NO_NODE)
        return here, (RouteAction.GO, body.behind, body.node) if body.body_place is BodyPlace.ON_EDGE else None

    def _enters(self, body: BodyState) -> bool:
        """Whether it goes into the node ahead: to load, to be free, or to wait where the rules say so (decision 14)."""
        if self._goal is None or self._goal == body.node:
            return self.approach is not Approach.AWAY
        stopped = self.approach is Approach.STOPPED or body.body_place is BodyPlace.AT_LINE
        return stopped and self.site.rules is Rules.EDGE_AND_NODE

    # --- words -------------------------------------------------------------------------------------------------

    def _tell(self, now_us: int) -> list[Effect]:
        assert self.body is not None
        goal, here = self._goal, self.planning.position
        way = (self.planning.way(goal) if goal is not None else None) or (here.node,)
        body = self.body
        at = RobotAt(
            self.fleet.node_id,
            body.behind,
            body.node,
            here.is_on_edge,
            self.mode,
            *told_way(way),
            NO_NODE if goal is None else goal,
        )
        due = self._told_at_us is not None and now_us >= self._told_at_us
        if at == self._told and not due:
            return []
        self._told = at
        self._told_at_us = now_us + TOLD_US if self.planning.errands else None
        return [Send(at)]
