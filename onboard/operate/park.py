"""What an operator's station has heard of a site: who lives, who stands and why, who else speaks as a tool."""

from dataclasses import dataclass, field

from onboard.contract.codes import CONTRACT_VERSION, Reason
from onboard.contract.constants import MAX_NODE_ID, NOBODY
from onboard.contract.messages import Blocked, Halted, Heartbeat, Message
from onboard.core.site import Machine, Segment, Site
from onboard.gateway.edge import edge_of
from onboard.gateway.positions import Tracker, TrackTracker
from onboard.history.history import History

#: A ``Halted`` that is not said again for this many heartbeat periods is over: it is said once in each.
HALTED_BEATS = 1.5


@dataclass(frozen=True, slots=True)
class Known:
    """One machine as a history tells it. Times are loop time in us, None: never."""

    machine: Machine
    site: Site
    history: History

    @property
    def heard_us(self) -> int | None:
        """When it said anything last."""
        return self.history.lives.heard_us.get(self.machine.node_id)

    @property
    def beat(self) -> Heartbeat | None:
        """Its last heartbeat, None where none was heard yet."""
        return self.history.lives.beats.get(self.machine.node_id)

    @property
    def beat_us(self) -> int:
        """When its last heartbeat was; 0 for never."""
        return self.history.lives.beats_us.get(self.machine.node_id, 0)

    @property
    def halted(self) -> Halted | None:
        """The latest word that it does not act, however old, unless it acts since."""
        return self.history.halts.by_node.get(self.machine.node_id, (0, None))[1]

    @property
    def is_held(self) -> bool:
        """Whether a person holds it."""
        return self.machine.node_id in self.history.hands.held

    @property
    def is_at_rest(self) -> bool:
        """Whether it is held and has come to rest."""
        return self.history.hands.is_at_rest(self.machine.node_id)

    @property
    def foreign(self) -> Reason:
        """What its heartbeat says of another contract or site; NONE where it is of this one."""
        beat = self.beat
        if beat is None:
            return Reason.NONE
        if beat.contract != CONTRACT_VERSION:
            return Reason.OTHER_CONTRACT
        return Reason.OTHER_SITE if beat.site_digest != self.site.digest else Reason.NONE


@dataclass
class Park:
    """A view of a history: feed it every message of the fleet bus but those of this station itself. It never raises."""

    site: Site
    history: History = field(init=False)
    machines: dict[int, Known] = field(init=False)
    #: Nodes of no machine of the site, with the class of what each said last.
    others: dict[int, str] = field(default_factory=dict)
    _tracker: Tracker = field(init=False)

    def __post_init__(self) -> None:
        self.history = History(self.site)
        self.machines = {node: Known(machine, self.site, self.history) for node, machine in self.site.machines.items()}
        self._tracker = edge_of(self.site).tracker(self.history)

    @property
    def blocked(self) -> dict[Segment, Blocked]:
        """Segments that nobody can pass."""
        return self.history.orders.blocked

    @property
    def dropped(self) -> dict[int, dict[Reason, int]]:
        """What each node has dropped since its start, by its own count."""
        return self.history.lives.dropped

    def feed(self, message: Message, now_us: int) -> None:
        """Take up one message of the fleet bus, heard at loop time ``now_us``."""
        if message.sender not in self.machines:
            self.others[message.sender] = type(message).__name__
        self._tracker.take(message, self.history.feed(message, now_us))

    def name(self, node: int) -> str:
        """A machine's name, or its node-ID where the site has none for it."""
        if node == NOBODY:
            return "nobody"
        known = self.machines.get(node)
        return known.machine.name if known is not None else f"node {node}"

    def lives(self, node: int, now_us: int) -> bool:
        """Whether a machine of the site was heard within its last three heartbeats."""
        return not self.history.lives.is_silent(node, now_us)

    def living(self, now_us: int) -> list[int]:
        """Node-IDs of the machines of the site that live, in the site's order."""
        return [node for node in self.machines if self.lives(node, now_us)]

    def halted(self, node: int, now_us: int) -> Halted | None:
        """Why a machine does nothing any more, as long as that is said: by itself, or by others of a silent one."""
        return self.history.halts.last(node, now_us, round(HALTED_BEATS * self.site.timing.heartbeat_us))

    def where(self, node: int) -> str:
        """Where a machine that moves is by its own word, or empty: who stands says it seldom."""
        place = self.history.places.by_node.get(node)
        if isinstance(self._tracker, TrackTracker) and (place is None or place.told_us is None):
            return ""
        try:
            return self._tracker.where(node).node
        except KeyError:
            return ""

    def tools(self) -> list[int]:
        """Node-IDs of gateways and tools that were heard."""
        return sorted(node for node in self.others if node > MAX_NODE_ID)
