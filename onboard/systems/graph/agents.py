"""A host of node agents: answers go, stop or take another edge, and keeps the rights of edges and slots.

Rows G04 to G06, G15 to G22. An agent acts on signals for its own node and on what neighbours tell of common edges.
"""

from dataclasses import dataclass, field
from zlib import crc32

from onboard.contract.codes import KindCode, MachineState, Reason
from onboard.contract.constants import NOBODY
from onboard.contract.graph import EdgeNotice, EdgeState, NodeAnswer, NodeVerdict, RobotAt, TurnSignal
from onboard.contract.messages import Heartbeat, Message, TokenDispute, TokenGrant, TokenRefusal
from onboard.core.authority import TokenKey
from onboard.core.behaviour import BehaviourFactory, Fleet
from onboard.core.effects import Effect, Send
from onboard.core.mirror import Mirror
from onboard.core.negotiation import Estimator, NegotiationEvent
from onboard.core.site import Machine, Site
from onboard.systems.graph.fields import NO_NODE
from onboard.systems.graph.network import NOWHERE, Edge, edge
from onboard.systems.graph.rights import edge_token, keeper, slot_token
from onboard.systems.graph.rules import (
    Heading,
    Rules,
    are_head_on,
    is_of_another_site,
    kept_edge,
    may_enter,
    other_edges,
)
from onboard.systems.graph.site import FactoryGraph
from onboard.work.plain import NoEstimator

#: A promise that its robot has not redeemed so long after it was made is void, us: the signal comes again.
PROMISE_US = 3_000_000
#: A robot that waits and has not been heard so long has another way, us: several of its signals are missing then.
WAITING_US = 6_000_000
#: A robot that is told to stop for so long may wait for a right that its holder gave back unheard, us: twice what
#: loading takes, so that hardly anybody is asked who stands there (site file, ``load_ms``).
DOUBT_US = 10_000_000


@dataclass(frozen=True)
class HostFactory(BehaviourFactory):
    """Makes hosts of node agents."""

    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> NoEstimator:
        """Agents of nodes bid for nothing."""
        return NoEstimator()

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> "NodeAgents":
        """The agents of this host's nodes. Raises ``TypeError`` for a site that is no graph."""
        if not isinstance(fleet.site, FactoryGraph):
            raise TypeError("a host of node agents needs a graph")
        return NodeAgents(fleet, fleet.site)


@dataclass
class _Waiting:
    """A robot before a node: its heading, when it was heard last, what it was told, and when its rivals are asked."""

    heading: Heading
    heard_us: int
    doubt_us: int
    answered: NodeVerdict | None = None


