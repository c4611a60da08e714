"""One run of a site of any system, connected but not switched on: what a campaign and a person who watches ask of it.

Everything else is the same for all: the loop, who joins from outside, faults, the end (bus_sim/session.py), and what a
trial adds (bus_sim/campaign/trial.py).
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import TYPE_CHECKING, Any, ClassVar, Generic, NamedTuple, Protocol, Self, TypeVar

from rich.console import Console

from bus_sim.demand import DemandError
from bus_sim.devices.timers import Timers
from bus_sim.run import BusRun
from bus_sim.systems.picture import LiveText
from onboard.contract.messages import Message

if TYPE_CHECKING:  # the page's libraries are an extra
    from bus_sim.web.run_source import RunSource

HOUR_US = 3_600_000_000


class SystemPlant(Protocol):
    """What a run asks of the plant: everything of a site that is no controller, and the oracle that judges it."""

    @property
    def timers(self) -> Timers:
        """The loop's time and calls at chosen times, for whatever happens to the run from outside."""

    @property
    def violations(self) -> list[str]:
        """What happened that must never happen, a line each."""

    def start(self) -> None:
        """Power on: every device tells how it stands."""

    @property
    def is_over(self) -> bool:
        """Whether everybody was served or told why."""


class Tally(NamedTuple):
    """What became of everybody who came; times in s. ``full``: those told why for want of room."""

    served: int
    told: int
    waiting: int
    longest_wait_s: float
    full: int = 0


class RunFigures(Protocol):
    """What a run came to."""

    @property
    def is_good(self) -> bool:
        """Nothing broke, nobody stopped, and everybody was served or told why."""

    def lines(self, width: int | None = None) -> list[str]:
        """For people; for a terminal of so many columns, None where it is none."""

    def to_json(self) -> dict[str, object]:
        """Values that ``json.dump`` takes as they are; the units are in the keys."""


class Show(Protocol):
    """What a person sees of a run while it goes on."""

    #: Of the page, if one is served: shown in every picture.
    address: str | None

    def __enter__(self) -> Self:
        """From now on."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Leave the terminal as it was."""

    def update(self, now_us: int) -> None:
        """Show the site as it is now, if it is time to."""


