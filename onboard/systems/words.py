"""The words of a system: what people call its loads, places, rights and deeds, which the bus carries as numbers.

A system's own are the class ``WORDS`` of its folder's ``words.py``; ``words_of`` finds them. Where no site is given, or
its system has none, the words are neutral ones: numbers as the bus has them.
"""

from collections.abc import Callable, Mapping

from onboard.contract.codes import Criterion, Operation, Reason, TaskPhase, TokenKind
from onboard.contract.constants import ANY_STATION, NOBODY, OUTSIDE
from onboard.contract.messages import CallForProposals, Message, Reference
from onboard.core.site import Segment, Site, Station
from onboard.systems.registry import part


class SiteWords:
    """What every system shares; a system replaces what it says in another way.

    ``hear`` every message where words depend on what was said before: drawings of orders, points of goals.
    """

    #: What is carried or worked on, in one word.
    noun = "load"
    #: Signals that mean nothing in this system, although messages of all have them.
    silent: frozenset[str] = frozenset()

    def __init__(self, site: Site | None) -> None:
        self._known = site
        #: How the number of a signal is said, by the signal's name.
        self.signals: Mapping[str, Callable[[int], str]] = {}

    def hear(self, message: Message) -> None:
        """Remember what later words need."""

    # --- names -------------------------------------------------------------------------------------------------

    def machine(self, node: int) -> str:
        """A machine's name, or its node-ID where the site has none for it."""
        if node == NOBODY:
            return "nobody"
        known = self._known.machines.get(node) if self._known is not None else None
        return known.name if known is not None else f"node {node}"

    def reference(self, value: Reference) -> str:
        """A task: who named it, and its number there."""
        return "none" if not any(value) else f"{self.machine(value.origin)}/{value.number}"

    def load(self, value: Reference) -> str:
        """The short name of what is carried or worked on."""
        return self.reference(value)

    def thing(self, value: Reference) -> str:
        """What is carried or worked on, noun and name."""
        return f"{self.noun} {self.load(value)}"

    def place(self, number: int) -> str:
        """A station by its number: track, index and side, or anywhere, or outside."""
        if number == ANY_STATION:
            return "anywhere"
        return "outside" if number == OUTSIDE else str(Station.from_number(number))

    def slot(self, track: int, index: int) -> str:
        """Where one body can be."""
        return str(Segment(track, index))

    def resource(self, kind: TokenKind, number: int) -> str:
        """What a token stands for."""
        match kind:
            case TokenKind.SEGMENT:
                return self.slot(number >> 8, number & 0xFF)
            case TokenKind.STATION:
                return self.place(number)
            case TokenKind.CAR:
                return self.thing(Reference(number >> 16, number & 0xFFFF))
        return f"{kind.name.lower()} {self.reference(Reference(number >> 16, number & 0xFFFF))}"

    # --- what is done ------------------------------------------------------------------------------------------

    def operation(self, operation: Operation) -> str:
        """What a task asks for, as a verb."""
        return plain(operation.name)

    def reason(self, reason: Reason) -> str:
        """A reason code in lower case with spaces, as people read it."""
        return plain(reason.name)

    def way(self, call: CallForProposals) -> str:
        """From where to where a call's load goes; empty where it goes nowhere."""
        return f"{self.place(call.from_station)} to {self.place(call.to_station)}"

    def cost(self, cost: int, criterion: Criterion | None) -> str:
        """A bid's cost in the unit of its call's criterion; the bare number where the call was not seen."""
        match criterion:
            case Criterion.FINISH_TIME:
                return f"{cost / 1000:.3f} s"
            case Criterion.MONEY:
                return f"{cost / 100:.2f} money"
            case Criterion.LENGTH:
                return f"{cost} mm"
        return str(cost)

    def finished(self, message: Message) -> Reference | None:
        """The task that a message tells to be done, where that is no report."""
        return None

    def deed(self, message: Message) -> str:
        """What the sender of a message does from now on; empty where the message does not say."""
        return ""

    def report(self, operation: Operation, phase: TaskPhase, load: Reference, station: int) -> str:
        """What a machine has done when it reports a phase of a task; empty where nobody needs to be told."""
        match phase:
            case TaskPhase.LOADED:
                return f"has loaded {self.thing(load)}"
            case TaskPhase.DONE:
                return self.done(load, station)
            case TaskPhase.REFUSED:
                return f"refuses {self.thing(load)}"
            case TaskPhase.FORFEITED:
                return f"gives {self.thing(load)} up"
        return ""

    def done(self, load: Reference, station: int) -> str:
        """What became of a task that is done."""
        return f"has done {self.thing(load)}"


def plain(name: str) -> str:
    """An enumeration's name as people write it."""
    return name.lower().replace("_", " ")


def words_of(site: Site | None) -> SiteWords:
    """The words of a site's system."""
    module = part(site.system, "words") if site is not None else None
    if module is None:
        return SiteWords(site)
    words: SiteWords = module.WORDS(site)
    return words
