"""The site as it happens, in a terminal: drawn from what the fleet bus says, and nothing else."""

import time
from collections.abc import Callable
from datetime import datetime, timedelta

from rich.console import Console, Group
from rich.text import Text

from bus_sim.systems.car_park.car_labels import bay_letters, car_labels
from bus_sim.systems.car_park.show_plan import draw_plans
from bus_sim.systems.car_park.slots import AHEAD, AHEAD_STYLE, ahead, boxed, named, style, text_columns
from bus_sim.systems.picture import LiveOutput
from onboard.contract.codes import KindCode, MachineState, Side
from onboard.core.site import Segment, Station
from onboard.systems.car_park.outlines import is_elevation, shifts
from onboard.systems.car_park.site import car_park
from onboard.trace.view import SiteView
from onboard.ways.kept import Kept
from onboard.ways.lifts import lift_at, lift_tracks, sill
from onboard.ways.site import TrackKind, WaySite

#: Pictures a second at most; more only costs the simulation time.
PICTURES_S = 15
#: Lines of events below a picture of no given height; of a low one as many if the floors leave them.
EVENT_LINES, FEWEST_EVENTS = 10, 3
#: Lines of one floor: far places, alley, near places.
FLOOR_LINES = 3
#: Lines of a picture that nothing bounds.
_ENOUGH = 1_000

#: Columns before an alley: its floor and side.
_LABEL = 5
_STATE_WORDS = {
    MachineState.STARTING: "starting",
    MachineState.IDLE: "idle",
    MachineState.WORKING: "working",
    MachineState.WAITING: "waiting",
    MachineState.OBSTACLE: "obstacle",
    MachineState.STOPPED: "stopped",
}


class DayClock:
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
CELLS = (5, 3, 2, 1)


_shifts: Kept[WaySite, dict[int, int]] = Kept(lambda site: shifts(car_park(site)))


def shift(site: WaySite, track: int) -> int:
    """Positions by which an alley begins to the right of the leftmost, as shafts at right ends join them."""
    return _shifts.of(site).get(track, 0)


def cell_width(site: WaySite, width: int) -> int:
    """Columns for one position, so that the longest alley fits in ``width`` columns if any does."""
    length = max(shift(site, t.number) + t.length for t in site.tracks.values() if t.kind is TrackKind.ALLEY)
    return next(
        (cell for cell in CELLS if _LABEL + 2 * _shaft_width(site, cell) + length * cell + 4 <= width), CELLS[-1]
    )


def draw_floor(site: WaySite, view: SiteView, track: int, cell: int = CELLS[0]) -> list[Text]:
    """Three lines: far places, alley with machines and plans, near places and bays; ``cell`` columns a position.

    A spur is drawn in round brackets beside its mouth, with whoever stands in it. Cars have short names
    (``car_labels``), the same on every floor.
    """
    taken = view.history.loads.standing()
    labels = car_labels(taken.values(), bay_letters(site.compartments), text_columns(cell))
    compartments = set(site.compartments.values())
    places = set(site.places)
    rows = []
    for side in (Side.FAR, Side.NEAR):
        label = f"{track:>2} {side.name[0]} " if side is Side.FAR else "   N "
        before = _shaft_width(site, cell) + shift(site, track) * cell
        row = Text(label + " " * before, no_wrap=True, overflow="crop")
        for index in range(1, site.tracks[track].length + 1):
            station = Station(track, index, side)
            car = taken.get(station.number)
            if station in compartments:
                row.append(boxed(labels[car] if car else "I/O", "[]", cell), style="bold magenta")
            elif station in places:
                row.append(boxed(labels[car] if car else "", "||", cell), style="cyan" if car else "dim")
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
    node = next((node for node, place in view.history.places.by_node.items() if place.segment == inside), None)
    if node is None:
        return Text(boxed("", "()", cell), style="dim")
    return Text(boxed(view.name(node)[-3:], "()", cell), style=style(view, [node]))


def _alley(site: WaySite, view: SiteView, track: int, cell: int) -> Text:
    row = Text(" " * (_LABEL + shift(site, track) * cell), no_wrap=True, overflow="crop")
    row.append_text(_shaft(site, view, track, 0, cell))
    here: dict[int, list[int]] = {}
    for node, place in view.history.places.by_node.items():
        machine, segment = site.machines.get(node), place.segment
        if machine is None or machine.kind is KindCode.COMPARTMENT:
            continue
        # Index 0 of a spur is its mouth: whoever is there turns.
        at = site.tracks[segment.track].joins[0] if _is_turning(site, segment) else segment
        if at.track == track:
            here.setdefault(at.index, []).append(node)
    planned = ahead(view)
    for index in range(1, site.tracks[track].length + 1):
        nodes = here.get(index)
        if nodes is None and Segment(track, index) in planned:
            row.append(f"{AHEAD:^{cell}}", style=AHEAD_STYLE)
        elif nodes is None:
            row.append(f"{'.':^{cell}}", style="dim")
        else:
            row.append(named(view, nodes[0], cell), style=style(view, nodes))
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
    node, places = site.stewards[lift], view.history.places.by_node
    at = places[node].segment.index
    if sill(site, lift, at).track != track:
        return Text(f"{':':^{width}}", style="dim")
    aboard = [view.name(n) for n, place in places.items() if place.segment == Segment(track, index)]
    return Text(f"[{aboard[0][-(width - 2) :] if aboard else '=':^{width - 2}}]", style="bold yellow")


