"""The time-space diagram: position over time on every floor and in every lift, a line a machine.

Light bands are reservations (what firm itineraries still planned, until a newer one replaced them), darker ones
authority (segments whose token a mobile machine held). All of it from the fleet bus.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

from onboard.contract.codes import LegAction, TokenKind
from onboard.contract.constants import MOBILE_KINDS
from onboard.contract.messages import Itinerary, Leg
from onboard.core.serial import ms_after
from onboard.core.site import Segment, Site
from onboard.history.history import History
from onboard.history.places import Place, PlaceTold
from onboard.history.plans import PlanTold
from onboard.history.rights import RightTold
from onboard.systems.car_park.site import CarPark
from onboard.trace.chart.over_time import BOTTOM, GAP, LEFT, RIGHT, TOP, WIDTH, name_machines, time_axis
from onboard.trace.chart.svg import SvgDrawing, colour
from onboard.trace.listener import LoggedMessage
from onboard.ways.lifts import stop_mm
from onboard.ways.site import Track, TrackKind, WaySite, way_site

#: How far from a track's ends its drives may tell of, segments: a platform, and what is missed of its mark.
_BEYOND = 1.5
#: Height of a segment's row at most, of a panel at least, and of the longest at most, pixels.
_ROW, _LEAST_HEIGHT, _MOST_HEIGHT = 14.0, 42.0, 260.0


class TrackPoint(NamedTuple):
    """Where a machine was: us of the log, place along the track in segments from index 1, speed as it said."""

    time_us: int
    place: float
    speed_mm_s: int


class Band(NamedTuple):
    """A stretch of a track over time: places at the beginning and the end, and the node whose it is."""

    node: int
    track: int
    begin_us: int
    end_us: int
    begin: tuple[float, float]
    end: tuple[float, float]


@dataclass
class TrackDiagram:
    """What is drawn: runs of points by node and track, bands of both layers."""

    runs: list[tuple[int, int, list[TrackPoint]]] = field(default_factory=list)
    reservations: list[Band] = field(default_factory=list)
    authority: list[Band] = field(default_factory=list)
    first_us: int = 0
    last_us: int = 0


class Watcher:
    """A view of a history of its own: feed every message, then ``finish``."""

    def __init__(self, site: Site, from_us: int | None = None, until_us: int | None = None) -> None:
        self.picture = TrackDiagram()
        self._site = site
        self._from_us, self._until_us = from_us, until_us
        self._open: dict[int, tuple[int, list[TrackPoint]]] = {}
        self._plans: dict[int, tuple[int, Itinerary]] = {}
        self._held: dict[Segment, tuple[int, int]] = {}
        self._history = History(site)
        self._started = False

    def feed(self, logged: LoggedMessage) -> None:
        """Take up one message of the fleet bus."""
        if self._until_us is not None and logged.time_us > self._until_us:
            return
        if not self._started:
            self._started = True
            self.picture.first_us = logged.time_us if self._from_us is None else self._from_us
        self.picture.last_us = max(self.picture.last_us, logged.time_us)
        match self._history.feed(logged.message, logged.time_us):
            case PlaceTold(node=node, place=place):
                self._on_place(node, place, logged.time_us)
            case PlanTold(plan=plan) as told if told.is_firm:
                self._end_plan(plan.sender, logged.time_us)
                self._plans[plan.sender] = logged.time_us, plan
            case RightTold(kind=TokenKind.SEGMENT) as told if told.giver:
                self._let_go(_segment(told.number), logged.time_us, of=told.giver)
            case RightTold(kind=TokenKind.SEGMENT) as told:
                self._hold(told.number, told.holder, logged.time_us)

    def finish(self) -> TrackDiagram:
        """The log is over: what is still going on ends with it."""
        end_us = self.picture.last_us
        for node, (track, points) in self._open.items():
            points.append(TrackPoint(end_us, points[-1].place, 0))
            self.picture.runs.append((node, track, points))
        for node in list(self._plans):
            self._end_plan(node, end_us)
        for segment in list(self._held):
            self._let_go(segment, end_us)
        first_us = self.picture.first_us
        self.picture.reservations = [band for band in self.picture.reservations if band.end_us > first_us]
        self.picture.authority = [band for band in self.picture.authority if band.end_us > first_us]
        return self.picture

    def _on_place(self, node: int, at: Place, time_us: int) -> None:
        segment = at.segment
        track = way_site(self._site).tracks.get(segment.track)
        if track is None:
            return
        place = segment.index - 1 + at.offset_mm / track.pitch_mm
        if not -_BEYOND <= place <= track.length - 1 + _BEYOND:
            # On the way through a lift in line, told by the track that it left.
            return
        point = TrackPoint(time_us, place, at.speed_mm_s)
        run = self._open.get(node)
        if run is not None and run[0] == segment.track:
            run[1].append(point)
            return
        if run is not None:
            self.picture.runs.append((node, *run))
        self._open[node] = segment.track, [point]

    def _end_plan(self, node: int, end_us: int) -> None:
        """Bands of a plan as long as it stood."""
        told_us, plan = self._plans.pop(node, (0, None))
        if plan is None:
            return
        begin_us = self._moment_us(plan.stamp.award_ms, told_us)
        for leg in plan.legs:
            until_us = self._moment_us(leg.end_ms, told_us)
            band = _cut(_band(node, leg, begin_us, until_us), told_us, end_us)
            if band is not None and leg.track in way_site(self._site).tracks and leg.action is not LegAction.RIDE:
                self.picture.reservations.append(band)
            begin_us = until_us

    def _hold(self, token: int, node: int, time_us: int) -> None:
        segment = _segment(token)
        machine = self._site.machines.get(node)
        if machine is None or machine.kind not in MOBILE_KINDS or segment.track not in way_site(self._site).tracks:
            return
        if segment.track in way_site(self._site).lifts or self._held.get(segment, (0, 0))[0] == node:
            return
        self._let_go(segment, time_us)
        self._held[segment] = node, time_us

    def _let_go(self, segment: Segment, time_us: int, of: int | None = None) -> None:
        node, since_us = self._held.get(segment, (0, 0))
        if not node or of not in (None, node):
            return
        del self._held[segment]
        around = (segment.index - 1.5, segment.index - 0.5)
        self.picture.authority.append(Band(node, segment.track, since_us, time_us, around, around))

    def _moment_us(self, bus_ms: int, near_us: int) -> int:
        return near_us + 1000 * ms_after(bus_ms, (near_us - (self._history.clock.offset_us or 0)) // 1000)


def _segment(token: int) -> Segment:
    return Segment(token >> 8, token & 0xFF)


def _band(node: int, leg: Leg, begin_us: int, end_us: int) -> Band:
    start, stop = leg.from_index - 1.0, leg.to_index - 1.0
    return Band(node, leg.track, begin_us, end_us, (start - 0.5, start + 0.5), (stop - 0.5, stop + 0.5))


def _cut(band: Band, from_us: int, until_us: int) -> Band | None:
    """The part of a band within a time, None where nothing is left."""
    begin_us, end_us = max(band.begin_us, from_us), min(band.end_us, until_us)
    if begin_us >= end_us:
        return None

    def at(time_us: int) -> tuple[float, float]:
        share = (time_us - band.begin_us) / (band.end_us - band.begin_us)
        low, high = (one + (two - one) * share for one, two in zip(band.begin, band.end, strict=True))
        return low, high

    return band._replace(begin_us=begin_us, end_us=end_us, begin=at(begin_us), end=at(end_us))


def watch(
    site: Site, logged: Iterable[LoggedMessage], from_us: int | None = None, until_us: int | None = None
) -> TrackDiagram:
    """What a log of the fleet bus shows, within a time of it."""
    watcher = Watcher(site, from_us, until_us)
    for one in logged:
        if one.is_fleet:
            watcher.feed(one)
    return watcher.finish()


def draw(site: Site, picture: TrackDiagram, start_us: int) -> SvgDrawing:
    """The diagram: a panel for each alley, spur and lift; seconds since ``start_us`` along the top.

    The highest floor comes first, lifts last with their highest floor at the top; all panels have one scale.
    """
    ways = way_site(site)
    tracks = sorted(ways.tracks.values(), key=lambda one: _order(ways, one))
    lengths = {track.number: _segments(ways, track) for track in tracks}
    longest_mm = max((lengths[track.number] + 2) * track.pitch_mm for track in tracks)
    px_mm = min(_ROW / min(track.pitch_mm for track in tracks), _MOST_HEIGHT / longest_mm)
    heights = [max(_LEAST_HEIGHT, (lengths[track.number] + 2) * track.pitch_mm * px_mm) for track in tracks]
    drawing = SvgDrawing(WIDTH, TOP + sum(heights) + GAP * len(tracks) + BOTTOM, f"{site.name}: time and space")
    numbers = {node: number for number, node in enumerate(sorted(site.machines))}
    moving = [site.machines[node] for node in sorted({node for node, _, _ in picture.runs} & set(site.machines))]
    names = [(machine.name, numbers[machine.node_id]) for machine in moving]
    name_machines(drawing, names, "light band: reserved; dark band: authority held")
    span_us = max(1, picture.last_us - picture.first_us)
    scale = (WIDTH - LEFT - RIGHT) / span_us
    top = float(TOP)
    for track, height in zip(tracks, heights, strict=True):
        is_lift = track.number in ways.lifts
        drawing.area([(LEFT, top), (WIDTH - RIGHT, top), (WIDTH - RIGHT, top + height), (LEFT, top + height)],
                     "#f3f3f3", opacity=1)  # fmt: skip
        drawing.text(8, top + 12, _panel_name(ways, track))
        speed_mm_s = (ways.lift if is_lift else ways.carrier).speed_mm_s
        panel = _Panel(
            drawing,
            picture,
            track.number,
            top,
            height,
            lengths[track.number],
            scale,
            track.pitch_mm,
            max(1, speed_mm_s),
        )
        if is_lift:
            panel.levels = [ways.level(sill.track) for sill in track.joins]
            panel.stops = [stop_mm(ways, track.number, stop) / track.pitch_mm for stop in range(1, track.length + 1)]
        panel.rows()
        panel.bands(picture.reservations, numbers, 0.22, "reserved", site)
        panel.bands(picture.authority, numbers, 0.38, "authority", site)
        panel.runs(numbers)
        top += height + GAP
    time_axis(drawing, picture.first_us, picture.last_us, start_us, top)
    return drawing


def _panel_name(ways: WaySite, track: Track) -> str:
    """A track by its floor and the name that the site file gives it."""
    if track.kind is TrackKind.LIFT:
        return f"lift {next((one.name for one in ways.machines.values() if one.home.track == track.number), '')}"
    floor = f"floor {ways.level(track.number)}"
    if track.kind is TrackKind.SPUR:
        return f"{floor}, spur {track.number}"
    name = ways.alley_names.get(track.number) if isinstance(ways, CarPark) else None
    if name:
        return f"{floor}, alley {name}"
    return f"{floor}, lobby" if track.ends else floor


def _segments(ways: WaySite, track: Track) -> float:
    """How long a track is in its pitches: a shaft from its lowest stop to its highest, and one floor."""
    return (
        1 + stop_mm(ways, track.number, track.length) / track.pitch_mm if track.number in ways.lifts else track.length
    )


def _order(ways: WaySite, track: Track) -> tuple[int, int]:
    """Floors from the highest, each with its spurs, then lifts."""
    return (0 if track.kind is TrackKind.LIFT else -ways.level(track.number)), track.number


@dataclass
class _Panel:
    drawing: SvgDrawing
    picture: TrackDiagram
    track: int
    top: float
    height: float
    length: float
    scale: float
    pitch_mm: int
    speed_mm_s: int
    #: Of a lift: the floors of its stops, and their heights in pitches; it has the highest at the top.
    levels: list[int] = field(default_factory=list)
    stops: list[float] = field(default_factory=list)

    def x(self, time_us: float) -> float:
        return min(WIDTH - RIGHT, max(LEFT, LEFT + (time_us - self.picture.first_us) * self.scale))

    def y(self, place: float) -> float:
        """Platforms lie beside an alley, at both ends: places -1 and the length."""
        share = (self._along(place) + 1.5) / (self.length + 2)
        share = 1 - share if self.stops else share
        return self.top + self.height * min(1.0, max(0.0, share))

    def _along(self, place: float) -> float:
        """Where a place is in pitches: between a lift's stops by their heights."""
        if not self.stops:
            return place
        low = max(0, min(len(self.stops) - 1, int(place)))
        high = min(len(self.stops) - 1, low + 1)
        return self.stops[low] + (self.stops[high] - self.stops[low]) * min(1.0, max(0.0, place - low))

    def rows(self) -> None:
        every = max(1, round(12 / (self.height / (self.length + 2))))
        for index in range(1, (len(self.levels) or round(self.length)) + 1, every):
            label = f"floor {self.levels[index - 1]}" if self.levels else f"p({self.track},{index})"
            self.drawing.text(LEFT - 4, self.y(index - 1) + 4, label, anchor="end", fill="#666666")

    def bands(self, bands: list[Band], numbers: dict[int, int], opacity: float, what: str, site: Site) -> None:
        for band in bands:
            if band.track == self.track and band.node in numbers:
                x1, x2 = self.x(band.begin_us), self.x(band.end_us)
                points = [(x1, self.y(band.begin[0])), (x2, self.y(band.end[0])), (x2, self.y(band.end[1]))]
                points.append((x1, self.y(band.begin[1])))
                note = f"{site.machines[band.node].name}: {what}"
                self.drawing.area(points, colour(numbers[band.node]), opacity=opacity, note=note)

    def runs(self, numbers: dict[int, int]) -> None:
        for node, track, points in self.picture.runs:
            if track == self.track and node in numbers and points[-1].time_us >= self.picture.first_us:
                line = [
                    (self.x(time_us), self.y(place)) for time_us, place in _line(points, self.pitch_mm, self.speed_mm_s)
                ]
                self.drawing.way(line, numbers[node], width=2)


