"""Stage 4 (row P25): where each tool goes.

Machine co-ordinates: z 0 at the finished face and falling towards the chuck, x the radius, both in mm.
"""

from dataclasses import dataclass
from itertools import pairwise
from math import atan2, ceil, cos, hypot, pi, remainder, sin
from typing import NamedTuple

from onboard.systems.turning.conditions import ALLOWANCE_MM, Conditions
from onboard.systems.turning.drawing import At, ContourElement, Drawing
from onboard.systems.turning.lathe import Lathe, LatheOperation, TurningJob

#: How far a tool keeps from the bar in rapid moves, mm: an ordinary clearance, from no standard.
CLEAR_MM = 2.0
#: How far a roughing cut is left before going back, mm: enough that the insert does not rub.
LIFT_MM = 0.5
#: Pieces into which a slanted or round cut is divided to work out its time.
_PIECES = 16


class Xz(NamedTuple):
    """A tool position, mm: radius and length."""

    x_mm: float
    z_mm: float


@dataclass(frozen=True, slots=True)
class Cut:
    """One move to ``end``. ``rapid``: not cutting. ``centre``: of an arc; ``convex`` tells on which side."""

    end: Xz
    rapid: bool = False
    centre: Xz | None = None
    convex: bool = False


@dataclass(frozen=True, slots=True)
class Trajectory:
    """The moves of one operation under its conditions, from ``start``, which is reached in rapid."""

    conditions: Conditions
    start: Xz
    cuts: tuple[Cut, ...]


def trajectories(job: TurningJob, drawing: Drawing, conditions: tuple[Conditions, ...]) -> tuple[Trajectory, ...]:
    """The paths of all operations, in order."""
    makers = {LatheOperation.FACE: _face, LatheOperation.ROUGH: _rough, LatheOperation.FINISH: _finish}
    return tuple(makers[one.work](job, drawing, one) for one in conditions)


def _face(job: TurningJob, drawing: Drawing, conditions: Conditions) -> Trajectory:
    """From outside to the axis, in as many cuts as the depth asks for; the last one makes the face."""
    outside_mm = job.bar_mm / 2 + CLEAR_MM
    count = ceil(job.face_mm / conditions.depth_mm)
    cuts: list[Cut] = []
    for number in range(1, count + 1):
        z_mm = job.face_mm * (count - number) / count
        cuts += [Cut(Xz(outside_mm, z_mm), rapid=True), Cut(Xz(0.0, z_mm))]
        cuts += [Cut(Xz(0.0, z_mm + CLEAR_MM), rapid=True), Cut(Xz(outside_mm, z_mm + CLEAR_MM), rapid=True)]
    return Trajectory(conditions, Xz(outside_mm, job.face_mm + CLEAR_MM), tuple(cuts))


def _rough(job: TurningJob, drawing: Drawing, conditions: Conditions) -> Trajectory:
    """Cuts along the axis, each as far as the contour and its allowance let it go, then one along the contour."""
    bar_mm, least_mm = job.bar_mm / 2, drawing.front_um / 1000 + ALLOWANCE_MM
    count = max(1, ceil((bar_mm - least_mm) / conditions.depth_mm))
    cuts: list[Cut] = []
    for number in range(1, count + 1):
        x_mm = bar_mm - (bar_mm - least_mm) * number / count
        end_mm = ALLOWANCE_MM - drawing.depth_um((x_mm - ALLOWANCE_MM) * 1000) / 1000
        cuts += [Cut(Xz(x_mm, CLEAR_MM), rapid=True), Cut(Xz(x_mm, end_mm))]
        cuts += [Cut(Xz(x_mm + LIFT_MM, end_mm + LIFT_MM), rapid=True), Cut(Xz(x_mm + LIFT_MM, CLEAR_MM), rapid=True)]
    cuts.append(Cut(Xz(least_mm, CLEAR_MM), rapid=True))
    cuts += _along(drawing.behind_front(), ALLOWANCE_MM)
    return Trajectory(conditions, Xz(bar_mm + CLEAR_MM, CLEAR_MM), (*cuts, *_away(job, cuts[-1].end.z_mm)))


