"""What the tests of every system must know of one."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from bus_sim.systems.orders import OrderArrivals
from onboard.contract.messages import Bid, Message, Reference
from onboard.core.site import Site
from onboard.trace.check.rule import Rule

#: Messages in their order, as a log would have them a second apart.
Log = Sequence[Message]
#: A bid of (node, initiator, call, task, cost) with whatever its bidder says before it.
Bidding = Callable[[int, int, int, Reference, int], list[Message]]


def plain_bid(node: int, initiator: int, call: int, task: Reference, cost: int) -> list[Message]:
    """Only the bid."""
    return [Bid(node, initiator, call, cost, 0)]


@dataclass(frozen=True, kw_only=True)
class Case:
    """One system, and what is played of it.

    ``site`` is a name or the text of a file; ``options`` make a run of it that is short, and in which every order is
    carried out. ``busy`` is a site whose own orders keep its machines at work between ``struck_s(seed)``, s after
    power-up, and are all carried out before ``limit_s``, whatever strikes the bus or the controllers meanwhile.
    """

    system: str
    site: str
    options: tuple[str, ...] = ()
    busy: Callable[[], Site]
    struck_s: Callable[[int], tuple[float, float]]
    limit_s: float
    #: A run in which something is soon set in motion.
    moving: tuple[str, ...] = ("--for", "60")
    #: What strikes it, turn and turn about; nothing where it does not claim to get over it.
    profiles: tuple[str, ...] = ("bus", "crash")
    #: Orders that are carried out beside a machine that does not do what it wins; None: none can be such a one.
    orders: OrderArrivals | None = None
    #: Whether a machine goes on from its journal with what it had in hand.
    goes_on: bool = True
    #: Who calls and two that bid, by node-ID; no calls by the core where it is None.
    parties: tuple[int, int, int] | None
    bidding: Bidding = plain_bid
    #: Logs in which a rule is broken once, by the rule's name: those that only this system has.
    broken: Mapping[str, Sequence[Log]] = field(default_factory=dict)
    #: The same, where it takes what was said in a run of ``busy``: the messages with their times, us.
    broken_in: Mapping[str, Callable[[list[tuple[int, Message]]], list[tuple[int, Message]]]] = field(
        default_factory=dict
    )
    #: Rules that planted mistakes show elsewhere.
    shown_elsewhere: frozenset[str] = frozenset()
    #: Rules that have nothing to judge where nobody interferes.
    idle: frozenset[type[Rule]] = frozenset()
    #: What ``onboard trace calls``, ``why`` and ``dump --decode`` say of the run, in words of the system.
    words: tuple[list[str], list[str], list[str]]
    #: What stands in its diagram.
    drawn: list[str] = field(default_factory=list)