@dataclass
class NodeAgents:
    """All agents of one host. ``waiting`` are robots before any node; ``promised`` says what to whom until when."""

    fleet: Fleet
    site: FactoryGraph
    kind: KindCode = KindCode.NODE
    waiting: dict[int, _Waiting] = field(default_factory=dict)
    promised: dict[TokenKey, tuple[int, int]] = field(default_factory=dict)
    #: By a node of mine and its neighbour: the neighbour keeps their edge.
    kept_by_other: set[tuple[int, int]] = field(default_factory=set)
    #: Robots whose heartbeat tells another site: their map is wrong or old (row G27).
    strangers: set[int] = field(default_factory=set)
    _kept: dict[int, int | None] = field(default_factory=dict)
    #: By an edge at a node of mine: the node from which a robot went onto it.
    _behind: dict[Edge, int] = field(default_factory=dict)
    _events: int = 0
    _seen_taken: set[Edge] = field(default_factory=set)

    # --- the Behaviour -----------------------------------------------------------------------------------------

    @property
    def state(self) -> MachineState:
        """WORKING while any robot waits for one of its nodes, for heartbeats."""
        return MachineState.WORKING if self.waiting else MachineState.IDLE

    @property
    def itinerary_version(self) -> int:
        """Always 0, for nodes go nowhere."""
        return 0

    def start(self, now_us: int) -> list[Effect]:
        """What my nodes kept by notices in an earlier life is forgotten, and so it is free."""
        if self.site.rules is not Rules.KEEP_ON_NOTICE:
            return []
        mine = (node for node in self.site.graph.nodes if self._is_mine(node))
        me, neighbours = self.fleet.node_id, self.site.graph.neighbours
        return [Send(EdgeNotice(me, node, other, EdgeState.FREE, 0)) for node in mine for other in neighbours[node]]

    def sense(self, message: Message, now_us: int) -> list[Effect]:
        """Nothing: a host of agents has no devices."""
        return []

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        """Robots that come near, where they are, and neighbours' notices."""
        match message:
            case TurnSignal() if message.sender not in self.site.robots:
                self.fleet.drops[Reason.NOT_AUTHORISED] += 1
            case EdgeNotice() if message.other not in self.site.graph.neighbours.get(message.node, ()):
                self.fleet.drops[Reason.VALUE_OUT_OF_RANGE] += 1
            case EdgeNotice() if self.site.hosts.get(message.node) != message.sender:
                # Only an agent itself tells what becomes of an edge of its node.
                self.fleet.drops[Reason.NOT_AUTHORISED] += 1
            case TurnSignal():
                return self._on_signal(message, now_us)
            case RobotAt():
                self._on_robot(message)
            case EdgeNotice() if self._is_mine(message.other):
                return self._on_notice(message, now_us)
            case TokenGrant():
                self._on_grant(message)
            case TokenRefusal() if message.requester in self.waiting:
                return self._on_refusal(message, now_us)
            case Heartbeat():
                is_strange = is_of_another_site(self.fleet.mirror, message.sender)
                (self.strangers.discard, self.strangers.add)[is_strange](message.sender)
        return []

    def negotiated(self, event: NegotiationEvent, now_us: int) -> list[Effect]:
        """Nothing: agents neither call nor bid."""
        return []

    def may_grant(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        """A right goes to whom it was promised, or to anybody where it was promised to nobody else."""
        promise = self.promised.get(key)
        if promise is not None and promise[0] != requester and promise[1] > now_us:
            return Reason.TOKEN_NOT_GRANTABLE_YET
        return Reason.NONE

    def advance(self, now_us: int) -> list[Effect]:
        """Keep last edges or let them go, and look again at robots that were told to stop (row G22)."""
        effects = self._keep()
        for robot, one in list(self.waiting.items()):
            if now_us > one.heard_us + WAITING_US:
                del self.waiting[robot]
            elif one.answered is NodeVerdict.STOP and self._is_mine(one.heading.end):
                effects += self._decide(robot, now_us, again=False)
        return effects

    def next_wake(self) -> int | None:
        """Nothing falls due by time alone: signals come again."""
        return None

    def statements(self, now_us: int) -> list[Effect]:
        """The rights that it holds; edges that are kept are said again when asked for."""
        if self.site.rules is Rules.KEEP_ON_NOTICE:
            me, kept = self.fleet.node_id, sorted(self._kept.items())
            said = [Send(EdgeNotice(me, node, other, EdgeState.KEPT, 0)) for node, other in kept if other is not None]
            return [*said, *self.fleet.tokens.statements()]
        self._kept.clear()
        return self.fleet.tokens.statements()

    # --- what is heard -----------------------------------------------------------------------------------------

    def _is_mine(self, node: int) -> bool:
        return self.site.hosts.get(node) == self.fleet.node_id

    def _on_signal(self, signal: TurnSignal, now_us: int) -> list[Effect]:
        graph = self.site.graph
        if signal.sender in self.strangers or signal.after not in graph.neighbours.get(signal.node, ()):
            return []
        behind = NOWHERE if signal.behind == NO_NODE else signal.behind
        heading, was = Heading(behind, signal.node, signal.after), self.waiting.get(signal.sender)
        doubt_us = was.doubt_us if was is not None and was.heading == heading else now_us + DOUBT_US
        self.waiting[signal.sender] = _Waiting(heading, now_us, doubt_us)
        decides = self._is_mine(signal.node) and not self.fleet.has_no_rights
        return self._decide(signal.sender, now_us, again=True) if decides else []

    def _on_robot(self, at: RobotAt) -> None:
        one = self.waiting.get(at.sender)
        if one is not None and at.node != one.heading.end:
            del self.waiting[at.sender]

    def _on_notice(self, notice: EdgeNotice, now_us: int) -> list[Effect]:
        key, pair = edge_token(notice.node, notice.other), (notice.other, notice.node)
        if notice.edge_state is EdgeState.KEPT:
            self.kept_by_other.add(pair)
            return []
        self.kept_by_other.discard(pair)
        if notice.edge_state is EdgeState.RESERVED:
            self.promised[key] = (notice.robot, now_us + PROMISE_US)
            return self._on_reserved(notice.node, notice.other, now_us)
        self.promised.pop(key, None)
        return []

    def _on_grant(self, grant: TokenGrant) -> None:
        """A promise that is redeemed."""
        key = TokenKey(grant.token_kind, grant.token)
        if key in self.promised and self.promised[key][0] == grant.holder:
            del self.promised[key]

    def _on_refusal(self, refusal: TokenRefusal, now_us: int) -> list[Effect]:
        """Who refuses what I take for another's has it, and I missed that: whoever gave it away says so once more.

        Else I let robots have it for ever, and they ask in vain.
        """
        key, one = TokenKey(refusal.token_kind, refusal.token), self.waiting[refusal.requester]
        latest = self.fleet.tokens.beliefs.latest(key)
        is_news = refusal.version > latest.version and refusal.sender != latest.holder
        if not is_news or now_us < one.doubt_us or latest.holder in (self.fleet.node_id, NOBODY):
            return []
        one.doubt_us = now_us + DOUBT_US
        return [Send(TokenDispute(self.fleet.node_id, *key, latest.version, latest.holder))]

    # --- what is answered --------------------------------------------------------------------------------------

    def _decide(self, robot: int, now_us: int, *, again: bool) -> list[Effect]:
        """The answer for a robot before a node of mine; a STOP is not said twice but where it was asked ``again``."""
        one = self.waiting[robot]
        node, wants = one.heading.end, one.heading.wants
        assert wants is not None
        taken = self._taken(robot, now_us)
        slot = self._slot(wants, robot, now_us)
        if slot is not None and self._grants(taken, node, wants):
            return self._promise(robot, node, wants, slot, NodeVerdict.GO, now_us)
        if self._is_stuck(robot, taken, slot):
            chosen = self._sent_elsewhere(robot, node, taken, now_us)
            if chosen is not None:
                return self._promise(robot, node, *chosen, NodeVerdict.ANOTHER, now_us)
        if one.answered is NodeVerdict.STOP and not again:
            return []
        one.answered = NodeVerdict.STOP
        answer = Send(NodeAnswer(self.fleet.node_id, robot, node, NodeVerdict.STOP, wants, 0))
        return [answer, *self._ask_rivals(one, robot, now_us)]

    def _ask_rivals(self, one: _Waiting, robot: int, now_us: int) -> list[Effect]:
        """Whoever is believed to have what a robot has waited for says whether it has it, or to whom it gave it.

        While its words did not come through nobody learnt that, and who is only told to stop asks no holder.
        """
        node, wants = one.heading.end, one.heading.wants
        if wants is None or now_us < one.doubt_us:
            return []
        one.doubt_us = now_us + DOUBT_US
        slots = range(1, self.site.capacity + 1) if self.site.rules is Rules.EDGE_AND_NODE else ()
        effects: list[Effect] = []
        for key in (edge_token(node, wants), *(slot_token(wants, slot) for slot in slots)):
            latest = self.fleet.tokens.beliefs.latest(key)
            if latest.holder not in (keeper(self.site, key), robot, self.fleet.node_id, NOBODY):
                effects.append(Send(TokenDispute(self.fleet.node_id, *key, latest.version, latest.holder)))
        return effects

    def _grants(self, taken: set[Edge], node: int, after: int) -> bool:
        """Free, and not kept by the agent at its other end (rows G17, G18, G21)."""
        return may_enter(self.site.graph, taken, node, after, Rules.PAPER) and (node, after) not in self.kept_by_other

    def _promise(self, robot: int, node: int, after: int, slot: int, verdict: NodeVerdict, now_us: int) -> list[Effect]:
        """Reserve, tell the robot, and tell the agent at the other end (row G20)."""
        self.waiting[robot].answered = verdict
        until_us = now_us + PROMISE_US
        self.promised[edge_token(node, after)] = (robot, until_us)
        if slot:
            self.promised[slot_token(after, slot)] = (robot, until_us)
        me = self.fleet.node_id
        if self.site.rules is Rules.KEEP_ON_NOTICE and self._kept.get(node) == after:
            # For its own needs: the notice of the reservation tells the neighbour.
            self._note_own(node, self._kept.pop(node), None)
        return [
            Send(NodeAnswer(me, robot, node, verdict, after, slot)),
            Send(EdgeNotice(me, node, after, EdgeState.RESERVED, robot)),
            *self._on_reserved(node, after, now_us),
        ]

    def _is_stuck(self, robot: int, taken: set[Edge], slot: int | None) -> bool:
        """Whether another robot wants the same way in the opposite direction (row G19)."""
        mine = self.waiting[robot].heading
        assert mine.wants is not None
        # Who was let go is no rival any more, though it still has to move.
        let_go = (NodeVerdict.GO, NodeVerdict.ANOTHER)
        others = [one.heading for other, one in self.waiting.items() if other != robot and one.answered not in let_go]
        if self.site.rules is Rules.EDGE_AND_NODE:
            return slot is None and any(one.end == mine.wants and one.wants == mine.end for one in others)
        return edge(mine.end, mine.wants) in taken and any(are_head_on(mine, one) for one in others)

    def _sent_elsewhere(self, robot: int, node: int, taken: set[Edge], now_us: int) -> tuple[int, int] | None:
        """A randomly chosen one of the robots is sent to a randomly chosen free edge: the draw is the event's (G19).

        Seeded by node and event counter, so that a run can be repeated (decision 12). None where the draw fell on the
        other robot, or where no edge is free.
        """
        self._events += 1
        draw = crc32(f"{node} {self._events}".encode())
        if draw & 1 and self._events % 4:
            return None
        came_from = self.waiting[robot].heading.start
        free = [
            (after, slot)
            for after in other_edges(self.site.graph, taken, node, came_from, Rules.PAPER)
            if (node, after) not in self.kept_by_other and (slot := self._slot(after, robot, now_us)) is not None
        ]
        return free[(draw >> 1) % len(free)] if free else None

    # --- what is taken -----------------------------------------------------------------------------------------

    def _is_taken(self, key: TokenKey, robot: int, now_us: int) -> bool:
        holder = self.fleet.tokens.holder_of(key)
        if holder not in (keeper(self.site, key), robot, NOBODY):
            return True
        promise = self.promised.get(key)
        return promise is not None and promise[0] != robot and promise[1] > now_us

    def _taken(self, robot: int, now_us: int) -> set[Edge]:
        """Edges that others than ``robot`` have, or that it is on itself."""
        taken = {ends for ends in self.site.graph.lengths_mm if self._is_taken(edge_token(*ends), robot, now_us)}
        heading = self.waiting[robot].heading
        if heading.start >= 0:
            taken.add(edge(heading.start, heading.end))
        return taken

    def _slot(self, node: int, robot: int, now_us: int) -> int | None:
        """A slot of a node that goes with an edge: 0 where the rules grant none, None where all are taken."""
        if self.site.rules is not Rules.EDGE_AND_NODE:
            return 0
        slots = range(1, self.site.capacity + 1)
        return next((slot for slot in slots if not self._is_taken(slot_token(node, slot), robot, now_us)), None)

    # --- edges kept --------------------------------------------------------------------------------------------

    def _keep(self) -> list[Effect]:
        """Keep the last free edge of each node of mine, or let it go; the agent at its other end is told (G21, G22)."""
        tokens, me = self.fleet.tokens, self.fleet.node_id
        taken = {
            ends
            for ends in self.site.graph.lengths_mm
            if tokens.holder_of(edge_token(*ends)) not in (keeper(self.site, edge_token(*ends)), NOBODY)
        }
        effects: list[Effect] = [
            Send(EdgeNotice(me, *ends, EdgeState.FREE, 0))
            for ends in sorted(self._seen_taken - taken)
            if keeper(self.site, edge_token(*ends)) == me
        ]
        released, self._seen_taken = sorted(self._seen_taken - taken), taken
        if self.site.rules is Rules.KEEP_ON_NOTICE:
            # Where a robot came from a neighbour has released an edge now; what is kept there is let go (row G22).
            return [
                *effects,
                *(one for ends in released for one in self._change(self._behind.pop(ends, NOWHERE), None)),
            ]
        if self.site.rules is not Rules.KEEP:
            return effects
        for node in self.site.graph.nodes:
            if not self._is_mine(node):
                continue
            effects += self._change(node, kept_edge(self.site.graph, taken, node))
        return effects

    def _on_reserved(self, node: int, after: int, now_us: int) -> list[Effect]:
        """To the letter (row G21): the far end of a reserved edge counts its free ones, and keeps the last."""
        if self.site.rules is not Rules.KEEP_ON_NOTICE:
            return []
        self._behind[edge(node, after)] = node
        if not self._is_mine(after):
            return []
        graph, kept = self.site.graph, self._kept.get(after)
        gone = {
            ends
            for ends in (edge(after, other) for other in graph.neighbours[after])
            if self._is_taken(edge_token(*ends), NOBODY, now_us)
        }
        gone |= {edge(*pair) for pair in self.kept_by_other if after in pair} | {edge(node, after)}
        last = kept_edge(graph, gone, after) if kept is None else kept
        return self._change(after, last)

    def _change(self, node: int, kept: int | None) -> list[Effect]:
        """A node of mine keeps another edge than before, or none: the agent at its other end is told."""
        before, me = self._kept.get(node), self.fleet.node_id
        if kept == before or not self._is_mine(node):
            return []
        self._kept[node] = kept
        self._note_own(node, before, kept)
        return [
            Send(EdgeNotice(me, node, other, state, 0))
            for other, state in ((before, EdgeState.FREE), (kept, EdgeState.KEPT))
            if other is not None
        ]

    def _note_own(self, node: int, before: int | None, kept: int | None) -> None:
        """Agents of one host tell each other without the bus."""
        if before is not None:
            self.kept_by_other.discard((before, node))
        if kept is not None:
            self.kept_by_other.add((kept, node))
