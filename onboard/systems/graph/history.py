"""What robots and agents of a factory graph say: the part of the history that this system has of its own."""

from dataclasses import dataclass

from onboard.contract.codes import Operation
from onboard.contract.graph import EdgeNotice, RobotAt, VisitList
from onboard.contract.messages import Message, Reference
from onboard.history.history import History
from onboard.history.system import SystemFact, SystemHistory
from onboard.history.tasks import TaskFold
from onboard.systems.graph.site import FactoryGraph


@dataclass(frozen=True, slots=True)
class RobotTold(SystemFact):
    """A robot says where it is and where it goes."""

    word: RobotAt


@dataclass(frozen=True, slots=True)
class VisitsTold(SystemFact):
    """Somebody asks for a list of nodes to be visited: a task without a call. ``is_first``: it was not heard of."""

    word: VisitList
    is_first: bool


class GraphHistory(SystemHistory):
    """A fold over words of robots and of the agents of nodes."""

    def __init__(self, site: FactoryGraph, tasks: TaskFold) -> None:
        super().__init__(tasks)
        self._site = site
        #: The last word of each robot, none before its first.
        self.robots: dict[int, RobotAt] = {}
        #: Nodes that each robot has left behind.
        self.passed = dict.fromkeys(site.robots, 0)
        #: By the two nodes that an edge joins.
        self.edges: dict[frozenset[int], EdgeNotice] = {}

    def feed(self, message: Message, time_us: int) -> SystemFact | None:
        """Follow robots, edges, and lists of nodes to visit; the first word of such a list opens a task."""
        match message:
            case RobotAt() if message.sender in self.passed:
                before = self.node_of(message.sender)
                self.robots[message.sender] = message
                self.passed[message.sender] += self.node_of(message.sender) != before
                return RobotTold(message)
            case EdgeNotice():
                self.edges[frozenset((message.node, message.other))] = message
            case VisitList():
                task = Reference(message.sender, message.order)
                return VisitsTold(message, self.tasks.open(task, Operation.TRANSPORT, time_us))
        return None

    def node_of(self, robot: int) -> int:
        """The node where a robot is, or that it left last."""
        at = self.robots.get(robot)
        if at is None:
            return self._site.machines[robot].home.track
        return at.behind if at.on_edge else at.node


def graph_history(history: History) -> GraphHistory:
    """A factory graph's part of a history of its bus."""
    assert isinstance(history.system, GraphHistory), "the site is a factory graph"
    return history.system


HISTORY = GraphHistory
