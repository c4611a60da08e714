"""What a kind of machine adds to the core: a task-generation function and the machine's own steps.

The core knows tasks, segments, windows, bids and tokens; a kind knows what its machine can do and what it costs
(rows P21, P22). A new kind is a new ``Behaviour``; no protocol code changes for it.
"""

from collections import Counter
from dataclasses import dataclass, field
from typing import ClassVar, Protocol, runtime_checkable

from onboard.contract.codes import KindCode, MachineState, Reason
from onboard.contract.messages import Message, Progress, TokenGrant, TokenHeld, TokenRefusal, TokenRequest
from onboard.core.authority import TokenBook, TokenKey
from onboard.core.effects import Effect
from onboard.core.journal_records import Entry
from onboard.core.mirror import Mirror
from onboard.core.motion_authority import MotionAuthority
from onboard.core.negotiation import Estimator, Negotiation, NegotiationEvent
from onboard.core.negotiation.winners import Winners
from onboard.core.petitions import Petitions
from onboard.core.site import Machine, Segment, Site


@dataclass
class Fleet:
    """What the core lends to a behaviour of the same node; ``entries`` are the journal's, oldest first."""

    #: What this machine believes of the others: more than the core's, where a system's own fleet says so.
    mirror_type: ClassVar[type[Mirror]] = Mirror

    site: Site
    machine: Machine
    tokens: TokenBook
    mirror: Mirror
    negotiation: Negotiation
    entries: tuple[Entry, ...] = ()
    #: Input that came to nothing, by reason: the holon's own count.
    drops: Counter[Reason] = field(default_factory=Counter)
    petitions: Petitions = field(init=False)
    #: What permits motion.
    motion: MotionAuthority = field(init=False)
    #: Who has this machine's tasks in hand, and whether it is at work.
    winners: Winners = field(init=False)
    #: How often this machine was admitted again after it had been an obstacle: its plans of before are old then.
    admissions: int = 0
    #: After this machine's rights were made anew: the slots that it was given, which are those of its body; else None.
    slots_told: tuple[Segment, ...] | None = None
    #: Whether nobody knows this machine's rights, and so not where it is.
    has_no_rights: bool = False
    #: Machines whose rights were made anew: of what was promised to them before they know nothing.
    forgetful: set[int] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.petitions = Petitions(self.site.timing.token_repeat_us)
        self.motion = MotionAuthority(self.tokens)
        self.winners = Winners(self.node_id, self.negotiation, self.mirror.aside)
        self.mirror.joins(self.tokens, self.drops)

    @property
    def node_id(self) -> int:
        """This machine's node-ID, 1 to 250."""
        return self.machine.node_id


class Behaviour(Protocol):
    """One kind of machine on one node. All times are bus time in us; every method returns effects in order."""

    kind: KindCode

    @property
    def state(self) -> MachineState:
        """What the heartbeat says of this machine; others plan around one that is STOPPED or OBSTACLE."""

    @property
    def itinerary_version(self) -> int:
        """Version of the firm itinerary, 0 for none."""

    def start(self, now_us: int) -> list[Effect]:
        """First effects after power-up: silence outputs; the devices are asked how they stand without it."""

    def sense(self, message: Message, now_us: int) -> list[Effect]:
        """A message of the machine's own device bus."""

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        """A fleet message, after tokens, mirror and negotiation have seen it."""

    def negotiated(self, event: NegotiationEvent, now_us: int) -> list[Effect]:
        """Pre-assigned, outbid, awarded, or an own call closed."""

    def may_grant(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        """NONE where the held token may go to ``requester`` now; any other reason refuses."""

    def advance(self, now_us: int) -> list[Effect]:
        """Do what can be done next; called after every event, so it must change nothing where nothing is due."""

    def next_wake(self) -> int | None:
        """When ``advance`` should be called next if nothing else happens."""

    def statements(self, now_us: int) -> list[Effect]:
        """Say again what this node vouches for: its itinerary, and what is in its custody."""


#: Words about others' rights and places: all hear them, and they concern one or two.
OverheardWord = Progress | TokenGrant | TokenHeld | TokenRefusal | TokenRequest
#: From when on a behaviour looks at all that happens, where it never does so by itself: bus us beyond any time.
NEVER_US = 1 << 63


@runtime_checkable
class Attentive(Protocol):
    """A behaviour that need not be called after every event: it knows what it waits for.

    It is called when it is due, and after each event that changed a right of its machine, or of which nothing here is
    said; a heartbeat of a mirror as mine it never hears. Runs in which all is called prove the rest (``sweeps``).
    """

    def looks_from(self) -> int:
        """From when on ``advance`` is to see every event, bus us: 0 for now, ``NEVER_US`` where it only waits."""

    def heeds(self, message: OverheardWord) -> bool:
        """Whether ``advance`` reads what this word changed in what is believed of others."""


class BehaviourFactory(Protocol):
    """Makes the behaviour of one kind; ``estimator`` is what the negotiation asks for bids."""

    #: What the core lends to it: more than the core's own where its system keeps more in its mirror.
    fleet_type: type[Fleet] = Fleet

    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> Estimator:
        """The task-generation function of a machine of this kind."""

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> Behaviour:
        """What one machine does from power-up on; ``estimator`` is the one that this factory made for it."""
