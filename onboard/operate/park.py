"""What an operator's station has heard of a site: who lives, who stands and why, who else speaks as a tool."""

from dataclasses import dataclass, field

from onboard.contract.codes import CONTRACT_VERSION, MachineState, ManualMode, Reason
from onboard.contract.constants import MAX_NODE_ID, NOBODY
from onboard.contract.messages import Blocked, Clear, Diagnostic, EmergencyStop, Halted, Heartbeat, ManualState, Message
from onboard.core.site import Machine, Segment, Site
from onboard.gateway.edge import edge_of
from onboard.gateway.positions import Tracker

#: Heartbeats missed before a machine counts as silent, as the machines themselves count (onboard/core/mirror.py).
SILENT_BEATS = 3
#: A ``Halted`` that is not said again for this many heartbeat periods is over: it is said once in each.
HALTED_BEATS = 1.5
#: Blocked segments that are remembered; more than so many are one too many for a person as well.
MOST_BLOCKED = 32


@dataclass(slots=True)
class Known:
    """One machine, by its own words. Times are loop time in us, None: never."""

    machine: Machine
    heard_us: int | None = None
    beat: Heartbeat | None = None
    beat_us: int = 0
    halted: Halted | None = None
    halted_us: int = 0
    is_held: bool = False
    is_at_rest: bool = False
    #: What its heartbeat says of another contract or site; NONE where it is of this one.
    foreign: Reason = Reason.NONE


@dataclass
class Park:
    """A fold: feed it every message of the fleet bus but those of this station itself. It never raises."""

    site: Site
    machines: dict[int, Known] = field(init=False)
    #: Nodes of no machine of the site, with the class of what each said last.
    others: dict[int, str] = field(default_factory=dict)
    blocked: dict[Segment, Blocked] = field(default_factory=dict)
    #: Emergency stops heard, by who said them, and when last.
    stops: dict[int, int] = field(default_factory=dict)
    dropped: dict[int, dict[Reason, int]] = field(default_factory=dict)
    _tracker: Tracker = field(init=False)

    def __post_init__(self) -> None:
        self.machines = {node: Known(machine) for node, machine in self.site.machines.items()}
        self._tracker = edge_of(self.site).tracker()

    def feed(self, message: Message, now_us: int) -> None:
        """Take up one message of the fleet bus, heard at loop time ``now_us``."""
        known = self.machines.get(message.sender)
        if known is None:
            self.others[message.sender] = type(message).__name__
        else:
            known.heard_us = now_us
            self._tracker.feed(message)
            self._on_own_word(known, message, now_us)
        match message:
            case EmergencyStop():
                self.stops[message.sender] = now_us
            case Halted():
                self._on_halted(message, now_us)
            case Blocked() if len(self.blocked) < MOST_BLOCKED:
                self.blocked[Segment(message.track, message.index)] = message
            case Clear():
                self.blocked.pop(Segment(message.track, message.index), None)

    def name(self, node: int) -> str:
        """A machine's name, or its node-ID where the site has none for it."""
        if node == NOBODY:
            return "nobody"
        known = self.machines.get(node)
        return known.machine.name if known is not None else f"node {node}"

    def lives(self, node: int, now_us: int) -> bool:
        """Whether a machine of the site was heard within its last three heartbeats."""
        heard_us = self.machines[node].heard_us
        return heard_us is not None and now_us - heard_us <= SILENT_BEATS * self.site.timing.heartbeat_us

    def living(self, now_us: int) -> list[int]:
        """Node-IDs of the machines of the site that live, in the site's order."""
        return [node for node in self.machines if self.lives(node, now_us)]

    def halted(self, node: int, now_us: int) -> Halted | None:
        """Why a machine does nothing any more, as long as that is said: by itself, or by others of a silent one."""
        known = self.machines[node]
        if known.halted is None or now_us - known.halted_us > HALTED_BEATS * self.site.timing.heartbeat_us:
            return None
        return known.halted

    def where(self, node: int) -> str:
        """Where a machine that moves is by its own word, or empty."""
        try:
            return self._tracker.where(node).node
        except KeyError:
            return ""

    def tools(self) -> list[int]:
        """Node-IDs of gateways and tools that were heard."""
        return sorted(node for node in self.others if node > MAX_NODE_ID)

    def _on_own_word(self, known: Known, message: Message, now_us: int) -> None:
        match message:
            case Heartbeat():
                known.beat, known.beat_us = message, now_us
                known.foreign = self._foreign(message)
                if message.state in (MachineState.IDLE, MachineState.WORKING):
                    known.is_held = known.is_at_rest = False
            case ManualState():
                known.is_held = message.manual_mode is not ManualMode.AUTOMATIC
                known.is_at_rest = known.is_held and message.at_rest
            case Diagnostic():
                self.dropped.setdefault(message.sender, {})[message.reason] = message.count

    def _on_halted(self, word: Halted, now_us: int) -> None:
        about = self.machines.get(word.machine)
        if about is None:
            return
        # Others speak for a machine that is silent, or that says something else than it does: else its own word counts.
        is_false = word.reason is Reason.FALSE_STATEMENT
        if word.sender == word.machine or is_false or not self.lives(word.machine, now_us):
            about.halted, about.halted_us = word, now_us

    def _foreign(self, beat: Heartbeat) -> Reason:
        if beat.contract != CONTRACT_VERSION:
            return Reason.OTHER_CONTRACT
        return Reason.OTHER_SITE if beat.site_digest != self.site.digest else Reason.NONE
