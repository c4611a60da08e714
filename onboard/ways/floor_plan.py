"""Where everything lies, in mm: from the links and lifts of a site, each track a straight line.

Of each floor the first alley that hangs together with nothing placed yet begins at the origin. A linked end lies one
pitch beside its mouth, at a right angle; a lift's platform one pitch beyond each of its sills, at one place of all
floors. What can be reached both ways round must come to the same place.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from onboard.contract.codes import Side
from onboard.core.site import Segment
from onboard.ways.lifts import is_same_stop
from onboard.ways.site import Track, TrackKind, WaySite


class Point(NamedTuple):
    """A place in the plan of the building, mm."""

    x_mm: int
    y_mm: int

    def __str__(self) -> str:
        return f"({self.x_mm}, {self.y_mm}) mm"


class Line(NamedTuple):
    """A track: the centre of index 1, and the direction of growing index, a unit along one axis. FAR is to its left."""

    x_mm: int
    y_mm: int
    dx: int
    dy: int


class Mismatch(NamedTuple):
    """A loop that does not close: a track's end is ``here`` by itself and ``there`` by the segment beside it.

    Of a lift the platform is ``here`` behind this sill and ``there`` behind its first.
    """

    track: int
    beside: Segment
    here: Point
    there: Point


@dataclass
class FloorPlan:
    """Lines of alleys and spurs, centres of lifts' platforms, and where a loop does not close."""

    lines: dict[int, Line] = field(default_factory=dict)
    shafts: dict[int, Point] = field(default_factory=dict)
    mismatches: tuple[Mismatch, ...] = ()


#: A loop that closes to this is closed, mm: what a carrier's marks allow.
TOLERANCE_MM = 5


def at_mm(plan: FloorPlan, site: WaySite, segment: Segment) -> Point:
    """The centre of a segment of an alley or spur; of index 0 and length + 1, the place beyond its end."""
    return _along(plan.lines[segment.track], segment.index, site.tracks[segment.track].pitch_mm)


def beside(line: Line, side: Side) -> tuple[int, int]:
    """The unit direction to one side of a line."""
    return (-line.dy, line.dx) if side is Side.FAR else (line.dy, -line.dx)


def floor_plan(site: WaySite) -> FloorPlan:
    """The plan of a site. A straight one has its alleys above each other; of different lengths, by the first lift."""
    plan = FloorPlan()
    order = sorted(site.tracks.values(), key=lambda one: (len(one.ends), one.number))
    for track in order:
        if track.kind is not TrackKind.LIFT and track.number not in plan.lines:
            plan.lines[track.number] = Line(0, 0, 1, 0)
            _spread(plan, site, track.number)
    for track in order:
        if track.kind is TrackKind.LIFT and track.joins:
            plan.shafts[track.number] = at_mm(plan, site, site.beyond(track.joins[0]))
    plan.mismatches = tuple(_mismatches(plan, site))
    return plan


def _spread(plan: FloorPlan, site: WaySite, first: int) -> None:
    """Place all that hangs together with a track; by a second link of a track only where nothing else is left."""
    sure, guessed = deque([first]), deque[int]()
    while sure or guessed:
        is_sure = bool(sure)
        here = sure.popleft() if sure else guessed.popleft()
        guessed += [here] if is_sure else []
        found = [*_by_lifts(plan, site, here)] if is_sure else []
        for number, line in [*found, *_through_mouths(plan, site, here, by_sides=is_sure)]:
            if number not in plan.lines:
                plan.lines[number] = line
                sure.append(number)


def _through_mouths(plan: FloorPlan, site: WaySite, here: int, *, by_sides: bool) -> Iterator[tuple[int, Line]]:
    """Tracks that a track is linked to: by links whose side the site tells, or by the others."""
    for mouth, ends in site.links.items():
        for end in ends:
            track = site.tracks[end.track]
            if (end.index == 0 or track.low is None) is not by_sides:
                continue
            if mouth.track == here:
                yield end.track, _off(plan, site, track, end.index, mouth)
            elif end.track == here:
                yield mouth.track, _back(plan, site, track, end.index, mouth)