def _alley_line(site: WaySite, view: SiteView, track: int, cell: int) -> Text:
    """A floor in one line, where there is no room for three: where nobody is, its cars as marks above and below."""
    row = _alley(site, view, track, cell)
    taken, desks = view.history.loads.standing(), set(site.compartments.values())
    plain = list(row.plain)
    first = _LABEL + _shaft_width(site, cell) + shift(site, track) * cell
    for index in range(1, site.tracks[track].length + 1):
        far, near = Station(track, index, Side.FAR), Station(track, index, Side.NEAR)
        at = first + (index - 1) * cell + (cell - 1) // 2
        if plain[at] in {".", AHEAD}:
            has = (far.number in taken, near.number in taken)
            plain[at] = "C" if {far, near} & desks else _MARKS[has] if any(has) else plain[at]
    label = f"{track:>2}".ljust(_LABEL)
    line = Text(label + "".join(plain[_LABEL:]), no_wrap=True, overflow="crop")
    line.spans = list(row.spans)
    return line


#: Cars at the far and at the near place of a position, in one column.
_MARKS = {(False, False): ".", (True, False): "'", (False, True): ",", (True, True): ":"}


def _states(view: SiteView, width: int) -> list[Text]:
    """What each machine does, in columns."""
    words = [f"{view.name(node)} {_STATE_WORDS[state]}" for node, state in sorted(view.history.lives.states.items())]
    column = max((len(word) for word in words), default=0) + 2
    a_line = max(1, width // column)
    return [
        _line("".join(word.ljust(column) for word in words[at : at + a_line]).rstrip())
        for at in range(0, len(words), a_line)
    ]


def _line(text: str, style: str = "") -> Text:
    return Text(text, style=style, no_wrap=True, overflow="ellipsis")


def _headed(text: str, width: int) -> Text:
    return _line(f"-- {text} ".ljust(width, "-"), "bold")


def _floors(site: WaySite, view: SiteView, width: int, room: int, events: int) -> list[Text]:
    """All floors, the highest first, so that ``events`` of ``room`` lines are left.

    Each has three lines, or one where that is too much; what has no room even so are the highest. Where floors are more
    than an alley each they are drawn from above.
    """
    park = car_park(site)
    if not is_elevation(park):
        return draw_plans(park, view, width, None if room >= _ENOUGH else max(1, room - events))
    cell = cell_width(park, width)
    tracks = sorted((n for n, t in site.tracks.items() if t.kind is TrackKind.ALLEY), reverse=True)
    if FLOOR_LINES * len(tracks) + events <= room:
        return [row for track in tracks for row in draw_floor(site, view, track, cell)]
    return [_alley_line(site, view, track, cell) for track in tracks[-max(1, room - 1) :]]


def draw(
    site: WaySite,
    view: SiteView,
    clock: DayClock,
    line: str,
    width: int = 120,
    height: int | None = None,
    address: str | None = None,
) -> Group:
    """The picture in ``width`` columns and ``height`` lines: floors from the top, machines' states, the last events.

    The newest event, the ``line`` of figures and the page's ``address`` are always there, from seven lines on: floors
    shrink first. Where there is more room the events have it; without a height they are ten.
    """
    legend = "".join(f"  {letter} {view.name(node)}" for node, letter in bay_letters(site.compartments).items())
    head, bus = _headed(f"{site.name}  {clock.at(view.now_us)}{legend}", width), _headed("on the bus", width)
    foot = [_line(line, "reverse")] + ([_line(f"picture at {address}")] if address is not None else [])
    states = _states(view, width)
    if height is None:
        floors, lines = _floors(site, view, width, _ENOUGH, EVENT_LINES), EVENT_LINES
    else:
        room = height - len(foot) - 2
        if room - len(states) < FEWEST_EVENTS:
            states = []
        floors = _floors(site, view, width, room - len(states), FEWEST_EVENTS)
        lines = room - len(states) - len(floors)
    said = list(dict.fromkeys((clock.at(when), text) for when, text in view.events))
    events = [_line(f"{when}  {text}") for when, text in said[-lines:]]
    events += [Text("")] * (lines - len(events))
    return Group(head, *floors, *states, bus, *events, *foot)


class ConsoleShow(LiveOutput):
    """A live picture where output is a terminal, else one plain line each simulated hour, or oftener."""

    def __init__(
        self, site: WaySite, view: SiteView, clock: DayClock, figures: Callable[[], str], console: Console
    ) -> None:
        super().__init__(console, shown=console.is_terminal)
        self._site = site
        self._view = view
        self._clock = clock
        self._figures = figures
        self._console = console
        self._next_line_us = 0
        self._every_us = 3_600_000_000
        self._last_s = 0.0

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
            width, height = self._console.size
            picture = draw(self._site, self._view, self._clock, self._figures(), width, height, self.address)
            self._live.update(picture, refresh=True)