class PersonAtKeys(Protocol):
    """A person who has a hand in the run by keys; entered and left with it."""

    @property
    def is_over(self) -> bool:
        """Whether this person has ended the run."""

    def __enter__(self) -> Self:
        """From now on keys are heard."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """No longer."""


class EndedRun(NamedTuple):
    """How a run ended: wall time in s, what it measured from loop time ``begin_us`` on, and processes that failed.

    ``is_warm``: what a person asked to see has begun; a run may be ended before.
    """

    wall_s: float
    begin_us: int = 0
    is_warm: bool = True
    failures: tuple[str, ...] = ()


@dataclass(frozen=True)
class Figures:
    """Figures by name, told one a line after what the system itself tells of its end."""

    figures: dict[str, object]
    is_good: bool
    wall_s: float
    remarks: tuple[str, ...] = ()

    def lines(self, width: int | None = None) -> list[str]:
        """Remarks, a figure a line, and wall time in s; ``width`` in characters is not needed."""
        figures = (f"{name.replace('_', ' ')}: {_shown(value)}" for name, value in self.figures.items())
        return [*self.remarks, *figures, f"wall time: {self.wall_s:.1f} s"]

    def to_json(self) -> dict[str, object]:
        """The figures alone, without remarks and wall time."""
        return self.figures


def _shown(value: object) -> str:
    if isinstance(value, list):
        return ", ".join(str(one) for one in value) or "none"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


PlantT = TypeVar("PlantT", bound=SystemPlant)
#: What a person does on the page: arguments in, a line about it out.
Act = Callable[[Any], str]


class SystemStage(ABC, Generic[PlantT]):
    """See the module. A system says what came of its orders, and how a person sees them."""

    #: Whom the report counts.
    who: ClassVar[str] = "orders"
    #: Looks whether it is over, us.
    step_us: ClassVar[int] = 500_000
    #: When everybody was served the machines may finish what they say, us.
    tail_us: ClassVar[int] = 3_000_000
    #: Whether a run whose plant has seen what must never happen goes on.
    goes_on_broken: ClassVar[bool] = False
    #: Whether a run that is watched on the page goes on until a person ends it.
    goes_on_watched: ClassVar[bool] = True

    def __init__(self, run: BusRun[PlantT]) -> None:
        self.run = run
        self.plant = run.plant
        #: Messages of the fleet bus with their times, of a run that a person asked for.
        self.messages: list[tuple[int, Message]] = []
        self._is_judged = False

    # --- how it stands -----------------------------------------------------------------------------------------

    @property
    def is_broken(self) -> bool:
        """Whether the oracle has seen what must never happen."""
        return bool(self.plant.violations)

    @property
    def is_over(self) -> bool:
        """Whether everybody was served or told why."""
        return self.plant.is_over

    @property
    def halted(self) -> list[str]:
        """Machines that stopped safely, and why."""
        found = ((one.holon.machine.name, one.holon.halted) for one in self.run.controllers.values())
        return [f"{name}: {why}" for name, why in found if why is not None]

    @property
    def is_good(self) -> bool:
        """Nothing broke, nobody stopped, and everybody was served or told why."""
        return self.is_over and not self.violations() and not self.halted

    def violations(self) -> list[str]:
        """What the oracle says of a run that is over."""
        if not self._is_judged:
            self._is_judged = True
            self.judge_end()
        return list(self.plant.violations)

    def judge_end(self) -> None:
        """What the oracle can only say when all is over."""

    def waits_since(self, time_us: int) -> int:
        """How many wait now who waited then already, us of loop time; 0 where a system does not tell."""
        return 0

    def waits_s(self) -> tuple[float | None, ...]:
        """What each waited in all, s, None for who was not served; empty where a system does not tell."""
        return ()

    @abstractmethod
    def tally(self) -> Tally:
        """What became of everybody who came; asked when the run is over."""

    # --- a machine under test ----------------------------------------------------------------------------------

    def bring(self, site: Any, node: int) -> None:
        """Something comes now that machine ``node`` can do alone; ``site`` is the run's own with all that it brings.

        Raises ``DemandError`` where nobody can be brought so.
        """
        raise DemandError(f"{site.name}: a {site.called} has no order that one machine carries out at any time")

    # --- a person who watches ----------------------------------------------------------------------------------

    @property
    def limit_us(self) -> int:
        """A run that does not end by itself ends here, us of loop time."""
        return 4 * HOUR_US

    @property
    def shown_us(self) -> tuple[int, int] | None:
        """The part that a person asked to see, us of loop time; what comes before is hurried. None: all of it."""
        return None

    def head(self) -> list[str]:
        """Lines for a person before the run begins: the site and its seed."""
        return [f"site {self.run.site.name}, seed {self.run.options.seed}"]

    def warming_up(self, wall_s: float | None) -> str:
        """A line before what is hurried (``wall_s`` None), and after it, when that took so many seconds."""
        return f"warmed up in {wall_s:.1f} s" if wall_s is not None else "warm-up, as fast as possible"

    def measure_from(self, now_us: int) -> None:
        """What is shown begins now: whatever is measured begins anew."""
        self.run.fleet.restart_statistics()

    def listen(self) -> None:
        """A person asked for this run: from its start on everything is heard that its figures are made of."""
        self.run.observers.append(lambda message, time_us: self.messages.append((time_us, message)))

    def picture(self) -> str:
        """The site as it is now, for a terminal; empty where there is none."""
        return ""

    def remarks(self) -> list[str]:
        """Lines about what was done, before the figures."""
        last = self.picture()
        return ["", last, ""] if last else []

    def figures(self) -> dict[str, object]:
        """What a run of this system is judged by, beside the figures of every run."""
        return {}

    def show(self, console: Console) -> Show:
        """What a person sees while it goes on."""
        return LiveText(self.picture, console, wanted=self.run.options.speed is not None)

    def hand(self, console: Console) -> PersonAtKeys | None:
        """The person at the keys, where one was asked for."""
        return None

    def source(self) -> "RunSource":
        """The run as the page shows it; its libraries are there."""
        from bus_sim.web.run_source import RunSource  # noqa: PLC0415  # its libraries are an extra

        return RunSource(self.run)

    def summary(self, ended: EndedRun) -> RunFigures:
        """What it came to; asked once, when it is over."""
        run, halted, violations = self.run, [*self.halted, *ended.failures], self.violations()
        whole: dict[str, object] = {
            "site": run.site.name,
            "seed": run.options.seed,
            "simulated_s": round(run.loop.now_us() / 1e6, 3),
            **self.figures(),
            "frames": run.fleet.statistics().frames,
            "violations": violations,
            "halted": halted,
            "over": self.is_over,
        }
        return Figures(whole, self.is_over and not violations and not halted, ended.wall_s, tuple(self.remarks()))
