"""What a run of a terminal shows while it goes on, and how it ends."""

from types import TracebackType
from typing import Self

from rich.console import Console, Group
from rich.live import Live
from rich.text import Text

from bus_sim.systems.terminal.run import TerminalOutcome, TerminalRun
from bus_sim.systems.terminal.table import picture, plan_table
from onboard.systems.terminal.site import Terminal


class TerminalShow:
    """Tells a run: a moving picture on a terminal, and one line for each thing that happens."""

    def __init__(self, run: TerminalRun, console: Console) -> None:
        self._run, self._site, self._console = run, run.plant.site, console
        wanted = console.is_terminal and not console.quiet
        self._live = Live(console=console, refresh_per_second=10) if wanted else None
        self._told = 0
        #: Of the page, if one is served: shown below every picture.
        self.address: str | None = None
        self._tables: set[int] = set()

    def __enter__(self) -> Self:
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._live is not None:
            self._live.stop()

    def update(self, now_us: int) -> None:
        """The picture in a terminal; and every line of the log that is new, wherever output goes."""
        if self._console.quiet:
            return
        run = self._run
        if self._live is not None:
            lines = [f"{now_us / 1e6:.0f} s", *picture(self._site, run.spectator, now_us)]
            lines += [f"picture at {self.address}"] if self.address is not None else []
            self._live.update(Group(*(Text(line) for line in lines)))
        for time_us, source, text in run.log.lines[self._told :]:
            self._say(f"{time_us / 1e6:8.1f} s  {source}: {text}")
        self._told = len(run.log.lines)
        self._first_plans(now_us)

    def _first_plans(self, now_us: int) -> None:
        """Each robot's first plan as a table, as the paper prints them."""
        site, traffic = self._site, self._run.spectator.traffic
        for node in site.vehicles:
            lines = plan_table(site, traffic, node, now_us) if node not in self._tables else []
            if lines:
                self._tables.add(node)
                self._say(f"{now_us / 1e6:8.1f} s  plan of {site.machines[node].name}")
                for line in lines:
                    self._say(f"            {line}")

    def _say(self, line: str) -> None:
        self._console.print(line, highlight=False, markup=False, soft_wrap=True)


def summary_lines(site: Terminal, found: TerminalOutcome) -> list[str]:
    """Indicators of a run for people: waiting is from the order to the picking up, finishing to the putting down."""
    late = [one for one in found.deliveries if one.late_us]
    lines = [
        f"{len(found.deliveries)} of {found.ordered} boxes put down, the last after {found.ended_us / 1e6:.1f} s",
        _times("waiting", found.mean_s(lambda one: one.waited_us), _longest(found, "waited_us")),
        _times("finishing", found.mean_s(lambda one: one.finished_us), _longest(found, "finished_us")),
        f"too late  {len(late)} boxes",
        f"plans made anew {found.touched}, for {found.disturbances} blocked lanes",
        f"planning interrupted by urgent missions {found.interrupted} times",
        f"bus       {found.frames} frames, load {found.busy * 100:.2f} %",
    ]
    lines += [f"BROKEN: {what}" for what in found.violations] + [f"halted: {what}" for what in found.halted]
    return lines


def _times(name: str, mean_s: float, longest_s: float) -> str:
    return f"{name:<9} mean {mean_s:7.1f} s   longest {longest_s:7.1f} s"


def _longest(found: TerminalOutcome, what: str) -> float:
    return max((getattr(one, what) for one in found.deliveries), default=0) / 1e6