def _line(points: list[TrackPoint], pitch_mm: int, speed_mm_s: int) -> list[tuple[float, float]]:
    """Points to draw through: a machine that said it stands did so until it must have started for the next point."""
    found: list[tuple[float, float]] = []
    for before, after in pairwise(points):
        found.append((before.time_us, before.place))
        if before.speed_mm_s == 0:
            # Evenly accelerated from a stand, or braked to one, it took twice the time of going at that speed.
            way_mm = abs(after.place - before.place) * pitch_mm
            spent_us = 2e6 * way_mm / abs(after.speed_mm_s or speed_mm_s)
            found.append((max(before.time_us, after.time_us - spent_us), before.place))
    last = points[-1]
    return [*found, (last.time_us, last.place)]


class TimeSpace:
    """The diagram of a log: fed with the fleet bus, within a time of it."""

    def __init__(self, site: Site, from_us: int | None, until_us: int | None) -> None:
        self._site = site
        self._watcher = Watcher(site, from_us, until_us)

    @property
    def first_us(self) -> int:
        """The first time that is shown, us of the log."""
        return self._watcher.picture.first_us

    @property
    def last_us(self) -> int:
        """When the last message was heard, time of the log in us."""
        return self._watcher.picture.last_us

    def feed(self, logged: LoggedMessage) -> None:
        """Take up one message of the fleet bus."""
        self._watcher.feed(logged)

    def draw(self, start_us: int) -> SvgDrawing:
        """The diagram of all that was heard; its time axis begins at ``start_us``."""
        return draw(self._site, self._watcher.finish(), start_us)


DIAGRAM = TimeSpace
