"""Rules of the factory graph, from the frames alone: one robot an edge, no turning back, agents of their nodes."""

from collections.abc import Callable

from onboard.contract.graph import EdgeNotice, EdgeState, NodeAnswer, NodeVerdict, RobotAt, TurnSignal
from onboard.contract.messages import TokenGrant
from onboard.systems.graph.fields import NO_NODE
from onboard.systems.graph.rights import edge_token
from onboard.systems.graph.site import FactoryGraph
from onboard.trace.check.calls import BidsGoDown, BidsInTime, CallsClosed
from onboard.trace.check.event import Finding, LogEvent
from onboard.trace.check.holds import HoldAnswered, LetGoAgain
from onboard.trace.check.picture import BusPicture
from onboard.trace.check.rights import OneHolder
from onboard.trace.check.rule import Handlers, Rule
from onboard.trace.check.tokens_seen import token_named


class OneAnEdge(Rule):
    """Robots that tell that they are on an edge are alone there, and the edge is one of the graph (rows G03, G08).

    Who gives the right to an edge away has left it: it may crash before it says where it has come to.
    """

    name = "one-an-edge"
    title = "no two robots are on one edge, and none beside the graph"
    source = "rows G03, G08"
    needs_site = True

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._on: dict[int, frozenset[int]] = {}

    def handlers(self) -> Handlers:
        """Robots' words on where they are, and rights that they give away."""
        return {RobotAt: self._on_robot, TokenGrant: self._on_grant}

    def _on_grant(self, event: LogEvent[TokenGrant]) -> None:
        ends = self._on.get(event.message.sender)
        if ends is None:
            return
        left = edge_token(*ends)
        if token_named(event.message) == (left.kind, left.number):
            del self._on[event.message.sender]

    def _on_robot(self, event: LogEvent[RobotAt]) -> None:
        at, site = event.message, self.picture.site
        if not isinstance(site, FactoryGraph):
            return
        self._on.pop(at.sender, None)
        if not at.on_edge:
            return
        ends = frozenset((at.behind, at.node))
        if not any(ends == {one, other} for one, other, _ in site.edges):
            self.find(event, (at.sender,), f"is between nodes {at.behind} and {at.node}, which no edge joins")
        others = tuple(robot for robot, edge in self._on.items() if edge == ends)
        if others:
            self.find(event, (at.sender, *others), f"two robots between nodes {at.behind} and {at.node}")
        self._on[at.sender] = ends


class NoTurningBack(Rule):
    """A robot on an edge comes to its end; it is never seen on the same edge the other way round (row G09)."""

    name = "no-turning-back"
    title = "no robot reverses on an edge"
    source = "row G09"

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._way: dict[int, tuple[int, int]] = {}

    def handlers(self) -> Handlers:
        """Robots' words on where they are."""
        return {RobotAt: self._on_robot}

    def _on_robot(self, event: LogEvent[RobotAt]) -> None:
        at = event.message
        before = self._way.pop(at.sender, None)
        if not at.on_edge:
            return
        if before == (at.node, at.behind):
            self.find(event, (at.sender,), f"turned back between nodes {at.behind} and {at.node}")
        self._way[at.sender] = (at.behind, at.node)


class AgentsOfNodes(Rule):
    """Who answers for a node or tells what becomes of its edges hosts its agent (rows G04 to G06)."""

    name = "agents-of-nodes"
    title = "only a node's own agent speaks for it"
    source = "rows G04, G05, G06"
    needs_site = True

    def handlers(self) -> Handlers:
        """Reads answers and notices of node agents."""
        return {NodeAnswer: self._on_word, EdgeNotice: self._on_word}

    def _on_word(self, event: LogEvent[NodeAnswer | EdgeNotice]) -> None:
        word, site = event.message, self.picture.site
        if not isinstance(site, FactoryGraph):
            return
        if site.hosts.get(word.node) != word.sender:
            self.find(event, (word.sender,), f"speaks for node {word.node}, whose agent is elsewhere")
        if isinstance(word, EdgeNotice) and word.other not in site.graph.neighbours.get(word.node, ()):
            self.find(event, (word.sender,), f"tells node {word.other} of an edge that joins it to no node {word.node}")


class GrantsAreTold(Rule):
    """A grant is told to the node at the other end (row G20), and it answers a signal (row G14)."""

    name = "grants-are-told"
    title = "every grant answers a signal, and its neighbour is told"
    source = "rows G14, G20"
    undisturbed = True

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._signals: dict[int, TurnSignal] = {}
        self._untold: dict[tuple[int, int, int], int] = {}

    def handlers(self) -> Handlers:
        """Reads robots' signals, and agents' answers and notices."""
        return {TurnSignal: self._on_signal, NodeAnswer: self._on_answer, EdgeNotice: self._on_notice}

    def tick(self, now_us: int) -> None:
        """A grant of which nobody was told within a second is reported."""
        for (node, after, robot), time_us in list(self._untold.items()):
            if now_us > time_us + 1_000_000:
                del self._untold[node, after, robot]
                self.miss(time_us, (robot,), f"node {after} was not told of a grant by node {node}")

    def _on_signal(self, event: LogEvent[TurnSignal]) -> None:
        self._signals[event.message.sender] = event.message

    def _on_answer(self, event: LogEvent[NodeAnswer]) -> None:
        word = event.message
        signal = self._signals.get(word.robot)
        if signal is None or signal.node != word.node:
            self.find(event, (word.sender, word.robot), f"node {word.node} answers a robot that did not ask it")
        if word.node_verdict is not NodeVerdict.STOP:
            self._untold[word.node, word.after, word.robot] = event.time_us
        elif word.after == NO_NODE:
            self.find(event, (word.sender,), "a stop for no edge")

    def _on_notice(self, event: LogEvent[EdgeNotice]) -> None:
        word = event.message
        if word.edge_state is EdgeState.RESERVED:
            self._untold.pop((word.node, word.other, word.robot), None)


#: What a graph's log is judged by: the rules of every system that apply, and its own.
RULES: tuple[type[Rule], ...] = (
    OneHolder,
    CallsClosed,
    BidsInTime,
    BidsGoDown,
    OneAnEdge,
    NoTurningBack,
    AgentsOfNodes,
    GrantsAreTold,
    LetGoAgain,
    HoldAnswered,
)
