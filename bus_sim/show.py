"""The site as it happens, in a terminal: drawn from what the fleet bus says, and nothing else."""

import time
from collections.abc import Callable
from datetime import datetime, timedelta
from types import TracebackType
from typing import Self

from rich.console import Console, Group
from rich.live import Live
from rich.panel import Panel
from rich.text import Text

from onboard.core.codes import KindCode, MachineState, Side
from onboard.core.lifts import lift_at, lift_tracks, sill
from onboard.core.site import Segment, Site, Station, TrackKind
from onboard.trace.view import SiteView

#: Pictures a second at most; more only costs the simulation time.
PICTURES_S = 15
#: Lines of events below the picture.
EVENT_LINES = 10

_STATE_WORDS = {
    MachineState.STARTING: "starting",
    MachineState.IDLE: "idle",
    MachineState.WORKING: "working",
    MachineState.WAITING: "waiting",
    MachineState.OBSTACLE: "obstacle",
    MachineState.STOPPED: "stopped",
}


class Clock:
    """Wall time of the simulated day; ``zero`` is the local time of loop time 0."""

    def __init__(self, zero: datetime) -> None:
        self._zero = zero

    def until_next_us(self, time_us: int, every_us: int) -> int:
        """From a loop time to the next full ``every_us`` (a divisor of an hour) of local time, above 0."""
        local = self._zero + timedelta(microseconds=time_us)
        past_us = (local.minute * 60 + local.second) * 1_000_000 + local.microsecond
        return every_us - past_us % every_us

    def at(self, time_us: int) -> str:
        """Local time, to the second."""
        return (self._zero + timedelta(microseconds=time_us)).strftime("%H:%M:%S")


def draw_floor(site: Site, view: SiteView, track: int) -> list[Text]:
    """Three lines: far places, alley with machines, near places and compartments."""
    taken = view.places_taken()
    compartments = {station: view.name(node) for node, station in site.compartments.items()}
    places = set(site.places)
    rows = []
    for side in (Side.FAR, Side.NEAR):
        row = Text((f"{track:>2} {side.name[0]} " if side is Side.FAR else "   N ") + " " * _shaft_width(site))
        for index in range(1, site.tracks[track].length + 1):
            station = Station(track, index, side)
            car = taken.get(station.number)
            if station in compartments:
                row.append("[" + (f"{car.number:^3}" if car else "I/O") + "]", style="bold magenta")
            elif station in places:
                row.append(f"|{car.number:^3}|" if car else "|   |", style="cyan" if car else "dim")
            else:
                row.append("     ")
        rows.append(row)
    rows.insert(1, _alley(site, view, track))
    return rows


def _alley(site: Site, view: SiteView, track: int) -> Text:
    row = Text("     ")
    row.append_text(_shaft(site, view, track, 0))
    here: dict[int, list[int]] = {}
    for node, (segment, _) in view.positions.items():
        machine = site.machines.get(node)
        if segment.track == track and machine is not None and machine.kind is not KindCode.COMPARTMENT:
            here.setdefault(segment.index, []).append(node)
    for index in range(1, site.tracks[track].length + 1):
        nodes = here.get(index)
        if nodes is None:
            row.append("  .  ", style="dim")
        else:
            loaded = any(view.aboard.get(node) is not None for node in nodes)
            row.append(f"{view.name(nodes[0])[:4]:^5}", style="bold reverse green" if loaded else "bold green")
    row.append_text(_shaft(site, view, track, site.tracks[track].length + 1))
    return row


def _shaft_width(site: Site) -> int:
    """Room for the lifts at the left end, where the site has any."""
    return 7 if lift_tracks(site) else 0


def _shaft(site: Site, view: SiteView, track: int, index: int) -> Text:
    """A lift at one end of an alley: its platform with whoever stands on it, or the empty shaft."""
    lift = lift_at(site, Segment(track, index))
    if lift is None:
        return Text(" " * _shaft_width(site))
    node = site.stewards[lift]
    at = view.positions[node][0].index
    if sill(site, lift, at).track != track:
        return Text("   :   ", style="dim")
    aboard = [view.name(n) for n, (segment, _) in view.positions.items() if segment == Segment(track, index)]
    return Text(f"[{aboard[0] if aboard else '=':^5}]", style="bold yellow")


def draw(site: Site, view: SiteView, clock: Clock, line: str) -> Group:
    """The whole picture: floors from the top, machines' states, the last events, one line of figures."""
    floors: list[Text] = []
    for number in sorted((n for n, t in site.tracks.items() if t.kind is TrackKind.ALLEY), reverse=True):
        floors += draw_floor(site, view, number)
    states = Text("   ".join(f"{view.name(n)} {_STATE_WORDS[state]}" for n, state in sorted(view.states.items())))
    events = [Text(f"{clock.at(when)}  {text}", overflow="ellipsis") for when, text in list(view.events)[-EVENT_LINES:]]
    events += [Text("")] * (EVENT_LINES - len(events))
    title = f"{site.name}  {clock.at(view.now_us)}"
    return Group(
        Panel(Group(*floors, Text(""), states), title=title), Panel(Group(*events), title="on the bus"), Text(line)
    )


class TerminalShow:
    """A live picture where output is a terminal, else one plain line each simulated hour, or oftener."""

    def __init__(self, site: Site, view: SiteView, clock: Clock, figures: Callable[[], str], console: Console) -> None:
        self._site = site
        self._view = view
        self._clock = clock
        self._figures = figures
        self._console = console
        self._next_line_us = 0
        self._every_us = 3_600_000_000
        self._last_s = 0.0
        self._live = Live(console=console, auto_refresh=False, transient=True) if console.is_terminal else None

    def __enter__(self) -> Self:
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._live is not None:
            self._live.stop()

    def every(self, every_us: int) -> None:
        """From now on a line each ``every_us`` of simulated time, a divisor of an hour."""
        self._every_us = every_us
        self._next_line_us = 0

    def update(self, now_us: int) -> None:
        """Show the site as it is now, if it is time to."""
        if self._live is None:
            if now_us >= self._next_line_us:
                self._next_line_us = now_us + self._clock.until_next_us(now_us, self._every_us)
                self._console.print(f"{self._clock.at(now_us)}  {self._figures()}", highlight=False, soft_wrap=True)
            return
        now_s = time.monotonic()
        if now_s - self._last_s >= 1 / PICTURES_S:
            self._last_s = now_s
            self._live.update(draw(self._site, self._view, self._clock, self._figures()), refresh=True)