def _off(plan: FloorPlan, site: WaySite, track: Track, index: int, mouth: Segment) -> Line:
    """A track that goes off from a mouth on a line that is placed."""
    dx, dy = beside(plan.lines[mouth.track], side_of(track, index))
    sign = 1 if index == 0 else -1
    at = at_mm(plan, site, mouth)
    return _from(at, sign * dx, sign * dy, index, track.pitch_mm)


def _back(plan: FloorPlan, site: WaySite, track: Track, index: int, mouth: Segment) -> Line:
    """The line of a mouth's track, from a track that is placed."""
    line = plan.lines[track.number]
    away = (line.dx, line.dy) if index == 0 else (-line.dx, -line.dy)
    dx, dy = (away[1], -away[0]) if side_of(track, index) is Side.FAR else (-away[1], away[0])
    at = _along(line, index, track.pitch_mm)
    return _from(at, dx, dy, mouth.index, site.tracks[mouth.track].pitch_mm)


def side_of(track: Track, index: int) -> Side:
    """On which side of its mouth's track a linked end goes off.

    A track that is linked at both ends leaves one side of its low mouth's track for the other side of the high one's,
    as between two alleys that go the same way; where it does not, both are placed by other links.
    """
    return track.side if index == 0 or track.low is None else Side(1 - track.side)


def _by_lifts(plan: FloorPlan, site: WaySite, here: int) -> Iterator[tuple[int, Line]]:
    line = plan.lines[here]
    for lift in site.lifts:
        joins = site.tracks[lift].joins
        doors = [(site.beyond(sill), _face(site, lift, stop)) for stop, sill in enumerate(joins, start=1)]
        for platform, face in [door for door in doors if door[0].track == here]:
            at = at_mm(plan, site, platform)
            for other, other_face in doors:
                is_alike = (platform.index == 0) is (other.index == 0)
                turn = 1 if is_alike is (face == other_face) else -1
                yield other.track, _from(at, turn * line.dx, turn * line.dy, other.index, _pitch(site, other))


def _face(site: WaySite, lift: int, stop: int) -> int:
    """On which face of the platform a door is: the first one of every stop on face 0, the second on the other."""
    return 1 if stop > 1 and is_same_stop(site, lift, stop - 1, stop) else 0


def _mismatches(plan: FloorPlan, site: WaySite) -> list[Mismatch]:
    found = []
    for mouth, ends in site.links.items():
        for end in ends:
            here, there = at_mm(plan, site, end), at_mm(plan, site, mouth)
            if _apart(here, there) or site.across(end.track) is site.across(mouth.track):
                found.append(Mismatch(end.track, mouth, here, there))
    for lift, shaft in plan.shafts.items():
        for sill in site.tracks[lift].joins:
            here = at_mm(plan, site, site.beyond(sill))
            if _apart(here, shaft):
                found.append(Mismatch(lift, sill, here, shaft))
    return found


def _along(line: Line, index: int, pitch_mm: int) -> Point:
    return Point(line.x_mm + (index - 1) * pitch_mm * line.dx, line.y_mm + (index - 1) * pitch_mm * line.dy)


def _from(at: Point, dx: int, dy: int, index: int, pitch_mm: int) -> Line:
    """The line on which ``index`` is at a place."""
    return Line(at.x_mm - (index - 1) * pitch_mm * dx, at.y_mm - (index - 1) * pitch_mm * dy, dx, dy)


def _pitch(site: WaySite, segment: Segment) -> int:
    return site.tracks[segment.track].pitch_mm


def _apart(one: Point, other: Point) -> bool:
    return abs(one.x_mm - other.x_mm) > TOLERANCE_MM or abs(one.y_mm - other.y_mm) > TOLERANCE_MM
