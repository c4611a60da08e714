"""A terminal's run: missions are typed at the desks, robots carry boxes; what came of it."""

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

from rich.console import Console

from bus_sim.systems.stage import HOUR_US, EndedRun, RunFigures, Show, SystemStage, Tally
from bus_sim.systems.terminal.orders import count
from bus_sim.systems.terminal.plant import TerminalPlant
from bus_sim.systems.terminal.run import TerminalOutcome, TerminalRun, outcome
from bus_sim.systems.terminal.show import TerminalShow, summary_lines
from onboard.systems.terminal.site import Terminal

if TYPE_CHECKING:  # the page's libraries are an extra
    from bus_sim.web.run_source import RunSource


@dataclass(frozen=True)
class TerminalSummary:
    """What a run of a terminal came to: its indicators, and machines that halted."""

    site: Terminal
    seed: int
    found: TerminalOutcome
    failures: tuple[str, ...]

    @property
    def is_good(self) -> bool:
        """Whether all that was ordered was delivered, nothing broke and no process failed."""
        return self.found.is_good and not self.failures

    def lines(self, width: int | None = None) -> list[str]:
        """The indicators and who halted; ``width`` in characters is not needed."""
        return summary_lines(self.site, self.found) + [f"halted: {what}" for what in self.failures]

    def to_json(self) -> dict[str, object]:
        """Site, seed and indicators; times in us, as the keys say."""
        return {"site": self.site.name, "seed": self.seed, **asdict(self.found), "good": self.is_good}


class TerminalStage(SystemStage[TerminalPlant]):
    """One run of a terminal: its vehicles on the lanes, and the boxes that are ordered."""

    who = "boxes"
    step_us = 1_000_000
    tail_us = 0
    run: TerminalRun

    @property
    def limit_us(self) -> int:
        """An hour of loop time, us, whatever is ordered."""
        return HOUR_US

    def head(self) -> list[str]:
        """One line: site, its digest, seed and where the trace goes."""
        site, options = self.plant.site, self.run.options
        trace = options.trace if options.trace is not None else "none"
        return [f"site {site.name}, digest {site.digest}, seed {options.seed}, trace {trace}"]

    def tally(self) -> Tally:
        """What became of each order for a box: done, refused, or open still."""
        return count(self.plant)

    def show(self, console: Console) -> Show:
        """Lanes and vehicles in a terminal, and the log's lines below."""
        return TerminalShow(self.run, console)

    def source(self) -> "RunSource":
        """The run as the page shows it; a person may block lanes and clear them."""
        from bus_sim.systems.terminal.page import TerminalSource  # noqa: PLC0415  # its libraries are an extra

        return TerminalSource(self.run)

    def outcome(self) -> TerminalOutcome:
        """The indicators as far as the run has come."""
        return outcome(self.run)

    def summary(self, ended: EndedRun) -> RunFigures:
        """The indicators at the end, with the processes that failed."""
        return TerminalSummary(self.plant.site, self.run.options.seed, self.outcome(), ended.failures)
