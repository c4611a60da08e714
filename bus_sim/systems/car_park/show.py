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
from onboard.core.site import Segment, Station
from onboard.trace.view import SiteView
from onboard.ways.lifts import lift_at, lift_tracks, sill
from onboard.ways.site import TrackKind, WaySite

#: Pictures a second at most; more only costs the simulation time.
PICTURES_S = 15
#: Lines of events below the picture.
EVENT_LINES = 10

#: Columns before an alley: its floor and side.
_LABEL = 5
_LOADED = "bold reverse green"
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


#: Columns that one position takes, widest first; the widest that fits is used.
CELLS = (5, 3, 2)


def cell_width(site: WaySite, width: int) -> int:
    """Columns for one position, so that the longest alley fits in ``width`` columns if any does."""
    length = max(track.length for track in site.tracks.values() if track.kind is TrackKind.ALLEY)
    return next(
        (cell for cell in CELLS if _LABEL + 2 * _shaft_width(site, cell) + length * cell + 4 <= width), CELLS[-1]
    )


def draw_floor(site: WaySite, view: SiteView, track: int, cell: int = CELLS[0]) -> list[Text]:
    """Three lines: far places, alley with machines, near places and compartments; ``cell`` columns a position.

    A spur is drawn in round brackets beside its mouth, with whoever stands in it.
    """
    taken = view.places_taken()
    compartments = set(site.compartments.values())
    places = set(site.places)
    rows = []
    for side in (Side.FAR, Side.NEAR):
        label = f"{track:>2} {side.name[0]} " if side is Side.FAR else "   N "
        row = Text(label + " " * _shaft_width(site, cell), no_wrap=True, overflow="crop")
        for index in range(1, site.tracks[track].length + 1):
            station = Station(track, index, side)
            car = taken.get(station.number)
            if station in compartments:
                row.append(_boxed(str(car.number) if car else "I/O", "[]", cell), style="bold magenta")
            elif station in places:
                row.append(_boxed(str(car.number) if car else "", "||", cell), style="cyan" if car else "dim")
            elif site.spurs.get(station.segment) is not None and _is_at_spur(station, places | compartments):
                row.append_text(_spur(view, Segment(site.spurs[station.segment], 1), cell))
            else:
                row.append(" " * cell)
        rows.append(row)
    rows.insert(1, _alley(site, view, track, cell))
    return rows


def _is_at_spur(station: Station, stations: set[Station]) -> bool:
    """Whether a spur is drawn on this side of its mouth: the far one unless cars stand there."""
    return station.side is Side.FAR or station._replace(side=Side.FAR) in stations


def _spur(view: SiteView, inside: Segment, cell: int) -> Text:
    node = next((node for node, (segment, _) in view.positions.items() if segment == inside), None)
    if node is None:
        return Text(_boxed("", "()", cell), style="dim")
    return Text(_boxed(view.name(node)[-3:], "()", cell), style=_style(view, [node]))


def _style(view: SiteView, nodes: list[int]) -> str:
    """Of machines drawn in one place: whether any of them carries a car."""
    return _LOADED if any(view.aboard.get(node) is not None for node in nodes) else "bold green"


def _boxed(text: str, box: str, cell: int) -> str:
    """Text of one position; a narrow one has no walls, and an empty place is a dash."""
    if cell >= CELLS[0]:
        return f"{box[0]}{text[-3:]:^3}{box[1]}"
    return f"{text[-cell:] or '-':^{cell}}"


def _alley(site: WaySite, view: SiteView, track: int, cell: int) -> Text:
    row = Text(" " * _LABEL, no_wrap=True, overflow="crop")
    row.append_text(_shaft(site, view, track, 0, cell))
    here: dict[int, list[int]] = {}
    for node, (segment, _) in view.positions.items():
        machine = site.machines.get(node)
        if machine is None or machine.kind is KindCode.COMPARTMENT:
            continue
        # Index 0 of a spur is its mouth: whoever is there turns.
        at = site.tracks[segment.track].joins[0] if _is_turning(site, segment) else segment
        if at.track == track:
            here.setdefault(at.index, []).append(node)
    for index in range(1, site.tracks[track].length + 1):
        nodes = here.get(index)
        if nodes is None:
            row.append(f"{'.':^{cell}}", style="dim")
        else:
            name = view.name(nodes[0])
            row.append(f"{name[:4] if cell > 4 else name[-cell:]:^{cell}}", style=_style(view, nodes))
    row.append_text(_shaft(site, view, track, site.tracks[track].length + 1, cell))
    return row


def _is_turning(site: WaySite, at: Segment) -> bool:
    track = site.tracks.get(at.track)
    return track is not None and track.kind is TrackKind.SPUR and at.index == 0


def _shaft_width(site: WaySite, cell: int) -> int:
    """Room for the lifts at the left end, where the site has any."""
    return min(7, cell + 2) if lift_tracks(site) else 0


def _shaft(site: WaySite, view: SiteView, track: int, index: int, cell: int) -> Text:
    """A lift at one end of an alley: its platform with whoever stands on it, or the empty shaft."""
    width = _shaft_width(site, cell)
    lift = lift_at(site, Segment(track, index))
    if lift is None:
        return Text(" " * width)
    node = site.stewards[lift]
    at = view.positions[node][0].index
    if sill(site, lift, at).track != track:
        return Text(f"{':':^{width}}", style="dim")
    aboard = [view.name(n) for n, (segment, _) in view.positions.items() if segment == Segment(track, index)]
    return Text(f"[{aboard[0][-(width - 2) :] if aboard else '=':^{width - 2}}]", style="bold yellow")


def draw(site: WaySite, view: SiteView, clock: Clock, line: str, width: int = 120) -> Group:
    """The picture in ``width`` columns: floors from the top, machines' states, the last events, a line of figures."""
    floors: list[Text] = []
    cell = cell_width(site, width)
    for number in sorted((n for n, t in site.tracks.items() if t.kind is TrackKind.ALLEY), reverse=True):
        floors += draw_floor(site, view, number, cell)
    states = Text("   ".join(f"{view.name(n)} {_STATE_WORDS[state]}" for n, state in sorted(view.states.items())))
    said = dict.fromkeys((clock.at(when), text) for when, text in view.events)
    events = [Text(f"{when}  {text}", no_wrap=True, overflow="ellipsis") for when, text in list(said)[-EVENT_LINES:]]
    events += [Text("")] * (EVENT_LINES - len(events))
    title = f"{site.name}  {clock.at(view.now_us)}"
    return Group(
        Panel(Group(*floors, Text(""), states), title=title), Panel(Group(*events), title="on the bus"), Text(line)
    )


class TerminalShow:
    """A live picture where output is a terminal, else one plain line each simulated hour, or oftener."""

    def __init__(
        self, site: WaySite, view: SiteView, clock: Clock, figures: Callable[[], str], console: Console
    ) -> None:
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
            width = self._console.width
            self._live.update(draw(self._site, self._view, self._clock, self._figures(), width), refresh=True)
