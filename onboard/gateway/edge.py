"""What a system's folder says to the gateway: orders in, where machines are, what they are.

A system's own is the class ``EDGE`` of its folder's ``gateway.py``; without one its machines are shown, and take no
orders from outside.
"""

from collections.abc import Callable
from dataclasses import dataclass

from onboard.contract.messages import Reference
from onboard.core.site import Site
from onboard.gateway.bus_orders import BusOrders, NoBusOrders
from onboard.gateway.dialect import Json
from onboard.gateway.positions import Tracker, TrackTracker
from onboard.history.history import History
from onboard.history.system import SystemFact
from onboard.systems.registry import part
from onboard.systems.words import words_of
from onboard.trace.view import SiteView


@dataclass(frozen=True, slots=True)
class PhysicalLimits:
    """Speed m/s, acceleration m/s^2, length m, most load kg; 0 where the site file is silent."""

    speed: float = 0.0
    acceleration: float = 0.0
    length: float = 0.0
    load: float = 0.0


class SystemEdge:
    """A system of which the gateway knows nothing more than its messages; a system replaces what it has."""

    #: Whether a machine takes orders by its name (VDA 5050's ``order``).
    takes_visits = False

    def __init__(self, site: Site) -> None:
        self.site = site

    def bus_orders(self, view: SiteView, place: Callable[[int], str | None]) -> BusOrders:
        """What orders become; ``view`` is what was heard, ``place`` names a station by its number."""
        return NoBusOrders(self.site)

    def tracker(self, history: History) -> Tracker:
        """What tells where machines are; the default reads places on tracks."""
        return TrackTracker(self.site, history)

    def place(self, number: int) -> str | None:
        """A station as topics name it; None for one that the site does not have."""
        return words_of(self.site).place(number)

    def told(self, fact: SystemFact, history: History, now_us: int) -> tuple[str, Json] | None:
        """What a fact of this system's own is told as, below the site's topic; times in us of the log end in ``_us``.

        None where nothing is told of it.
        """
        return None

    def of_load(self, load: Reference, history: History, now_us: int) -> Json:
        """What is known of a load beside what a task for it tells; times as in ``told``."""
        return {}

    def body(self) -> PhysicalLimits:
        """What a mobile machine is, as far as the site file tells."""
        return PhysicalLimits()

    def loads(self) -> Json:
        """What it carries, as a factsheet's ``loadSpecification``."""
        return {}


def edge_of(site: Site) -> SystemEdge:
    """The edge of a site's system."""
    module = part(site.system, "gateway")
    if module is None:
        return SystemEdge(site)
    edge: SystemEdge = module.EDGE(site)
    return edge