def _finish(job: TurningJob, drawing: Drawing, conditions: Conditions) -> Trajectory:
    """Along the drawing's contour, beginning in the air before the face."""
    start = Xz(drawing.elements[0].start.r_um / 1000, CLEAR_MM)
    cuts = _along(drawing.elements, 0.0)
    return Trajectory(conditions, start, (*cuts, *_away(job, cuts[-1].end.z_mm)))


def _along(elements: tuple[ContourElement, ...], allowance_mm: float) -> list[Cut]:
    """A contour moved outwards and forwards by the allowance."""
    first = elements[0].start
    return [Cut(_moved(first, allowance_mm)), *(_cut(element, allowance_mm) for element in elements)]


def _cut(element: ContourElement, allowance_mm: float) -> Cut:
    end = _moved(element.end, allowance_mm)
    if not element.radius_um:
        return Cut(end)
    return Cut(end, centre=_moved(element.centre, allowance_mm), convex=element.radius_um > 0)


def _moved(at: At, allowance_mm: float) -> Xz:
    return Xz(at.r_um / 1000 + allowance_mm, allowance_mm - at.u_um / 1000)


def _away(job: TurningJob, z_mm: float) -> list[Cut]:
    """Out of the cut, then before the bar, where the turret may turn."""
    outside_mm = job.bar_mm / 2 + CLEAR_MM
    return [Cut(Xz(outside_mm, z_mm)), Cut(Xz(outside_mm, CLEAR_MM), rapid=True)]


# --- how long they take -------------------------------------------------------------------------------------------


def cutting_min(trajectory: Trajectory) -> float:
    """Minutes of the trajectory that the tool cuts, under feed."""
    return sum(minutes for minutes, rapid in _minutes(trajectory, 1.0) if not rapid)


def rapid_min(trajectory: Trajectory, lathe: Lathe) -> float:
    """Minutes of the trajectory in rapid moves, at the lathe's rapid speed."""
    return sum(minutes for minutes, rapid in _minutes(trajectory, lathe.rapid_mm_min) if rapid)


def _minutes(trajectory: Trajectory, rapid_mm_min: float) -> list[tuple[float, bool]]:
    here, found = trajectory.start, []
    for cut in trajectory.cuts:
        if cut.rapid:
            found.append((hypot(cut.end.x_mm - here.x_mm, cut.end.z_mm - here.z_mm) / rapid_mm_min, True))
        else:
            found.append((_feed_min(here, cut, trajectory.conditions), False))
        here = cut.end
    return found


def _feed_min(start: Xz, cut: Cut, conditions: Conditions) -> float:
    """Time of one cut: at constant surface speed the spindle turns faster near the axis."""
    points = path(start, cut)
    minutes = 0.0
    for one, other in pairwise(points):
        rpm = conditions.rpm(one.x_mm + other.x_mm)
        minutes += hypot(other.x_mm - one.x_mm, other.z_mm - one.z_mm) / (conditions.feed_mm * rpm)
    return minutes


def path(start: Xz, cut: Cut) -> list[Xz]:
    """Points along one move: both ends of a cut along the axis, pieces of a slanted or round one."""
    end = cut.end
    if cut.centre is None:
        pieces = 1 if start.x_mm == end.x_mm else _PIECES
        return [
            Xz(start.x_mm + (end.x_mm - start.x_mm) * i / pieces, start.z_mm + (end.z_mm - start.z_mm) * i / pieces)
            for i in range(pieces + 1)
        ]
    centre = cut.centre
    begin = atan2(start.x_mm - centre.x_mm, start.z_mm - centre.z_mm)
    turn = remainder(atan2(end.x_mm - centre.x_mm, end.z_mm - centre.z_mm) - begin, 2 * pi)
    radius_mm = hypot(start.x_mm - centre.x_mm, start.z_mm - centre.z_mm)
    angles = [begin + turn * i / _PIECES for i in range(_PIECES + 1)]
    return [Xz(centre.x_mm + radius_mm * sin(a), centre.z_mm + radius_mm * cos(a)) for a in angles]
