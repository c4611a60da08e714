"""What the simulator has to know of one system; each describes itself in the ``simulated`` module of its folder."""

from abc import ABC, abstractmethod
from argparse import Namespace
from collections.abc import Callable, Mapping, Sequence
from enum import StrEnum
from typing import Any, ClassVar, Generic, NamedTuple, Protocol, TypeVar

from bus_sim.attacks.attack import Attack
from bus_sim.faults.injection import Injection
from bus_sim.options import RunOptions
from bus_sim.systems.stage import SystemPlant, SystemStage
from bus_sim.systems.stranger import Stranger, factories_with
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.contract.codes import KindCode
from onboard.core.behaviour import BehaviourFactory
from onboard.core.site import Site

#: What a fault does to a run at its time.
Action = Callable[[Any, Injection], None]
#: Simulated seconds a second for a person who presses keys or watches the page.
HAND_SPEED = 10.0

SiteT = TypeVar("SiteT", bound=Site)
PlantT = TypeVar("PlantT", bound=SystemPlant)


class Coming(Protocol):
    """Who comes in one run, as a scenario file says it."""

    @property
    def apart_s(self) -> float:
        """Mean time between two, s."""

    def to_toml(self) -> list[str]:
        """The lines of a scenario file's section that ``read`` takes up again."""


class Occasion(StrEnum):
    """What for somebody comes, where nobody asked for anything else."""

    #: One order alone: the scene of single faults.
    ALONE = "alone"
    #: Orders that overlap: the other scene of single faults.
    OVERLAP = "overlap"
    #: All kinds of work are under way when the power fails.
    BUSY = "busy"
    #: A few, to hear all that is said.
    FEW = "few"
    #: Beside an attack.
    ATTACK = "attack"
    #: Whoever is wanted is brought by hand.
    NOBODY = "nobody"


class Faulted(NamedTuple):
    """When faults may strike a run, s after power-up.

    ``span_s`` is where a few of them begin. At a rate they come until ``until_s``, when nobody comes or waits any more;
    a fault that names who came is about somebody of ``arrivals_s``, the moments at which each comes.
    """

    span_s: tuple[float, float]
    until_s: float
    arrivals_s: Sequence[float] = ()


class SimulatedSystem(ABC, Generic[SiteT, PlantT]):
    """One system in the simulator: how its sites become runs, and who comes to them."""

    #: As site files say it.
    name: str
    #: Whom a run counts.
    who: ClassVar[str] = "orders"
    #: Machines that carry out what comes; a stranger stands in for one of them. None: none bids by the core's calls.
    worker: KindCode | None = None
    #: Faults that only this system can have, by kind.
    actions: Mapping[str, Action] = {}
    #: Attacks that speak this system's own messages, by name.
    attacks: Mapping[str, type[Attack]] = {}
    #: Kinds that campaigns draw here, of a profile's; None: all of them.
    drawn: frozenset[str] | None = None
    #: The section of a scenario file that says who comes, and each setting's type.
    section: ClassVar[str]
    settings: ClassVar[Mapping[str, type]]
    #: Settings that it must have where it is there, and what is an example.
    needed: ClassVar[Mapping[str, str]] = {}

    def draws(self, kind: str, site: SiteT) -> bool:
        """Whether campaigns draw a kind of fault on this site."""
        return self.drawn is None or kind in self.drawn

    # --- a run -------------------------------------------------------------------------------------------------

    @abstractmethod
    def stage(self, site: SiteT, options: RunOptions, loop: VirtualTimeLoop) -> SystemStage[PlantT]:
        """One run of a site with those who come by ``options.demand``. Raises ``DemandError``."""

    @abstractmethod
    def asked(self, site: SiteT, args: Namespace, given: Mapping[str, object], *, live: bool) -> Any:
        """Who comes in ``bus-sim run``: ``given`` are its options about that which a person wrote, by name.

        ``live``: others join by a bus. Raises ``DemandError`` for an option that says nothing here, with the reason.
        """

    def speed(self, demand: Any, *, web: bool, terminal: bool) -> float | None:
        """How fast a run goes where nobody asked for a speed; ``terminal``: a person looks on."""
        return HAND_SPEED if web else None

    def stranger(self, site: SiteT, target: int, how: Stranger) -> Callable[[Site, KindCode], BehaviourFactory]:
        """For ``BusRun.factories``: node ``target``, a ``worker``, bids and does not do what it wins."""
        assert self.worker is not None, "only a machine that bids can be a stranger"
        return factories_with(site, self.worker, target, how)

    def planted(self, name: str) -> Callable[[Any], None]:
        """Puts the mistake so named into a run. Raises ``KeyError`` with the names that there are."""
        raise KeyError(f"{name}: no such bug; {self.name} has none")

    # --- who comes to a trial ----------------------------------------------------------------------------------

    @abstractmethod
    def read(self, given: Mapping[str, object]) -> Any:
        """Who comes by a scenario file's section, in which nothing is missing."""

    @abstractmethod
    def usual(self, site: SiteT, args: Mapping[str, float | None]) -> Any:
        """Who comes in a campaign: by ``cars``, ``orders`` and ``apart``, None where nobody said. ``DemandError``."""

    @abstractmethod
    def on(self, occasion: Occasion, site: SiteT) -> Any:
        """Who comes on an occasion."""

    @abstractmethod
    def count(self, demand: Any) -> str:
        """How many come, in words."""

    @abstractmethod
    def check(self, site: SiteT, demand: Any, seed: int) -> None:
        """Raise ``DemandError`` for what this site cannot be brought."""

    @abstractmethod
    def faulted(self, site: SiteT, demand: Any, seed: int, limit_s: float) -> Faulted:
        """When faults may strike a run of at most ``limit_s``."""

    @abstractmethod
    def attacked_s(self, site: SiteT, demand: Any, seed: int) -> tuple[float, float]:
        """When attacks may begin, s after power-up."""

    @abstractmethod
    def patience_s(self, site: SiteT, demand: Any, seed: int) -> float:
        """When a trial is given up, s after power-up."""
