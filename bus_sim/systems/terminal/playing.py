"""A terminal played to the end of its missions without a word."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Self

from rich.console import Console

from bus_sim import session
from bus_sim.options import RunOptions
from bus_sim.systems.stage import HOUR_US, Show
from bus_sim.systems.terminal.plant import NOISE, make_plant
from bus_sim.systems.terminal.run import TerminalOutcome, TerminalRun
from bus_sim.systems.terminal.simulated import SIMULATED
from bus_sim.systems.terminal.stage import TerminalStage
from onboard.systems.terminal.site import Terminal


class _Looking:
    """Somebody who is shown the run after each step."""

    def __init__(self, run: TerminalRun, look: Callable[[TerminalRun], None]) -> None:
        self._run, self._look = run, look
        self.address: str | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing to leave behind."""

    def update(self, now_us: int) -> None:
        """See ``Show``."""
        self._look(self._run)


class _LookedAt(TerminalStage):
    look: Callable[[TerminalRun], None]

    def show(self, console: Console) -> Show:
        """See ``SystemStage``."""
        return _Looking(self.run, self.look)


def play(
    site: Terminal,
    options: RunOptions,
    *,
    limit_us: int = HOUR_US,
    noise: float = NOISE,
    prepare: Callable[[TerminalRun], None] | None = None,
    show: Callable[[TerminalRun], None] | None = None,
) -> TerminalOutcome:
    """``prepare`` gets the run before it is switched on, ``show`` after each second; ``noise`` as of the plant."""
    staged: type[TerminalStage] = TerminalStage
    if show is not None:
        staged = type("Looked", (_LookedAt,), {"look": staticmethod(show)})
    system = replace(SIMULATED, plant=partial(make_plant, noise=noise), staged=staged)
    played = session.play(site, replace(options, limit_s=limit_us / 1e6), prepare, system)
    assert isinstance(played, TerminalStage)
    return played.outcome()
