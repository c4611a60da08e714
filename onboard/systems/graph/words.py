"""Words of a factory graph: nodes as N7, edges as N3-N7, orders by their numbers."""

from onboard.contract.codes import TokenKind
from onboard.contract.constants import ANY_STATION
from onboard.contract.graph import RobotAt, RobotMode
from onboard.contract.messages import Message, Reference
from onboard.systems.graph.fields import NO_NODE
from onboard.systems.graph.site import FactoryGraph
from onboard.systems.words import SiteWords

_NODES = (
    *("ahead1", "ahead2", "ahead3", "after", "behind", "end", "goal", "node", "other", "start"),
    *(f"stop{number}" for number in range(1, 6)),
)


class GraphWords(SiteWords):
    """What a factory graph's messages mean."""

    noun = "order"
    silent = frozenset({"wheelbase_mm", "station"})

    def __init__(self, site: FactoryGraph) -> None:
        super().__init__(site)
        self.signals = {**dict.fromkeys(_NODES, node_name), "robot": self.machine}

    def load(self, value: Reference) -> str:
        """An order goes by its number at its desk."""
        return str(value.number) if any(value) else "none"

    def place(self, number: int) -> str:
        """A node by its number, as `N7`; or any of them."""
        return "any node" if number == ANY_STATION else node_name(number)

    def slot(self, track: int, index: int) -> str:
        """An edge, by its ends."""
        return f"N{track}-N{index}"

    def resource(self, kind: TokenKind, number: int) -> str:
        """An edge, or one of a node's slots."""
        if kind is TokenKind.STATION:
            return f"slot {number & 0x7F} of N{number >> 8}"
        if kind is TokenKind.SEGMENT:
            return f"edge {self.slot(number >> 8, number & 0xFF)}"
        return super().resource(kind, number)

    def deed(self, message: Message) -> str:
        """Where a robot is, and what it does there."""
        if not isinstance(message, RobotAt):
            return ""
        if message.on_edge:
            return f"drives from {node_name(message.behind)} to {node_name(message.node)}"
        doing = "loads" if message.robot_mode is RobotMode.LOADING else "stands"
        return f"{doing} in {node_name(message.node)}"


def node_name(number: int) -> str:
    """A node as people write it."""
    return "none" if number == NO_NODE else f"N{number}"


WORDS = GraphWords
