"""``bus-sim run terminal``: what a run shows while it goes on, and how it ends."""

import json
import sys
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console, Group
from rich.live import Live
from rich.text import Text

from bus_sim.faults.arm import frame_faults
from bus_sim.run import RunOptions
from bus_sim.systems.session import arm_all, check_faults
from bus_sim.systems.terminal.run import LIMIT_US, Outcome, TerminalRun, play
from bus_sim.systems.terminal.table import picture, plan_table
from bus_sim.systems.watched import FOREVER_US
from onboard.core.site import Site
from onboard.systems.terminal.site import Terminal
from onboard.systems.terminal.vehicle import terminal

if TYPE_CHECKING:  # that module names this one
    from bus_sim.systems.registry import SystemOptions

#: Where a person looks on: so many simulated seconds a second, unless another speed was asked for.
LOOK_SPEED = 20.0


@dataclass
class Show:
    """Tells a run: a moving picture on a terminal, else one line for each thing that happens."""

    site: Terminal
    quiet: bool = False
    live: Live | None = None
    _told: int = 0
    _tables: set[int] = field(default_factory=set)

    def __call__(self, run: TerminalRun) -> None:
        """After each simulated second."""
        if self.quiet:
            return
        now_us = run.loop.now_us()
        if self.live is not None:
            lines = [f"{now_us / 1e6:.0f} s", *picture(self.site, run.spectator, now_us)]
            self.live.update(Group(*(Text(line) for line in lines)))
        for time_us, source, text in run.log.lines[self._told :]:
            self._say(f"{time_us / 1e6:8.1f} s  {source}: {text}")
        self._told = len(run.log.lines)
        self._first_plans(run, now_us)

    def _first_plans(self, run: TerminalRun, now_us: int) -> None:
        """Each robot's first plan as a table, as the paper prints them."""
        for node in self.site.vehicles:
            lines = plan_table(self.site, run.spectator.traffic, node, now_us) if node not in self._tables else []
            if lines:
                self._tables.add(node)
                self._say(f"{now_us / 1e6:8.1f} s  plan of {self.site.machines[node].name}")
                for line in lines:
                    self._say(f"            {line}")

    def _say(self, line: str) -> None:
        if self.live is not None:
            self.live.console.print(line, highlight=False, markup=False)
        else:
            print(line)


def summary_lines(site: Terminal, found: Outcome) -> list[str]:
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


def _longest(found: Outcome, what: str) -> float:
    return max((getattr(one, what) for one in found.deliveries), default=0) / 1e6


def run_terminal(site: Site, options: "SystemOptions") -> int:
    """Run a terminal to the end of its missions. 0, or 1 where something broke or was left undone."""
    place = terminal(site)
    check_faults(options.faults, place)
    shown = not options.quiet
    if shown:
        trace = options.trace if options.trace is not None else "none"
        print(f"site {site.name}, digest {site.digest}, seed {options.seed}, trace {trace}")
    on_terminal = shown and sys.stdout.isatty()
    pace = options.speed if options.speed is not None or not on_terminal else LOOK_SPEED
    run_options = RunOptions(
        seed=options.seed,
        epoch_us=options.epoch_us,
        trace=options.trace,
        trace_devices=options.devices,
        pace=pace,
        faults=frame_faults(options.faults, place),
    )
    unlimited_us = LIMIT_US if options.web is None else FOREVER_US
    limit_us = unlimited_us if options.limit_s is None else round(options.limit_s * 1e6)
    show, armed = Show(place, options.quiet), partial(arm_all, faults=options.faults)
    if on_terminal:
        with Live(console=Console(), refresh_per_second=10) as show.live:
            found = play(place, run_options, limit_us=limit_us, prepare=armed, show=show, web=options.web)
    else:
        found = play(place, run_options, limit_us=limit_us, prepare=armed, show=show, web=options.web)
    if shown:
        print("\n".join(summary_lines(place, found)))
    if options.json is not None:
        write_json(options.json, found)
    return 0 if found.is_good else 1


def write_json(path: Path, found: Outcome) -> None:
    """The indicators for programs; times in us."""
    path.write_text(json.dumps({**asdict(found), "good": found.is_good}, indent=2) + "\n", encoding="utf-8")
